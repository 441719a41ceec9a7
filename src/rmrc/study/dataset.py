"""Rows on disk: those of a sweep as parts of a folder during the run, one Parquet file at the end.

    NAME.sweep/part-00000017.parquet  some rows, beginning with run 17; appears whole, or not at all
    NAME.sweep.parquet                all rows by index; then the parts go

Each file has the description of the sweep in its metadata, and so either is enough to resume it.
"""

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pyarrow.lib as pa
import pyarrow.parquet as pq

from rmrc.scenario import angle, inline
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.files import reading, written_whole

_TYPES = {"number": pa.float64(), "count": pa.int64(), "text": pa.string(), "switch": pa.bool_()}
_MOVE = "move it, or choose another --out"

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
    """Description of the rows of a sweep, ready for JSON.

    Attributes:
        identity: All inputs of the rows as texts, by name: sweeps with equal identities are the same.
        columns: Columns of a row.
        metrics: Names of the metrics of most interest.
    """

    identity: Mapping[str, str]
    columns: Sequence[Column]
    metrics: Sequence[str]

    @classmethod
    def read(cls, text: str | bytes) -> "Contents":
        """Return the contents from JSON.

        Raises:
            KeyError, TypeError, ValueError: It is other JSON, or none.
        """
        facts = json.loads(text)
        return cls(**{**facts, "columns": [Column(*column) for column in facts["columns"]]})


class Dataset:
    """Rows of a sweep on disk.

    Attributes:
        folder: Folder of the parts.
        file: Final file with all rows.
        contents: Their description; None before there are rows.
        done: Indices of the rows that are there.
    """

    def __init__(self, folder: Path, name: str, identity: Mapping[str, str]) -> None:
        """Read the description of the rows that are there.

        Args:
            folder: Folder of the files.
            name: Name of the scenario.
            identity: Identity of the sweep.

        Raises:
            QuestionError: Something else has their name.
            ScenarioError: They belong to another sweep.
        """
        self.folder, self.file = folder / f"{name}.sweep", folder / f"{name}.sweep.parquet"
        self.contents: Contents | None = None
        self.done = set[int]()
        for path in self._files():
            try:
                table = read_table(path, ["index"])
            except QuestionError as error:
                raise QuestionError(f"{error}; {_MOVE}") from None
            with reading(path, "of this sweep"):
                self.done.update(table["index"].to_pylist())
                contents = Contents.read(about_of(table))
            differs = [key for key, text in identity.items() if contents.identity.get(key) != text]
            if differs:
                raise ScenarioError.about(path, f"is of another sweep ({', '.join(differs)} differ); {_MOVE}")
            self.contents = contents

    def _files(self) -> list[Path]:
        return [self.file] if self.file.exists() else sorted(self.folder.glob("part-*.parquet"))

    def add(self, rows: Sequence[Mapping[str, Any]], contents: Contents) -> None:
        """Write some rows as a part."""
        if rows:
            path = self.folder / f"part-{rows[0]['index']:08d}.parquet"
            write_table(path, contents.columns, rows, contents._asdict())
            self.done.update(row["index"] for row in rows)

    def merge(self) -> None:
        """Make one file of all parts, in order, and remove them; keep other files and their folder.

        Raises:
            QuestionError: A part is damaged.
        """
        if self.file.exists():
            return
        parts = self._files()
        table = pa.concat_tables(map(read_table, parts)).sort_by("index").combine_chunks()
        with written_whole(self.file) as temporary:
            pq.write_table(table, temporary)
        for path in parts:
            path.unlink()
        with suppress(OSError):
            self.folder.rmdir()


def read_table(path: Path, columns: Sequence[str] | None = None) -> Table:
    """Return the contents of a file of rows from `sweep` or `tune`.

    Args:
        path: The file.
        columns: Names of the columns to read; None: all.

    Raises:
        OSError: It cannot be opened.
        QuestionError: It is another kind of file, or damaged.
    """
    with reading(path, "a file of rows"), path.open("rb") as file:
        return pq.ParquetFile(file).read(columns)


def about_of(table: Table) -> str:
    """Return the metadata of rows as JSON; "": none."""
    return str((table.schema.metadata or {}).get(b"rmrc", b""), "utf-8")


def write_table(
    path: Path, columns: Sequence[Column], rows: Sequence[Mapping[str, Any]], about: Mapping[str, Any]
) -> None:
    """Write a file of rows atomically.

    A missing number is NaN, any other missing value null. An angle may be a text; other lists are written as
    YAML.

    Args:
        path: Path of the file.
        columns: Columns of a row.
        rows: All rows.
        about: Metadata as strict JSON, stored under the name `rmrc` in the file.
    """
    fields = [
        pa.field(c.name, _TYPES[c.kind], metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns
    ]
    metadata = {"rmrc": json.dumps(about, ensure_ascii=False, allow_nan=False)}
    values = {name: [_cell(row, name, kind) for row in rows] for name, kind, *_ in columns}
    with written_whole(path) as temporary:
        pq.write_table(pa.table(values, pa.schema(fields, metadata)), temporary)


def _cell(row: Mapping[str, Any], name: str, kind: str) -> Any:
    """Return a value as its column has it."""
    value = row.get(name, math.nan if kind == "number" else None)
    if kind == "number":
        return as_number(value)
    return inline(value) if kind == "text" and value is not None and not isinstance(value, str) else value


def as_number(value: Any) -> float | None:
    """Return a number, or an angle in radians; None for any other value."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    with suppress(ValueError):
        return angle(value) if isinstance(value, str) else None
    return None
