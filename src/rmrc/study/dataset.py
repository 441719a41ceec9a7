"""The rows of a sweep on disk: a folder of finished batches during the run, one Parquet file at the end.

    NAME.sweep/_plan.json             runs and columns of the sweep; written before the first run
    NAME.sweep/part-00000017.parquet  the rows of one batch; appears whole, or not at all
    NAME.sweep.parquet                all rows by index; then the folder goes

Either is enough to resume the sweep, or to find that it is complete. Readers of Parquet skip names that begin
with `_` or `.`.

Existing files are not trusted. The plan and each part carry a SHA-256 of themselves, that of a part with the
plan and its number. This detects truncated, changed, swapped or foreign files before their use. It guards
against accidents, not against an attacker with write access.
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

# Rows that are held while parts become one file: some 30 MB of metrics.
_MERGED = 50_000

# The key of a part's digest, and the placeholder while the digest is computed.
_DIGEST, _NONE = b"rmrc.sha256", b"0" * 64

_TYPES = {"number": pa.float64(), "count": pa.int64(), "text": pa.string(), "switch": pa.bool_()}


# Errors of pyarrow for foreign or damaged files.
_UNREADABLE = (pa.ArrowException, OSError)


Table: TypeAlias = pa.Table


class Column(NamedTuple):
    """A column of the dataset.

    Attributes:
        name: A key of the scenario, a metric of the scorecard, or another name.
        kind: `number`, `count`, `text` or `switch`.
        unit: SI, `1` for a plain number, "" for none.
        meaning: A short description.
    """

    name: str
    kind: str
    unit: str
    meaning: str


class Contents(NamedTuple):
    """Description of a dataset, ready for JSON.

    Attributes:
        identity: All inputs of the rows, by name: sweeps with equal identities are the same.
        runs: Final number of rows.
        batch: Rows per part; the last part may have fewer.
        columns: Columns of a row.
    """

    identity: Mapping[str, Any]
    runs: int
    batch: int
    columns: Sequence[Column]

    @property
    def parts(self) -> int:
        """Final number of parts."""
        return -(-self.runs // self.batch)

    def indices(self, part: int) -> range:
        """Return the runs of a part."""
        return range(part * self.batch, min((part + 1) * self.batch, self.runs))

    @property
    def schema(self) -> pa.Schema:
        """Types of the columns, with units and meanings, and the contents as JSON."""
        contents = json.dumps(self._asdict(), ensure_ascii=False)
        return _described(self.columns).with_metadata({"rmrc": contents})

    @property
    def digest(self) -> str:
        """Digest of the plan, in hexadecimal."""
        return hashlib.sha256(json.dumps(self._asdict(), sort_keys=True).encode()).hexdigest()

    @classmethod
    def read(cls, text: str | bytes) -> "Contents":
        """Return the contents from JSON.

        Raises:
            ValueError: They were altered.
        """
        facts = json.loads(text)
        digest = facts.pop("digest", None)
        found = cls(**{**facts, "columns": [Column(*column) for column in facts["columns"]]})
        if digest not in (None, found.digest):
            raise ValueError("was altered")
        return found


def as_parquet(columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return rows as the bytes of a Parquet file for a part, which is small and sent over the network.

    It omits units and meanings, which `_plan.json` and the final file have, and dictionaries and statistics,
    which would be larger than its few values. `Dataset.keep` fills in its digest.
    """
    bare = _bare(columns).with_metadata({_DIGEST: _NONE})
    stream = pa.BufferOutputStream()
    pq.write_table(_table(bare, columns, rows), stream, use_dictionary=False, write_statistics=False)
    return bytes(stream.getvalue())


