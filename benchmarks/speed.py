"""How fast rmrc is, in ratios: over MuJoCo's C loop, over one's own loop, or over another checkout.

    python benchmarks/speed.py [--only PART ...] [--rounds 5]
    python benchmarks/speed.py --against CHECKOUT

Both sides of a ratio take turns in each round, and the least time of each counts. A row has min, median and
max over the rounds.
"""

import argparse
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from loop import ARMS, CONSTANT, ROOT, closed_loop, controls_of, floor, numpy_loop, scenario
from scipy.optimize import least_squares

import rmrc
from rmrc import arm as arms
from rmrc.analysis.ik import RESTARTS, TOLERANCE, random_starts, solve_ik
from rmrc.analysis.survey import survey
from rmrc.law.task import Task, choose
from rmrc.scenario.choices import INVERSES
from rmrc.support.spatial import pose_error

# A name, and two functions that return seconds.
Row = tuple[str, Callable[[], float], Callable[[], float]]
CORES = os.cpu_count() or 1
# Seconds that both sides of a row have in a round.
TURNS = 0.5
# The figures of the loop in numpy, by the names of metrics.
FIGURES = ("joint_rate.peak", "position_error.max", "sigma.min")
DAMPING = "control.inverse.damping.maximum"


def timed(work: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Return seconds of a call."""
    started = clock()
    work()
    return clock() - started


def ratios(numerator: Callable[[], float], denominator: Callable[[], float], rounds: int) -> list[float]:
    """Return a ratio for each round, after a turn that compiles."""
    numerator(), denominator()
    found = []
    for _ in range(rounds):
        pairs, begun = [(numerator(), denominator())], time.perf_counter()
        while time.perf_counter() - begun < TURNS:
            pairs.append((numerator(), denominator()))
        found.append(min(top for top, _ in pairs) / min(bottom for _, bottom in pairs))
    return found


def over_floor(name: str, prepared: rmrc.Prepared, worlds: int = 1) -> Row:
    """Return the row of the closed loop over MuJoCo's C loop on the same motion."""
    closed, c = partial(closed_loop, [prepared] * worlds), partial(floor, prepared, controls_of(prepared))
    return f"closed loop / MuJoCo's C loop, {name}", lambda: closed() / worlds, c


def loop_rows() -> Iterator[Row]:
    """Each arm, one world and many; an arm with a gripper, on rate servos and on its own drives."""
    for arm in ("planar_2link", "planar_3link", "stanford"):
        yield over_floor(f"{arm}, 1 world", rmrc.prepare(scenario(arm)))
        yield over_floor(f"{arm}, 16 worlds", rmrc.prepare(scenario(arm)), 16)
    for plant in ("servo", "model"):
        keys = ("control.period=0.002", "plant.timestep=0.002", f"plant.kind={plant}")
        yield over_floor(f"fr3, plant {plant}", rmrc.prepare(scenario("fr3", *keys)))


def method_rows() -> Iterator[Row]:
    """Each inverse on six joints."""
    for method in INVERSES.names:
        yield over_floor(
            f"stanford, {method}", rmrc.prepare(scenario("stanford", f"control.inverse.method={method}"))
        )


def numpy_rows() -> Iterator[Row]:
    """An engineer's own loop over ours, which has more columns: one world on one core."""
    for arm in ("planar_2link", "planar_3link", "stanford"):
        prepared = rmrc.prepare(scenario(arm, CONSTANT))
        (run,) = rmrc.Simulation([prepared]).run()
        figures = [run.scorecard[name].value for name in FIGURES]
        np.testing.assert_allclose(numpy_loop(prepared), figures, rtol=1e-6)
        plain = partial(timed, partial(numpy_loop, prepared), time.thread_time)
        yield f"a loop in numpy / closed loop, {arm}", plain, partial(closed_loop, [prepared])


def run_in_numpy(damping: float) -> None:
    """Make one run of a sweep by the loop in numpy."""
    numpy_loop(rmrc.prepare(scenario("stanford", CONSTANT, f"{DAMPING}={damping}")))


def sweep_rows(runs: int = 100) -> Iterator[Row]:
    """Whole sweeps: over their steps, one core over all, and the loop in numpy on all cores over ours."""
    clock = time.perf_counter
    written = scenario("stanford", CONSTANT)
    dampings = np.linspace(0.05, 0.2, runs).tolist()
    prepared = [rmrc.prepare(written.set({DAMPING: damping})) for damping in dampings]
    worlds, threads = 16 * CORES, f"1 thread / {CORES} threads"

    def swept(values: list[float] = dampings, **where: Any) -> float:
        return timed(lambda: rmrc.sweep(written, {DAMPING: values}, **where)) / len(values)

    single, every = partial(swept, threads=1), partial(swept, threads=CORES)
    steps = partial(closed_loop, prepared, clock=clock, columns=False)
    yield f"sweep of {runs} runs / its steps, 1 thread", single, lambda: steps() / runs
    yield f"sweep of {runs} runs, {threads}", single, every
    large = np.linspace(0.05, 0.2, 500 * CORES).tolist()
    processes = partial(swept, large, cluster=f"local:{CORES}")
    yield f"a run of a sweep, 1 thread / of {len(large)} on local:{CORES}", single, processes
    many = partial(closed_loop, prepared[:1] * worlds, clock=clock, columns=False)
    yield f"closed loop, {worlds} worlds, {threads}", many, partial(many, threads=CORES)
    batch = partial(floor, prepared[0], controls_of(prepared[0]), worlds, clock=clock)
    yield f"MuJoCo's C loop, {worlds} worlds, {threads}", batch, partial(batch, threads=CORES)
    with multiprocessing.get_context("spawn").Pool(CORES) as pool:
        few = dampings[: 4 * CORES]

        def in_numpy() -> float:
            return timed(lambda: pool.map(run_in_numpy, few, chunksize=1)) / len(few)

        yield f"a run in numpy / of a sweep, on {CORES} cores", in_numpy, every


def step_rows(calls: int = 300) -> Iterator[Row]:
    """A step in a loop of one's own, over J.T @ solve(J @ J.T + λ² I, v) in numpy: seven joints, six rows."""
    limits = {"limits": {"rate": 2.0, "acceleration": 10.0}}
    controller = rmrc.Controller("fr3", control=limits, period=0.001)
    arm, n = controller.arm, controller.arm.n
    q = arm.configuration("home")[arm.wiring.qpos] + 0.1
    J, pose, still = arm.jacobian(q), arm.pose(q), np.zeros(n)
    pose[0] += 0.01
    v, damping = np.array([0.1, 0.0, -0.05, 0.1, 0.0, 0.2]), 0.1**2 * np.eye(6)
    law = rmrc.Law(n, 6, limits, position_limit=arm.position_limit)
    in_data, data = rmrc.Controller("fr3", control=limits, period=0.001), mujoco.MjData(arm.model)
    data.qpos[arm.wiring.qpos] = q
    mujoco.mj_fwdPosition(arm.model, data)

    def repeated(call: Callable[[], object]) -> Callable[[], float]:
        return partial(timed, lambda: [call() for _ in range(calls)], time.thread_time)

    plain = repeated(lambda: J.T @ np.linalg.solve(J @ J.T + damping, v))
    for name, call in {
        "resolve_rates(J, v)": lambda: rmrc.resolve_rates(J, v),
        "Law.step(J, v, q, qdot)": lambda: law.step(J, v, q, still),
        "Controller.step(q, qdot, twist=v)": lambda: controller.step(q, still, twist=v),
        "Controller.step(q, qdot, pose=T, twist=v)": lambda: controller.step(q, still, pose=pose, twist=v),
        "Controller.step_data(data, pose=T, twist=v)": lambda: in_data.step_data(data, pose=pose, twist=v),
    }.items():
        yield f"{name} / damped least squares in numpy", repeated(call), plain


def newton(task: Task, goal: np.ndarray, start: np.ndarray) -> bool:
    """Say whether damped Newton steps, clipped to the limits, reach a goal: the loop of many a tutorial."""
    q = start.copy()
    for _ in range(50):
        error = pose_error(goal, task.arm.pose(q))
        if np.linalg.norm(error) <= TOLERANCE:
            return True
        J = task.arm.jacobian(q)
        q = np.clip(q + J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error), *task.arm.position_limit.T)
    return False


