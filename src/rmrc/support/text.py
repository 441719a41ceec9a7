"""Texts from elsewhere in a form for terminals: no control characters, not too long.

A file, a model, MuJoCo or an option may hold anything. Characters that would move the cursor, reverse the
direction of writing or show nothing are written as escapes.
"""

import dataclasses
import os
import re
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

# Characters of a value in a message: two of them and the words between them fill two lines of a terminal.
LONGEST = 80

# Characters of a message, and of one word in it, which may be a path: longer ones are cut in the middle.
LONGEST_LINE, LONGEST_WORD = 2000, 500


def visible(text: str, keep: str = "") -> str:
    r"""Return a text with each character that cannot be printed as its escape.

    Args:
        text: Any text.
        keep: Characters that stay as they are, such as a line feed.

    >>> print(visible("red\x1b[31m, é and σ"))
    red\x1b[31m, é and σ
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else ascii(c)[1:-1] for c in text)


def shortened(text: str, most: int = LONGEST) -> str:
    """Return a text of about this many characters: without its middle, and with its length.

    Args:
        text: A text that may be too long; quotes around it stay.
        most: A text of up to this many characters stays as it is.

    >>> shortened('"' + "a" * 10_000 + '"', 10)
    '"aaa…aaa" (10,000 characters)'
    """
    if len(text) <= most:
        return text
    half = (most - 1) // 2
    is_quoted = text[0] == text[-1] and text[0] in "\"'"
    return f"{text[:half]}…{text[-half:]} ({len(text) - 2 * is_quoted:,} characters)"


def line(text: str) -> str:
    """Return a message as one printable line: its long words cut in their middle, then the message itself.

    A message begins with the problem and ends with the remedy, so both stay.
    """
    text = visible(text)
    if len(text) <= LONGEST_WORD:
        return text
    long = rf'"[^"\s]{{{LONGEST_WORD},}}"|[^"\s]{{{LONGEST_WORD},}}(?<![:;,.])'
    text = re.sub(long, lambda match: shortened(match[0]), text)
    if len(text) <= LONGEST_LINE:
        return text
    return f"{text[: LONGEST_LINE // 2]} … {text[-LONGEST_LINE // 2 :]}"


def quoted(text: str) -> str:
    """Return an option's value as Python writes a text, its middle left out if it is long.

    >>> print(quoted("1,2"))
    '1,2'
    """
    return shortened(repr(text))


def listed(names: Iterable[str], most: int = 20) -> str:
    """Return names with commas between them, only the first ones if there are many.

    >>> listed(["a", "b", "c", "d"], 2)
    'a, b and 2 more'
    """
    names = [shortened(visible(name)) for name in names]
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most:,} more"


def escaped(text: str) -> str:
    """Return one line that Markdown shows unchanged."""
    return re.sub(r"([\\|*`<\[\]])", r"\\\1", " ".join(text.split()))


# A repr that fits on a screen --------------------------------------------------------------------

T = TypeVar("T")

# Most characters of a value within another, and of the whole, which is 24 lines of 80.
VALUE, WHOLE = 120, 1900


def brief(cls: type[T]) -> type[T]:
    """Give a dataclass a repr that fits on a screen: arrays by their shapes, nested objects by their names.

    >>> import numpy as np
    >>> @brief
    ... @dataclasses.dataclass
    ... class Path:
    ...     name: str
    ...     points: np.ndarray
    >>> Path("line", np.zeros((500, 3)))
    Path(name='line', points=array of (500, 3))
    """

    def shown(self: Any) -> str:
        names = [field.name for field in dataclasses.fields(self) if field.repr and field.name[0] != "_"]
        inner = ", ".join(f"{name}={_short(getattr(self, name))}" for name in names)
        return cut(f"{type(self).__name__}({inner})", WHOLE)

    cls.__repr__ = shown  # type: ignore[method-assign]
    return cls


def _short(value: object) -> str:
    """Return a value in few characters."""
    if isinstance(value, np.ndarray) and value.size > 6:
        return f"array of {value.shape}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}(…)"
    return cut(repr(value), VALUE)


def cut(text: str, most: int = WHOLE) -> str:
    """Return a text on one line; if it is longer than a screen, without its middle."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 2]}…{text[-1]}"


# Commands to copy ---------------------------------------------------------------------------------
#
# Command lines to copy, in messages.


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
