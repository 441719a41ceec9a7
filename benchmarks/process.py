"""What a whole `rmrc run` costs: against importing its libraries, the first time ever, and per recorded tick.

    python benchmarks/process.py [--rounds 5] [--json]

1. `run` of scenarios/approach_singularity.yaml as a whole process over a process that only imports the same
   libraries, in turn.
2. The first run ever, with an empty cache for machine code: seconds, and what it said meanwhile.
3. Recording: processor time a tick beyond that of one tick alone, and of one tick alone, flushed to disk.
4. `plot` and `report` of what that run left, as whole processes: CPU seconds, which other programs disturb
   less than time; and the size of the page. Budgets: 2 s, 3 s and 3 MB; `--check` holds medians against them.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).parent.parent
SCENARIO = ROOT / "scenarios/approach_singularity.yaml"
LIBRARIES = (
    "mujoco, mujoco.batch, numba, numpy, pydantic, rerun, rerun.blueprint, rich.progress, ruckig, typer, yaml"
)


def seconds(command: list[str], **environment: str) -> tuple[float, str]:
    """Return how long a process took, and what it wrote to stderr."""
    started = time.perf_counter()
    done = subprocess.run(
        command, check=True, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True
    )
    return time.perf_counter() - started, done.stderr


def spread(values: list[float]) -> dict[str, float]:
    """Return min, median and max."""
    return {"min": min(values), "median": statistics.median(values), "max": max(values)}


def run_command(folder: str) -> list[str]:
    """Return the command line of the main job, leaving its files in a folder."""
    return [sys.executable, "-m", "rmrc", "run", str(SCENARIO), "--out", folder, "--quiet"]


def run_over_imports(rounds: int) -> dict[str, float]:
    """Whole process over imports alone."""
    imports = [sys.executable, "-c", f"import {LIBRARIES}"]
    with tempfile.TemporaryDirectory() as folder:
        seconds(run_command(folder))  # fills the caches of both
        return spread([seconds(run_command(folder))[0] / seconds(imports)[0] for _ in range(rounds)])


# Of the median: CPU seconds of `plot` and of `report`, and megabytes of the page.
BUDGETS = {"plot, CPU s": 2.0, "report, CPU s": 3.0, "page of the report, MB": 3.0}


def cpu_seconds(command: list[str]) -> float:
    """Return what a process took of the processor."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds(command)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def pictures(rounds: int) -> dict[str, dict[str, float]]:
    """What `plot` and `report` cost."""
    with tempfile.TemporaryDirectory() as folder:
        seconds(run_command(folder))
        left, page = f"{folder}/{SCENARIO.stem}.npz", Path(folder) / f"{SCENARIO.stem}.html"
        found: dict[str, dict[str, float]] = {}
        for verb in ("plot", "report"):
            command = [sys.executable, "-m", "rmrc", verb, left, "--quiet"]
            seconds(command)  # the fonts of matplotlib are searched for once ever
            found[f"{verb}, CPU s"] = spread([cpu_seconds(command) for _ in range(rounds)])
        return found | {"page of the report, MB": spread([page.stat().st_size / 1e6])}


def first_run_ever() -> tuple[float, str]:
    """With nothing compiled before."""
    with tempfile.TemporaryDirectory() as folder:
        return seconds(run_command(folder), NUMBA_CACHE_DIR=folder)


def recording(rounds: int) -> tuple[dict[str, float], dict[str, float]]:
    """Microseconds a tick that the 6-joint arm's recording takes, and milliseconds of one tick alone."""
    from rmrc.recording.single import Recorder
    from rmrc.results.run import Run
    from rmrc.scenario import load
    from rmrc.simulation.prepare import prepare
    from rmrc.simulation.simulation import Simulation

    prepared = prepare(load(ROOT / "scenarios/stanford_line.yaml"))
    parts: list[Run] = []
    Simulation([prepared]).run(lambda _, part: parts.append(part))
    first = replace(parts[0], columns={name: values[:1] for name, values in parts[0].columns.items()})
    ticks = sum(len(part) for part in parts)

    def once(parts: list[Run]) -> float:
        with tempfile.TemporaryDirectory() as folder:
            started = time.thread_time()
            with Recorder(Path(folder) / "benchmark.rrd", prepared) as recorder:
                for part in parts:
                    recorder.write(part)
                recorder.finish("")
            return time.thread_time() - started

    once(parts)  # imports and warms up
    less, more = sorted(once([first]) for _ in range(rounds)), sorted(once(parts) for _ in range(rounds))
    each = [(b - a) / (ticks - 1) * 1e6 for a, b in zip(less, more, strict=True)]
    return spread(each), spread([1e3 * one for one in less])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--pictures", action="store_true", help="only what plot and report cost")
    parser.add_argument("--check", action="store_true", help="exit with 1 where a budget is exceeded")
    arguments = parser.parse_args()
    table, last = pictures(arguments.rounds), {}
    if not arguments.pictures:
        table["run / importing its libraries"] = run_over_imports(arguments.rounds)
        table["recording, us a tick"], table["recording of one tick, ms"] = recording(4 * arguments.rounds)
        first, said = first_run_ever()
        last = {"first run ever, s": round(first, 1), "said": said.strip()}
    over = [name for name, most in BUDGETS.items() if table[name]["median"] > most]
    if arguments.json:
        print(json.dumps(table | last, indent=2))
    else:
        print(f"{'':<32}{'min':>8}{'median':>8}{'max':>8}{'budget':>8}")
        for name, row in table.items():
            most = f"{BUDGETS[name]:>8.2f}" if name in BUDGETS else ""
            print(f"{name:<32}{row['min']:>8.2f}{row['median']:>8.2f}{row['max']:>8.2f}{most}")
        for name, value in last.items():
            print(f"{name}: {value!r}")
    if over and arguments.check:
        sys.exit(f"over its budget: {', '.join(over)}")


if __name__ == "__main__":
    main()
