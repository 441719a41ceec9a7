"""What sweeps of a million runs and more would cost on many machines, by a model of what is measured here.

    python benchmarks/scaling.py [--machines 100] [--cores 32] [--tasks 20000] [--json]

Measured on this machine: a run of 4 s of the six-joint arm from scenario to row on one core, its check, the
bytes of its row, making one file of the rows, and a piece of a sweep that has nothing to do, on a local
cluster of two workers. `--tasks 1000000` takes the scheduler through a million of these.
"""

import argparse
import json
import os
import pickle
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from sweep import DAMPING, SECONDS, scenario_of

from rmrc.scenario import draft_of
from rmrc.study import dask as cluster
from rmrc.study.executors import done
from rmrc.study.parcel import pack
from rmrc.study.rows import AsRows
from rmrc.study.study import Check, Listed, check_size
from rmrc.study.sweep import Sweep, batch_size

RUNS = (1e4, 1e6, 1e9)
# Of a run.
TICKS = round(1000 * SECONDS) + 1
# Pieces under way: two for each core of many machines.
ROOM = 400
# Tasks of Dask alone, all of which it has at once.
MOST_ALONE = 10_000
# Of the client's network [byte/s], 1 Gbit/s.
NETWORK = 1.25e8


def of_a_sweep(runs: int = 400) -> dict[str, float]:
    """Return what a run costs, from a sweep on one thread."""
    with scenario_of("stanford") as path, tempfile.TemporaryDirectory() as folder:
        sweep = Sweep(path, [DAMPING, f"sweep.samples={runs}"], Path(folder), 1)
        sweep.compile()
        started = time.perf_counter()
        sweep.check()
        checked = time.perf_counter()
        sweep.run()
        ran = time.perf_counter()
        return {
            "check [s a run]": (checked - started) / runs,
            "run [s a run]": (ran - checked) / runs,
            "row [byte a run]": os.path.getsize(sweep.dataset.file) / runs,
        }


def of_files(rows: int = 100_000) -> dict[str, float]:
    """Return what one file of many parts costs, made of one part of a real sweep again and again."""
    with scenario_of("stanford") as path, tempfile.TemporaryDirectory() as folder:
        sweep = Sweep(path, [DAMPING, "sweep.samples=44"], Path(folder), 1)
        contents = sweep.check()._replace(batch=44)
        results = sweep._study.results(sweep.plan, range(44), threading.Event())
        data = AsRows(sweep.plan, sweep.scenario, contents.columns)(results)
        many = contents._replace(runs=44 * (rows // 44))
        rows = pq.read_table(pa.BufferReader(data))
        for part in range(many.parts):
            index = pa.array(many.indices(part), pa.int64())
            stream = pa.BufferOutputStream()
            pq.write_table(
                rows.set_column(0, "index", index), stream, use_dictionary=False, write_statistics=False
            )
            sweep.dataset.keep(part, bytes(stream.getvalue()), many)
        started = time.perf_counter()
        sweep.dataset.merge(many)
        return {
            "one file of parts [s a run]": (time.perf_counter() - started) / many.runs,
            "part [byte a run]": len(data) / 44,
        }


def of_the_scheduler(tasks: int) -> dict[str, float]:
    """Return what a piece costs that has nothing to do, with as many under way as for 200 workers.

    Beside it stands what Dask's own `map` and `gather` take for some tasks of nothing, all under way at once.
    """
    with scenario_of("stanford") as path:
        parcel, nothing_to_do = pack(draft_of(path, [DAMPING])), Check(Listed([]))
        with cluster.opened(cluster.Address.read("local:2"), parcel) as crew:
            nothing = (range(i, i) for i in range(tasks))
            for _ in done(crew, nothing_to_do, iter([range(0)] * 4), threading.Event()):
                pass  # unpacks the parcel
            type(crew).room = ROOM
            started = time.perf_counter()
            count = sum(1 for _ in done(crew, nothing_to_do, nothing, threading.Event()))
            seconds = time.perf_counter() - started
            assert count == tasks
            some, started = range(min(tasks, MOST_ALONE)), time.perf_counter()
            crew._client.gather(crew._client.map(abs, some, pure=False, batch_size=ROOM))
            alone = (time.perf_counter() - started) / len(some)
    return {
        "tasks": tasks,
        "empty piece [s]": seconds / tasks,
        "empty task, Dask alone [s]": alone,
        "parcel [byte]": len(pickle.dumps(parcel)),
    }


def model(measured: Mapping[str, float], runs: float, workers: int) -> dict[str, float]:
    """Return hours of each part of a sweep; parts of different machines go on at the same time.

    Args:
        measured: What one of everything costs.
        runs: How many.
        workers: Cores of all machines.
    """
    batch = batch_size(int(runs), int(runs) * TICKS, TICKS)
    pieces = runs / batch + runs / check_size(int(runs))
    hours = {
        "checks, on the workers": runs * measured["check [s a run]"] / workers,
        "runs, on the workers": runs * measured["run [s a run]"] / workers,
        "pieces, in scheduler and client": pieces * measured["empty piece [s]"],
        "rows, to the client's network": runs * measured["part [byte a run]"] / NETWORK,
        "one file, in the client": runs * measured["one file of parts [s a run]"],
    }
    return {name: seconds / 3600 for name, seconds in hours.items()} | {
        "runs in a piece": batch,
        "pieces, checks and runs": pieces,
        "file [GB]": runs * measured["row [byte a run]"] / 1e9,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--cores", type=int, default=32, help="of each machine")
    parser.add_argument("--tasks", type=int, default=20_000, help="empty pieces that are scheduled")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    measured = of_a_sweep() | of_files() | of_the_scheduler(arguments.tasks)
    found = {f"{runs:g}": model(measured, runs, arguments.machines * arguments.cores) for runs in RUNS}
    if arguments.json:
        print(json.dumps({"measured": measured, "model": found}, indent=2))
        return
    for name, value in measured.items():
        print(f"{name:<40}{value:>14.4g}")
    print(f"\n{'hours, runs:':<40}" + "".join(f"{runs:>14}" for runs in found))
    for name in next(iter(found.values())):
        print(f"{name:<40}" + "".join(f"{one[name]:>14.3g}" for one in found.values()))


if __name__ == "__main__":
    main()
