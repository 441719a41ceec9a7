"""How much the closed loop costs over the physics alone, as ratios measured in one run.

    python benchmarks/loop.py [--rounds 7] [--json] [--only arms|blocks|robots|way|methods|threads|numpy]

The floor is MuJoCo's own C loop: the same batch, from the same state, fed with the very controls that the
closed loop sent, so that both step the same motion. The closed loop adds the law (decomposition, scheduled
damping, null space, rate limits) and every column of every tick. Machines
are noisy: what is compared takes turns, time is that of the thread and not of the clock, and each ratio is
given as min, median and max over the rounds, beside that of the least times of all rounds. The memory of the
columns is used once before the clock starts, as the system takes a varying time to give it. The least such
time has a row of its own.
"""

import itertools
import json
import mmap
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial

import numpy as np
from measure import ROOT, options, ratios, show, spread
from mujoco.batch import Batch

sys.path.insert(0, str(ROOT / "tests"))  # the plain numpy loop is the tests' oracle

from oracles import NumpyLoop
from rmrc.law.jit import Record, entry
from rmrc.law.kinematics import chain_jacobian, follow_chain
from rmrc.law.law import take_error
from rmrc.law.record import tick_type
from rmrc.plants import native
from rmrc.plants.around import BEFORE
from rmrc.plants.chance import normals
from rmrc.plants.encoders import AHEAD
from rmrc.results.columns import COLUMNS
from rmrc.scenario import loads
from rmrc.scenario.choices import INVERSES, SCHEDULES
from rmrc.simulation.prepare import Prepared, prepare, world_records
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


def world(arm: str, *overrides: str) -> Prepared:
    """Return the benchmark's scenario for an arm: there and back, always moving."""
    site, axes, by, back = ARMS.get(arm, ROBOT)
    text = SCENARIO.format(root=ROOT, model=arm, site=site, axes=axes, by=by, back=back)
    return prepare(loads(text, overrides=overrides))


def closed_loop(prepared: list[Prepared], threads: int = 1) -> tuple[float, Simulation]:
    """Return seconds of stepping, without wiring and the first use of memory, and the simulation."""
    simulation = Simulation(prepared, threads)
    touch(simulation)
    clock = time.thread_time if threads == 1 else time.perf_counter
    started = clock()
    simulation.step()
    return clock() - started, simulation


def controls_of(prepared: Prepared, rates: np.ndarray) -> np.ndarray:
    """Return what all actuators were told, (worlds, ticks, nu), from the rates sent, (worlds, ticks, n).

    Actuators that are not the arm's come first. On the plant `model` all drives are position servos.
    """
    held = np.array(np.broadcast_to(prepared.held[0], (*rates.shape[:2], len(prepared.held[0]))))
    if prepared.scenario.plant.kind != "model":
        return np.concatenate([held, rates], axis=-1)
    held[..., list(prepared.arm.drives.kinds)] += prepared.scenario.control.period * np.cumsum(rates, axis=1)
    return held


def floor(prepared: Prepared, controls: np.ndarray) -> float:
    """Return seconds of stepping the same motions open loop, in C; controls are (worlds, ticks, nu)."""
    batch = _at_start(prepared, len(controls))
    started = time.thread_time()
    batch.rollout(controls.shape[1], controls, record=())
    return time.thread_time() - started


def _at_start(prepared: Prepared, worlds: int) -> Batch:
    batch = Batch(prepared.plant.model([prepared.plant]), worlds, 1, persistent=True)
    batch.bind("qpos")[:] = prepared.qpos
    batch.forward()
    return batch


def over_floor(prepared: list[Prepared], rounds: int) -> dict[str, float]:
    """Closed loop over floor, of worlds on one arm with paths of one length."""
    controls = controls_of(
        prepared[0], np.array([run["qdot_cmd"] for run in closed_loop(prepared)[1].runs()])
    )
    found = ratios(rounds, lambda: closed_loop(prepared)[0], lambda: floor(prepared[0], controls))
    found["floor_us"] = min(floor(prepared[0], controls) for _ in range(5)) / controls[..., 0].size * 1e6
    return found


