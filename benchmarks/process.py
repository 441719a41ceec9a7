"""What a whole `rmrc run` costs: against importing its libraries, the first time ever, and per recorded tick.

    python benchmarks/process.py [--rounds 5] [--json]

1. `run` of scenarios/approach_singularity.yaml as a whole process over a process that only imports the same
   libraries, in turn.
2. The first run ever, with an empty cache for machine code: seconds, and what it said meanwhile.
3. Recording: microseconds a tick, everything that `Recorder.write` and `finish` do.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
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


def first_run_ever() -> tuple[float, str]:
    """With nothing compiled before."""
    with tempfile.TemporaryDirectory() as folder:
        return seconds(run_command(folder), NUMBA_CACHE_DIR=folder)


def recording(rounds: int) -> dict[str, float]:
    """Microseconds a tick of the 6-joint arm's recording."""
    from rmrc.output.recording import Recorder
    from rmrc.preparation import prepare
    from rmrc.run import Run
    from rmrc.scenario import load
    from rmrc.simulation import Simulation

    prepared = prepare(load(ROOT / "scenarios/stanford_line.yaml"))
    parts: list[Run] = []
    Simulation([prepared]).run(lambda _, part: parts.append(part))
    ticks = sum(len(part) for part in parts)

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            started = time.perf_counter()
            with Recorder(Path(folder) / "benchmark.rrd", prepared) as recorder:
                for part in parts:
                    recorder.write(part)
                recorder.finish("")
            return (time.perf_counter() - started) / ticks * 1e6

    once()  # imports and warms up
    return spread([once() for _ in range(rounds)])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    measures: dict[str, Callable[[], dict[str, float]]] = {
        "run / importing its libraries": lambda: run_over_imports(arguments.rounds),
        "recording, us a tick": lambda: recording(arguments.rounds),
    }
    table = {name: measure() for name, measure in measures.items()}
    first, said = first_run_ever()
    if arguments.json:
        print(json.dumps(table | {"first run ever, s": first, "said": said.strip()}, indent=2))
        return
    print(f"{'':<32}{'min':>8}{'median':>8}{'max':>8}")
    for name, row in table.items():
        print(f"{name:<32}{row['min']:>8.2f}{row['median']:>8.2f}{row['max']:>8.2f}")
    print(f"first run ever: {first:.1f} s; it said: {said.strip()!r}")


if __name__ == "__main__":
    main()
