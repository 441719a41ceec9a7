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


class Dataset:
    """Rows of a sweep on disk.

    Attributes:
        folder: Folder of the parts.
        file: Final file with all rows.
        schema: Their columns, with the identity of the sweep; None before there are rows.
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
        self.schema: pa.Schema | None = None
        self.done = set[int]()
        for path in self._files():
            try:
                table = read_table(path, ["index"])
                with reading(path, "of this sweep"):
                    self.done.update(table["index"].to_pylist())
                    before = json.loads(about_of(table.schema))["identity"]
            except QuestionError as error:
                raise QuestionError(f"{error}; {_MOVE}") from None
            differs = [key for key, text in identity.items() if before.get(key) != text]
            if differs:
                raise ScenarioError.about(path, f"is of another sweep ({', '.join(differs)} differ); {_MOVE}")
            with path.open("rb") as file:
                self.schema = pq.read_schema(file)

    def _files(self) -> list[Path]:
        return [self.file] if self.file.exists() else sorted(self.folder.glob("part-*.parquet"))

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write some rows as a part."""
        if rows:
            write_table(self.folder / f"part-{rows[0]['index']:08d}.parquet", self.schema, rows)
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
        with written_whole(self.file) as temporary, temporary.open("wb") as file:
            pq.write_table(table, file)
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


def schema_of(columns: Sequence[Column], about: Mapping[str, Any]) -> pa.Schema:
    """Return columns with their units and meanings as a schema of pyarrow.

    Args:
        columns: Columns of a row.
        about: Metadata as strict JSON, stored under the name `rmrc` in the file.
    """
    fields = [
        pa.field(name, _TYPES[kind], metadata={"unit": unit, "meaning": meaning})
        for name, kind, unit, meaning in columns
    ]
    return pa.schema(fields, {"rmrc": json.dumps(about, ensure_ascii=False, allow_nan=False)})


def about_of(schema: pa.Schema) -> str:
    """Return the metadata of rows as JSON; "": none."""
    return str((schema.metadata or {}).get(b"rmrc", b""), "utf-8")


def write_table(path: Path, schema: pa.Schema, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a file of rows atomically.

    A missing number is NaN, any other missing value null. An angle may be a text; other lists are written as
    YAML.

    Args:
        path: Path of the file.
        schema: Its columns, as `schema_of` returns them.
        rows: All rows.
    """
    values = {field.name: [_cell(row, field) for row in rows] for field in schema}
    # pyarrow takes no path that is not UTF-8
    with written_whole(path) as temporary, temporary.open("wb") as file:
        pq.write_table(pa.table(values, schema), file)


def _cell(row: Mapping[str, Any], field: pa.Field) -> Any:
    """Return a value as its column has it."""
    if field.type == pa.float64():
        return as_number(row.get(field.name, math.nan))
    value = row.get(field.name)
    is_list = field.type == pa.string() and value is not None and not isinstance(value, str)
    return inline(value) if is_list else value


def as_number(value: Any) -> float | None:
    """Return a number, or an angle in radians; None for any other value."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    with suppress(ValueError):
        return angle(value) if isinstance(value, str) else None
    return None
