"""How often, and how fast, inverse kinematics reach poses that can be reached.

    python benchmarks/inverse_kinematics.py [--goals 10000] [--peer-goals 100] [--rounds 5] [--json]

The goals are the poses of random joint positions within the limits, from a seed that no start of the search
is drawn from. Every search begins at `home`, then at random starts within the limits; a success is an error
of at most 1e-9 (m and rad), by MuJoCo's own forward kinematics.

1. Success, steps, starts and time of a goal.
2. On some of the same goals, what a user would write: a loop of damped Newton steps in numpy on mj_jacSite,
   and scipy's least_squares with bounds, both with the same starts, one after the other until one succeeds.
   The ratios are their time over ours, of the same goals on one core in one process, in turn.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from rmrc import arm as arms
from rmrc.analysis.ik.ik import RESTARTS, TOLERANCE, solve_ik
from rmrc.analysis.ik.postures import random_starts
from rmrc.analysis.survey import survey
from rmrc.law.task import Array, Task, choose
from rmrc.support.spatial import pose_error

ROOT = Path(__file__).parent.parent
ARMS = ("stanford", "puma560")
GOAL_SEED = 20261121  # no seed of the search


def size(task: Task, goal: Array, q: Array) -> float:
    return float(np.linalg.norm(pose_error(goal, task.arm.pose(q))))


def newton_loop(task: Task, goal: Array, start: Array) -> Array | None:
    """Damped Newton steps with a constant damping, clipped to the limits: the loop of many a tutorial."""
    lower, upper = task.arm.position_limit.T
    q = start.copy()
    for _ in range(50):
        error = pose_error(goal, task.arm.pose(q))
        if np.linalg.norm(error) <= TOLERANCE:
            return q
        J = task.arm.jacobian(q)
        step = J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error)
        q = np.clip(q + step, lower, upper)
    return None


def scipy_bounded(task: Task, goal: Array, start: Array) -> Array | None:
    """Trust-region reflective least squares with MuJoCo's Jacobian, within the limits."""
    lower, upper = task.arm.position_limit.T
    begin = np.clip(start, lower + 1e-6, upper - 1e-6)
    found = least_squares(
        lambda q: -pose_error(goal, task.arm.pose(q)), begin, task.arm.jacobian,
        bounds=(lower, upper), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200,
    )  # fmt: skip
    return found.x if size(task, goal, found.x) <= TOLERANCE else None


def home(task: Task) -> Array:
    return task.arm.configuration("home")[task.arm.wiring.qpos]


def with_restarts(task: Task, goal: Array, method: Callable[[Task, Array, Array], Array | None]) -> bool:
    starts = [home(task), *random_starts(task, RESTARTS, True)]
    return any(method(task, goal, start) is not None for start in starts)


def seconds(act: Callable[[], object]) -> float:
    started = time.perf_counter()
    act()
    return time.perf_counter() - started


def quartiles(values: list[float] | Array) -> list[float]:
    """Return min, quartiles and max."""
    return [float(value) for value in np.percentile(values, [0, 25, 50, 75, 100])]


def measure(name: str, goals: int, peer_goals: int, rounds: int) -> dict[str, object]:
    """All figures of one arm."""
    task = choose(arms.load(ROOT / f"models/{name}.xml"))
    start = home(task)
    poses = survey(task, task.arm.sampled(goals, GOAL_SEED)).pose
    solve_ik(task, poses[0], start)  # compiles, or loads
    found = [solve_ik(task, goal, start) for goal in poses]
    proven = [it.found and size(task, goal, it.q) <= TOLERANCE for goal, it in zip(poses, found, strict=True)]
    lower, upper = task.arm.position_limit.T
    within = all((it.q >= lower).all() and (it.q <= upper).all() for it in found)
    each = [seconds(partial(solve_ik, task, goal, start)) for goal in poses]
    some = poses[:peer_goals]
    peers = {"numpy loop": newton_loop, "scipy least_squares": scipy_bounded}
    ratios: dict[str, list[float]] = {peer: [] for peer in peers}
    succeeded: dict[str, float] = {}
    for _ in range(rounds):
        for peer, method in peers.items():
            ours = seconds(lambda: [solve_ik(task, goal, start) for goal in some])
            begun = time.perf_counter()
            ended = [with_restarts(task, goal, method) for goal in some]
            theirs = time.perf_counter() - begun
            ratios[peer].append(theirs / ours)
            succeeded[peer] = statistics.mean(ended)
    return {
        "success, %": 100.0 * statistics.mean(proven),
        "within limits": bool(within),
        "at the first start, %": 100.0 * statistics.mean(it.found and it.tries == 1 for it in found),
        "steps a goal": quartiles([it.steps for it in found]),
        "starts a goal": quartiles([it.tries for it in found]),
        "a goal, us": quartiles(np.array(each) * 1e6),
        **{f"{peer} / ours": quartiles(values) for peer, values in ratios.items()},
        **{f"{peer}: success, %": 100.0 * value for peer, value in succeeded.items()},
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=10_000)
    parser.add_argument("--peer-goals", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    table = {name: measure(name, arguments.goals, arguments.peer_goals, arguments.rounds) for name in ARMS}
    if arguments.json:
        print(json.dumps(table, indent=2))
        return
    heads = "".join(f"{head:>10}" for head in ("min", "25 %", "median", "75 %", "max"))
    for name, rows in table.items():
        print(f"{f'{name}, {arguments.goals} goals':<34}{heads}")
        for row, value in rows.items():
            cells = value if isinstance(value, list) else ["", "", value, "", ""]
            texts = (f"{cell:>10.4g}" if isinstance(cell, float) else f"{cell!s:>10}" for cell in cells)
            print(f"{row:<34}{''.join(texts)}")
        print()


if __name__ == "__main__":
    main()
