"""What a sweep costs, as ratios measured in one run.

    python benchmarks/sweep.py [--rounds 5] [--json] [--only scorecards|overhead|threads|cluster|plain|memory]

- scorecards: worlds whose columns are not kept, over those whose are, and over the physics alone, in C.
- overhead: a whole sweep on one thread over stepping its runs alone: the rest is reading and checking each
  run, its target, its row, and the files.
- threads: a whole sweep on one thread over the same one on two, and over half as many runs in each of two
  processes, which tells what the cores of the machine give; and the second over the third, which tells what
  threads lose to that. By the clock: only an idle machine shows it.
- cluster: a whole sweep on a local cluster of one worker over the same one on two, with its start.
- plain: what a user would write instead, a Python loop of MuJoCo and numpy on two processes, over a sweep.
- memory: of a process that makes 100,000 short runs; no ratio.

A run lasts 4 s, 4,001 control ticks. The floor is that of `loop.py`. Compiling is left out of all.
"""

import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from loop import ARMS, closed_loop, controls_of, floor, world
from measure import ROOT, Rows, options, ratios, show, spread

from rmrc.results.scorecard import scorecard
from rmrc.scenario import load
from rmrc.simulation.prepare import Prepared, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.study import Study
from rmrc.study.sweep import Sweep

SCENARIO = """
name: benchmark
arm: {{model: {root}/models/{model}.xml, site: {site}}}
task: {{axes: [{axes}]}}
control: {{inverse: {{method: damped, damping: {{schedule: constant, maximum: 0.1}}}}}}
target:
  path: [{{line: {{by: [{by}]}}}}, {{line: {{by: [{back}]}}}}, {{hold: {{for: {hold}}}}}]
  limits: {{velocity: 0.4, acceleration: 2, jerk: 20}}
"""
SECONDS = 4.0
# What is drawn, for each arm: of the first kind runs share their target, of the second each has its own.
DAMPING = "sweep.draw={control.inverse.damping.maximum: [0.05, 0.2]}"
STARTS = {
    "planar_2link": ("arm.start=[0.4, 1.0]", "sweep.draw={'arm.start[0]': [0.3, 0.5]}"),
    "stanford": ("arm.start=[0.1, 1.2, 0.6, 0.1, 0.8, 0.1]", "sweep.draw={'arm.start[0]': [0.0, 0.2]}"),
}


@contextmanager
def scenario_of(arm: str) -> Iterator[Path]:
    """Yield the file of a scenario that lasts SECONDS, in a folder of its own."""
    site, axes, by, back = ARMS[arm]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "benchmark.yaml"
        values = {"root": ROOT, "model": arm, "site": site, "axes": axes, "by": by, "back": back}
        path.write_text(SCENARIO.format(**values, hold=1.0))
        moving = prepare(load(path)).reference.duration - 1.0
        path.write_text(SCENARIO.format(**values, hold=SECONDS - moving))
        yield path


def swept(path: Path, runs: int, *overrides: str, threads: int = 1, cluster: str | None = None) -> float:
    """Return seconds of a sweep, from its scenario to its file; the law is there."""
    with tempfile.TemporaryDirectory() as folder:
        Sweep(path, [*overrides, "sweep.samples=2"], Path(folder)).check()  # compiles
        started = time.perf_counter()
        Sweep(path, [*overrides, f"sweep.samples={runs}"], Path(folder), threads, cluster).run()
        return time.perf_counter() - started


def stepped(path: Path, runs: int, *overrides: str) -> float:
    """Return seconds of stepping the runs of a sweep alone, with their scorecards, on one thread."""
    sweep = Sweep(path, [*overrides, f"sweep.samples={runs}"])
    study = Study(sweep.scenario)
    prepared = [study.prepare(sweep.plan.changes(index)) for index in range(runs)]
    study.compile(prepared[:1])
    return streamed(prepared)


def with_columns(prepared: list[Prepared]) -> float:
    """Return seconds of stepping with all columns, and of the scorecards made of them."""
    simulation = Simulation(prepared)
    started = time.perf_counter()
    for run in simulation.run():
        scorecard(run)
    return time.perf_counter() - started


