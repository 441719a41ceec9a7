"""An integrated state, an arm that nobody calibrated, friction that nobody knows: the closed forms.

Whole runs, with encoders of all kinds, are held against the loop of `oracles.py` in `test_simulation.py`.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from rmrc.arm import load
from rmrc.scenario import Scenario
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

PLANAR = ("arm.model=models/planar_3link.xml", "arm.start=home", "plant.kind=ideal")
SHORT = "target.path=[{line: {by: [0.05, 0.02]}}]"
HOLD = "target.path=[{hold: {for: 2}}]"
PERIOD = 0.001


# An integrated state ----------------------------------------------------------------------------


DRIVEN = """<mujoco>
  <option timestep="0.001" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" damping="5"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass="2" contype="0" conaffinity="0"/>
      <body name="lower" pos=".4 0 0"><joint name="elbow" axis="0 1 0" damping="5"/>
        <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0" mass="1" contype="0" conaffinity="0"/>
        <site name="hand" pos=".3 0 0"/>
      </body></body>
  </worldbody>
  <actuator>
    <position name="a" joint="shoulder" kp="{kp}" kv="20"/><position name="b" joint="elbow" kp="{kp}" kv="20"/>
  </actuator>
  <keyframe><key name="home" qpos="-1.2 1.5"/></keyframe>
</mujoco>"""
KP = 500.0


def driven(tmp_path, feedback, state):
    """Return the end of a run of position servos without gravity compensation, which settled where it began."""
    path = tmp_path / "driven.xml"
    path.write_text(DRIVEN.format(kp=KP))
    prepared = prepare(Scenario.model_validate({
        "name": "droop", "arm": {"model": path, "site": "hand"}, "task": {"axes": ("x", "z")},
        "control": {"feedback": feedback, "state": state, "inverse": {"method": "pseudoinverse"}},
        "target": {"path": ({"line": {"by": (0.15, 0.0, 0.1)}}, {"hold": {"for": 3.0}})}, "plant": {"kind": "model"},
    }))  # fmt: skip
    (run,) = Simulation([prepared]).run()
    return run


def weight(q):
    """Return what bears the links, (2,), by hand: both hang from horizontal axes."""
    g, (a, b) = 9.81, q
    outer = 1.0 * g * 0.15 * np.cos(a + b)
    inner = 2.0 * g * 0.2 * np.cos(a) + 1.0 * g * (0.4 * np.cos(a)) + outer
    return -np.array([inner, outer])  # positive angles turn the links down


@pytest.mark.parametrize("feedback", [5.0, 40.0])
def test_position_servos_droop_by_load_over_stiffness_and_the_integral_never_sees_it(tmp_path, feedback):
    run = driven(tmp_path, feedback, "integrated")
    q0, q, believed = run["q"][0], run["q"][-1], run["q_believed"][-1]
    droop = (weight(q0) - weight(q)) / KP  # what the controls held at first was right
    # 1e-6: what is left of the servos' swing after 3 s
    assert_allclose(q - believed, -droop * -1, rtol=0, atol=1e-6)
    assert np.abs(droop).max() > 2e-3
    arm = load(tmp_path / "driven.xml")
    assert_allclose(arm.pose(believed)[[0, 2]], run["pose_ref"][-1, [0, 2]], atol=1e-6)  # the law is content
    error = np.linalg.norm(run["pose_error"][-1, [0, 2]])
    assert error == pytest.approx(np.linalg.norm((arm.pose(q) - arm.pose(believed))[:3]), abs=1e-6)
    assert error > 1e-3
    # negative control: with measured positions the same arm arrives
    assert np.linalg.norm(driven(tmp_path, feedback, "measured")["pose_error"][-1, [0, 2]]) < 1e-5


# An arm that nobody calibrated ------------------------------------------------------------------

OFF = "plant.stretch={link_1: 1.005, link_2: 1.005}"
REACH = (
    "plant.kind=ideal",
    "control.inverse.method=pseudoinverse",
    "target.path=[{line: {to: [1.99, 0]}}, {hold: {for: 2}}]",
)


@pytest.mark.parametrize("feedback", [5, 20, 200])
def test_lengths_that_are_half_a_percent_off_cost_ten_millimeters_near_reach_under_every_gain(
    simulate, feedback
):
    prepared, run = simulate(*REACH, OFF, f"control.feedback={feedback}")
    # the whole arm is 1.005 times as large, about the shoulder: so is every tip
    # 1e-6: what the integration of a path so near to reach has left after 2 s of the lowest gain
    assert_allclose(run["pose_error"][-1, :2], [-0.005 * 1.99, 0.0], rtol=0, atol=1e-6)
    assert_allclose(
        run["pose"][::20, :2],
        1.005 * np.array([prepared.arm.pose(q)[:2] for q in run["q"][::20]]),
        atol=1e-12,
    )
    assert_array_equal(run["q_believed"], run["q"])


# Friction ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["servo", "torque"])
def test_friction_that_nobody_knows_is_not_compensated_and_friction_of_the_model_is(
    scenario, tmp_path, plant
):
    """A joint that turns evenly: rates are as commanded but for what the friction takes of the drive's stiffness."""
    text = '<mujoco><option gravity="0 0 0"/><worldbody><body name="arm"><joint name="turn" axis="0 0 1" {own}/>' \
        '<geom type="capsule" size=".05" fromto="0 0 0 1 0 0" mass="3"/><site name="tip" pos="1 0 0"/></body></worldbody></mujoco>'  # fmt: skip
    model, kv, rate = tmp_path / "turn.xml", 50.0, 0.5

    def lost(own, *friction):
        model.write_text(text.format(own=own))
        prepared = prepare(scenario(
            f"arm={{model: {model}, site: tip}}", "task.axes=[rz]", f"plant={{kind: {plant}, kv: {kv}, bandwidth: 20}}", *friction,
            "control.feedback=0", f"target={{path: [{{turn: {{axis: z, angle: 1}}}}], limits: {{angular_velocity: {rate}}}}}",
        ))  # fmt: skip
        (run,) = Simulation([prepared]).run()
        middle = len(run) // 2
        assert run["qdot_cmd"][middle, 0] == pytest.approx(rate, abs=1e-12)
        inertia = float(prepared.arm.inertia[0])
        stiffness = kv if plant == "servo" else 20.0 * inertia
        return stiffness * (rate - run["qdot"][middle, 0]), run["qdot"][middle, 0]

    # 1 %: so far has the loop settled; and MuJoCo's dry friction is all there but for 0.2 % at this rate
    assert lost("", "plant.friction.coulomb=0.3")[0] == pytest.approx(0.3, rel=1e-2)
    torque, turned = lost("", "plant.friction.viscous=0.4")
    assert torque == pytest.approx(0.4 * turned, rel=1e-2)
    both = "plant.friction={coulomb: 0.3, viscous: 0.4}"
    torque, turned = lost('damping="0.4" frictionloss="0.3"', both)  # what the model has is compensated
    assert torque == pytest.approx(0.3 + 0.4 * turned, rel=2e-2)
    assert abs(lost('damping="0.4" frictionloss="0.3"')[0]) < 1e-2