class Dataset:
    """Rows of a sweep on disk.

    Attributes:
        folder: Folder of the parts.
        file: Final file with all rows.
    """

    def __init__(self, folder: Path, name: str) -> None:
        """Set the file names, without reading or writing.

        Args:
            folder: Folder of the files.
            name: Name of the scenario.
        """
        self.folder, self.file = folder / f"{name}.sweep", folder / f"{name}.sweep.parquet"
        self._plan = self.folder / "_plan.json"

    @property
    def is_whole(self) -> bool:
        """Whether one file has all rows."""
        return self.file.exists()

    def contents(self, identity: Mapping[str, Any], runs: int) -> Contents | None:
        """Return the contents of an existing dataset, or None.

        Args:
            identity: Identity of the sweep to resume.
            runs: Number of its runs.

        Raises:
            ScenarioError: It belongs to another sweep or to none, or was altered.
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
            what = "was altered" if str(error) == "was altered" else "does not belong to a sweep"
            raise ScenarioError.about(place, f"{what}; move it, or choose another --out") from None
        if differs:
            what = f"belongs to another sweep ({', '.join(differs)} differ)"
        elif found.runs != runs:
            what = f"has {found.runs} runs, and not of {runs}"
        elif self.is_whole:
            what = self._lack(found)
        else:
            return found
        if what:
            raise ScenarioError.about(place, f"{what}; move it, or choose another --out")
        return found

    def _lack(self, contents: Contents) -> str:
        """Return the problem of the final file, or "": it must have all rows, in order."""
        with _opened(self.file) as file:
            if not file.schema_arrow.equals(contents.schema):
                return "has unexpected columns"
            first = 0
            for batch in file.iter_batches(columns=["index"]):
                if batch["index"].to_pylist() != list(range(first, first + len(batch))):
                    return "does not have every row once and in order"
                first += len(batch)
        return "" if first == contents.runs else f"has {first} of {contents.runs} rows"

    def begin(self, contents: Contents) -> None:
        """Write the plan."""
        facts = {**contents._asdict(), "digest": contents.digest}
        text = json.dumps(facts, indent=1, ensure_ascii=False)
        with written_whole(self._plan) as temporary:
            temporary.write_text(f"{text}\n", "utf-8")

    def missing(self, contents: Contents) -> list[int]:
        """Return the missing parts."""
        if self.is_whole:
            return []
        # an empty file may remain after a power failure
        there = {path.name for path in self.folder.glob("part-*.parquet") if path.lstat().st_size}
        return [part for part in range(contents.parts) if self._part(part).name not in there]

    def verify(self, contents: Contents) -> None:
        """Check existing files for alterations, before adding to them.

        Raises:
            ScenarioError: A part is damaged, altered or from another sweep; or the folder has a foreign file,
                which would be lost.
        """
        if self.is_whole or not self.folder.is_dir():
            return
        parts = {self._part(part).name: part for part in range(contents.parts)}
        for path in sorted(self.folder.iterdir()):
            if path.name in parts:
                if path.lstat().st_size:
                    self._table(parts[path.name], contents)
            elif not (path == self._plan or path.name.startswith(".")):
                raise ScenarioError.about(path, "is no part of this sweep; move it, or choose another --out")

    def keep(self, part: int, data: bytes, contents: Contents) -> None:
        """Write one part atomically.

        Args:
            part: Its number.
            data: Its rows, as `as_parquet` returns them.
            contents: Contents of the dataset.
        """
        digest = _digest(part, data, contents)
        at = data.rindex(_NONE)
        with written_whole(self._part(part)) as temporary:
            temporary.write_bytes(data[:at] + digest + data[at + len(_NONE) :])

    def _table(self, part: int, contents: Contents) -> pa.Table:
        """Return the rows of a part, checked for alterations.

        Raises:
            ScenarioError: They were altered.
        """
        path = self._part(part)
        if not stat.S_ISREG(path.lstat().st_mode):
            raise _spoiled(path, "is not a regular file")
        data = path.read_bytes()
        try:
            with pq.ParquetFile(pa.BufferReader(data)) as file:
                table, written = file.read(), (file.metadata.metadata or {}).get(_DIGEST, b"")
        except _UNREADABLE:
            raise _spoiled(path, "is damaged") from None
        indices = contents.indices(part)
        if not table.schema.equals(_bare(contents.columns)):
            raise _spoiled(path, "has columns that differ from the sweep's")
        if len(table) != len(indices):
            raise _spoiled(path, f"has {len(table)} rows instead of {len(indices)}")
        if table["index"].to_pylist() != list(indices):
            raise _spoiled(path, f"has rows of runs outside {indices[0]} to {indices[-1]}")
        at = data.rfind(written) if len(written) == len(_NONE) else -1
        bare = data[:at] + _NONE + data[at + len(_NONE) :]
        if at < 0 or _digest(part, bare, contents) != written:
            raise _spoiled(path, "was altered, or belongs to another sweep")
        return table.replace_schema_metadata(None)

    def merge(self, contents: Contents) -> None:
        """Merge all parts into one file, in order, reading one at a time, and remove them."""
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
        """Remove the parts once one file has them all; keep other files and their folder."""
        if not (self.is_whole and self.folder.is_dir()):
            return
        with suppress(OSError):
            for path in (*self.folder.glob("part-*.parquet"), *self.folder.glob(".*"), self._plan):
                path.unlink(missing_ok=True)
            self.folder.rmdir()

    def table(self) -> Table:
        """Return all rows of the final file."""
        with _opened(self.file) as file:
            return file.read()

    def batches(self, columns: Sequence[str]) -> Iterator[Mapping[str, list[Any]]]:
        """Iterate over the existing rows, some thousands at a time: values by column.

        Args:
            columns: Names of the columns to read.
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
    """Yield an open file of rows.

    Raises:
        ScenarioError: It was altered.
    """
    with path.open("rb") as data:
        try:
            with pq.ParquetFile(data, page_checksum_verification=True) as file:
                yield file
        except _UNREADABLE:
            raise _spoiled(path, "is damaged") from None


