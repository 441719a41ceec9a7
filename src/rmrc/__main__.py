"""`python -m rmrc`, and the script `rmrc`: the command line in a process of its own."""

import sys

try:
    from rmrc.cli import main as command_line
    from rmrc.support import process
except KeyboardInterrupt:  # while modules are read, which takes a while: no traceback of them
    sys.exit(130)


def main() -> None:
    """Run the command line, and end the process."""
    process.ends_with_job = True
    command_line()


if __name__ == "__main__":
    main()
