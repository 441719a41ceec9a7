"""A command line that does the fault that its first argument names, for a test of the fuzzer."""

import os
import sys
import time
import warnings
from pathlib import Path


def main():
    """Do a fault, and end well."""
    FAULTS[sys.argv[1]]()
    sys.exit(0)


def _fail():
    raise ValueError("a bug")


def _sleep():
    while True:
        try:
            time.sleep(60.0)
        except KeyboardInterrupt:
            continue


FAULTS = {
    "": lambda: print("a table of nano and inf"),
    "traceback": _fail,
    "exit code": lambda: sys.exit(9),
    "silence": lambda: sys.exit(1),
    "control": lambda: print("\x1b[31m"),
    "nan": lambda: print("error nan m"),
    "warning": lambda: warnings.warn("a warning", stacklevel=1),
    "file": lambda: Path("../models/stray").touch(),
    "memory": lambda: print(f"rmrc: not enough memory for {len(bytearray(2**20))}", file=sys.stderr),
    "hang": _sleep,
    "death": os.abort,
}
