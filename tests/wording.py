"""What a message must say, whatever its words: one test at most has them in full."""

import re


def whole(piece):
    """Return the pattern of a piece that is no part of a longer word or number."""
    before = r"(?<![\w.-])" if re.match(r"[\w-]", piece) else ""
    return before + re.escape(piece) + (r"(?!\w|\.\d)" if re.search(r"\w$", piece) else "")


class says(str):  # noqa: N801 - reads as a verb
    """Equals a text of the same pieces in the same order, with words of any kind in the place of each `…`.

    At either end of a line there may be none. The pieces are what a reader needs: where it is, what was given, the
    bound or the choices, the way out.
    """

    __slots__ = ()
    __hash__ = str.__hash__

    def __eq__(self, text):
        pattern = ".+".join(whole(piece.strip(" ")) for piece in self.strip("… ").split("…"))
        start, end = (".*" * one for one in (self.startswith("…"), self.endswith("…")))
        pattern = start + pattern.replace(".+\\\n", ".*\\\n") + end
        return isinstance(text, str) and re.fullmatch(pattern, text) is not None

    def __ne__(self, text):
        return not self == text
