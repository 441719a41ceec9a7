"""Hold the README's tables of choices against their declarations in `rmrc.scenario.choices`, or write them.

Prints the rows that it lacks, and ends with 1 if it is not as declared. With `--write` the tables are written
instead. A table is known by its heading, whose first cell is the key that its rows are choices of.
"""

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from rmrc.scenario.choices import CHOICES, INVERSES, PLANTS, PRIORITIES

README = Path(__file__).resolve().parent.parent / "README.md"


def tables() -> Iterator[tuple[str, list[tuple[str, ...]]]]:
    """Yield each key with the cells of its rows."""
    for some in CHOICES:
        cells = [(f"`{one.name}`", one.meaning.replace("|", r"\|")) for one in some.options]
        if some is INVERSES:
            needs = ("as many task axes as joints" if one.needs_square else "any" for one in INVERSES.options)
            yield f"control.{some.key}", [(*row, need) for row, need in zip(cells, needs, strict=True)]
        elif some is not PRIORITIES:  # which the objective `secondary` names
            yield f"control.{some.key}", cells
    yield "plant.kind", [(f"`{one.name}`", one.equation) for one in PLANTS.options]


def with_tables(text: str) -> str:
    """Return a text with the rows of its tables as declared.

    Raises:
        ValueError: A key has no table, or more than one.
    """
    for key, rows in tables():
        heading = rf"^\| `{re.escape(key)}` \|.*\n\|[-|]+\n"
        lines = "".join(f"| {' | '.join(row)} |\n" for row in rows)
        text, count = re.subn(
            rf"({heading})(?:\|.*\n)*", lambda found, new=lines: found[1] + new, text, flags=re.M
        )
        if count != 1:
            raise ValueError(f"README.md: must have one table of {key}, has {count}")
    return text


def main(arguments: list[str] | None = None) -> int:
    """Compare or write; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--write", action="store_true", help="write the tables into the README")
    write = parser.parse_args(arguments).write
    text = README.read_text("utf-8")
    wanted = with_tables(text)
    if write:
        README.write_text(wanted, "utf-8")
    else:
        for line in wanted.splitlines():
            if line not in text.splitlines():
                print(line)
    return 0 if write else int(wanted != text)


if __name__ == "__main__":
    sys.exit(main())
