"""The command line that started this program, for messages that print a command to copy."""

import os
import shlex
import shutil
import sys
from pathlib import Path

from rmrc.support.legible import visible


def command(*words: str | os.PathLike[str]) -> str:
    """Return a command line for a shell: the program as it was called, followed by some words.

    Args:
        words: Verb, options and arguments; quoted where a shell needs it.

    Returns:
        Such as `.venv/bin/python -m rmrc replay x.rrd` after a call by `.venv/bin/python -m rmrc ...`, and
        `rmrc replay 'my runs/x.rrd'` after one by `rmrc ...`.
    """
    return " ".join(map(_quoted, [*_called(), *(os.fspath(word) for word in words)]))


def _quoted(word: str) -> str:
    """Return a word as a shell reads it, on one line."""
    if word.isprintable():
        return shlex.quote(word)
    return "$'{}'".format(visible(word.replace("\\", "\\\\").replace("'", "\\'")))


def _called() -> list[str]:
    """Return the words that start this program."""
    script, given = sys.argv[0], sys.argv[1:]
    if Path(script).parts[-2:] == ("rmrc", "__main__.py") and len(sys.orig_argv) > len(given):
        return sys.orig_argv[: len(sys.orig_argv) - len(given)]  # `python -m rmrc`
    name = Path(script).stem if script.endswith(".exe") else Path(script).name
    found = shutil.which(name)
    if name != "rmrc":  # another program, or a notebook, that uses this one as a library
        return ["rmrc"]
    # A program that a shell finds by its name was most likely called by it; the kernel gives the whole path.
    is_found = found is not None and os.path.realpath(found) == os.path.realpath(script)
    return [name if is_found or os.sep not in script else script]