def bounded_least_squares(task: Task, goal: np.ndarray, start: np.ndarray) -> bool:
    """Say whether scipy's least squares reach a goal within the limits."""
    lower, upper = task.arm.position_limit.T
    found = least_squares(
        lambda q: -pose_error(goal, task.arm.pose(q)), np.clip(start, lower + 1e-6, upper - 1e-6),
        task.arm.jacobian, bounds=(lower, upper), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200,
    )  # fmt: skip
    return bool(np.linalg.norm(found.fun) <= TOLERANCE)


def searched(reaches: Callable[..., object], poses: np.ndarray, starts: list[np.ndarray]) -> float:
    """Return seconds of searches of all poses, each from start to start until one succeeds."""
    return timed(lambda: [any(reaches(pose, start) for start in starts) for pose in poses])


def singular_values(arm: arms.Arm, q: np.ndarray) -> np.ndarray:
    """Return the singular values of J at configurations, one by one, as one would write it."""
    data, J, found = mujoco.MjData(arm.model), np.empty((6, arm.model.nv)), np.empty_like(q)
    for i, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_fwdKinematics(arm.model, data)
        mujoco.mj_jacSite(arm.model, data, J[:3], J[3:], arm.wiring.site)
        found[i] = np.linalg.svd(J, compute_uv=False)
    return found


