"""`python -m rmrc`, and the script `rmrc`."""

import sys

try:
    from rmrc.cli import main
except KeyboardInterrupt:  # while modules are read, which takes a while: no trace of them
    sys.exit(130)

if __name__ == "__main__":
    main()
