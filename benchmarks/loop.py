"""How much the closed loop costs over the physics alone, as ratios measured in one run.

    python benchmarks/loop.py [--rounds 7] [--json]

The floor is MuJoCo's own C loop: the same batch, from the same state, fed with the very controls that the
closed loop sent, so that both step the same motion. The closed loop adds the law (decomposition, scheduled
damping, null space, rate limits), every column of every tick, and one Python call of each per tick. Machines
are noisy: floor and loop take turns, and each ratio is given as min, median and max over the rounds.
"""

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from mujoco.batch import Batch

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))  # the plain numpy loop is the tests' oracle

from oracles import NumpyLoop  # noqa: E402
from rmrc.preparation import Prepared, prepare  # noqa: E402
from rmrc.run import COLUMNS  # noqa: E402
from rmrc.scenario import loads  # noqa: E402
from rmrc.simulation import Simulation  # noqa: E402

SCENARIO = """
name: benchmark
arm: {{model: {root}/models/{model}.xml, site: {site}}}
task: {{axes: [{axes}]}}
control:
  inverse: {{method: damped, damping: {{schedule: smallest_singular_value, maximum: 0.1, below: 0.6}}}}
  nullspace: {{objective: posture}}
target:
  path: [{{line: {{by: [{by}]}}}}, {{line: {{by: [{back}]}}}}]
"""
ARMS = {
    "planar_2link": ("tip", "x, y", "0.3, 0.3, 0", "-0.3, -0.3, 0"),
    "planar_3link": ("tip", "x, y", "0.3, 0.3, 0", "-0.3, -0.3, 0"),
    "stanford": ("wrist", "x, y, z, rx, ry, rz", "0.2, 0.2, 0.2", "-0.2, -0.2, -0.2"),
}
# Seconds of stepping that one timing should take at least, against the clock's and the scheduler's grain.
TIMING = 0.05


def world(arm: str) -> Prepared:
    """Return the benchmark's scenario for an arm: there and back, always moving."""
    site, axes, by, back = ARMS[arm]
    return prepare(loads(SCENARIO.format(root=ROOT, model=arm, site=site, axes=axes, by=by, back=back)))


def closed_loop(prepared: Prepared, worlds: int, threads: int = 1) -> tuple[float, Simulation]:
    """Return seconds of stepping, compiling and wiring excluded, and the simulation."""
    simulation = Simulation([prepared] * worlds, threads)
    started = time.perf_counter()
    simulation.run()
    return time.perf_counter() - started, simulation


def floor(prepared: Prepared, worlds: int, controls: np.ndarray) -> float:
    """Return seconds of stepping the same motion open loop, in C."""
    plant = prepared.scenario.plant
    model = prepared.arm.adapted(plant.kind, prepared.kv, plant.timestep, plant.gravity_compensation)
    batch = Batch(model, worlds, 1, persistent=True)
    batch.bind("qpos")[:] = prepared.qpos
    batch.forward()
    control = np.broadcast_to(controls, (worlds, *controls.shape)).copy()
    started = time.perf_counter()
    batch.rollout(len(controls), control, record=())
    return time.perf_counter() - started


def ratios(rounds: int, numerator, denominator) -> dict[str, float]:
    """Return min, median and max of numerator() / denominator(), taken in turn."""
    found = []
    for _ in range(rounds):
        a, b = numerator(), denominator()
        found.append(a / b)
    return {"min": min(found), "median": statistics.median(found), "max": max(found)}


def repeated(measure, seconds: float) -> float:
    """Return the mean of a timing, repeated until it has taken `seconds` in all."""
    total, count = 0.0, 0
    while total < seconds:
        total += measure()
        count += 1
    return total / count


def over_floor(arm: str, worlds: int, rounds: int) -> dict[str, float]:
    """Closed loop over floor."""
    prepared = world(arm)
    _, simulation = closed_loop(prepared, 1)
    controls = simulation.runs()[0]["qdot_cmd"]
    found = ratios(
        rounds,
        lambda: repeated(lambda: closed_loop(prepared, worlds)[0], TIMING),
        lambda: repeated(lambda: floor(prepared, worlds, controls), TIMING),
    )
    ticks = worlds * len(controls)
    found["floor_us"] = repeated(lambda: floor(prepared, worlds, controls), TIMING) / ticks * 1e6
    return found


def two_threads(rounds: int, worlds: int = 64) -> dict[str, float]:
    """One thread over two, after a check that both give the same bits."""
    prepared = world("stanford")
    one, two = (closed_loop(prepared, worlds, threads)[1].runs() for threads in (1, 2))
    for a, b in zip(one, two, strict=True):
        for name in COLUMNS:
            np.testing.assert_array_equal(a[name], b[name])
    return ratios(
        rounds, lambda: closed_loop(prepared, worlds, 1)[0], lambda: closed_loop(prepared, worlds, 2)[0]
    )


def numpy_over_loop(worlds: int, rounds: int) -> dict[str, float]:
    """The plain numpy loop, world by world, over the closed loop."""
    prepared = world("stanford")

    def plain() -> float:
        loop = NumpyLoop(prepared)
        started = time.perf_counter()
        loop.run()
        return (time.perf_counter() - started) * worlds

    return ratios(rounds, plain, lambda: repeated(lambda: closed_loop(prepared, worlds)[0], TIMING))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rounds = arguments.rounds
    table = {
        f"closed loop / C floor, {arm}, {worlds} world{'s' * (worlds > 1)}": over_floor(arm, worlds, rounds)
        for arm in ARMS
        for worlds in (1, 64)
    }
    table["1 thread / 2 threads, stanford, 64 worlds"] = two_threads(rounds)
    for worlds in (1, 64):
        name = f"plain numpy loop / closed loop, stanford, {worlds} world{'s' * (worlds > 1)}"
        table[name] = numpy_over_loop(worlds, 3)
    if arguments.json:
        print(json.dumps(table, indent=2))
        return
    print(f"{'ratio':<58}{'min':>8}{'median':>8}{'max':>8}   floor, us a step")
    for name, row in table.items():
        floor_us = f"{row['floor_us']:>16.2f}" if "floor_us" in row else ""
        print(f"{name:<58}{row['min']:>8.2f}{row['median']:>8.2f}{row['max']:>8.2f}{floor_us}")


if __name__ == "__main__":
    main()
