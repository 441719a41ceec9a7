"""Run methods on shipped scenarios, and write `docs/methods.csv` and the tables of `docs/which_method.md`.

    python tools/methods.py [--page]

Each row is `rmrc run` of a scenario with the `--set` of a method. `--page` writes the page alone, from the
file that is there. A test runs a part of it again.
"""

import csv
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
PAGE, FILE = ROOT / "docs/which_method.md", ROOT / "docs/methods.csv"

SITUATIONS = {
    "approach_singularity": "5 mm before full reach",
    "blow_up": "1 mm beyond reach",
    "ur5e_elbow": "10 mm beyond reach",
    "fr3_elbow": "the same, redundant",
    "ur5e_wrist": "wrist at 1°",
    "ur5e_wrist_close": "wrist at 0.1°",
    "joint_limit": "into the limit",
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
    "peak rate [rad/s]", "error [mm]", "error [mrad]", "end [mm]", "end [mrad]", "peak acceleration [rad/s²]",
    "chatter [1/s]", "duration [s]",
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


def error_of(row: tuple[float, ...]) -> float:
    """Return the larger of both errors [mm or mrad]."""
    return max(value for value in row[1:3] if not math.isnan(value))


def decision(scenario: str, found: dict[str, tuple[float, ...] | str]) -> str:
    """Return the row of the decision table: the best of those that come back, the simplest of equals."""
    back = {
        name: row
        for name, row in found.items()
        if not isinstance(row, str) and max(v for v in row[3:5] if not math.isnan(v)) <= BACK
    }
    if not back:
        return f"| {scenario}: {SITUATIONS[scenario]} | none comes back | | |"
    least = min(back, key=lambda name: error_of(back[name]))
    allowed = max(WORTH * error_of(back[least]), NOTHING)
    near = [name for name in back if error_of(back[name]) <= allowed]
    slowest, smoothest = (min(near, key=lambda name, i=i: back[name][i]) for i in (0, 5))
    cells = [least, slowest, smoothest]
    for name in dict.fromkeys(cells):
        numbers = (shown(value) for value in (error_of(back[name]), back[name][0], back[name][5]))
        cells[cells.index(name)] += f": {'; '.join(numbers)}"
    return f"| {scenario}: {SITUATIONS[scenario]} | {' | '.join(cells)} |"


def rows() -> dict[str, dict[str, tuple[float, ...] | str]]:
    """Return the rows of the file: the metrics of each method on each scenario, or why there are none."""
    found: dict[str, dict[str, tuple[float, ...] | str]] = {}
    with FILE.open(encoding="utf-8", newline="") as opened:
        for scenario, method, first, *others in list(csv.reader(opened))[1:]:
            is_run = first[:1].isdigit()
            values = tuple(float(cell or "nan") for cell in (first, *others))
            found.setdefault(scenario, {})[method] = values if is_run else first
    return found


def summary(found: dict[str, dict[str, tuple[float, ...] | str]]) -> Iterator[str]:
    """Yield the table of all methods: their largest error in each situation."""
    yield f"| method | {' | '.join(name.replace('_', '_<wbr>') for name in found)} |"  # may be broken
    yield f"|---|{'---:|' * len(found)}"
    for name in METHODS:
        each = [found[scenario][name] for scenario in found]
        cells = [row if isinstance(row, str) else shown(error_of(row)) for row in each]
        yield f"| {name} | {' | '.join(cells)} |"


def with_tables(page: str) -> str:
    """Return a page with the tables between its marks replaced."""
    found = rows()
    decided = ["| situation | least error | slowest joints | smoothest |", "|---|---|---|---|"]
    decided += [decision(scenario, each) for scenario, each in found.items()]
    named = ["| method | `--set` |", "|---|---|"]
    named += [f"| {name} | {' '.join(f'`{one}`' for one in sets)} |" for name, sets in METHODS.items()]
    for name, lines in {"decision": decided, "methods": named, "tables": summary(found)}.items():
        mark, block = f"<!-- {name} -->\n", "\n".join(lines)
        page = re.sub(f"(?s){mark}.*?{mark}", lambda _, m=mark, b=block: f"{m}\n{b}\n\n{m}", page)
    return page


def main() -> int:
    """Measure and write the file, or write the page alone; return the exit code."""
    if "--page" not in sys.argv[1:]:
        with FILE.open("w", encoding="utf-8", newline="") as opened:
            lines = csv.writer(opened, lineterminator="\n")
            lines.writerow(("scenario", "method", *COLUMNS))
            for scenario in SITUATIONS:
                for name, row in measured(scenario, list(METHODS)).items():
                    lines.writerow((scenario, name, *([row] if isinstance(row, str) else map(shown, row))))
    PAGE.write_text(with_tables(PAGE.read_text("utf-8")), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
