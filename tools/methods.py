"""Run methods on shipped scenarios, and write the results into `docs/which_method.md`.

    python tools/methods.py [--write] [--only METHOD ...]

Prints the tables, or writes them into the page, between its marks. With `--only` the rows of the others are
those of the page. Each row is `rmrc run` of a scenario with the row's `--set`; only metrics of its
scorecard go into the page. A test runs a part of it again.
"""

import argparse
import math
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import rmrc
from rmrc import Run
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import RmrcError

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/which_method.md"

SITUATIONS = {
    "approach_singularity": "near the edge of the workspace, 5 mm from full reach",
    "blow_up": "1 mm beyond reach",
    "ur5e_elbow": "10 mm beyond reach, six joints",
    "fr3_elbow": "10 mm beyond reach, redundant",
    "ur5e_wrist": "past the wrist singularity at 1°",
    "ur5e_wrist_close": "past the wrist singularity at 0.1°",
    "joint_limit": "into a joint limit",
    "line_tracking": "far from singularities",
}
# The settings of a situation beside its scenario.
SETS = {"approach_singularity": ("target.path[0].line.to=[1.995, 0]",)}
METHOD, SCHEDULE = "control.inverse.method=", "control.inverse.damping.schedule="
POLICY, EXCESS = "control.at_singularity=", "control.limits.on_excess="
PLAIN = METHOD + "pseudoinverse"
METHODS: dict[str, tuple[str, ...]] = {
    "undamped": (PLAIN,),
    "undamped, clamped": (PLAIN, EXCESS + "clamp"),
    "undamped, redistributed": (PLAIN, EXCESS + "redistribute"),
    "undamped, sns": (PLAIN, EXCESS + "sns"),
    "undamped, reverse priority": (PLAIN, EXCESS + "reverse_priority"),
    "damped, optimal": (METHOD + "damped", EXCESS + "optimal"),
    "undamped, slow": (PLAIN, POLICY + "slow"),
    "undamped, singularity-consistent": (PLAIN, POLICY + "singularity_consistent"),
    "transpose": (METHOD + "transpose",),
    "damped, constant": (METHOD + "damped", SCHEDULE + "constant"),
    "damped by σ_min": (METHOD + "damped", SCHEDULE + "smallest_singular_value"),
    "damped by rate_bound": (METHOD + "damped", SCHEDULE + "rate_bound"),
    "filtered": (METHOD + "filtered",),
    "selectively damped": (METHOD + "selectively_damped",),
    "jparse": (METHOD + "jparse",),
    "damped, inertia": (METHOD + "damped", "control.inverse.metric=inertia"),
    "damped, stop": (METHOD + "damped", POLICY + "stop"),
    "damped, keep out": (METHOD + "damped", POLICY + "keep_out"),
}
# A recommended run must be back on its path at the end, within this error [mm or mrad].
BACK = 2.0
# A smaller metric may cost this multiple of the least error, or this error.
WORTH, NOTHING = 3.0, 0.5
COLUMNS = (
    "peak rate [rad/s]", "error [mm]", "[mrad]", "end [mm]", "[mrad]", "acceleration [rad/s²]",
    "chatter [1/s]", "time [s]",
)  # fmt: skip


def figures(run: Run) -> tuple[float, ...]:
    """Return the metrics of a run, in the order of the columns; NaN where it has none."""

    def value(name: str, factor: float = 1.0) -> float:
        found = run.scorecard.get(name)
        return factor * float(found.value) if found is not None and found.value is not None else math.nan

    return (
        value("joint_rate_cmd.peak"), value("position_error.max", 1e3), value("orientation_error.max", 1e3),
        value("position_error.end", 1e3), value("orientation_error.end", 1e3),
        value("joint_acceleration_cmd.peak"), value("chatter"), value("duration"),
    )  # fmt: skip


def measured(scenario: str, methods: Sequence[str]) -> dict[str, tuple[float, ...] | str]:
    """Return the metrics of methods on a scenario, or the reason why there are none."""
    prepared, found = {}, dict[str, tuple[float, ...] | str]()
    for name in methods:
        try:
            prepared[name] = prepare(
                rmrc.load(ROOT / f"scenarios/{scenario}.yaml", (*SETS.get(scenario, ()), *METHODS[name]))
            )
        except RmrcError:
            found[name] = "refused"
    for name, run in zip(prepared, Simulation(list(prepared.values())).run(), strict=True):
        whole = run.divergence is None and run.is_complete
        found[name] = figures(run) if whole else "diverged" if run.divergence else "path not finished"
    return {name: found[name] for name in methods}


