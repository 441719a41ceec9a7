"""What a recording costs: processor time a tick, bytes a tick, and how long a torn one holds up who opens it.

    python benchmarks/recording.py [SCENARIO ...] [--rounds 25] [--cuts 20] [--json]

Each scenario runs once, without a recording. Its columns are then written as `run` writes them, block by
block, flushed to disk:

1. Processor time of the thread that writes, a tick: that of the whole recording, from opening the file to
   finishing it, less that of a recording of the first tick alone, by the other ticks. Both are written one
   after the other, in turns first; a round gives one difference. The first number is of the least times of
   both, the others are the median of the differences and their quartiles; and the least time of one tick
   alone, in milliseconds. A short run takes off a time that is 20 times its own: its quartiles are wide.
2. Size of the file, by the ticks of the run; and of the ticks alone, without layout, texts and geometries.
3. The first recording, cut anywhere, and with a wrong head: seconds until it is repaired or refused.
"""

import argparse
import gc
import json
import random
import statistics
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import rmrc
from rmrc.recording.single import Recorder, RecordingError, read_columns
from rmrc.recording.viewer import ViewerError
from rmrc.results.run import Run
from rmrc.scenario import load
from rmrc.simulation.prepare import Prepared, prepare

ROOT = Path(__file__).parent.parent
SCENARIOS = ("full_reach", "recorded_motion", "wrong_lengths", "start_by_pose", "stanford_line", "ur5e_wrist")
BLOCK = 1000


def blocks(run: Run, ticks: int) -> Iterator[Run]:
    """Yield the first ticks of a run as the simulation shows them."""
    for first in range(0, ticks, BLOCK):
        last = min(first + BLOCK, ticks)
        yield replace(run, columns={name: values[first:last] for name, values in run.columns.items()})


def written(prepared: Prepared, run: Run, path: Path, ticks: int) -> float:
    """Write the recording of the first ticks, and return its processor time [s]."""
    parts, begun = list(blocks(run, ticks)), time.thread_time()
    with Recorder(path, prepared) as recorder:
        for part in parts:
            recorder.write(part)
        recorder.finish("")
    return time.thread_time() - begun


def quartiles(values: list[float]) -> list[float]:
    """Return the quartiles of some values, of which there may be one."""
    return statistics.quantiles(values, n=4, method="inclusive") if len(values) > 1 else values * 3


def measured(name: str, rounds: int, folder: Path) -> dict[str, object]:
    """Return what a scenario's recording costs."""
    path = ROOT / "scenarios" / f"{name}.yaml"
    run, prepared, file = rmrc.run(path), prepare(load(path)), folder / f"{name}.rrd"
    ticks = len(run)
    half = ticks // 2
    written(prepared, run, file, half)  # fills caches
    small = file.stat().st_size
    found = dict[int, list[float]]({1: [], ticks: []})
    for i in range(rounds):
        for count in (1, ticks)[:: 1 if i % 2 else -1]:
            gc.collect()  # of what was there before, which costs more than a tick
            found[count].append(written(prepared, run, file, count))
    each = [more - less for less, more in zip(*found.values(), strict=True)]
    times = [1e6 * one / (ticks - 1) for one in (min(found[ticks]) - min(found[1]), *quartiles(each))]
    written(prepared, run, file, ticks)
    size = file.stat().st_size
    return {
        "joints": len(run.joints),
        "ticks": ticks,
        "us a tick": dict(zip(("least", "quartile", "median", "third quartile"), times, strict=True)),
        "ms of one tick": 1e3 * min(found[1]),
        "bytes a tick": size / ticks,
        "of the ticks alone": (size - small) / (ticks - half),
    }


def torn(path: Path, cuts: int, folder: Path) -> dict[str, object]:
    """Return how long reading takes where a recording is cut, or has a wrong head [s]."""
    content, draw, times, lines = path.read_bytes(), random.Random(1), [], 0
    for i in range(cuts + 1):
        cut = folder / "cut.rrd"
        cut.write_bytes(b"RRF9" + content[4:] if i == cuts else content[: draw.randrange(4, len(content))])
        begun = time.perf_counter()
        try:
            read_columns(cut)
        except (RecordingError, ViewerError) as error:
            lines += "\n" not in str(error)
        times.append(time.perf_counter() - begun)
    return {"cuts": cuts, "seconds": [min(times), statistics.median(times), max(times)], "refused": lines}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", default=SCENARIOS)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--cuts", type=int, default=20)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = {one: measured(one, arguments.rounds, folder) for one in arguments.scenarios}
        cut = torn(folder / f"{next(iter(rows))}.rrd", arguments.cuts, folder)
    if arguments.json:
        print(json.dumps({"recordings": rows, "torn": cut}))
        return
    heads = ("joints", "ticks", "us a tick: least", "quartile", "median", "3rd quartile", "ms of one",
             "B a tick", "alone")  # fmt: skip
    print(f"{'recording of':18}" + "".join(f"{head:>17}" for head in heads))
    for one, row in rows.items():
        each = [*row["us a tick"].values(), row["ms of one tick"]]  # type: ignore[attr-defined]
        times = "".join(f"{value:17.1f}" for value in each)
        print(f"{one:18}{row['joints']:17}{row['ticks']:17}{times}"
              f"{row['bytes a tick']:17.0f}{row['of the ticks alone']:17.0f}")  # fmt: skip
    least, middle, most = cut["seconds"]  # type: ignore[misc]
    print(f"cut at {cut['cuts']} places, and with a wrong head: {least:.2f} {middle:.2f} {most:.2f} s; "
          f"{cut['refused']} refused in a line, the others repaired")  # fmt: skip


if __name__ == "__main__":
    main()