def kinematics_rows(goals: int = 30, configurations: int = 10_000) -> Iterator[Row]:
    """Inverse kinematics from the same starts, and σ of many configurations, over loops in Python."""
    for name in ("stanford", "puma560"):
        task = choose(arms.load(ROOT / f"models/{name}.xml"), length=1.0)
        start = task.arm.configuration("home")[task.arm.wiring.qpos]
        poses = survey(task, task.arm.sampled(goals, 20261121)).pose  # a seed that no start is drawn from
        starts = [start, *random_starts(task, RESTARTS, True)]

        ours = partial(searched, partial(solve_ik, task), poses, [start])
        for reaches in (newton, bounded_least_squares):
            theirs = partial(searched, partial(reaches, task), poses, starts)
            yield f"{reaches.__name__} / ik, {name}, {goals} poses", theirs, ours
    q = task.arm.sampled(configurations)
    np.testing.assert_allclose(survey(task, q).sigma, singular_values(task.arm, q), atol=1e-12)
    plain = partial(timed, partial(singular_values, task.arm, q))
    batch = partial(timed, partial(survey, task, q, threads=1))
    yield f"{configurations} configurations one by one / survey, puma560, 1 thread", plain, batch


def process_rows() -> Iterator[Row]:
    """Whole processes: a run over importing its libraries, its recording, its pictures, the first run."""
    with tempfile.TemporaryDirectory() as folder:

        def process(*words: str, **environment: str) -> float:
            command, told = [sys.executable, *words], {**os.environ, **environment}
            return timed(
                lambda: subprocess.run(command, check=True, cwd=folder, env=told, capture_output=True)
            )

        verb = partial(process, "-m", "rmrc")
        run = partial(verb, "run", "approach_singularity", "--quiet")
        imports = "import mujoco.batch, numba, pydantic, rerun.blueprint, rich.progress, ruckig, typer, yaml"
        yield "rmrc run / importing its libraries", run, partial(process, "-c", imports)
        yield "rmrc run / without a recording", run, partial(run, "--no-record")
        for name in ("plot", "report"):
            picture = partial(verb, name, "recordings/approach_singularity.npz", "--quiet")
            yield f"rmrc {name} / rmrc run", picture, run

        def first() -> float:
            with tempfile.TemporaryDirectory() as empty:
                return run(NUMBA_CACHE_DIR=empty)

        yield "first run ever, which compiles / rmrc run", first, run


def checkout_rows(other: Path) -> Iterator[Row]:
    """Yield the tick of each arm, here over another checkout."""

    def tick(root: Path, arm: str) -> float:
        environment = os.environ | {"PYTHONPATH": f"{root / 'src'}"}
        done = subprocess.run(
            [sys.executable, Path(__file__).with_name("loop.py")],
            env=environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
        found = json.loads(done.stdout)
        if not Path(found["package"]).is_relative_to(root):
            sys.exit(f"{found['package']} is imported in place of {root}")
        return found["tick"][arm]

    for arm in ARMS:
        yield f"tick here / tick there, {arm}", partial(tick, ROOT, arm), partial(tick, other.resolve(), arm)


PARTS = {
    "loop": loop_rows, "methods": method_rows, "numpy": numpy_rows, "sweep": sweep_rows, "step": step_rows,
    "kinematics": kinematics_rows, "process": process_rows,
}  # fmt: skip


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=[*PARTS], metavar="PART")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="compare the tick with that of this")
    arguments = parser.parse_args()
    if arguments.against:
        parts = [partial(checkout_rows, arguments.against)]
    else:
        parts = [PARTS[name] for name in arguments.only]
    print(f"{'ratio':<76}{'min':>9}{'median':>9}{'max':>9}")
    for part in parts:
        for name, numerator, denominator in part():
            found = ratios(numerator, denominator, arguments.rounds)
            figures = (min(found), statistics.median(found), max(found))
            print(f"{name:<76}" + "".join(f"{value:>9.3g}" for value in figures), flush=True)


if __name__ == "__main__":
    main()
