"""Kinds of files and the verbs that accept them; a message about a wrong kind names the right verb."""

from pathlib import Path
from typing import NamedTuple

from rmrc.support.errors import QuestionError
from rmrc.support.invocation import command
from rmrc.support.legible import listed, visible
from rmrc.support.shipped import Folder, found


class Kind(NamedTuple):
    """A kind of file.

    Attributes:
        name: In words.
        suffixes: Suffixes of its files.
        begins: How such a file begins, or nothing if that is not specific.
        verb: The verb that takes it, or "".
        library: The library that reads it in Python, if there is no verb.
        shipped: The folder of those that come with the program, if any do.
    """

    name: str
    suffixes: tuple[str, ...]
    begins: bytes = b""
    verb: str = ""
    library: str = ""
    shipped: Folder | None = None


SCENARIO = Kind("a scenario", (".yaml", ".yml"), verb="run", shipped="scenarios")
MODEL = Kind("a model", (".xml", ".mjcf", ".urdf"), b"<", "inspect", shipped="models")
RECORDING = Kind("a recording", (".rrd", ".part"), b"RRF", "replay")
LOG = Kind("a log", (".csv", ".parquet", ".npz"), verb="identify")
RUN = Kind("the output of a run", (".npz", ".rrd", ".part", ".json"))
REPORTED = Kind("the output of run, compare, sweep or tune", (*RUN.suffixes, ".parquet"))
KINDS = (
    SCENARIO,
    MODEL,
    RECORDING,
    Kind("the columns of a run", (".npz",), b"PK\x03\x04", "plot"),
    Kind("the rows of a sweep", (".parquet",), b"PAR1", "report", library="pandas.read_parquet"),
    LOG,
    Kind("a scorecard", (".json",), library="json.load"),
    Kind("a picture", (".png",), b"\x89PNG"),
    Kind("a picture", (".svg", ".pdf")),
)


def expect(path: Path, wanted: Kind) -> Path:
    """Return the file that a verb was given, unless it is of another kind, or a folder.

    Args:
        path: Or the bare name of a shipped file. It need not exist: the reader reports a missing file best.
        wanted: The kind that the verb takes.

    Raises:
        QuestionError: It is something else; the message names the verb for it.
    """
    if wanted.shipped is not None:
        path = found(path, wanted.shipped)
    if path.is_dir():
        inside = sorted(str(entry) for suffix in wanted.suffixes for entry in path.glob(f"*{suffix}"))
        some = f"; it has {listed(inside, 5)}" if inside else ""
        raise QuestionError(f"{visible(str(path))}: is a folder, give {wanted.name}{some}")
    kind = _kind(path)
    if kind is None or set(kind.suffixes) & set(wanted.suffixes):
        return path
    way = ""
    if kind.verb:
        way = f"; use `{command(kind.verb, path)}`"
    elif kind.library:
        way = f"; read it in Python with {kind.library}"
    if wanted is SCENARIO and kind is MODEL:
        way += f", or name it in a scenario: `arm: {{model: {visible(path.name)}, site: ...}}`"
    if wanted is MODEL and kind is SCENARIO:
        way += "; or give the model named by its arm.model"
    if wanted is RECORDING and kind is SCENARIO:
        way += ", which writes a recording"
    raise QuestionError(f"{visible(str(path))}: is {kind.name}, not {wanted.name}{way}")


def _kind(path: Path) -> Kind | None:
    """Return the kind of a file: by its beginning, or else by its name; None if there is no such file."""
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            start = file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip()
    except (OSError, ValueError):  # its reader reports the reason
        return None
    for kind in KINDS:
        if kind.begins and start.startswith(kind.begins):
            return kind
    for kind in KINDS:
        if path.suffix.lower() in kind.suffixes:
            # A text with the suffix of a binary file is invalid; its reader reports that.
            return kind if not kind.begins or kind is MODEL else None
    return None
