"""Assumptions about a model with an incomplete file: lines, some with their own code."""


class Note(str):
    """A line about an assumption.

    Attributes:
        code: The code by which `rmrc check` reports it.
        is_obvious: Whether hardly anybody would doubt it, so that only answers that list all have it.
    """

    code = "assumed"
    is_obvious = False


def note(code: str, text: str, is_obvious: bool = False) -> Note:
    """Return a line with its own code.

    >>> note("frame", 'site "tool" is controlled').code
    'frame'
    """
    line = Note(text)
    line.code, line.is_obvious = code, is_obvious
    return line


def code_of(line: str) -> str:
    """Return the code of a line; `assumed` for those without.

    >>> code_of(note("frame", "a")), code_of("a")
    ('frame', 'assumed')
    """
    return getattr(line, "code", "assumed")
