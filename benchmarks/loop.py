"""How much the closed loop costs over the physics alone, as ratios measured in one run.

    python benchmarks/loop.py [--rounds 7] [--json] [--only arms|robots|way|methods|threads|numpy]

The floor is MuJoCo's own C loop over one world, from the same state, fed with the very controls that the
closed loop sent, so that both step the same motion. The closed loop adds the law (decomposition, scheduled
damping, null space, rate limits), every column of every tick, and making and releasing the world. Machines
are noisy: what is compared takes turns, time is that of the thread (of the clock for two threads), and each
ratio is given as min, median and max over the rounds, beside that of the least times of all rounds.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from measure import ROOT, options, ratios, show, spread
from mujoco.batch import Batch

sys.path.insert(0, str(ROOT / "tests"))  # the plain numpy loop is the tests' oracle

from oracles import NumpyLoop
from rmrc.results.columns import COLUMNS
from rmrc.scenario import loads
from rmrc.scenario.choices import INVERSES, SCHEDULES
from rmrc.simulation.prepare import Prepared, prepare
from rmrc.simulation.simulation import Simulation

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
# An arm of seven joints with a gripper, at its own timestep.
ROBOT = ("tool", "x, y, z, rx, ry, rz", "0.1, 0.1, 0.1", "-0.1, -0.1, -0.1")
ROBOT_PERIOD = ("control.period=0.002", "plant.timestep=0.002")
# One world, and many, one after another.
WORLDS = 1, 16


def world(arm: str, *overrides: str) -> Prepared:
    """Return the benchmark's scenario for an arm: there and back, always moving."""
    site, axes, by, back = ARMS.get(arm, ROBOT)
    text = SCENARIO.format(root=ROOT, model=arm, site=site, axes=axes, by=by, back=back)
    return prepare(loads(text, overrides=overrides))


def closed_loop(
    prepared: list[Prepared], threads: int = 1, clock: Callable[[], float] = time.thread_time
) -> tuple[float, Simulation]:
    """Return seconds of stepping, and the simulation."""
    simulation = Simulation(prepared, threads)
    started = clock()
    simulation.step()
    return clock() - started, simulation


def controls_of(prepared: Prepared, rates: np.ndarray) -> np.ndarray:
    """Return the inputs of all actuators, (ticks, nu), from the rates sent, (ticks, n).

    Actuators that are not the arm's come first. On the plant `model` all drives are position servos.
    """
    held = np.tile(prepared.held[0], (len(rates), 1))
    if prepared.scenario.plant.kind != "model":
        return np.concatenate([held, rates], axis=-1)
    held[..., list(prepared.arm.drives.kinds)] += prepared.scenario.control.period * np.cumsum(rates, axis=0)
    return held


def floor(prepared: Prepared, controls: np.ndarray) -> float:
    """Return seconds of stepping the same motion open loop, in C; controls are (ticks, nu)."""
    batch = Batch(prepared.plant.own_model(), 1, 1, persistent=True)
    batch.bind("qpos")[:] = prepared.qpos
    batch.forward()
    started = time.thread_time()
    batch.rollout(len(controls), controls[None], record=())
    return time.thread_time() - started


def over_floor(prepared: Prepared, rounds: int, worlds: int = 1) -> dict[str, float]:
    """Return a world of the closed loop, of one or of many, over the floor."""
    (run,) = closed_loop([prepared])[1].runs()
    controls = controls_of(prepared, run["qdot_cmd"])
    found = ratios(
        rounds, lambda: closed_loop([prepared] * worlds)[0] / worlds, lambda: floor(prepared, controls)
    )
    found["floor_us"] = min(floor(prepared, controls) for _ in range(5)) / len(controls) * 1e6
    return found


def arm_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop of each arm over the floor, of one world and of many."""
    return {
        f"closed loop / C floor, {arm}, {named(worlds)}": over_floor(world(arm), rounds, worlds)
        for arm in ARMS
        for worlds in WORLDS
    }


def named(worlds: int) -> str:
    """Return the words for a number of worlds."""
    return "1 world" if worlds == 1 else f"{worlds} worlds"


def robot_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop of an arm with a gripper over the floor, on servos of ours and on its own."""
    return {
        f"closed loop / C floor, fr3, gripper, {plant}": over_floor(
            world("fr3", *ROBOT_PERIOD, f"plant.kind={plant}"), rounds
        )
        for plant in ("servo", "model")
    }


