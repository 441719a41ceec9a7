"""Command lines to copy, in messages."""

import os
import shlex

from rmrc.support.legible import visible


def command(*words: str | os.PathLike[str]) -> str:
    """Return a command line for a shell: the program, followed by some words.

    Args:
        words: Verb, options and arguments; quoted where a shell needs it.

    >>> command("replay", "my runs/x.rrd")
    "rmrc replay 'my runs/x.rrd'"
    """
    return visible(shlex.join(["rmrc", *(os.fspath(word) for word in words)]))
