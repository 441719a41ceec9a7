"""The closed loop, and the loops that it is compared with: MuJoCo's own in C, and an engineer's in numpy.

As a program it prints seconds of a tick of each arm as JSON. `speed.py --against` compares checkouts by it.
"""

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch

import rmrc

ROOT = Path(__file__).parent.parent
SCENARIO = """
name: benchmark
arm: {{model: {root}/models/{model}.xml, site: {site}}}
task: {{axes: [{axes}], length: 1}}
control:
  inverse: {{method: damped, damping: {{schedule: smallest_singular_value, maximum: 0.1, below: 0.6}}}}
  nullspace: {{objective: posture}}
target:
  path: [{{line: {{by: [{by}]}}}}, {{line: {{by: [{back}]}}}}]
"""
# Site, task, way there and way back.
ARMS = {
    "planar_2link": ("tip", "x, y", "0.3, 0.3, 0", "-0.3, -0.3, 0"),
    "planar_3link": ("tip", "x, y", "0.3, 0.3, 0", "-0.3, -0.3, 0"),
    "stanford": ("wrist", "x, y, z, rx, ry, rz", "0.2, 0.2, 0.2", "-0.2, -0.2, -0.2"),
    "fr3": ("tool", "x, y, z, rx, ry, rz", "0.1, 0.1, 0.1", "-0.1, -0.1, -0.1"),
}
# The law of the loop in numpy.
CONSTANT = "control={inverse: {method: damped, damping: {schedule: constant, maximum: 0.1}}}"
Clock = Callable[[], float]


def scenario(arm: str, *overrides: str) -> rmrc.Scenario:
    """Return the benchmark's scenario of an arm: there and back, always moving."""
    site, axes, by, back = ARMS[arm]
    text = SCENARIO.format(root=ROOT, model=arm, site=site, axes=axes, by=by, back=back)
    return rmrc.loads(text, overrides=overrides)


def closed_loop(
    prepared: Sequence[rmrc.Prepared], threads: int = 1, clock: Clock = time.thread_time, columns: bool = True
) -> float:
    """Return seconds of all ticks of all worlds, with every column, or with scorecards instead."""
    simulation = rmrc.Simulation(prepared, threads, keep_columns=columns)
    started = clock()
    simulation.step()
    return clock() - started


def controls_of(prepared: rmrc.Prepared) -> np.ndarray:
    """Return the inputs of all actuators in a run, (ticks, nu); those that are not the arm's come first."""
    (run,) = rmrc.Simulation([prepared]).run()
    held = np.tile(prepared.held[0], (len(run), 1))
    if prepared.scenario.plant.kind != "model":
        return np.concatenate([held, run["qdot_cmd"]], axis=-1)
    # the arm's own drives are position servos
    held[:, list(prepared.arm.drives.kinds)] += prepared.scenario.control.period * np.cumsum(
        run["qdot_cmd"], axis=0
    )
    return held


def floor(
    prepared: rmrc.Prepared,
    controls: np.ndarray,
    worlds: int = 1,
    threads: int = 1,
    clock: Clock = time.thread_time,
) -> float:
    """Return seconds of stepping the same motion open loop in C, with recorded controls."""
    batch = Batch(prepared.plant.own_model(), worlds, threads, persistent=True)
    batch.bind("qpos")[:] = prepared.qpos
    batch.forward()
    inputs = np.tile(controls, (worlds, 1, 1))
    started = clock()
    batch.rollout(len(controls), inputs, record=())
    return clock() - started


def numpy_loop(prepared: rmrc.Prepared) -> list[float]:
    """Return the largest rate, largest position error and smallest σ of a run by an engineer's own loop.

    It has feedback, constant damping and rate limits, and records three columns. Its law is CONSTANT.
    """
    control, arm, rows = prepared.scenario.control, prepared.arm, prepared.task.rows
    pose, twist, limit = prepared.reference.pose, prepared.reference.twist, arm.rate_limit
    damping = control.inverse.damping.maximum
    model = prepared.plant.own_model()
    data, site = mujoco.MjData(model), model.site(arm.site).id
    data.qpos[:] = prepared.qpos
    J, quat, turn = np.zeros((6, model.nv)), np.zeros(4), np.zeros(3)
    rates, errors, sigma = (np.zeros((len(pose), n)) for n in (model.nv, 6, min(len(rows), model.nv)))
    for k in range(len(pose)):
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
        mujoco.mju_mat2Quat(quat, data.site_xmat[site])
        mujoco.mju_subQuat(turn, pose[k, 3:], quat)
        errors[k, :3] = pose[k, :3] - data.site_xpos[site]
        errors[k, 3:] = data.site_xmat[site].reshape(3, 3) @ turn
        wanted = twist[k] + control.feedback * errors[k]
        U, sigma[k], Vt = np.linalg.svd(J[rows], full_matrices=False)
        qdot = Vt.T @ (sigma[k] / (sigma[k] ** 2 + damping**2) * (U.T @ wanted[rows]))
        data.ctrl[:] = qdot / max(1.0, np.abs(qdot / limit).max())
        rates[k] = data.qvel
        mujoco.mj_step(model, data)
    return [np.abs(rates).max(), np.linalg.norm(errors[:, :3], axis=1).max(), sigma.min()]


def main() -> None:
    """Print seconds of a tick of each arm, the least of some runs."""
    found = {}
    for arm in ARMS:
        prepared = rmrc.prepare(scenario(arm))
        runs = [closed_loop([prepared]) for _ in range(20)]
        found[arm] = min(runs) / prepared.reference.ticks
    print(json.dumps({"package": rmrc.__file__, "tick": found}))


if __name__ == "__main__":
    main()
