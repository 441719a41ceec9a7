"""How well the plants follow, and what damping promises at every tick of a run."""

import numpy as np
import pytest

LINE = "target.limits={velocity: 0.25, acceleration: 1.0, jerk: 10.0}"
PLANAR = ("target.path=[{line: {to: [1.3, 0.4]}}, {line: {to: [1.0, 0.0]}}]", LINE)
STANFORD = (
    "arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]", LINE,
    "target.path=[{line: {by: [0.1, 0.25, 0.0]}}, {line: {by: [-0.1, -0.35, 0.1], turn: {axis: z, angle: 0.3}}}]",
)  # fmt: skip
REACH = "target.path=[{line: {to: [1.995, 0]}}, {hold: {for: 0.3}}, {line: {to: [1.2, 0]}}]"


@pytest.mark.parametrize("arm", [PLANAR, STANFORD], ids=["2-link", "Stanford"])
@pytest.mark.parametrize(("plant", "rms", "largest"), [("servo", 1e-4, 2.5e-4), ("torque", 2e-5, 1e-4)])
def test_tip_follows_a_line_at_a_quarter_meter_a_second(simulate, arm, plant, rms, largest):
    _, run = simulate(*arm, f"plant.kind={plant}", "control.inverse.method=inverse")
    error = np.linalg.norm(run["pose_error"][:, :3], axis=1)
    got = np.sqrt(np.mean(error**2)), error.max()
    assert np.linalg.norm(run["twist_ref"][:, :3], axis=1).max() == pytest.approx(0.25)
    assert got[0] <= rms and got[1] <= largest


def test_damped_rates_stay_under_their_bound_at_every_tick(simulate):
    _, run = simulate(REACH, "control.inverse.damping.schedule=constant", "control.limits.on_excess=none")
    twist = np.linalg.norm((run["twist_ref"] + 20 * run["pose_error"])[:, :2], axis=1)
    rates = np.linalg.norm(run["qdot_cmd"], axis=1)
    assert np.all(rates <= twist / (2 * run["damping"]) * (1 + 1e-12))
    assert np.max(rates * 2 * run["damping"] / twist.clip(1e-12)) > 0.9  # the bound is nearly reached