def streamed(prepared: list[Prepared], threads: int = 1) -> float:
    """Return seconds of stepping without columns, scorecards included."""
    simulation = Simulation(prepared, threads, keep_columns=False)
    started = time.perf_counter()
    simulation.step()
    simulation.scorecards()
    return time.perf_counter() - started


def scorecard_rows(rounds: int, worlds: int = 16) -> Rows:
    """Return worlds without columns over those with, with and without scorecards, and over the floor."""
    prepared = [world("stanford")] * worlds
    (run,) = closed_loop(prepared[:1])[1].runs()
    controls = controls_of(prepared[0], run["qdot_cmd"])
    below = {
        "stepping with columns + scorecard(run)": lambda: with_columns(prepared),
        "stepping with columns, no scorecards": lambda: closed_loop(prepared)[0],
        "C floor": lambda: worlds * floor(prepared[0], controls),
    }
    return {
        f"scorecards without columns / {name}": ratios(rounds, lambda: streamed(prepared), of)
        for name, of in below.items()
    }


def overhead_rows(rounds: int, runs: int = 400) -> Rows:
    """Return whole sweeps over their steps, where runs share a target and where each has its own."""
    rows = {}
    for arm, start in STARTS.items():
        with scenario_of(arm) as path:
            for what, overrides in (("damping drawn", [DAMPING]), ("start drawn", start)):
                pairs = [
                    (swept(path, runs, *overrides), stepped(path, runs, *overrides)) for _ in range(rounds)
                ]
                rows[f"whole sweep / its steps, {arm}, {what}, {runs} runs"] = spread(pairs)
    return rows


