"""The rows of a sweep on disk: a folder of finished batches while it runs, one Parquet file in the end.

    NAME.sweep/_plan.json             what is run, and which columns a row has; written before the first run
    NAME.sweep/part-00000017.parquet  the rows of one batch; appears whole, or not at all
    NAME.sweep.parquet                all rows by index; then the folder goes

Either has all that is needed to go on, or to say that nothing is missing. Readers of Parquet skip what begins
with `_` or `.`.

What is there is not trusted. The plan and each part carry a SHA-256 of themselves, that of a part with the
plan and its number: what was torn, changed, swapped or copied from elsewhere is found before it counts. This
is meant for accidents; who may write to the folder can make files that pass.
"""

import hashlib
import json
import math
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pyarrow.lib as pa
import pyarrow.parquet as pq

from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.files import written_whole

# Rows that are held while parts become one file: some 30 MB of figures.
_MERGED = 50_000

# Where a part has its digest, and what stands there while that is computed.
_DIGEST, _NONE = b"rmrc.sha256", b"0" * 64

_TYPES = {"number": pa.float64(), "count": pa.int64(), "text": pa.string(), "switch": pa.bool_()}


# What pyarrow raises of files that are none of its own, or torn.
_UNREADABLE = (pa.ArrowException, OSError)


Table: TypeAlias = pa.Table


class Column(NamedTuple):
    """What a column of the dataset holds.

    Attributes:
        name: A key of the scenario, a figure of the scorecard, or one of our own.
        kind: `number`, `count`, `text` or `switch`.
        unit: SI, `1` for a plain number, "" for none.
        meaning: In a few words.
    """

    name: str
    kind: str
    unit: str
    meaning: str


