"""Whitney's algorithm and the textbook's closed forms, reproduced by the running simulation."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from rmrc.preparation import prepare
from rmrc.simulation import Simulation

IDEAL = ("plant.kind=ideal", "control.inverse.method=inverse", "control.limits.on_excess=none")
BEYOND = "target.path=[{line: {to: [2.001, 0]}}]"  # 1 mm further than the arm reaches
OUT = "target.path=[{line: {to: [2.0, 0]}}]"
STANFORD = (
    "arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]",
    "target.path=[{line: {by: [0.1, 0.1, 0.1], turn: {axis: z, angle: 0.3}}}]",
)  # fmt: skip


def closed_form_rates(q, v):
    """Craig's example 5.5 for any direction: J⁻¹ v of the arm with links of 1 m, J⁻¹ as printed."""
    c1, s1, c12, s12 = np.cos(q[:, 0]), np.sin(q[:, 0]), np.cos(q.sum(1)), np.sin(q.sum(1))
    s2 = np.sin(q[:, 1])
    return np.stack(
        [
            (c12 * v[:, 0] + s12 * v[:, 1]) / s2,
            -((c1 + c12) * v[:, 0] + (s1 + s12) * v[:, 1]) / s2,
        ],
        axis=1,
    )


def test_plain_inverse_sends_the_closed_form_rates_up_to_the_blow_up(simulate):
    _, run = simulate(*IDEAL, BEYOND, "control.feedback=20")
    twist = (run["twist_ref"] + 20 * run["pose_error"])[:, :2]
    want = closed_form_rates(run["q"], twist)
    # At s₂ = 1e-6 both forms have lost six digits of sixteen, so the comparison ends where s₂ is 1e-5.
    before = np.abs(np.sin(run["q"][:, 1])) > 1e-5
    assert before.sum() > 0.9 * len(run)
    assert np.abs(run["qdot_cmd"]).max() > 100  # it does blow up
    error = np.linalg.norm(run["qdot_cmd"] - want, axis=1) / np.linalg.norm(want, axis=1).clip(1e-9)
    assert error[before].max() < 1e-9


def test_example_5_5_elbow_rate_grows_as_one_over_sin_elbow(simulate):
    # 1 m/s along x: θ̇₂ = −(c₁ + c₁₂)/s₂, so θ̇₂ s₂ → −2 as the arm stretches, and θ̇₂ → −∞ for s₂ > 0.
    _, run = simulate(
        *IDEAL, OUT, "control.feedback=0", "control.period=1.0e-4",
        "target.limits={velocity: 1.0, acceleration: 1.0e+3, jerk: 1.0e+6}",
    )  # fmt: skip
    steady = np.abs(run["twist_ref"][:, 0] - 1.0) < 1e-12
    near = steady & (np.abs(run["q"][:, 1]) < 0.1) & (np.abs(run["q"][:, 1]) > 1e-2)
    q, rate = run["q"][near], run["qdot_cmd"][near]
    product = rate[:, 1] * np.sin(q[:, 1])
    assert_allclose(product, -(np.cos(q[:, 0]) + np.cos(q.sum(1))), rtol=1e-9)
    assert_allclose(product, -2.0, rtol=0.005)  # cos of angles below 0.1
    assert np.abs(rate[:, 1]).max() > 15 * np.abs(run["qdot_cmd"][steady][0, 1])


@pytest.mark.parametrize("arm", [(), STANFORD])
def test_position_feedback_of_one_over_period_is_whitneys_algorithm(scenario, arm):
    # δθ = J⁻¹ (x_d − x), θ⁺ = θ + δθ, tick by tick
    prepared = prepare(scenario(*IDEAL, *arm, "control.feedforward=false", "control.feedback=1000"))
    (run,) = Simulation([prepared]).run()
    rows = slice(0, 2) if not arm else slice(0, 6)
    for t in range(0, len(run) - 1, 7):
        pose, target = run["pose"][t], run["pose_ref"][t]
        turn = (
            Rotation.from_quat(target[3:], scalar_first=True)
            * Rotation.from_quat(pose[3:], scalar_first=True).inv()
        )
        step = np.linalg.solve(
            prepared.arm.jacobian(run["q"][t])[rows],
            np.concatenate([target[:3] - pose[:3], turn.as_rotvec()])[rows],
        )
        assert_allclose(run["q"][t + 1], run["q"][t] + step, rtol=0, atol=1e-12)


def drift(scenario, period):
    prepared = prepare(scenario(*IDEAL, "control.feedback=0", f"control.period={period}"))
    (run,) = Simulation([prepared]).run()
    return np.linalg.norm(run["pose_error"][-1, :2])


def test_open_loop_drift_falls_with_the_first_order_of_the_period(scenario):
    # Rates held constant over a period are Euler's method: order 1.
    periods = np.array([0.008, 0.004, 0.002, 0.001])
    errors = np.array([drift(scenario, period) for period in periods])
    orders = np.log2(errors[:-1] / errors[1:])
    print("drift", dict(zip(periods, errors, strict=True)), "orders", orders)
    assert_allclose(orders, 1.0, rtol=0, atol=0.1)


@pytest.mark.parametrize("gain", [5.0, 20.0])
def test_with_feedback_an_initial_error_decays_exponentially(scenario, gain):
    # ė = −K e in continuous time; Euler's (1 − K T)^t differs from exp(−K t) by K² T t / 2 relative.
    prepared = prepare(
        scenario(
            *IDEAL, f"control.feedback={gain}", "control.period=1.0e-4", "target.path=[{hold: {for: 0.5}}]"
        )
    )
    prepared.reference.pose[:, 0] += 0.01
    (run,) = Simulation([prepared]).run()
    error = np.linalg.norm(run["pose_error"][:, :2], axis=1)
    want = 0.01 * np.exp(-gain * run["time"])
    # 2e-3 m of curvature: the tip moves 10 mm on an arm of 1 m, so J changes by a hundredth
    assert_allclose(error / want, 1.0, rtol=0, atol=0.05)
