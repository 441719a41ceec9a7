"""All benchmarks in one go, beside the figures of an earlier run.

    python benchmarks/all.py [--only PART ...] [--out FILE] [--before FILE]

Each part is one of the other programs with few rounds, in a process of its own; together they take some ten
minutes of CPU time. All figures are written to a file of JSON. `--before` names such a file of an earlier
run, for example of another checkout: a row is worse where it is so beyond the noise of both, that is, where
its best round is worse than the median before, and its median worse than the worst round before, both by more
than 5 %. Seconds are compared only on the same machine. The exit code is 1 where a row is worse, or a part
failed.
"""

import argparse
import json
import os
import platform
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

from measure import ROOT, SPREAD, Row, Rows

# Least rounds that give a spread; where a round is long, fewer.
PARTS = {
    "arms": "loop.py --only arms --rounds 3",
    "robots": "loop.py --only robots --rounds 3",
    "way": "loop.py --only way --rounds 3",
    "methods": "loop.py --only methods --rounds 2",
    "numpy": "loop.py --only numpy --rounds 2",
    "scorecards": "sweep.py --only scorecards --rounds 3",
    "overhead": "sweep.py --only overhead --rounds 2",
    "threads": "sweep.py --only threads --rounds 3",
    "plain": "sweep.py --only plain --rounds 2",
    "run": "process.py --only run --rounds 7",
    "first": "process.py --only first --rounds 2",
    "pictures": "process.py --only pictures --rounds 3",
    "recording": "recording.py --rounds 5 --cuts 5",
    "inverse_kinematics": "inverse_kinematics.py --goals 2000 --peer-goals 30 --rounds 3",
    "controller": "controller.py",
    "limits": "limits.py --rounds 3",
    "workspace": "workspace.py --rounds 2",
    "tune": "tune.py --scenarios approach_singularity --seeds 1",
}
MIRRORED = {"min": "max", "median": "median", "max": "min"}
# Of these rows more is better.
MORE = re.compile(
    r"^plain |^1 thread /|(numpy|Python) loop / |, scipy .* / |success|first start|within|hypervolume"
)
# These only count what there was.
COUNTS = re.compile(r"refused|cuts|joints$|ticks$|acts$|looks|settings|runs$")
SECONDS = re.compile(r"\b(s|us|ms|ns|MB)\b|seconds")
MARGIN = 0.05


def rows_of(found: Any, name: str = "") -> Iterator[tuple[str, Row]]:
    """Yield the rows of what a program printed: of mappings within mappings, lists and single numbers."""
    if isinstance(found, dict) and "median" in found:
        yield name, {key: found[key] for key in SPREAD if key in found}
    elif isinstance(found, dict):
        for key, value in found.items():
            yield from rows_of(value, f"{name}, {key}".lstrip(", "))
    elif isinstance(found, list) and found and not isinstance(found[0], list):
        yield name, {"min": min(found), "median": statistics.median(found), "max": max(found)}
    elif isinstance(found, bool | int | float):
        yield name, dict.fromkeys(("min", "median", "max"), float(found))


def measured(command: str) -> tuple[Rows, float, str]:
    """Return the rows of a program, its CPU seconds, and why it failed, if it did."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, *f"benchmarks/{command}".split(), "--json"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if done.returncode:
        return {}, cpu, (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    start = re.search(r"^[{\[]", done.stdout, re.MULTILINE)  # a table may come first
    return dict(rows_of(json.loads(done.stdout[start.start() :]))) if start else {}, cpu, ""


def worse_by(name: str, row: Row, before: Row) -> float:
    """Return by what factor a row is worse than an earlier one beyond the noise of both; 1 if it is not.

    The median stands for a least or a largest value that a row does not have.
    """
    if MORE.search(name):
        row, before = (
            {MIRRORED[key]: -value for key, value in each.items() if key in MIRRORED}
            for each in (row, before)
        )
    margin, middle = MARGIN * abs(before["median"]), before["median"]
    beyond = (
        row.get("min", row["median"]) > middle + margin and row["median"] > before.get("max", middle) + margin
    )
    return 1.0 + (row["median"] - middle) / abs(middle) if beyond and margin else 1.0


def machine() -> str:
    """Return what tells this machine from another."""
    info = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", info.read_text()) if info.exists() else None
    cpu = model[1] if model else platform.processor()
    return f"{cpu}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def compare(found: dict[str, Rows], earlier: dict[str, Any]) -> list[str]:
    """Print each row beside that of an earlier run; return those that are worse."""
    is_same, worse = earlier.get("machine") == machine(), []
    print(f"{'':<78}" + "".join(f"{key:>9}" for key in (*SPREAD, "before")))
    for part, rows in found.items():
        for name, row in rows.items():
            before = earlier.get("parts", {}).get(part, {}).get(name)
            counts = before and not COUNTS.search(name) and (is_same or not SECONDS.search(name))
            factor = worse_by(name, row, before) if counts else 1.0
            mark = f"  WORSE by {factor - 1:.0%}" if factor > 1.0 else ""
            cells = "".join(f"{row[key]:>9.4g}" if key in row else " " * 9 for key in SPREAD)
            last = f"{before['median']:>9.4g}" if before else ""
            print(f"{f'{part}: {name}':<78}{cells}{last}{mark}")
            if mark:
                worse.append(f"{part}: {name}")
    return worse


def main() -> None:
    """Measure, write, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=[*PARTS], default=[*PARTS], metavar="PART")
    parser.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "benchmarks.json")
    parser.add_argument("--before", type=Path, help="figures of an earlier run")
    arguments = parser.parse_args()
    earlier = json.loads(arguments.before.read_text()) if arguments.before else {}
    found: dict[str, Rows] = {}
    failed, begun = [], time.perf_counter()
    for part in arguments.only:
        started = time.perf_counter()
        rows, cpu, why = measured(PARTS[part])
        print(f"{part}: {time.perf_counter() - started:.0f} s, {cpu:.0f} s of CPU  {why}", flush=True)
        if why:
            failed.append(part)
        else:
            found[part] = rows
    about = {"machine": machine(), "date": f"{date.today()}"}
    arguments.out.write_text(json.dumps(about | {"parts": found}, indent=1) + "\n")
    worse = compare(found, earlier)
    print(f"{time.perf_counter() - begun:.0f} s in all; wrote {arguments.out}")
    if worse or failed:
        sys.exit(f"worse: {'; '.join(worse) or 'none'}. Failed: {', '.join(failed) or 'none'}.")


if __name__ == "__main__":
    main()
