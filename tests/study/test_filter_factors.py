"""Filter factors hold against closed forms, and against the gain that the run itself recorded."""

import numpy as np
import pytest

from codes import Method, Schedule
from rmrc.study.filters import NEAREST, filter_factor

CONSTANT = "control.inverse.damping.schedule=constant"


def damped(sigma, damping):
    return sigma / (sigma**2 + damping**2)


def test_constant_damping_is_its_closed_form(simulate):
    curve = filter_factor(*simulate(CONSTANT, "control.inverse.damping.maximum=0.3"))
    np.testing.assert_allclose(curve.gain, damped(curve.sigma, 0.3), rtol=1e-12)
    assert np.abs(curve.gain * damped(curve.sigma, 0.31) ** -1 - 1).max() > 0.05  # a changed λ is seen


def test_the_schedule_damps_below_its_bound_only(simulate):
    curve = filter_factor(*simulate("control.inverse.damping={maximum: 0.2, below: 0.4}"))
    damping = np.sqrt(np.clip(1.0 - (curve.sigma / 0.4) ** 2, 0.0, None)) * 0.2
    np.testing.assert_allclose(curve.gain, damped(curve.sigma, damping), rtol=1e-12)


def test_the_pseudoinverse_drops_what_is_below_its_tolerance(simulate):
    prepared, run = simulate("control.inverse={method: pseudoinverse, tolerance: 0.1}")
    curve = filter_factor(prepared, run)
    largest = run["sigma"][run["sigma"][:, -1].argmin(), 0]
    kept = curve.sigma > 0.1 * largest
    np.testing.assert_allclose(curve.gain[kept], 1.0 / curve.sigma[kept], rtol=1e-12)
    assert 0 < kept.sum() < len(kept)
    assert (curve.gain[~kept] == 0.0).all()


def test_sigma_rises_from_a_thousandth_of_the_largest_to_the_next_of_the_tick(simulate):
    prepared, run = simulate()
    curve = filter_factor(prepared, run)
    tick = run["sigma"][:, -1].argmin()
    assert (np.diff(curve.sigma) > 0).all()
    np.testing.assert_allclose(
        curve.sigma[[0, -1]], run["sigma"][tick, 0] * np.array([NEAREST, 1.0]), rtol=1e-12
    )
    assert curve.sigma_min == run["sigma"][tick, -1]


def test_a_task_of_one_row_has_one_sigma_and_a_range_around_it(simulate):
    prepared, run = simulate("task.axes=[x]", CONSTANT, "control.inverse.damping.maximum=0.1")
    curve = filter_factor(prepared, run)
    np.testing.assert_allclose(curve.sigma[-1], 1.2 * run["sigma"].max(), rtol=1e-12)
    np.testing.assert_allclose(curve.gain, damped(curve.sigma, 0.1), rtol=1e-12)


@pytest.mark.parametrize("method", [method.name.lower() for method in Method])
@pytest.mark.parametrize(
    "task",
    [
        ("task.axes=[x, y]", "task.weights=[4, 0.25]"),
        pytest.param(("task.length=0.5",), marks=pytest.mark.long),
    ],
)
def test_the_mark_has_the_gain_that_the_run_recorded(simulate, method, task):
    """At the σ that the arm had, asking the law again must give what it gave."""
    prepared, run = simulate(f"control.inverse.method={method}", *task)
    tick = run["sigma"][:, -1].argmin()
    # another route through the decomposition: some 30 roundings
    assert filter_factor(prepared, run).gain_min == pytest.approx(run["gain"][tick, -1], rel=1e-10)


@pytest.mark.parametrize("schedule", [schedule.name.lower() for schedule in Schedule])
def test_the_mark_has_the_gain_of_the_run_for_every_schedule(simulate, schedule):
    prepared, run = simulate(f"control.inverse.damping={{schedule: {schedule}, below: 2, error_gain: 50}}")
    tick = run["sigma"][:, -1].argmin()
    assert filter_factor(prepared, run).gain_min == pytest.approx(run["gain"][tick, -1], rel=1e-10)


def test_the_law_is_asked_about_the_arm_that_it_saw(simulate):
    by_error = "control.inverse.damping={schedule: error, error_gain: 50}"
    prepared, run = simulate(by_error, "arm.encoder.offset=[0.02, -0.05]")
    tick = run["sigma"][:, -1].argmin()
    # the law's own forward kinematics are not MuJoCo's: some 30 roundings more
    assert filter_factor(prepared, run).gain_min == pytest.approx(run["gain"][tick, -1], rel=1e-10)
