"""What the benchmarks share: a command line, ratios in turns, and how rows are printed."""

import argparse
import json
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent
Row = dict[str, float]
Rows = dict[str, Row]
SPREAD = ("min", "median", "max", "minima")
# Seconds that go into one ratio.
TIMING = 0.5


def options(doc: str | None, rounds: int, only: Iterable[str] = ()) -> argparse.ArgumentParser:
    """Return a parser of `--rounds`, `--json` and, where there are parts, `--only`."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=rounds)
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")
    if parts := [*only]:
        parser.add_argument("--only", choices=parts, help="measure these rows alone")
    return parser


def spread(found: Sequence[float] | Sequence[tuple[float, float]]) -> Row:
    """Return min, median and max of values; of pairs, of their ratios, and the ratio of the least of each."""
    each = [one[0] / one[1] if isinstance(one, tuple) else float(one) for one in found]
    row = {"min": min(each), "median": statistics.median(each), "max": max(each)}
    pairs = [one for one in found if isinstance(one, tuple)]
    if pairs:
        row["minima"] = min(a for a, _ in pairs) / min(b for _, b in pairs)
    return row


def ratios(
    rounds: int, numerator: Callable[[], float], denominator: Callable[[], float], least: int = 3
) -> Row:
    """Return the spread of numerator() / denominator() over the rounds.

    In a round both take turns until TIMING has gone by, at least `least` times, and the least of each counts.
    """
    found = []
    for _ in range(rounds):
        pairs: list[tuple[float, float]] = []
        while len(pairs) < least or sum(map(sum, pairs)) < TIMING:
            pairs.append((numerator(), denominator()))
        found.append((min(a for a, _ in pairs), min(b for _, b in pairs)))
    return spread(found)


def show(table: Mapping[str, Mapping[str, float]], as_json: bool, head: str = "ratio") -> None:
    """Print rows, one a line, or all of them as JSON."""
    if as_json:
        print(json.dumps(table, indent=2))
        return
    columns = [*dict.fromkeys(key for row in table.values() for key in row)]
    print(f"{head:<70}" + "".join(f"{key:>{_width(key)}}" for key in columns))
    for name, row in table.items():
        cells = (f"{row[key]:>{_width(key)}.3f}" if key in row else " " * _width(key) for key in columns)
        print(f"{name:<70}{''.join(cells)}".rstrip())


def _width(key: str) -> int:
    return max(9, len(key) + 2)
