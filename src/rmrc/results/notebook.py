"""The display of results in a notebook: tables as HTML, and DataFrames of pandas if that is installed."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from rmrc.results.columns import COLUMNS, Recorded
from rmrc.support.errors import QuestionError

PANDAS = "to_pandas needs pandas, which rmrc does not require: `pip install pandas`"


def pandas() -> Any:
    """Return pandas.

    Raises:
        QuestionError: It is not installed.
    """
    try:
        import pandas as found
    except ImportError:
        raise QuestionError(PANDAS) from None
    return found


def table(caption: str, headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table as HTML: numbers right-aligned, with six digits.

    Args:
        caption: Text above it.
        headings: Headings of the columns.
        rows: Rows of values; None and NaN print as dashes.
    """
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    title = f"<caption>{escape(caption)}</caption>"
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return '<td style="text-align:right">–</td>'
    if isinstance(value, int | float):
        return f'<td style="text-align:right">{value:.6g}</td>'
    return f'<td style="text-align:left">{escape(str(value))}</td>'


def figures(name: str, card: Mapping[str, Any]) -> str:
    """Return the defined metrics of a run, as HTML; not the times of others."""
    # NaN is not equal to itself
    known = {key for key, one in card.items() if one.value != "" and one.value == one.value}
    rows = [
        (key, one.value, one.unit, one.meaning)
        for key, one in card.items()
        if key in known and (key.removesuffix("_time") in known or key.removesuffix("_time") not in card)
    ]
    return table(name, ("metric", "value", "unit", "meaning"), rows)


def beside(cards: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the metrics that differ between several runs, side by side, as HTML.

    Args:
        cards: By label; the names of metrics are those of the first.
    """
    first = next(iter(cards.values()))
    rows = []
    for name, one in first.items():
        values = [card[name].value if name in card else None for card in cards.values()]
        if len({str(value) for value in values}) > 1:  # NaN, of a missing metric, equals no NaN
            rows.append((name, one.unit, *values))
    return table("metrics that differ", ("metric", "unit", *cards), rows)


def frame(run: Recorded) -> Any:
    """Return the columns of a run as a DataFrame over time: `qdot_cmd.elbow`, `pose.0`, `status`.

    Raises:
        QuestionError: There is no pandas.
    """
    flat = {}
    for name, values in run.columns.items():
        if name == "time":
            continue
        if values.ndim == 1:
            flat[name] = values
            continue
        parts = run.joints if COLUMNS[name].width == "n" else tuple(map(str, range(values.shape[1])))
        flat |= {f"{name}.{part}": values[:, i] for i, part in enumerate(parts)}
    return pandas().DataFrame(flat, index=pandas().Index(run.columns["time"], name="time"))
