"""Tables of numbers in files: CSV in the dialects of many programs, and Parquet."""

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The dialect of a file is found from this many bytes.
HEAD = 65536
# The beginning of comment lines before the names of the columns.
COMMENTS = ("#", "%", "//")


@dataclass(frozen=True)
class Table:
    """The contents of a file.

    Attributes:
        numbers: Columns of numbers by name, all (R,); a cell that is empty is NaN.
        texts: First non-numeric cell of each other column, by name.
        skipped: Rows that were left out because they have too few cells or too many.
    """

    numbers: Mapping[str, Array]
    texts: Mapping[str, str]
    skipped: int


def read_table(path: Path, is_log: bool = False) -> Table:
    """Read a CSV or Parquet file.

    A CSV file may begin with comments; the last of them may hold the names of the columns. Its cells are
    separated by commas, semicolons, tabs or blanks. With semicolons, a comma may be the decimal point.

    Args:
        path: Path of the file; any suffix except `.parquet` means CSV.
        is_log: Whether to skip rows with another number of cells instead of refusing them, as a logger that
            is killed leaves half a row; dates with times are then numbers as well, in ns.

    Raises:
        OSError: The file cannot be read.
        ValueError: It has another format; one line says why.
    """
    import pyarrow as untyped
    import pyarrow.parquet as pq

    pa: Any = untyped

    skipped: list[Any] = []
    try:
        if path.suffix == ".parquet":
            table: Any = pq.read_table(path)
        else:  # pyarrow reports a bad row to its handler as UTF-8, and ends where it is not
            table = _csv(path.read_bytes().decode("utf-8", "replace"), is_log, skipped)
    except pa.ArrowException as error:
        raise ValueError(str(error).splitlines()[0]) from None
    numbers, texts = dict[str, Array](), dict[str, str]()
    for name, column in zip(table.column_names, table.columns, strict=True):
        is_date = is_log and pa.types.is_timestamp(column.type)
        values = (column.cast(pa.timestamp("ns")).cast(pa.int64()) if is_date else column).to_numpy()
        if values.dtype.kind in "iuf":
            numbers[name.strip()] = values.astype(np.float64)
        else:
            texts[name.strip()] = next((str(cell) for cell in values if not _is_number(str(cell))), "")
    return Table(numbers, texts, len(skipped))


def _csv(text: str, is_log: bool, skipped: list[Any]) -> Any:
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
    has_names = not comment or not _is_number(first.split(mark)[0])
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
        csv.ParseOptions(delimiter=mark, invalid_row_handler=skip if is_log else None),
        csv.ConvertOptions(decimal_point="," if mark == ";" and has_commas else "."),
    )


def _is_number(text: str) -> bool:
    try:
        float(text.strip().replace(",", "."))
    except ValueError:
        return text.strip() in ("", "None")
    return True
