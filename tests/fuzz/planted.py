"""A command line with one fault of each kind, which the supervisor must count, and nothing else."""

import contextlib
import os
import signal
import sys
import time
import warnings
from pathlib import Path

from .case import Case

# What the first argument asks for, and the kind of finding that it must give; "" for none.
FAULTS = {
    "well": "", "raise": "traceback", "trace_and_70": "traceback", "thread": "traceback", "nine": "exit code", "text": "exit code",
    "mute": "silence", "escape": "control", "c1": "control", "bell_from_c": "control", "bytes_from_c": "control", "nan_in_json": "nan",
    "nan_in_table": "nan", "undefined_figure": "nan", "column": "nan", "warn": "warning", "temporary": "file", "outside": "file", "left_over": "file",
    "shipped": "file", "hang": "hang", "sleep": "hang", "deaf": "hang", "long": "", "eat": "memory", "eat_slowly": "memory", "segfault": "death", "abort": "death", "vanish": "death",
}  # fmt: skip


def case(kind, index):
    """Return the case that asks for a fault, by its place in FAULTS."""
    assert kind == "planted"
    name = list(FAULTS)[index]
    return Case((name, "--json") if name == "nan_in_json" else (name,))


def main():
    """Do as the first argument says, and end well where it says nothing else."""
    globals()[f"_{sys.argv[1]}"]()
    sys.exit(0)


def _well():
    print("a table, of nano and inf, in \u03ba\tand m")
    print("rmrc: compiling ...", file=sys.stderr)
    Path("recordings").mkdir()
    Path("recordings/x.json").write_text(
        '{"status": "complete", "scorecard": {"a": 1, "b": "inf", "return": {"joint_change": null}}}'
    )


def _raise():
    raise ValueError("a bug")


def _trace_and_70():
    print(
        'Traceback (most recent call last):\n  File "x/rmrc/job.py", line 7, in run\nValueError: a bug',
        file=sys.stderr,
    )
    sys.exit(70)


def _thread():
    print("Exception in thread Thread-1:", file=sys.stderr)


def _nine():
    print("a reason", file=sys.stderr)
    sys.exit(9)


def _text():
    sys.exit("a reason")


def _mute():
    sys.exit(2)


def _escape():
    print("error: \x1b[31mred", file=sys.stderr)


def _c1():
    print("a name: \x9b31m")


def _bell_from_c():
    os.write(2, b"WARNING: \x07")


def _bytes_from_c():
    os.write(1, b"name \xff\xfe")


def _nan_in_json():
    print('{"a": NaN}')


def _nan_in_table():
    print("sigma  nan  m")


def _undefined_figure():
    Path("recordings").mkdir()
    Path("recordings/x.json").write_text(
        '{"status": "complete", "scorecard": {"joint_rate": {"peak": null}}}'
    )


def _column():
    import numpy as np

    Path("recordings").mkdir()
    np.savez("recordings/x.npz", q=np.array([0.0, np.nan]), facts=np.array("{}"))


def _warn():
    warnings.warn("overflow", RuntimeWarning, stacklevel=1)


def _temporary():
    Path(os.environ["TMPDIR"], "left").mkdir()


def _outside():
    Path("MUJOCO_LOG.TXT").write_text("x")


def _left_over():
    Path("recordings").mkdir()
    Path("recordings/.x-0123456789abcdef.rrd").write_text("x")


def _shipped():
    Path("../models/planar_rp.xml").write_text("x")


def _hang():
    while True:
        pass


def _deaf():
    while True:
        with contextlib.suppress(KeyboardInterrupt):
            time.sleep(0.1)


def _long():
    try:
        time.sleep(3600)
    except KeyboardInterrupt:
        print("rmrc: interrupted at tick 3 of 100000", file=sys.stderr)
        sys.exit(130)


def _sleep():
    time.sleep(3600)


def _eat():
    bytearray(2**36)


def _eat_slowly():
    kept = []
    while True:
        kept.append(b"x" * 2**25)
        time.sleep(0.001)


def _segfault():
    os.kill(os.getpid(), signal.SIGSEGV)


def _abort():
    os.abort()


def _vanish():
    os._exit(0)
