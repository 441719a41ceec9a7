"""An input: what is typed, which files there are, and what the terminal is like."""

import json
from dataclasses import dataclass, field

# The folder that the command line is called in, beside `models` and `scenarios`.
HERE = "here"


@dataclass(frozen=True)
class Case:
    """One input.

    Attributes:
        argv: What is typed after `rmrc`, in a folder `here` beside the shipped `models` and `scenarios`.
        files: Contents of files that are there as well, by path from the folder above; a path that ends in a
            slash is a folder.
        encoding: Of stdout and stderr.
        columns: Width of the terminal, as `COLUMNS` says.
    """

    argv: tuple[str, ...]
    files: dict[str, bytes] = field(default_factory=dict)
    encoding: str = "utf-8"
    columns: str = "80"

    def text(self, **about):
        """Return the input as JSON, with what else is known about it."""
        files = {path: _pieces(data) for path, data in self.files.items()}
        more = {} if self.encoding == "utf-8" else {"encoding": self.encoding}
        more |= {} if self.columns == "80" else {"columns": self.columns}
        return json.dumps({**about, "argv": self.argv, "files": files, **more}, indent=1) + "\n"


def read(text):
    """Return the input that `Case.text` wrote.

    The contents of a file may be a list of [text, count], each text repeated so often: large, in few bytes.
    """
    facts = json.loads(text)
    files = {path: _bytes(pieces) for path, pieces in facts["files"].items()}
    known = {name: facts[name] for name in ("encoding", "columns") if name in facts}
    return Case(tuple(facts["argv"]), files, **known)


def _bytes(pieces):
    if isinstance(pieces, str):
        return pieces.encode("utf-8", "surrogateescape")
    return b"".join(_bytes(text) * count for text, count in pieces)


def _pieces(data):
    # JSON keeps the lone surrogates that stand for bytes that are no UTF-8.
    return data.decode("utf-8", "surrogateescape")
