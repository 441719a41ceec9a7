"""Assumptions about a model with an incomplete file: lines, some with their own code."""


class Note(str):
    """A line with the code by which `rmrc check` reports it; plain lines have the code `assumed`.

    >>> Note("frame", 'site "tool" is controlled').code
    'frame'
    """

    code: str

    def __new__(cls, code: str, text: str) -> "Note":
        """Return a line.

        Args:
            code: Code of the finding.
            text: The assumption.
        """
        note = super().__new__(cls, text)
        note.code = code
        return note

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        """Return what a copy is made of."""
        return self.code, str(self)


def code_of(note: str) -> str:
    """Return the code of a line.

    >>> code_of(Note("frame", "a")), code_of("a")
    ('frame', 'assumed')
    """
    return note.code if isinstance(note, Note) else "assumed"
