"""What was assumed of a model where its file does not say it: lines, some with a code of their own."""


class Note(str):
    """A line with the code by which `rmrc check` tells it; lines that are plain text go by `assumed`.

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


def code_of(note: str) -> str:
    """Return the code by which a line is told.

    >>> code_of(Note("frame", "a")), code_of("a")
    ('frame', 'assumed')
    """
    return note.code if isinstance(note, Note) else "assumed"
