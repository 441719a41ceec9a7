"""Command lines to copy, in messages."""

import os
import shlex
import sys
from pathlib import Path

from rmrc.support.text import visible


def command(*words: str | os.PathLike[str]) -> str:
    """Return a command line for a shell: the program, followed by some words.

    After a call of `.venv/bin/python -m rmrc`, the program is that, because a shell may not find `rmrc`.

    Args:
        words: Verb, options and arguments; quoted where a shell needs it.

    >>> command("replay", "my runs/x.rrd")
    "rmrc replay 'my runs/x.rrd'"
    """
    program = ["rmrc"]
    if sys.argv and Path(sys.argv[0]).parts[-2:] == ("rmrc", "__main__.py"):
        program = sys.orig_argv[: len(sys.orig_argv) - len(sys.argv) + 1]
    return visible(shlex.join([*program, *(os.fspath(word) for word in words)]))
