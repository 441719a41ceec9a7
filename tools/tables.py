"""Compare the tables of the reference with their declarations, or write them.

Prints the rows that a page lacks, and ends with 1 if it is not as declared. With `--write` the tables
are written instead. A table of choices is known by its heading, whose first cell is the key of the choices in
its rows. Other pages have the declared part between two lines `<!-- declared -->`.
"""

import argparse
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path

import typer

from rmrc import cli
from rmrc.results.columns import COLUMNS
from rmrc.results.expectations import blank
from rmrc.scenario import SchemaRow, schema_rows
from rmrc.scenario.choices import CHOICES, PLANTS, PRIORITIES

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
    """Return all keys of a scenario, a table for each section; `turn` and `tilt` of segments once."""
    rows = (row for row in schema_rows() if not re.search(r"\.(line|arc|set)\.(turn|tilt)\.", row.key))
    parts = []
    for section, group in groupby(rows, lambda row: re.split(r"[.\[]", row.key)[0]):
        cells = [(code(row.key), value(row), row.meaning) for row in group]
        parts += [f"## {section}\n", table(("key", "value", "meaning"), *cells)]
    return "\n".join(parts)


def value(row: SchemaRow) -> str:
    """Return type, unit and default of a key in a cell; null is the default of those without."""
    unit = "" if row.unit in ("", "1") else f" [{row.unit}]"
    default = "" if row.default == "null" else f"; {code(row.default)}"
    return f"{row.type.replace(' | ', ', ')}{unit}{default}"


def metrics() -> str:
    """Return all metrics of a run with one joint and all axes, those of one quantity in one row."""
    card = blank(("JOINT",), ("x", "y", "z", "rx", "ry", "rz"))
    quantities = dict[str, list[str]]()
    for name in card:
        if not re.match(r"status_time\.(?!OK|DAMPED)", name):  # one status stands for all
            quantities.setdefault(re.sub(r"(\.(rms|max|end|max_time)|_time|_joint)$", "", name), []).append(
                name
            )
    rows = []
    for names in quantities.values():
        units = dict.fromkeys(card[name].unit for name in names)
        meanings = [card[names[0]].meaning, *(beside(name, card[name].meaning) for name in names[1:])]
        rows.append((", ".join(map(code, names)), ", ".join(filter(None, units)), "; ".join(meanings)))
    return table(("metric", "unit", "meaning"), *rows).replace("DAMPED", "STATUS")


def beside(name: str, meaning: str) -> str:
    """Return the meaning of a metric in the row of another one of its quantity."""
    return {"time": "when first", "joint": "which joint"}.get(
        name.rpartition("_")[2], meaning.partition(", ")[2]
    )


def columns() -> str:
    """Return all columns of a run."""
    rows = [
        (code(name), f"{each.unit} ({each.width})" if each.width else each.unit, each.meaning)
        for name, each in COLUMNS.items()
    ]
    return table(("column", "unit (width)", "meaning"), *rows)


def verbs() -> str:
    """Return all verbs with their arguments and options, those of several verbs once."""
    helps, options = [], dict[str, list[tuple[str, str]]]()
    for name, verb in typer.main.get_command(cli.app).commands.items():  # type: ignore[attr-defined]
        context = verb.context_class(verb, info_name=name)
        helps.append((name, verb.help.replace("\b\n", "").strip()))
        options[name] = list(
            filter(None, (each.get_help_record(context) for each in verb.get_params(context)))
        )
    count = Counter(record for records in options.values() for record in records)
    common = dict[str, str]()
    for (name, does), number in count.most_common():
        if number > 2 and name not in common:
            common[name] = does
    parts = [
        "## Common options\n",
        table(("option", "does"), *((code(name), does) for name, does in common.items())),
    ]
    for name, text in helps:
        rows = [(code(option), does) for option, does in options[name] if common.get(option) != does]
        named = [option for option, does in options[name] if common.get(option) == does]
        shared = [code(re.sub(r"[ ,].*", "", option)) for option in named if option != "--help"]
        parts += [f"## {name}\n", f"{text}\n"]
        parts += [f"Common: {', '.join(shared)}.\n"] if shared else []
        parts += [table(("option", "does"), *rows)] if rows else []
    return "\n".join(parts)


def choices() -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Yield each key with the cells of its rows."""
    for some in CHOICES:
        if some is not PRIORITIES:  # which the objective `secondary` names
            yield f"control.{some.key}", [(code(one.name), one.meaning) for one in some.options]
    yield "plant.kind", [(code(one.name), one.meaning) for one in PLANTS.options]


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