class Contents(NamedTuple):
    """What a dataset holds, ready for JSON.

    Attributes:
        identity: What decides the rows, by name: two sweeps are the same if all of it is equal.
        runs: How many rows there are in the end.
        batch: How many of them a part has; the last one may have fewer.
        columns: Of a row.
    """

    identity: Mapping[str, Any]
    runs: int
    batch: int
    columns: Sequence[Column]

    @property
    def parts(self) -> int:
        """How many parts there are in the end."""
        return -(-self.runs // self.batch)

    def indices(self, part: int) -> range:
        """Return which runs a part has."""
        return range(part * self.batch, min((part + 1) * self.batch, self.runs))

    @property
    def schema(self) -> pa.Schema:
        """Types of the columns, with their units and meanings, and the contents themselves as JSON."""
        contents = json.dumps(self._asdict(), ensure_ascii=False)
        return _described(self.columns).with_metadata({"rmrc": contents})

    @property
    def digest(self) -> str:
        """Tells one plan from another, in hexadecimal."""
        return hashlib.sha256(json.dumps(self._asdict(), sort_keys=True).encode()).hexdigest()

    @classmethod
    def read(cls, text: str | bytes) -> "Contents":
        """Return the contents that were written as JSON.

        Raises:
            ValueError: They are not what was written.
        """
        facts = json.loads(text)
        digest = facts.pop("digest", None)
        found = cls(**{**facts, "columns": [Column(*column) for column in facts["columns"]]})
        if digest not in (None, found.digest):
            raise ValueError("was altered")
        return found


def as_parquet(columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return rows as the bytes of a Parquet file: of a part, which is small and travels.

    So it has no units and meanings, which `_plan.json` and the one file have, and values without dictionaries
    or statistics, which would be larger than so few of them. `Dataset.keep` fills in its digest.
    """
    bare = _bare(columns).with_metadata({_DIGEST: _NONE})
    stream = pa.BufferOutputStream()
    pq.write_table(_table(bare, columns, rows), stream, use_dictionary=False, write_statistics=False)
    return bytes(stream.getvalue())


class Dataset:
    """Rows of a sweep on disk.

    Attributes:
        folder: Of the parts.
        file: With all rows, in the end.
    """

    def __init__(self, folder: Path, name: str) -> None:
        """Name the files; nothing is read or written yet.

        Args:
            folder: Where they go.
            name: Of the scenario.
        """
        self.folder, self.file = folder / f"{name}.sweep", folder / f"{name}.sweep.parquet"
        self._plan = self.folder / "_plan.json"

    @property
    def is_whole(self) -> bool:
        """Whether all rows are in one file."""
        return self.file.exists()

    def contents(self, identity: Mapping[str, Any], runs: int) -> Contents | None:
        """Return the contents of what is there, or None.

        Args:
            identity: Of the sweep that wants to go on with it.
            runs: How many it has.

        Raises:
            ScenarioError: It is another sweep's, or no sweep's, or not what was written.
        """
        place = self.file if self.is_whole else self.folder
        try:
            if self.is_whole:
                with self.file.open("rb") as file:  # its errors name the file, and those of pyarrow do not
                    found = Contents.read(pq.read_schema(file).metadata[b"rmrc"])
            elif self._plan.exists():
                found = Contents.read(self._plan.read_bytes())
            else:
                return None
            differs = [key for key in identity if found.identity.get(key) != identity[key]]
        except (*_UNREADABLE, AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
            if isinstance(error, OSError) and error.filename and not isinstance(error, IsADirectoryError):
                raise
            what = "was altered" if str(error) == "was altered" else "is no sweep's"
            raise ScenarioError.about(place, f"{what}; move it, or take another --out") from None
        if differs:
            what = f"is of another sweep ({', '.join(differs)} differ)"
        elif found.runs != runs:
            what = f"is of {found.runs} runs, and not of {runs}"
        elif self.is_whole:
            what = self._lack(found)
        else:
            return found
        if what:
            raise ScenarioError.about(place, f"{what}; move it, or take another --out")
        return found

    def _lack(self, contents: Contents) -> str:
        """Return what is wrong with the one file, or nothing: it must have all rows, in order."""
        with _opened(self.file) as file:
            if not file.schema_arrow.equals(contents.schema):
                return "has other columns than it should"
            first = 0
            for batch in file.iter_batches(columns=["index"]):
                if batch["index"].to_pylist() != list(range(first, first + len(batch))):
                    return "has not the rows that it should, each once and in order"
                first += len(batch)
        return "" if first == contents.runs else f"has {first} of {contents.runs} rows"

    def begin(self, contents: Contents) -> None:
        """Write what will be there."""
        facts = {**contents._asdict(), "digest": contents.digest}
        text = json.dumps(facts, indent=1, ensure_ascii=False)
        with written_whole(self._plan) as temporary:
            temporary.write_text(f"{text}\n", "utf-8")

    def missing(self, contents: Contents) -> list[int]:
        """Return the parts that are not there yet."""
        if self.is_whole:
            return []
        # one without a byte is what a power failure may leave
        there = {path.name for path in self.folder.glob("part-*.parquet") if path.lstat().st_size}
        return [part for part in range(contents.parts) if self._part(part).name not in there]

    def verify(self, contents: Contents) -> None:
        """Check that what is there is what was written, before anything is added to it.

        Raises:
            ScenarioError: A part is damaged, was altered or is of another sweep; or there is another file,
                which would be lost with the folder.
        """
        if self.is_whole or not self.folder.is_dir():
            return
        parts = {self._part(part).name: part for part in range(contents.parts)}
        for path in sorted(self.folder.iterdir()):
            if path.name in parts:
                if path.lstat().st_size:
                    self._table(parts[path.name], contents)
            elif not (path == self._plan or path.name.startswith(".")):
                raise ScenarioError.about(path, "is no part of this sweep; move it, or take another --out")

    def keep(self, part: int, data: bytes, contents: Contents) -> None:
        """Write one part, whole or not at all.

        Args:
            part: Which.
            data: Its rows, by `as_parquet`.
            contents: Of the dataset.
        """
        digest = _digest(part, data, contents)
        at = data.rindex(_NONE)
        with written_whole(self._part(part)) as temporary:
            temporary.write_bytes(data[:at] + digest + data[at + len(_NONE) :])

    def _table(self, part: int, contents: Contents) -> pa.Table:
        """Return the rows of a part, after a look whether they are what was written.

        Raises:
            ScenarioError: They are not.
        """
        path = self._part(part)
        if not stat.S_ISREG(path.lstat().st_mode):
            raise _spoiled(path, "is no file of its own")
        data = path.read_bytes()
        try:
            with pq.ParquetFile(pa.BufferReader(data)) as file:
                table, written = file.read(), (file.metadata.metadata or {}).get(_DIGEST, b"")
        except _UNREADABLE:
            raise _spoiled(path, "is damaged") from None
        indices = contents.indices(part)
        if not table.schema.equals(_bare(contents.columns)):
            raise _spoiled(path, "has other columns than the sweep")
        if len(table) != len(indices):
            raise _spoiled(path, f"has {len(table)} rows instead of {len(indices)}")
        if table["index"].to_pylist() != list(indices):
            raise _spoiled(path, f"has rows of other runs than {indices[0]} to {indices[-1]}")
        at = data.rfind(written) if len(written) == len(_NONE) else -1
        bare = data[:at] + _NONE + data[at + len(_NONE) :]
        if at < 0 or _digest(part, bare, contents) != written:
            raise _spoiled(path, "was altered, or is of another sweep")
        return table.replace_schema_metadata(None)

    def merge(self, contents: Contents) -> None:
        """Make one file of all parts, in order, and remove them; they are read one after another."""
        schema = contents.schema
        with (
            written_whole(self.file) as temporary,
            pq.ParquetWriter(temporary, schema, write_page_checksum=True) as writer,
        ):
            held: list[pa.Table] = []
            for part in range(contents.parts):
                held.append(self._table(part, contents))
                if part == contents.parts - 1 or sum(map(len, held)) >= _MERGED:
                    writer.write_table(pa.concat_tables(held))
                    held = []
        self.clear()

    def clear(self) -> None:
        """Remove the parts, where one file has them all; what is no part stays, and the folder with it."""
        if not (self.is_whole and self.folder.is_dir()):
            return
        with suppress(OSError):
            for path in (*self.folder.glob("part-*.parquet"), *self.folder.glob(".*"), self._plan):
                path.unlink(missing_ok=True)
            self.folder.rmdir()

    def table(self) -> Table:
        """Return all rows, where one file has them all."""
        with _opened(self.file) as file:
            return file.read()

    def batches(self, columns: Sequence[str]) -> Iterator[Mapping[str, list[Any]]]:
        """Iterate over the rows of what is there, some thousands at a time: values by column.

        Args:
            columns: That are wanted.
        """
        paths = [self.file] if self.is_whole else sorted(self.folder.glob("part-*.parquet"))
        for path in paths:
            with _opened(path) as file:
                for batch in file.iter_batches(10_000, columns=list(columns)):
                    yield batch.to_pydict()

    def _part(self, part: int) -> Path:
        return self.folder / f"part-{part:08d}.parquet"


@contextmanager
def _opened(path: Path) -> Iterator[pq.ParquetFile]:
    """Yield a file of rows to be read.

    Raises:
        ScenarioError: It is not what was written.
    """
    with path.open("rb") as data:
        try:
            with pq.ParquetFile(data, page_checksum_verification=True) as file:
                yield file
        except _UNREADABLE:
            raise _spoiled(path, "is damaged") from None


def _spoiled(path: Path, what: str) -> ScenarioError:
    return ScenarioError.about(path, f"{what}; remove it, and the same command makes it again")


def _digest(part: int, data: bytes, contents: Contents) -> bytes:
    """Return what tells that a part is as it was written, and of this plan; its own place holds zeros."""
    found = hashlib.sha256(f"{contents.digest} {part} ".encode())
    found.update(data)
    return found.hexdigest().encode()


class Left(NamedTuple):
    """What a file of rows holds that `sweep` or `tune` left.

    Attributes:
        rows: Its columns, by name.
        about: What is told of them, as JSON; "": nothing.
    """

    rows: Mapping[str, list[Any]]
    about: str


def read_left(path: Path) -> Left:
    """Return what a file of rows holds.

    Raises:
        OSError: It cannot be opened.
        QuestionError: It is something else, or damaged.
    """
    path.stat()  # of a file that is not there Arrow tells no more than of a damaged one
    try:
        table = pq.read_table(path)
    except _UNREADABLE:
        raise QuestionError(f"{path}: is no Parquet file, or is damaged") from None
    return left_of(table)


def left_of(table: Table) -> Left:
    """Return what a table of rows holds."""
    return Left(table.to_pydict(), (table.schema.metadata or {}).get(b"rmrc", b"").decode())


def write_table(
    path: Path,
    columns: Sequence[Column],
    rows: Sequence[Mapping[str, Any]],
    about: Mapping[str, Any] | None = None,
) -> None:
    """Write a file of its own, whole or not at all; a number that a row lacks is NaN, anything else null.

    Args:
        path: Of the file.
        columns: Of a row.
        rows: All of them.
        about: What else is told of them, as strict JSON, by the name `rmrc` in the file's metadata.
    """
    schema = _described(columns)
    if about is not None:
        schema = schema.with_metadata({"rmrc": json.dumps(about, ensure_ascii=False, allow_nan=False)})
    with written_whole(path) as temporary:
        pq.write_table(_table(schema, columns, rows), temporary)


def _bare(columns: Sequence[Column]) -> pa.Schema:
    """Return the types of columns alone."""
    return pa.schema([(column.name, _TYPES[column.kind]) for column in columns])


def _described(columns: Sequence[Column]) -> pa.Schema:
    """Return the types of columns, with units and meanings."""
    return pa.schema(
        [pa.field(c.name, _TYPES[c.kind], metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns]
    )


def _table(schema: pa.Schema, columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows as a table; a number that a row lacks is NaN, like an undefined one, and else null."""
    blanks = [(column.name, math.nan if column.kind == "number" else None) for column in columns]
    return pa.table({name: [row.get(name, blank) for row in rows] for name, blank in blanks}, schema)
