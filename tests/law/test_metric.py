"""The inertia of the arm as the metric of joint rates: the dynamically consistent inverse [Khatib87].

MuJoCo's own mass matrix is the oracle, mapped to the arm's joints by its equalities; gradients are differences of it.
"""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from chains import random_chain, seeds
from oracle_limits import bounds
from project import ROOT, examples
from rmrc.arm import load
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from wording import says

INERTIA = "control.inverse.metric=inertia"
STILL = "target.path=[{hold: {for: 0.002}}]"
SIX = "task.axes=[x, y, z, rx, ry, rz]"


def inertia(arm, q):
    """Return M (n, n): MuJoCo's, with F of the joints that move with the arm's."""
    model, data = arm.model, mujoco.MjData(arm.model)
    zero, F = arm.configuration(np.zeros(arm.n)), np.zeros((arm.n, arm.model.nv))
    for row, one in zip(F, np.eye(arm.n), strict=True):
        mujoco.mj_differentiatePos(model, row, 1.0, zero, arm.configuration(one))
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_fwdPosition(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return F @ full @ F.T


def task_matrices(prepared, q):
    """Return S_x J of the task's rows, and the scaled inertia, so that σ² are the values of S_x J M⁻¹ Jᵀ S_x."""
    arm, task = prepared.arm, prepared.task
    lengths = np.where(arm.is_slide, task.length, 1.0)
    home = np.diag(inertia(arm, arm.configuration("home")[arm.wiring.qpos]))
    return task.row_scale[:, None] * arm.jacobian(q)[task.rows], inertia(arm, q) / np.mean(lengths**2 * home)


def first_tick(*overrides):
    """Return what is prepared and the first tick's joint positions, rates and singular values."""
    prepared = prepare(loads(f"name: test\narm: {{model: {ROOT}/models/planar_2link.xml}}\ntarget: {{path: [{{hold: {{for: 1}}}}]}}",
                             overrides=("plant.kind=ideal", *overrides)))  # fmt: skip
    (run,) = Simulation([prepared]).run()
    return prepared, run


@given(seeds)
@examples(4, 200)
def test_any_chain_has_the_singular_values_and_rates_that_mujocos_inertia_gives(tmp_path_factory, seed):
    rng, path = np.random.default_rng(seed), tmp_path_factory.mktemp("metric") / "model.xml"
    path.write_text(random_chain(seed, 1 + seed % 7, followers=bool(seed & 8)))
    arm = load(path, "tip")
    start = rng.uniform(-1, 1, arm.n).round(3).tolist()
    axes = [axis for axis in ("x", "y", "z", "rx") if rng.random() < 0.5] or ["y"]
    prepared, run = first_tick(
        f"arm={{model: {path}, site: tip, start: {start}}}", f"task={{axes: [{', '.join(axes)}], length: {rng.uniform(0.3, 3)}}}",
        INERTIA, "control.inverse.damping={schedule: constant, maximum: 0.3}", "control.limits.on_excess=none",
        "target.path=[{line: {by: [0.002, 0.003, -0.001]}}]", "control.feedback=3",
    )  # fmt: skip
    t = len(run) // 2
    q = run["q"][t]
    A, M = task_matrices(prepared, q)
    values = np.sort(np.linalg.eigvalsh(A @ np.linalg.solve(M, A.T)))[::-1]
    sigma = run["sigma"][t]
    # the smallest may be rounding of the largest, of which squares have half the digits
    assert_allclose(sigma**2, values[: len(sigma)], rtol=0, atol=1e-10 * values[0])
    asked = prepared.task.row_scale * (run["twist_ref"][t] + 3 * run["pose_error"][t])[prepared.task.rows]
    normal = A @ np.linalg.solve(M, A.T) + 0.09 * np.eye(len(A))
    want = np.linalg.solve(M, A.T @ np.linalg.solve(normal, asked))
    assert_allclose(run["qdot_cmd"][t], want, rtol=0, atol=1e-9 * max(np.abs(want).max(), 1e-6))


@pytest.mark.parametrize("model", ["xarm7", "chain", "followers"])
def test_the_slope_of_w_is_that_of_the_arm_with_its_inertia(tmp_path, model):
    # 4e-4 to either side: differences of fourth order are off by 1e-13, and by rounding over 4e-4
    path, axes = ROOT / "models/xarm7.xml", SIX
    if model != "xarm7":
        path, axes = tmp_path / "model.xml", "task.axes=[x, rz]"
        path.write_text(random_chain(11 if model == "chain" else 7, 6, followers=model == "followers"))
    arm = load(path, "tool" if model == "xarm7" else "tip")
    start = np.random.default_rng(3).uniform(0.2, 0.8, arm.n).round(2)
    prepared, run = first_tick(
        f"arm={{model: {path}, site: {arm.site}, start: {start.tolist()}}}", axes, "task.length=0.7", STILL, INERTIA,
        "control.nullspace={objective: manipulability, gain: 0.8}", "control.limits.on_excess=none",
    )  # fmt: skip

    def w(q):
        A, M = task_matrices(prepared, q)
        return np.sqrt(np.linalg.det(A @ np.linalg.solve(M, A.T)))

    h, n = 4e-4, arm.n
    assert n > len(prepared.task.rows)
    slope = np.array([
        8 * (w(start + e) - w(start - e)) - (w(start + 2 * e) - w(start - 2 * e)) for e in h * np.eye(n)
    ]) / (12 * h)  # fmt: skip
    A, M = task_matrices(prepared, start)
    N = np.eye(n) - np.linalg.solve(M, A.T) @ np.linalg.solve(A @ np.linalg.solve(M, A.T), A)
    wished = 0.8 * np.linalg.solve(M, slope)
    assert np.abs(N @ wished).max() > 1e-3
    assert_allclose(run["qdot_cmd"][0], N @ wished, rtol=0, atol=1e-7 * np.abs(wished).max())


FOLDED = (
    f"arm={{model: {ROOT}/models/planar_3link.xml, start: [0, -20 deg, 159 deg]}}", "task.axes=[x, y]",
    "target.path=[{line: {by: [-0.4, 0.1]}}]", "control.period=0.004",
)  # fmt: skip


def test_at_a_stop_rates_are_the_best_within_the_bounds_in_the_metric_of_the_arm():
    lam = 0.2
    prepared, run = first_tick(
        *FOLDED, INERTIA, f"control.inverse.damping={{schedule: constant, maximum: {lam}}}", "control.limits.rate=1000",
    )  # fmt: skip
    limited, arm, K = run["status"] & 16 > 0, prepared.arm, prepared.scenario.control.feedback
    assert np.count_nonzero(limited) > 20
    zero, other = np.zeros(arm.n), 0
    for t in np.flatnonzero(limited)[::5]:
        A, M = task_matrices(prepared, run["q"][t])
        asked = (run["twist_ref"][t] + K * run["pose_error"][t])[:2]
        low, up, *_ = bounds(run["q"][t], zero, np.full(3, 1e3), np.full(3, np.inf), np.full(3, 10.0),
                             arm.position_limit, 0.004)  # fmt: skip
        for metric in (M, np.eye(3)):
            root = np.linalg.cholesky(metric).T
            best = lsq_linear(np.vstack([A, lam * root]), np.r_[asked, zero], (low, up + 1e-12), tol=1e-14).x
            same = np.allclose(run["qdot_cmd"][t], best, rtol=0, atol=1e-6)
            assert same or metric is not M
            other += not same
    assert other > 3  # negative control: in the metric of the joints others are the best


def test_what_clamps_joint_by_joint_is_refused():
    with pytest.raises(ScenarioError) as caught:
        first_tick("task.axes=[x, y]", INERTIA, "control.inverse.method=selectively_damped")
    assert says("… control.inverse.metric: … joints … inertia … damped…") == str(caught.value)
