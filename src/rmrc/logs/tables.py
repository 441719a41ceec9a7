"""Tables of numbers in files: CSV in the dialects of many programs, Parquet, and npz."""

import codecs
import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias
from zipfile import BadZipFile, is_zipfile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.results.run import BASELINE
from rmrc.support.errors import QuestionError
from rmrc.support.files import reading
from rmrc.support.text import listed, quoted

Numbers: TypeAlias = Mapping[str, NDArray[Any]]
"""Columns by name, all (R,), of floats or, as stamps in ns need all their digits, of integers of 64 bits."""

# The components of a pose.
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
# The dialect of a file is found from this many bytes.
HEAD = 65536
# The beginning of comment lines before the names of the columns.
COMMENTS = ("#", "%", "//")


@dataclass(frozen=True)
class Table:
    """The contents of a file.

    Attributes:
        numbers: Columns of numbers; a cell that is empty is NaN.
        texts: First non-numeric cell of each other column, by name.
        skipped: Rows that were left out because they have too few cells or too many, as a logger that is
            killed leaves half a row.
        strays: Cells of columns of numbers that are none, in words; they are NaN.
    """

    numbers: Numbers
    texts: Mapping[str, str]
    skipped: int = 0
    strays: str = ""


def read_table(path: Path, contents: str) -> Table:
    """Read a CSV, Parquet or npz file.

    A CSV file may begin with comments; the last of them may hold the names of the columns. Its cells are
    separated by commas, semicolons, tabs or blanks. With semicolons, a comma may be the decimal point. Dates
    with times are numbers, in ns. The npz file of a run has the joints' names and parts of a pose behind the
    names of its columns: `q[elbow]`, `pose[qw]`.

    Args:
        path: Path of the file; any other suffix means CSV.
        contents: What it must be, such as `"a log"`.

    Raises:
        OSError: The file cannot be read.
        QuestionError: It has another format, or no numeric column; one line says why.
    """
    with reading(path, f"{contents} as CSV, Parquet or npz"):
        table = _read_npz(path) if path.suffix == ".npz" else _read_arrow(path)
    if not table.numbers:
        texts = listed((f"{name} ({quoted(text)})" for name, text in table.texts.items()), 8)
        raise QuestionError(f"{path}: has no numeric column; its columns are {texts or 'none'}")
    return table


def columns_of(arrays: Mapping[str, ArrayLike], joints: Sequence[str] = ()) -> dict[str, NDArray[Any]]:
    """Return columns of one value per row; joints, parts of a pose or numbers name those of (R, n).

    Args:
        arrays: By name, (R,) or (R, n); others are left out.
        joints: Names of the joints.
    """
    columns = dict[str, NDArray[Any]]()
    for name in arrays:
        values = np.asarray(arrays[name])
        if values.dtype.kind not in "iufb" or values.ndim not in (1, 2):
            continue
        values = values.astype(np.float64 if values.dtype.kind == "f" else np.int64)
        if values.ndim == 1:
            columns[name] = values
            continue
        labels: Sequence[object] = range(values.shape[1])
        known = (POSE if name.startswith("pose") else (), joints)
        labels = next((names for names in known if len(names) == len(labels)), labels)
        columns |= {f"{name}[{label}]": values[:, i] for i, label in enumerate(labels)}
    return columns


def _read_npz(path: Path) -> Table:
    if not is_zipfile(path):  # otherwise numpy would take it for a pickle
        raise BadZipFile("it is not a zip file")
    with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
        facts = json.loads(str(file["facts"])) if "facts" in file else {}
        arrays = {name: file[name] for name in file.files if not name.startswith(BASELINE)}
        return Table(columns_of(arrays, facts.get("joints", ())), {})


def _read_arrow(path: Path) -> Table:
    import pyarrow as untyped
    import pyarrow.parquet as pq

    pa: Any = untyped

    skipped: list[Any] = []
    try:
        if path.suffix == ".parquet":
            table: Any = pq.read_table(io.BytesIO(path.read_bytes()))  # of any path, also not UTF-8
        else:  # pyarrow reports a bad row to its handler as UTF-8, and ends where it is not
            data = path.read_bytes()
            code = "utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8"
            table = _csv(data.decode(code, "replace"), skipped)
    except pa.ArrowException as error:
        raise ValueError(str(error).splitlines()[0]) from None
    if not table.num_rows:
        raise ValueError("it has names of columns, and no rows")
    numbers, texts, strays = dict[str, NDArray[Any]](), dict[str, str](), list[str]()
    for name, column in zip(table.column_names, table.columns, strict=True):
        is_date = pa.types.is_timestamp(column.type)
        values = (column.cast(pa.timestamp("ns")).cast(pa.int64()) if is_date else column).to_numpy()
        if values.dtype.kind in "iuf":
            numbers[name.strip()] = values.astype(np.float64 if values.dtype.kind == "f" else np.int64)
            continue
        cells = [str(cell).strip() for cell in values]
        parsed = np.array([_number(cell) for cell in cells])
        wrong = [row for row, cell in enumerate(cells) if _is_stray(cell)]
        if len(wrong) < np.isfinite(parsed).sum():
            numbers[name.strip()] = parsed
            strays += [f"{name.strip()} has {quoted(cells[row])} in row {row + 1:,}" for row in wrong]
        else:
            texts[name.strip()] = cells[wrong[0]] if wrong else ""
    note = f"cells that are no number left out: {listed(strays, 4)}" if strays else ""
    return Table(numbers, texts, len(skipped), note)


def _csv(text: str, skipped: list[Any]) -> Any:
    """Return the text of a CSV file as a pyarrow table, whose types mypy does not know."""
    from pyarrow import csv as untyped

    csv: Any = untyped

    lines = text[:HEAD].removeprefix("\ufeff").splitlines() or [""]
    start = next((i for i, line in enumerate(lines) if line.strip() and not line.startswith(COMMENTS)), 0)
    first, comment = lines[start], re.sub(r"^[#%/\s]+", "", lines[start - 1] if start else "")
    has_commas = any("," in line for line in lines[start : start + 50])
    mark = next((mark for mark in ";,\t" if mark in first), " ")
    if mark == " ":
        text = "\n".join(",".join(line.split()) for line in text.splitlines()[start:])
        first, comment, start, mark = ",".join(first.split()), ",".join(comment.split()), 0, ","
    has_names = not comment or _is_stray(first.split(mark)[0])
    data = text.encode()

    def skip(row: Any) -> str:
        skipped.append(row)
        return "skip"

    return csv.read_csv(
        io.BytesIO(data),
        csv.ReadOptions(
            skip_rows=start,
            column_names=None if has_names else comment.split(mark),
            block_size=min(len(data) + 1, 2**31 - 1),  # all rows decide whether a column is of integers
        ),
        csv.ParseOptions(delimiter=mark, invalid_row_handler=skip),
        csv.ConvertOptions(decimal_point="," if mark == ";" and has_commas else "."),
    )


def _is_stray(text: str) -> bool:
    """Return whether a cell is neither empty nor a number."""
    return text.strip().lower() not in ("", "none", "nan") and math.isnan(_number(text))


def _number(text: str) -> float:
    """Return the number that a cell holds; NaN: it holds none."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return math.nan