# What stands between law and plant, and nothing that changes the motion much; nothing at all shows the noise.
WAYS = {
    "nothing": (),
    "delay, lag and noise": ("plant={delay: 0.008, lag: 0.005}", "arm.encoder.noise=1.0e-5"),
    "delay": ("plant.delay=0.008",),
    "delay, no whole ticks": ("plant.delay=0.0085",),
    "lag": ("plant.lag=0.005",),
    "noise": ("arm.encoder.noise=1.0e-5",),
    "encoder offset": ("arm.encoder.offset=0.001",),
    "jitter and loss": ("plant={delay: 0.004, jitter: 0.004, loss: 0.1}",),
    "resonance": ("plant={resonance: {frequency: 30, damping: 0.5}}",),
    "backlash": ("plant.backlash=1.0e-4",),
    "jerk limit": ("control.limits.jerk=5000",),
}
# A short way there and back, so that rounds are short, and how often each is run in a round.
SHORT_WAY = "target.path=[{line: {by: [0.03, 0.03, 0.03]}}, {line: {by: [-0.03, -0.03, -0.03]}}]"
TURNS = 20


def way_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop with something between law and plant over the same with nothing there.

    All take turns, so that a slow moment of the machine is one of all.
    """
    gain = "control.feedback=5"
    direct = world("stanford", gain, SHORT_WAY)
    others = {name: world("stanford", gain, SHORT_WAY, *keys) for name, keys in WAYS.items()}
    pairs: dict[str, list[tuple[float, float]]] = {name: [] for name in others}
    for _ in range(rounds):
        times: dict[str, list[float]] = {name: [] for name in ("", *others)}
        for _ in range(TURNS):
            for name, prepared in {"": direct, **others}.items():
                times[name].append(closed_loop([prepared])[0])
        for name in others:
            pairs[name].append((min(times[name]), min(times[""])))
    return {f"with / without {name}": spread(found) for name, found in pairs.items()}


def method_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop over the floor for each inverse and schedule."""
    rows = {}
    schedules = [name for name in SCHEDULES.names if name != SCHEDULES.default]  # which the other rows have
    for method in INVERSES.options:
        for schedule in schedules if method.is_scheduled else ("",):
            overrides = [f"control.inverse.method={method.name}"]
            overrides += [f"control.inverse.damping.schedule={schedule}"] if schedule else []
            name = f"closed loop / C floor, {method.name} {schedule}".rstrip()
            rows[name] = over_floor(world("stanford", *overrides), rounds)
    return rows


def thread_rows(rounds: int, worlds: int = 128) -> dict[str, dict[str, float]]:
    """Return one thread over two by the clock, after a check that both give the same arrays."""
    prepared = world("stanford")
    one, two = (closed_loop([prepared] * worlds, threads)[1].runs() for threads in (1, 2))
    for a, b in zip(one, two, strict=True):
        for name in COLUMNS:
            np.testing.assert_array_equal(a[name], b[name])
    found = ratios(
        rounds,
        lambda: closed_loop([prepared] * worlds, 1, time.perf_counter)[0],
        lambda: closed_loop([prepared] * worlds, 2, time.perf_counter)[0],
    )
    return {f"1 thread / 2 threads, stanford, {named(worlds)}": found}


def numpy_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the plain numpy loop over the closed loop."""
    prepared = world("stanford")

    def plain() -> float:
        loop = NumpyLoop(prepared)
        started = time.thread_time()
        loop.run()
        return time.thread_time() - started

    found = ratios(min(rounds, 3), plain, lambda: closed_loop([prepared])[0])
    return {"plain numpy loop / closed loop, stanford": found}


ROWS = {
    "arms": arm_rows, "robots": robot_rows, "way": way_rows, "methods": method_rows, "threads": thread_rows,
    "numpy": numpy_rows,
}  # fmt: skip


def main() -> None:
    """Measure and print."""
    arguments = options(__doc__, 7, ROWS).parse_args()
    table: dict[str, dict[str, float]] = {}
    for name, measure in ROWS.items():
        if arguments.only in (None, name):
            table |= measure(arguments.rounds)
    show(table, arguments.json)


if __name__ == "__main__":
    main()