def shown(value: float) -> str:
    """Return a number with three digits."""
    return "" if math.isnan(value) else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def table(scenario: str, found: dict[str, tuple[float, ...] | str]) -> Iterator[str]:
    """Yield the lines of a scenario's table."""
    yield f"### {SITUATIONS[scenario][0].upper()}{SITUATIONS[scenario][1:]}"
    yield ""
    own = "".join(f' --set "{one}"' for one in SETS.get(scenario, ()))
    yield f"`rmrc run {scenario}{own}` with the `--set` of the [method](#the-methods):"
    yield ""
    yield f"| method | {' | '.join(COLUMNS)} |"
    yield f"|---|{'---|' * len(COLUMNS)}"
    for name, row in found.items():
        cells = [row, *[""] * (len(COLUMNS) - 1)] if isinstance(row, str) else map(shown, row)
        yield f"| {name} | {' | '.join(cells)} |"
    yield ""


def error_of(row: tuple[float, ...]) -> float:
    """Return the larger of both errors [mm or mrad]."""
    return max(value for value in row[1:3] if not math.isnan(value))


def decision(scenario: str, found: dict[str, tuple[float, ...] | str]) -> str:
    """Return the row of the decision table: the best of those that come back, the simplest of equals.

    Equal are those with the same displayed metrics: the decision must be visible in the tables.
    """
    back = {}
    for name, row in found.items():
        if not isinstance(row, str) and max(v for v in row[3:5] if not math.isnan(v)) <= BACK:
            back[name] = tuple(float(shown(value) or "nan") for value in row)
    if not back:
        return f"| {SITUATIONS[scenario]} | none comes back | | |"
    least = min(back, key=lambda name: error_of(back[name]))
    allowed = max(WORTH * error_of(back[least]), NOTHING)
    near = [name for name in back if error_of(back[name]) <= allowed]

    def cell(name: str, unit: str, value: float) -> str:
        return f"{name}: {shown(value)} {unit}"

    slowest, smoothest = (min(near, key=lambda name, i=i: back[name][i]) for i in (0, 5))
    cells = [
        f"{cell(least, 'mm or mrad', error_of(back[least]))}, {shown(back[least][0])} rad/s",
        f"{cell(slowest, 'rad/s', back[slowest][0])}, {shown(error_of(back[slowest]))} mm or mrad",
        f"{cell(smoothest, 'rad/s²', back[smoothest][5])}, {shown(error_of(back[smoothest]))} mm or mrad",
    ]
    return f"| {SITUATIONS[scenario]} | {' | '.join(cells)} |"


def row_of(page: str, scenario: str, method: str) -> tuple[float, ...] | str:
    """Return a row as a page has it."""
    block = page.partition(f"`rmrc run {scenario}`")[2].partition("###")[0]
    cells = re.findall(rf"^\| {re.escape(method)} \| (.*) \|$", block, re.MULTILINE)[0].split("|")
    told: str = cells[0].strip()
    return tuple(float(cell.strip() or "nan") for cell in cells) if told[:1].isdigit() else told


def rows_of(page: str, scenario: str, only: Sequence[str]) -> dict[str, tuple[float, ...] | str]:
    """Return the metrics of all methods on a scenario: measured, or from the page."""
    found = measured(scenario, only)
    return {name: found[name] if name in only else row_of(page, scenario, name) for name in METHODS}


def blocks(page: str, only: Sequence[str]) -> dict[str, str]:
    """Return the texts between the marks of the page, by their names."""
    rows = {scenario: rows_of(page, scenario, only) for scenario in SITUATIONS}
    decided = [
        "| situation | least error | slowest joints | smoothest |", "|---|---|---|---|",
        *(decision(scenario, found) for scenario, found in rows.items()),
    ]  # fmt: skip
    named = ["| method | `--set` |", "|---|---|"]
    named += [f"| {name} | {' '.join(f'`{one}`' for one in sets)} |" for name, sets in METHODS.items()]
    tables = [line for scenario, found in rows.items() for line in table(scenario, found)]
    parts = {"decision": decided, "methods": named, "tables": tables}
    return {name: "\n".join(lines).strip() for name, lines in parts.items()}


def with_blocks(page: str, found: dict[str, str]) -> str:
    """Return a page with the texts between its marks replaced."""
    for name, block in found.items():
        mark = f"<!-- {name} -->\n"
        page = re.sub(f"(?s){mark}.*?{mark}", lambda _, m=mark, b=block: f"{m}\n{b}\n\n{m}", page)
    return page


def main(arguments: list[str] | None = None) -> int:
    """Print or write; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--write", action="store_true", help="write the tables into the page")
    parser.add_argument("--only", nargs="+", choices=METHODS, default=list(METHODS), metavar="METHOD")
    given, page = parser.parse_args(arguments), PAGE.read_text("utf-8")
    found = blocks(page, given.only)
    if given.write:
        PAGE.write_text(with_blocks(page, found), "utf-8")
    else:
        print("\n\n".join(found.values()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