def thread_rows(rounds: int, runs: int = 1000) -> Rows:
    """Return one thread over two, of stepping with scorecards and of whole sweeps; and beside two processes.

    The three ways of a whole sweep take turns. Two threads over the slower of two processes, which share
    nothing but the machine, is what threads lose.
    """
    prepared = [world("stanford")] * 128
    rows = {
        "1 thread / 2 threads, stanford, 128 worlds without columns": ratios(
            rounds, lambda: streamed(prepared, 1), lambda: streamed(prepared, 2)
        )
    }
    with scenario_of("stanford") as path, multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.starmap(swept, [(path, 2, DAMPING)] * 2, chunksize=1)  # loads all that is imported
        halves, ways = [(path, runs // 2, DAMPING)] * 2, dict[str, list[float]]()
        for _ in range(rounds):
            for threads in (1, 2):
                ways.setdefault(f"{threads}", []).append(swept(path, runs, DAMPING, threads=threads))
            ways.setdefault("apart", []).append(max(pool.starmap(swept, halves, chunksize=1)))
        one, two, apart = (ways[name] for name in ("1", "2", "apart"))
    return rows | {
        f"1 thread / 2 threads, stanford, {runs} runs": spread([*zip(one, two, strict=True)]),
        "1 thread / 2 processes of half the runs, stanford": spread([*zip(one, apart, strict=True)]),
        "2 threads / 2 processes of half the runs, stanford": spread([*zip(two, apart, strict=True)]),
    }


def cluster_rows(rounds: int, runs: int = 1000) -> Rows:
    """Return one worker over two."""
    with scenario_of("stanford") as path:
        one, two = (lambda n=n: swept(path, runs, DAMPING, cluster=f"local:{n}") for n in (1, 2))
        return {f"Dask: 1 worker / 2 workers, stanford, {runs} runs": ratios(rounds, one, two, least=1)}


def user_loop(path: Path, damping: float) -> list[float]:
    """Return largest rate and position error and smallest σ of one run, by a loop as one writes it."""
    prepared = prepare(load(path))
    control, arm = prepared.scenario.control, prepared.arm
    model = prepared.plant.own_model()
    data, site = mujoco.MjData(model), model.site(arm.site).id
    data.qpos[:] = prepared.qpos
    pose, twist, rows = prepared.reference.pose, prepared.reference.twist, prepared.task.rows
    J, quat, turn = np.zeros((6, model.nv)), np.zeros(4), np.zeros(3)
    gain, limit = control.feedback, arm.rate_limit
    rates, errors = np.zeros((len(pose), model.nv)), np.zeros((len(pose), 6))
    sigmas = np.zeros((len(pose), min(len(rows), model.nv)))
    for k in range(len(pose)):
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
        mujoco.mju_mat2Quat(quat, data.site_xmat[site])
        mujoco.mju_subQuat(turn, pose[k, 3:], quat)
        errors[k, :3] = pose[k, :3] - data.site_xpos[site]
        errors[k, 3:] = data.site_xmat[site].reshape(3, 3) @ turn
        wanted = twist[k] + gain * errors[k]
        U, sigmas[k], Vt = np.linalg.svd(J[rows])
        qdot = Vt.T @ (sigmas[k] / (sigmas[k] ** 2 + damping**2) * (U.T @ wanted[rows]))
        data.ctrl[:] = qdot / max(1.0, np.abs(qdot / limit).max())
        rates[k] = data.qvel
        mujoco.mj_step(model, data)
    return [np.abs(rates).max(), np.linalg.norm(errors[:, :3], axis=1).max(), sigmas.min()]


def plain_rows(rounds: int, runs: int = 16, whole: int = 400) -> Rows:
    """The user's loop over a sweep, both on two cores, a run each; first a look that both do the same."""
    rows = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for arm in STARTS:
            with scenario_of(arm) as path:
                task = [(path, damping) for damping in np.linspace(0.05, 0.2, runs)]
                scenario = load(path, [f"control.inverse.damping.maximum={task[0][1]}"])
                (run,) = Simulation([prepare(scenario)]).run()
                card = scorecard(run)
                ours = [card[name].value for name in ("joint_rate.peak", "position_error.max", "sigma.min")]
                np.testing.assert_allclose(pool.starmap(user_loop, task)[0], ours, rtol=1e-6)
                plain = partial(of_users, pool, task)
                ourselves = partial(swept, path, whole, DAMPING, threads=2)
                found = [plain() / (ourselves() / whole) for _ in range(rounds)]
                rows[f"plain Python loop on 2 processes / sweep on 2 threads, {arm}"] = spread(found)
    return rows


def of_users(pool, task: list[tuple[Path, float]]) -> float:
    """Return seconds of one of several runs by the user's loop."""
    started = time.perf_counter()
    pool.starmap(user_loop, task, chunksize=1)
    return (time.perf_counter() - started) / len(task)


def memory_rows(rounds: int, runs: int = 100_000) -> Rows:  # noqa: ARG001
    """Megabytes of this process at each tenth of a sweep of many short runs, on two threads (Linux)."""
    found: list[float] = []
    with scenario_of("planar_2link") as path, tempfile.TemporaryDirectory() as folder:
        short = "target.path=[{hold: {for: 0.05}}]"
        sweep = Sweep(path, [short, DAMPING, f"sweep.samples={runs}"], Path(folder), 2)
        sweep.check()
        done = 0

        def count(more: int) -> None:
            nonlocal done
            done += more
            if done * 10 // runs > len(found):
                pages = int(Path("/proc/self/statm").read_text().split()[1])
                found.append(pages * os.sysconf("SC_PAGE_SIZE") / 1e6)

        sweep.run(count)
    return {
        f"MB at each tenth of a sweep, planar_2link, {runs} runs of 51 ticks": spread(found),
        "the same, last tenth / first": spread([found[-1] / found[0]]),
    }


ROWS = {
    "scorecards": scorecard_rows,
    "overhead": overhead_rows,
    "threads": thread_rows,
    "cluster": cluster_rows,
    "plain": plain_rows,
    "memory": memory_rows,
}


def main() -> None:
    """Measure and print."""
    arguments = options(__doc__, 5, ROWS).parse_args()
    rows: Rows = {}
    for name, measure in ROWS.items():
        if arguments.only in (None, name):
            rows |= measure(arguments.rounds)
    show(rows, arguments.json)


if __name__ == "__main__":
    main()