def arm_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop of each arm over the floor, alone and with others."""
    return {
        f"closed loop / C floor, {arm}, {worlds} world{'s' * (worlds > 1)}": over_floor(
            [world(arm)] * worlds, rounds
        )
        for arm in ARMS
        for worlds in (1, 64)
    }


# Of a planar arm and of another: some 700 ticks, so that many of all ways take turns.
SHORT = "target.path=[{line: {by: [0.05, 0.05, %s]}}]"


# Pieces of a run that take turns, so that a slow moment of the machine is one of all; and how often a run of
# some worlds is repeated in a round.
PIECES = 4
REPEATED = {1: 12, 64: 2}


def block_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return blocks of ticks and single ticks over the floor, piece by piece in turn."""
    rows: dict[str, dict[str, float]] = {}
    for arm, worlds in itertools.product(ARMS, (1, 64)):
        prepared = [world(arm, SHORT % (0.05 if arm == "stanford" else 0))] * worlds
        runs = closed_loop(prepared)[1].runs()
        controls = controls_of(prepared[0], np.array([run["qdot_cmd"] for run in runs]))
        # (rounds, repetitions, ways, pieces)
        times = np.array(
            [[_in_turn(prepared, controls) for _ in range(REPEATED[worlds])] for _ in range(rounds)]
        )
        least, of_all = times.sum(axis=3).min(axis=1), times.min(axis=(0, 1)).sum(axis=1)
        named = f"{arm}, {worlds} world{'s' * (worlds > 1)}"
        for name, one, other in (
            ("single ticks / C floor", 2, 0), ("blocks / C floor", 3, 0),
            ("blocks / C floor without its timers", 3, 1),
        ):  # fmt: skip
            row = rows[f"{name}, {named}"] = spread([(a[one], a[other]) for a in least])
            row["minima"] = of_all[one] / of_all[other]
            row["floor_us"] = of_all[other] / controls[..., 0].size * 1e6
    return rows


def _in_turn(prepared: list[Prepared], controls: np.ndarray) -> list[list[float]]:
    """Return seconds of each piece of the floor, the same without timers, single ticks, and blocks."""
    ends = np.linspace(0, controls.shape[1], PIECES + 1).astype(int)
    batches, steppers = [_at_start(prepared[0], len(prepared)) for _ in range(2)], []
    for serves in (lambda _: False, native.serves):
        with _served(serves):
            simulation = Simulation(prepared)
        steppers.append(simulation._shards[0].batch)
        touch(simulation)
    times: list[list[float]] = [[], [], [], []]
    for first, last in itertools.pairwise(ends):
        part = controls[:, first:last].copy()
        for way, (batch, clock) in enumerate(zip(batches, (nullcontext, native.untimed), strict=True)):
            with clock():
                started = time.thread_time()
                batch.rollout(last - first, part, record=())
                times[way].append(time.thread_time() - started)
        for way, stepper in enumerate(steppers, 2):
            started = time.thread_time()
            while stepper.done < last and stepper.advance(last - stepper.done):
                pass
            times[way].append(time.thread_time() - started)
    return times


def touch(simulation: Simulation) -> None:
    """Write once to every page of the columns, so that the system has given them."""
    for shard in simulation._shards:
        shard.batch.ticks.reshape(-1).view(np.uint8)[::4096] = 0


def first_use(size: int) -> float:
    """Return the seconds that the system takes to give memory of a size [B] in the way of numpy."""
    memory = mmap.mmap(-1, size)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        memory.madvise(mmap.MADV_HUGEPAGE)
    pages, started = np.frombuffer(memory, np.uint8)[::4096], time.thread_time()
    pages[:] = 0
    return time.thread_time() - started


@contextmanager
def _served(serves: Callable[[object], bool]) -> Iterator[None]:
    """Have blocks, or not: without them each tick is a call of its own, as for arms that may touch."""
    before, native.serves = native.serves, serves
    try:
        yield
    finally:
        native.serves = before


