"""What policies promise of whole runs through and beyond singularities."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from rmrc.scenario.choices import Status

PLAIN = "control.inverse.method=inverse"
SLOW, STOP = "control.at_singularity=slow", "control.at_singularity=stop"


def error_norms(run):
    """Return the norms of position and orientation error, (T,) each."""
    return np.linalg.norm(run["pose_error"][:, :3], axis=1), np.linalg.norm(run["pose_error"][:, 3:], axis=1)


def has(run, status):
    """Return at which ticks a status bit is set."""
    return run["status"] & status > 0


# Slow ---------------------------------------------------------------------------------------------------------

OFFSETS = {
    "1 deg": "-88.4438 deg",
    "0.1 deg": "-89.8444 deg",
}  # of theta_4, for a hand so far beside theta_5 = 0


def wrist(offset, *more):
    """Return the overrides of a Stanford hand that sweeps past its boom and back."""
    return (
        "arm.model=models/stanford.xml", "arm.site=wrist", "task.axes=[x, y, z, rx, ry, rz]", PLAIN,
        f"arm.start=[0, 90 deg, 0.7, {OFFSETS[offset]}, 40 deg, 90 deg]",
        "target.path=[{turn: {axis: z, angle: 80 deg}}, {hold: {for: 0.5}}, {turn: {axis: z, angle: -80 deg}}]",
        "target.limits={angular_velocity: 0.5, angular_acceleration: 2.0, angular_jerk: 20.0}", *more,
    )  # fmt: skip


def off_the_path(prepared, run, every=20):
    """Return how far poses are from the nearest of the path [m], [rad]; neighbors of it are 0.5 mrad apart."""
    path, pose = prepared.reference.pose, run["pose"][::every]
    nearest = np.abs(pose[:, 3:] @ path[:, 3:].T).argmax(axis=1)
    same = np.abs(np.sum(pose[:, 3:] * path[nearest, 3:], axis=1)).clip(max=1.0)
    return (
        np.linalg.norm(pose[:, :3] - path[nearest, :3], axis=1).max(),
        2.0 * np.sqrt(2.0 * (1.0 - same)).max(),
    )


@pytest.mark.parametrize(("offset", "plant"), [("1 deg", "ideal"), ("0.1 deg", "servo")])
def test_slow_passes_a_wrist_singularity_on_its_path_and_within_its_rates(simulate, offset, plant):
    # No limit helps it: the pace alone keeps the rates.
    prepared, run = simulate(*wrist(offset, SLOW, f"plant.kind={plant}", "control.limits.on_excess=none"))
    assert np.all(np.abs(run["qdot_cmd"]) <= prepared.arm.rate_limit)
    position, orientation = error_norms(run)
    assert position.max() < 0.2e-3 and orientation.max() < 0.5e-3
    # Half a step between neighbors is 0.25 mrad; 0.5 mrad more is what the error may be.
    off = off_the_path(prepared, run)
    assert off[0] < 0.2e-3 and off[1] < 0.75e-3
    assert run.completed == 1.0 and run.is_complete
    assert run["path_rate"].min() < 0.2 and np.any(has(run, Status.SLOWED))
    assert_array_equal(has(run, Status.SLOWED), run["path_rate"] < 1.0)
    # theta_5 = 0 was passed: theta_4 made its half turn
    assert np.ptp(run["q"][:, 3]) > np.radians(150)


@pytest.mark.parametrize(
    "overrides",
    [(), ("arm.model=models/planar_3link.xml", "arm.start=home", "control.nullspace={objective: manipulability, gain: 1}",
          "target.path=[{line: {by: [-0.1, 0.1]}}]")],
    ids=["2-link", "3-link"],
)  # fmt: skip
@pytest.mark.parametrize(
    "policy", [(SLOW,), ("control.at_singularity=keep_out", "control.keep_out.approach=50")]
)
def test_far_from_a_singularity_a_policy_changes_no_bit(simulate, overrides, policy):
    _, damp = simulate(*overrides)
    _, run = simulate(*overrides, *policy)
    assert np.all(run["path_rate"] == 1.0)
    for name, column in damp.columns.items():
        assert_array_equal(run[name], column, err_msg=name)


# Out of reach -------------------------------------------------------------------------------------------------

START = "arm.start=[41.409622 deg, -82.819244 deg]"  # at r = 1.5 m
COARSE = (
    "control.period=0.002",
    "control.feedback=5",
    "target.limits={velocity: 0.2, acceleration: 1.0, jerk: 10.0}",
)
BEYOND = "target.path=[{line: {to: [2.1, 0]}}, {line: {to: [1.5, 0]}}, {hold: {for: 1.0}}]"
OUT = (START, *COARSE, BEYOND, "plant.kind=ideal")


@pytest.mark.parametrize("patience", [0.2, 1.0])
def test_slow_waits_beyond_reach_goes_on_and_comes_back(simulate, patience):
    _, run = simulate(*OUT, PLAIN, SLOW, f"control.slow.patience={patience}")
    # It takes 0.1 s for the pace to fall to 0, and some more where s* = 0 comes and goes.
    stands = np.count_nonzero(run["path_rate"] == 0.0) * run.period
    assert stands == pytest.approx(patience, abs=0.15)
    assert error_norms(run)[0][-1] < 0.002
    assert run.completed == 1.0 and run.is_complete
    assert len(run) > run.planned


# Stop ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("plant", "change"), [("ideal", 5.0), ("servo", 20.0)])
def test_stop_holds_the_arm_before_the_singularity_and_lets_it_back(simulate, change, plant):
    _, run = simulate(
        *OUT, PLAIN, STOP, f"control.stop={{sigma: 0.2, change: {change}}}", f"plant.kind={plant}"
    )
    sigma, elbow = run["sigma"][:, -1], run["q"][:, 1]
    # Rates that fall to 0 by `change` lead on by rate/(2 change). sigma = sin(elbow)/sigma_1 falls by at most 0.47 of
    # that; a quarter more, as the rates that are taken away rise meanwhile.
    travel = np.abs(run["qdot"]).max() / (2 * change)
    assert sigma.min() >= 0.2 - 1.25 * 0.47 * travel
    assert sigma.min() < 0.2 and np.any(has(run, Status.STOPPED))
    held = has(run, Status.STOPPED) & (np.abs(run["qdot_cmd"]).max(axis=1) == 0.0)
    assert np.count_nonzero(held) * run.period > 1.0
    # while it is held it stands: ideal at once, servos when the last command has been obeyed, some timesteps later
    still = held & np.roll(held, 10)
    assert np.abs(run["qdot"][still]).max() <= (0.0 if plant == "ideal" else 1e-3)
    # It stands while the target is out there, and follows again once it is back.
    assert np.all(elbow < 0) and error_norms(run)[0][-1] < 0.002
    assert not has(run, Status.STOPPED)[-1]


# Keep out, and the kernel --------------------------------------------------------------------------------------

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
    # the arm is stretched, and rests where its reference has left it behind
    beyond = np.linalg.norm(run["pose_ref"][:, :2], axis=1) > 2.001
    assert beyond.any() and np.abs(run["qdot_cmd"][beyond]).max() < 1e-3
