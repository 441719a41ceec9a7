"""Compare the tables of the reference with their declarations, or write them.

Prints the rows that a page lacks, and ends with 1 if it is not as declared. With `--write` the tables
are written instead. A table of choices is known by its heading, whose first cell is the key of the choices in
its rows. Other pages have the declared part between two lines `<!-- declared -->`.
"""

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path

import typer

from rmrc import cli
from rmrc.results.columns import COLUMNS
from rmrc.results.expectations import blank
from rmrc.scenario import schema_rows
from rmrc.scenario.choices import CHOICES, INVERSES, PLANTS, PRIORITIES

DOCS = Path(__file__).resolve().parent.parent / "docs"
DECLARED = "<!-- declared -->"


def cell(text: str) -> str:
    """Return a text as it stands in a cell."""
    return " ".join(text.split()).replace("|", r"\|")


def table(*rows: tuple[str, ...]) -> str:
    """Return rows, of which the first one is the heading, as Markdown."""
    lines = [f"| {' | '.join(map(cell, row))} |" for row in rows]
    return "\n".join([lines[0], "|---" * len(rows[0]) + "|", *lines[1:], ""])


def code(text: str) -> str:
    """Return a text as code, and nothing as nothing."""
    return f"`{text}`" if text else ""


def keys() -> str:
    """Return all keys of a scenario, a table for each section."""
    parts = []
    for section, rows in groupby(schema_rows(), lambda row: re.split(r"[.\[]", row.key)[0]):
        cells = [(code(row.key), row.type, row.unit, code(row.default), row.meaning) for row in rows]
        parts += [f"## {section}\n", table(("key", "type", "unit", "default", "meaning"), *cells)]
    return "\n".join(parts)


def metrics() -> str:
    """Return all metrics of a run with one joint and all axes."""
    card = blank(("JOINT",), ("x", "y", "z", "rx", "ry", "rz"))
    rows = [(code(name), one.unit, one.meaning) for name, one in card.items()]
    return table(("metric", "unit", "meaning"), *rows)


def columns() -> str:
    """Return all columns of a run."""
    rows = [(code(name), one.unit, one.width, one.meaning) for name, one in COLUMNS.items()]
    return table(("column", "unit", "width", "meaning"), *rows)


def verbs() -> str:
    """Return all verbs with their arguments and options."""
    parts = []
    for name, verb in typer.main.get_command(cli.app).commands.items():  # type: ignore[attr-defined]
        context = verb.context_class(verb, info_name=name)
        records = [one.get_help_record(context) for one in verb.get_params(context)]
        rows = [(code(option), help_) for option, help_ in filter(None, records)]
        usage = " ".join([f"rmrc {name}", *verb.collect_usage_pieces(context)])
        said = verb.help.replace("\b\n", "").strip()
        parts += [f"## {name}\n", f"```\n{usage}\n```\n", f"{said}\n", table(("option", "does"), *rows)]
    return "\n".join(parts)


def choices() -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Yield each key with the cells of its rows."""
    for some in CHOICES:
        cells = [(code(one.name), one.meaning) for one in some.options]
        if some is INVERSES:
            needs = ("as many task axes as joints" if one.needs_square else "any" for one in INVERSES.options)
            yield f"control.{some.key}", [(*row, need) for row, need in zip(cells, needs, strict=True)]
        elif some is not PRIORITIES:  # which the objective `secondary` names
            yield f"control.{some.key}", cells
    yield "plant.kind", [(code(one.name), one.equation) for one in PLANTS.options]


def with_choices(text: str) -> str:
    """Return a text with the rows of its tables of choices as declared.

    Raises:
        ValueError: A key has no table, or more than one.
    """
    for key, rows in choices():
        heading = rf"^\| `{re.escape(key)}` \|.*\n\|[-|]+\n"
        lines = "".join(f"| {' | '.join(map(cell, row))} |\n" for row in rows)
        text, count = re.subn(
            rf"({heading})(?:\|.*\n)*", lambda found, new=lines: found[1] + new, text, flags=re.M
        )
        if count != 1:
            raise ValueError(f"choices.md: must have one table of {key}, has {count}")
    return text


def between(what: Callable[[], str]) -> Callable[[str], str]:
    """Return a function that replaces the declared part of a text."""

    def replaced(text: str) -> str:
        before, _, after = text.split(DECLARED)
        return f"{before}{DECLARED}\n\n{what()}\n{DECLARED}{after}"

    return replaced


PAGES: dict[str, Callable[[str], str]] = {
    "choices.md": with_choices,
    "keys.md": between(keys),
    "metrics.md": between(metrics),
    "columns.md": between(columns),
    "commands.md": between(verbs),
}


def main(arguments: list[str] | None = None) -> int:
    """Compare or write; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--write", action="store_true", help="write the tables into the pages")
    write = parser.parse_args(arguments).write
    differs = False
    for name, as_declared in PAGES.items():
        text = (DOCS / name).read_text("utf-8")
        wanted = as_declared(text)
        differs |= wanted != text
        if write:
            (DOCS / name).write_text(wanted, "utf-8")
        else:
            lines = set(text.splitlines())
            print(*(f"{name}: {line}" for line in wanted.splitlines() if line not in lines), sep="\n", end="")
    return int(differs and not write)


if __name__ == "__main__":
    sys.exit(main())