def robot_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop of an arm with a gripper over the floor, on servos of ours and on its own."""
    return {
        f"closed loop / C floor, fr3, gripper, {plant}, {worlds} world{'s' * (worlds > 1)}": over_floor(
            [world("fr3", *ROBOT_PERIOD, f"plant.kind={plant}")] * worlds, rounds
        )
        for plant in ("servo", "model")
        for worlds in (1, 64)
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
# A short way there and back, so that rounds are short, and how often each is run in a round, by worlds.
SHORT_WAY = "target.path=[{line: {by: [0.03, 0.03, 0.03]}}, {line: {by: [-0.03, -0.03, -0.03]}}]"
TURNS = {1: 20, 16: 6}


def way_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Return the closed loop with something between law and plant over the same with nothing there.

    All take turns, so that a slow moment of the machine is one of all.
    """
    gain, rows = "control.feedback=5", {}
    direct = world("stanford", gain, SHORT_WAY)
    others = {name: world("stanford", gain, SHORT_WAY, *keys) for name, keys in WAYS.items()}
    for worlds, turns in TURNS.items():
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in others}
        for _ in range(rounds):
            times: dict[str, list[float]] = {name: [] for name in ("", *others)}
            for _ in range(turns):
                for name, one in {"": direct, **others}.items():
                    times[name].append(closed_loop([one] * worlds)[0])
            for name in others:
                found[name].append((min(times[name]), min(times[""])))
        for name, pairs in found.items():
            rows[f"with / without {name}, {worlds} world{'s' * (worlds > 1)}"] = spread(pairs)
    return rows


def way_parts(calls: int = 100_000, times: int = 10) -> dict[str, float]:
    """Microseconds of what encoders with noise add to a tick, each on its own, hot in the caches."""
    prepared = world("stanford")
    record, tick = world_records([prepared], [0]), np.zeros(1, tick_type(prepared.arm.n))
    record["pose"][0], tick["pose_ref"][0] = prepared.reference.pose[[0, -1]]
    found = {}
    for name, parts in {
        "random numbers of six joints": noise_many, "kinematics by the chain": chain_many,
        "the true error": error_many,
    }.items():  # fmt: skip
        parts(record, tick, 1)  # compiles, or loads
        least = float("inf")
        for _ in range(times):
            started = time.thread_time()
            parts(record, tick, calls)
            least = min(least, time.thread_time() - started)
        found[name] = least / calls * 1e6
    return found


def method_rows(rounds: int) -> dict[str, dict[str, float]]:
    """Closed loop over floor for each inverse and schedule, and for worlds of all of them in one batch."""
    rows, every = {}, []
    schedules = [name for name in SCHEDULES.names if name != SCHEDULES.default]  # which the other rows have
    for method in INVERSES.options:
        for schedule in schedules if method.is_scheduled else ("",):
            overrides = [f"control.inverse.method={method.name}"]
            overrides += [f"control.inverse.damping.schedule={schedule}"] if schedule else []
            one = world("stanford", *overrides)
            every.append(one)
            rows[f"closed loop / C floor, 64 worlds, {method.name} {schedule}".rstrip()] = over_floor(
                [one] * 64, rounds
            )
    mixed = (every * 64)[:64]
    rows["closed loop / C floor, 64 worlds, all of these in one batch"] = over_floor(mixed, rounds)
    return rows


def thread_rows(rounds: int, worlds: int = 128) -> dict[str, dict[str, float]]:
    """One thread over two, after a check that both give the same bits."""
    prepared = world("stanford")
    one, two = (closed_loop([prepared] * worlds, threads)[1].runs() for threads in (1, 2))
    for a, b in zip(one, two, strict=True):
        for name in COLUMNS:
            np.testing.assert_array_equal(a[name], b[name])
    found = ratios(
        rounds,
        lambda: closed_loop([prepared] * worlds, 1)[0],
        lambda: closed_loop([prepared] * worlds, 2)[0],
    )
    return {f"1 thread / 2 threads, stanford, {worlds} worlds": found}


def numpy_rows(rounds: int) -> dict[str, dict[str, float]]:
    """The plain numpy loop, world by world, over the closed loop."""
    prepared = world("stanford")

    def plain(worlds: int) -> float:
        loop = NumpyLoop(prepared)
        started = time.thread_time()
        loop.run()
        return (time.thread_time() - started) * worlds

    return {
        f"plain numpy loop / closed loop, stanford, {worlds} world{'s' * (worlds > 1)}": ratios(
            min(rounds, 3), partial(plain, worlds), lambda of=[prepared] * worlds: closed_loop(of)[0]
        )
        for worlds in (1, 64)
    }