def _spoiled(path: Path, what: str) -> ScenarioError:
    return ScenarioError.about(path, f"{what}; remove it and rerun the command to create it again")


def _digest(part: int, data: bytes, contents: Contents) -> bytes:
    """Return the digest of a part and its plan; the place of the digest itself holds zeros."""
    found = hashlib.sha256(f"{contents.digest} {part} ".encode())
    found.update(data)
    return found.hexdigest().encode()


class Left(NamedTuple):
    """Contents of a file of rows from `sweep` or `tune`.

    Attributes:
        rows: Its columns, by name.
        about: Metadata as JSON; "": none.
    """

    rows: Mapping[str, list[Any]]
    about: str


def read_left(path: Path) -> Left:
    """Return the contents of a file of rows.

    Raises:
        OSError: It cannot be opened.
        QuestionError: It is another kind of file, or damaged.
    """
    path.stat()  # Arrow's error for a missing file is that for a damaged one
    try:
        table = pq.read_table(path)
    except _UNREADABLE:
        raise QuestionError(f"{path}: is not a Parquet file, or is damaged") from None
    return left_of(table)


def left_of(table: Table) -> Left:
    """Return the contents of a table of rows."""
    return Left(table.to_pydict(), (table.schema.metadata or {}).get(b"rmrc", b"").decode())


def write_table(
    path: Path,
    columns: Sequence[Column],
    rows: Sequence[Mapping[str, Any]],
    about: Mapping[str, Any] | None = None,
) -> None:
    """Write a file of rows atomically; a missing number is NaN, any other missing value null.

    Args:
        path: Path of the file.
        columns: Columns of a row.
        rows: All rows.
        about: Metadata as strict JSON, stored under the name `rmrc` in the file.
    """
    schema = _described(columns)
    if about is not None:
        schema = schema.with_metadata({"rmrc": json.dumps(about, ensure_ascii=False, allow_nan=False)})
    with written_whole(path) as temporary:
        pq.write_table(_table(schema, columns, rows), temporary)


def _bare(columns: Sequence[Column]) -> pa.Schema:
    """Return the types of columns, without units and meanings."""
    return pa.schema([(column.name, _TYPES[column.kind]) for column in columns])


def _described(columns: Sequence[Column]) -> pa.Schema:
    """Return the types of columns, with units and meanings."""
    return pa.schema(
        [pa.field(c.name, _TYPES[c.kind], metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns]
    )


def _table(schema: pa.Schema, columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return rows as a table; a missing or undefined number is NaN, any other missing value null."""
    blanks = [(column.name, math.nan if column.kind == "number" else None) for column in columns]
    return pa.table({name: [row.get(name, blank) for row in rows] for name, blank in blanks}, schema)
