"""What keeping out of singularities, and following the kernel of [J | −t] through them, promise of whole runs."""

import numpy as np
import pytest

from rmrc.scenario.choices import Status
from test_policies import BEYOND, COARSE, PLAIN, START, error_norms, has, wrist

KEEP_OUT, KERNEL = "control.at_singularity=keep_out", "control.at_singularity=singularity_consistent"
OUT = (START, *COARSE, BEYOND, "plant.kind=ideal", KEEP_OUT)


ARMS = {
    "2-link": OUT,
    "wrist": wrist("1 deg", KEEP_OUT, "plant.kind=ideal"),
    "xarm7": (
        "arm={model: models/xarm7.xml, site: tool, start: home}", "task.axes=[x, y, z]", "plant.kind=ideal",
        "control.keep_out.sigma=0.15", "target.path=[{line: {by: [0.5, 0, 0]}}, {line: {by: [-0.5, 0, 0]}}]", *COARSE,
        KEEP_OUT,
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("arm", "on_excess"),
    [
        ("2-link", "scale"), ("wrist", "redistribute"),
        ("xarm7", "scale"),
    ],
)  # fmt: skip
def test_the_smallest_singular_value_stays_above_its_floor(simulate, arm, on_excess):
    overrides = *ARMS[arm], f"control.limits.on_excess={on_excess}"
    prepared, run = simulate(*overrides)
    floor, sigma = prepared.scenario.control.keep_out.sigma, run["sigma"][:, -1]
    # between ticks it falls below by T σ̈/(2 α), at the most
    assert sigma[0] > floor and sigma.min() >= 0.99 * floor
    assert sigma.min() < 1.2 * floor and np.any(has(run, Status.KEPT_OUT))
    # negative control: without it, the arm goes where it is not to be
    _, free = simulate(*overrides, "control.at_singularity=damp")
    assert free["sigma"][:, -1].min() < 0.6 * floor


def test_it_comes_back_and_waits_without_being_stuck(simulate):
    _, run = simulate(*OUT, PLAIN)
    assert error_norms(run)[0][-1] < 0.002 and not has(run, Status.KEPT_OUT)[-1]
    assert np.count_nonzero(has(run, Status.KEPT_OUT)) * run.period > 1.0 and not np.any(
        has(run, Status.STUCK)
    )
    # what it loses is the way outwards, 0.1 m, and hardly any of the way across
    assert np.abs(run["pose_error"][:, 0]).max() > 0.1 > 20 * np.abs(run["pose_error"][:, 1]).max()


def test_below_its_floor_an_arm_is_brought_back(simulate):
    hold = "target.path=[{hold: {for: 1.5}}]"
    prepared, run = simulate("arm.start=[2 deg, -4 deg]", *COARSE, hold, "plant.kind=ideal", KEEP_OUT)
    sigma = run["sigma"][:, -1]
    assert sigma[0] < 0.04 and np.all(np.diff(sigma) > -1e-6) and sigma[-1] > 0.09
    assert np.diff(sigma).max() / run.period <= 5.0 * 0.1  # no faster than by α times the floor


# Along the kernel ---------------------------------------------------------------------------------------------


def tangent(prepared, run):
    """Return of each tick how far J qdot_cmd is from the pace times the tangent, in scaled rows."""
    task, off = prepared.task, []
    for t in range(0, len(run), 5):
        J = task.turned(prepared.arm.jacobian(run["q"][t]), run["pose"][t])
        moved = J[task.rows] @ run["qdot_cmd"][t]
        off.append(task.row_scale * (moved - run["twist_ref"][t][task.rows]))  # which has the pace in it
    return np.abs(off).max()


@pytest.mark.parametrize(("offset", "method"), [("1 deg", "inverse"), ("0.1 deg", "damped")])
def test_along_the_kernel_the_tip_is_on_the_tangent_and_rates_are_within_their_limits(
    simulate, offset, method
):
    prepared, run = simulate(
        *wrist(offset, KERNEL, "plant.kind=ideal", "control.feedback=0", "control.limits.on_excess=none"),
        f"control.inverse.method={method}",
    )  # fmt: skip
    # σ_r falls to 1e-3, so that rounding of J is 1e-13 of a rate
    assert tangent(prepared, run) < 1e-12
    assert np.all(np.abs(run["qdot_cmd"]) <= prepared.arm.rate_limit)
    assert run.is_complete and run["path_rate"].min() < 0.3 and np.any(has(run, Status.SLOWED))
    # negative control: the inverse alone is off the tangent, or beyond its limits
    _, free = simulate(
        *wrist(offset, "plant.kind=ideal", "control.feedback=0", "control.limits.on_excess=none"),
        f"control.inverse.method={method}",
    )  # fmt: skip
    assert tangent(prepared, free) > 1e-3 or np.any(np.abs(free["qdot_cmd"]) > 3 * prepared.arm.rate_limit)


def test_beyond_reach_it_waits_goes_on_and_comes_back(simulate):
    _, run = simulate(START, *COARSE, BEYOND, "plant.kind=ideal", KERNEL, "control.slow.patience=0.5")
    waits = run["path_rate"] < 1e-3
    assert np.count_nonzero(waits) * run.period == pytest.approx(0.5, abs=0.15)
    assert error_norms(run)[0][-1] < 0.002 and run.is_complete
