"""What a whole `rmrc run` costs: against importing its libraries, and the first time ever; plot and report.

    python benchmarks/process.py [--rounds 5] [--json] [--only run|first|pictures] [--check]

1. run: `run` of scenarios/approach_singularity.yaml as a whole process over a process that only imports the
   same libraries, in turn: by the clock, and in CPU time, which other programs disturb less.
2. first: the first run ever, with an empty cache for machine code.
3. pictures: `plot` and `report` of what that run left, as whole processes, and the size of the page. Budgets:
   2 s, 3 s and 3 MB; `--check` holds medians against them.

`recording.py` has what recording costs.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import ROOT, Rows, options, show, spread

SCENARIO = ROOT / "scenarios/approach_singularity.yaml"
LIBRARIES = (
    "mujoco, mujoco.batch, numba, numpy, pydantic, rerun, rerun.blueprint, rich.progress, ruckig, typer, yaml"
)


# Of the median: CPU seconds of `plot` and of `report`, and megabytes of the page.
BUDGETS = {"plot, CPU s": 2.0, "report, CPU s": 3.0, "page of the report, MB": 3.0}


def seconds(command: list[str], **environment: str) -> tuple[float, float]:
    """Return how long a process took, by the clock and of the processor."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, cwd=ROOT, env={**os.environ, **environment}, capture_output=True)
    clock, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    return clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run_command(folder: str) -> list[str]:
    """Return the command line of the main job, leaving its files in a folder."""
    return [sys.executable, "-m", "rmrc", "run", str(SCENARIO), "--out", folder, "--quiet"]


def run_rows(rounds: int) -> Rows:
    """Whole process over imports alone."""
    imports = [sys.executable, "-c", f"import {LIBRARIES}"]
    with tempfile.TemporaryDirectory() as folder:
        seconds(run_command(folder)), seconds(imports)  # fills the caches of both
        pairs = [(seconds(run_command(folder)), seconds(imports)) for _ in range(rounds)]
    ways = ("run / importing its libraries", "run / importing its libraries, CPU")
    return {name: spread([(run[i], other[i]) for run, other in pairs]) for i, name in enumerate(ways)} | {
        "run, CPU s": spread([run[1] for run, _ in pairs])
    }


def first_rows(rounds: int) -> Rows:
    """The first run ever, with nothing compiled before."""
    found = []
    for _ in range(min(rounds, 2)):
        with tempfile.TemporaryDirectory() as folder:
            found.append(seconds(run_command(folder), NUMBA_CACHE_DIR=folder))
    return {
        name: spread([one[i] for one in found])
        for i, name in enumerate(("first run ever, s", "first run ever, CPU s"))
    }


def picture_rows(rounds: int) -> Rows:
    """What `plot` and `report` cost."""
    with tempfile.TemporaryDirectory() as folder:
        seconds(run_command(folder))
        left, page = f"{folder}/{SCENARIO.stem}.npz", Path(folder) / f"{SCENARIO.stem}.html"
        found: Rows = {}
        for verb in ("plot", "report"):
            command = [sys.executable, "-m", "rmrc", verb, left, "--quiet"]
            seconds(command)  # the fonts of matplotlib are searched for once ever
            found[f"{verb}, CPU s"] = spread([seconds(command)[1] for _ in range(rounds)])
        return found | {"page of the report, MB": spread([page.stat().st_size / 1e6])}


ROWS = {"run": run_rows, "first": first_rows, "pictures": picture_rows}


def main() -> None:
    """Measure and print."""
    parser = options(__doc__, 5, ROWS)
    parser.add_argument("--check", action="store_true", help="exit with 1 where a budget is exceeded")
    arguments = parser.parse_args()
    table: Rows = {}
    for name, measure in ROWS.items():
        if arguments.only in (None, name):
            table |= measure(arguments.rounds)
    for name in BUDGETS.keys() & table:
        table[name]["budget"] = BUDGETS[name]
    show(table, arguments.json, "")
    over = [name for name, most in BUDGETS.items() if name in table and table[name]["median"] > most]
    if over and arguments.check:
        sys.exit(f"over its budget: {', '.join(over)}")


if __name__ == "__main__":
    main()
