"""What a recording costs: processor time a tick, and bytes a tick.

    python benchmarks/recording.py [SCENARIO ...] [--rounds 9] [--json]

Each scenario runs once, without a recording. Its columns are then written as `run` writes them. The first
numbers are the least, the median and the largest processor time of all threads over the number of ticks.
"""

import argparse
import gc
import json
import statistics
import tempfile
import time
from pathlib import Path

import rmrc
from rmrc.recording.recorder import write
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare

ROOT = Path(__file__).parent.parent
SCENARIOS = ("full_reach", "recorded_motion", "wrong_lengths", "start_by_pose", "stanford_line", "ur5e_wrist")


def measured(name: str, rounds: int, folder: Path) -> dict[str, object]:
    """Return what a scenario's recording costs."""
    path = ROOT / "scenarios" / f"{name}.yaml"
    run, prepared, file = rmrc.run(path), prepare(load(path)), folder / f"{name}.rrd"
    times = []
    for _ in range(rounds + 1):  # the first fills caches
        gc.collect()
        begun = time.process_time()
        write(file, {name: (prepared, run)}, None, {})
        times.append(1e6 * (time.process_time() - begun) / len(run))
    each = sorted(times[1:])
    return {
        "joints": len(run.joints),
        "ticks": len(run),
        "us a tick": {"least": each[0], "median": statistics.median(each), "largest": each[-1]},
        "bytes a tick": file.stat().st_size / len(run),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", default=SCENARIOS)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        rows = {one: measured(one, arguments.rounds, Path(name)) for one in arguments.scenarios}
    if arguments.json:
        print(json.dumps({"recordings": rows}))
        return
    heads = ("joints", "ticks", "us a tick: least", "median", "largest", "B a tick")
    print(f"{'recording of':18}" + "".join(f"{head:>17}" for head in heads))
    for one, row in rows.items():
        times = "".join(f"{value:17.1f}" for value in row["us a tick"].values())  # type: ignore[attr-defined]
        print(f"{one:18}{row['joints']:17}{row['ticks']:17}{times}{row['bytes a tick']:17.0f}")


if __name__ == "__main__":
    main()