def pieces(arm: str, times: int = 20) -> dict[str, float]:
    """Microseconds of each part of one control tick of one world: where the ratio comes from.

    Parts take turns, and of each the least time counts. Alone they differ from what they take in the loop.
    """
    prepared = world(arm)
    simulation = closed_loop([prepared])[1]
    (run,) = simulation.runs()
    controls, count = run["qdot_cmd"][None].copy(), len(run) - 1

    def untimed() -> float:
        with native.untimed():
            return floor(prepared, controls)

    least = np.full(5, np.inf)
    for _ in range(times):
        now = (
            floor(prepared, controls), untimed(), ticks_alone(prepared, count, False),
            ticks_alone(prepared, count, True), closed_loop([prepared])[0],
        )  # fmt: skip
        least = np.minimum(least, np.array(now) / count * 1e6)
    physics, bare, ticks, kept, loop = least.tolist()
    columns = 64 * simulation._shards[0].batch.ticks.nbytes
    return {
        "physics in C (the floor)": physics,
        "without MuJoCo's timers": bare - physics,
        "ticks of an arm that stands still": ticks,
        "that their columns leave the caches": kept - ticks,
        "that it moves, and law and physics in turn": loop - bare - kept,
        "closed loop": loop,
        "memory of the columns of 64 worlds, when first used":
            min(first_use(columns) for _ in range(5)) / (64 * count) * 1e6,
    }  # fmt: skip


def ticks_alone(prepared: Prepared, count: int, keeps: bool) -> float:
    """Seconds of ticks with nothing of MuJoCo's between them, in rows for all of them or in a few."""
    simulation = Simulation([prepared], keep_columns=keeps)
    blocks = simulation._shards[0].batch._blocks
    touch(simulation)
    blocks._fill({BEFORE: native.function_at("mju_isBad")})  # does nothing
    started = time.thread_time()
    blocks.run(np.array([0]), 0, count, steps=False)
    return time.thread_time() - started


@entry
def noise_many(records: Record, outs: Record, calls: int) -> None:  # noqa: ARG001 - as all
    """Draw the noise of six joints again and again."""
    for first in range(0, calls, AHEAD):
        normals(1, 2, first, records[0].n, records[0].drawn, records[0].noise)


@entry
def chain_many(records: Record, outs: Record, calls: int) -> None:  # noqa: ARG001 - as all
    """Follow a chain that moves, again and again."""
    for _ in range(calls):
        records[0].q[0] += 1e-9
        follow_chain(records[0], records[0].q)
        chain_jacobian(records[0])


@entry
def error_many(records: Record, outs: Record, calls: int) -> None:
    """Take the error of a pose that moves, again and again."""
    for _ in range(calls):
        records[0].pose[0] += 1e-9
        take_error(records[0], outs[0].pose_ref, records[0].pose, outs[0].pose_error)


ROWS = {
    "arms": arm_rows, "blocks": block_rows, "robots": robot_rows, "way": way_rows, "methods": method_rows,
    "threads": thread_rows, "numpy": numpy_rows,
}  # fmt: skip


def main() -> None:
    """Measure and print."""
    arguments = options(__doc__, 7, ROWS).parse_args()
    table: dict[str, dict[str, float]] = {}
    for name, measure in ROWS.items():
        if arguments.only in (None, name):
            table |= measure(arguments.rounds)
    parts = {"stanford": way_parts()} if arguments.only in (None, "way") else {}
    if arguments.only in (None, "arms", "blocks"):
        parts |= {arm: pieces(arm) | parts.get(arm, {}) for arm in ARMS}
    if arguments.json:
        print(json.dumps(table | {"us a tick": parts}, indent=2))
        return
    show(table, False)
    for arm, found in parts.items():
        print(f"\n{f'us a tick of one world, {arm}':<58}{'':>12}")
        for piece, microseconds in found.items():
            print(f"{piece:<58}{microseconds:>12.2f}")


if __name__ == "__main__":
    main()
