"""`python -m rmrc`, and the script `rmrc`: the command line in a process of its own."""

import atexit
import gc
import os
import sys
import threading
from contextlib import suppress
from typing import NoReturn

# Objects of modules live as long as the process: searching them repeatedly takes a tenth of a run.
gc.disable()
try:
    from rmrc.cli import main as command_line
    from rmrc.support import lifetime
except KeyboardInterrupt:  # while modules are read, which takes a while: no traceback of them
    sys.exit(130)

# Objects made and not yet freed between two collections [1]; Python's own 700 suits small programs.
_BETWEEN_COLLECTIONS = 50_000


def main() -> NoReturn:
    """Run the command line, and end the process."""
    lifetime.ends_with_job = True
    gc.freeze()
    gc.set_threshold(_BETWEEN_COLLECTIONS)
    gc.enable()
    try:
        command_line()
    except SystemExit as ended:
        _leave_at_once(ended)


def _leave_at_once(ended: SystemExit) -> NoReturn:
    """End the process without dismantling it, which takes 0.3 s; registered exit functions still run.

    Raises:
        SystemExit: Another thread still works, so that Python must wait for it.
    """
    others = (one for one in threading.enumerate() if one is not threading.main_thread())
    if not isinstance(ended.code, int) or any(not one.daemon for one in others):
        raise ended
    atexit._run_exitfuncs()
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with suppress(OSError, ValueError):  # closed, or nobody reads it
            stream.flush()
    os._exit(ended.code)


if __name__ == "__main__":
    main()
