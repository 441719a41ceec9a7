"""What a step of the law costs in a loop of one's own, over a damped least squares by numpy beside it.

    python benchmarks/controller.py [--rounds 30] [--json]

numpy computes `J.T @ solve(J @ J.T + lambda**2 * I, v)` for seven joints and six rows, and nothing else. The
law decomposes, schedules its damping, keeps limits of rate and acceleration, and says what it did. All take
turns, in short pieces of CPU time of this thread; a ratio is that of one round.
"""

import time
from collections.abc import Callable

import mujoco
import numpy as np
from measure import options, show, spread

import rmrc

CALLS = 300  # of each in a round: less than a millisecond or two, which other programs seldom interrupt
LIMITS = {"limits": {"rate": 2.0, "acceleration": 10.0}}


def microseconds(call: Callable[[], object]) -> float:
    """Return the CPU time of a call."""
    begun = time.thread_time_ns()
    for _ in range(CALLS):
        call()
    return (time.thread_time_ns() - begun) / CALLS / 1e3


def contestants() -> dict[str, tuple[Callable[[], object], int]]:
    """Return what is called, and how many worlds it moves."""
    c = rmrc.Controller("fr3", control=LIMITS, period=0.001)
    arm, n = c.arm, c.arm.n
    q = arm.configuration("home")[arm.wiring.qpos] + 0.1
    J, pose = arm.jacobian(q), arm.pose(q)
    pose[0] += 0.01
    rates, v = np.zeros(n), np.array([0.1, 0.0, -0.05, 0.1, 0.0, 0.2])
    damping = 0.1**2 * np.eye(6)
    law, limited = rmrc.Law(n, 6, LIMITS), rmrc.Law(n, 6, LIMITS, position_limit=arm.position_limit)
    batch = rmrc.Law(n, 6, LIMITS)
    batch.reset(worlds=64)
    many, twists = np.tile(J, (64, 1, 1)), np.tile(v, (64, 1))
    by_data, data = rmrc.Controller("fr3", control=LIMITS, period=0.001), mujoco.MjData(arm.model)
    data.qpos[arm.wiring.qpos] = q
    mujoco.mj_fwdPosition(arm.model, data)
    return {
        "numpy": (lambda: J.T @ np.linalg.solve(J @ J.T + damping, v), 1),
        "Law.step(J, v)": (lambda: law.step(J, v), 1),
        "Law.step(J, v, q, qdot)": (lambda: limited.step(J, v, q, rates), 1),
        "Law.step, 64 worlds, each": (lambda: batch.step(many, twists), 64),
        "resolve_rates(J, v)": (lambda: rmrc.resolve_rates(J, v), 1),
        "Controller.step(q, qdot, twist=v), with kinematics": (lambda: c.step(q, rates, twist=v), 1),
        "Controller.step(q, qdot, pose=T, twist=v), with kinematics": (
            lambda: c.step(q, rates, pose=pose, twist=v), 1,
        ),
        "Controller.step_data(data, pose=T, twist=v)": (
            lambda: by_data.step_data(data, pose=pose, twist=v), 1,
        ),
    }  # fmt: skip


def main() -> None:
    """Measure and print."""
    arguments = options(__doc__, 30).parse_args()
    calls = contestants()
    for call, _ in calls.values():
        call()  # compiles, or loads
    took: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(arguments.rounds):
        for name, (call, worlds) in calls.items():
            took[name].append(microseconds(call) / worlds)
    table = {
        name: spread([*zip(values, took["numpy"], strict=True)]) | {"us, least": min(values)}
        for name, values in took.items()
    }
    show(table, arguments.json, "CPU time over that of numpy")


if __name__ == "__main__":
    main()
