"""Believed positions: encoders that are late, noisy and coarse, an integrated state, an arm that nobody
calibrated.

Whole runs are held against the loop of `oracles.py` in `test_simulation.py`; here are the closed forms.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import fsolve
from scipy.special import chdtri, ndtri

from oracle_way import formula
from project import ROOT
from rmrc.arm import load
from rmrc.results.columns import COLUMNS
from rmrc.scenario import Scenario
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from wording import says

PLANAR = ("arm.model=models/planar_3link.xml", "arm.start=home", "plant.kind=ideal")
SHORT = "target.path=[{line: {by: [0.05, 0.02]}}]"
HOLD = "target.path=[{hold: {for: 2}}]"
PERIOD = 0.001


# Encoders ---------------------------------------------------------------------------------------


def test_what_is_read_is_the_nearest_multiple_of_the_resolution(simulate):
    steps = np.array([1e-3, 2**-17 * 2 * np.pi, 0.0])
    _, run = simulate(*PLANAR, SHORT, f"arm.encoder.resolution={steps.tolist()}")
    q, read = run["q"], run["q_believed"]
    assert (np.abs(read - q) <= steps / 2 + 1e-15).all()
    counts = read[:, :2] / steps[:2]
    assert_allclose(counts, np.round(counts), rtol=0, atol=1e-9)
    assert_array_equal(read[:, 2], q[:, 2])
    assert len(set(counts[:, 0])) > 10


@pytest.mark.parametrize("ticks", [3.0, 3.25, 0.5])
def test_what_is_read_is_as_old_as_the_delay_to_the_share_of_a_tick(simulate, ticks):
    """The ideal plant moves evenly within a tick, so that between two ticks the mean of both is where it was."""
    _, run = simulate(*PLANAR, SHORT, f"arm.encoder.delay={ticks * PERIOD}")
    q, t = run["q"], np.arange(len(run))
    then = np.maximum(t - ticks, 0.0)
    want = np.column_stack([np.interp(then, t, one) for one in q.T])
    assert_allclose(run["q_believed"], want, rtol=0, atol=1e-13)
    if ticks == round(ticks):
        assert_array_equal(run["q_believed"][3:], q[:-3])
    other = np.column_stack([np.interp(np.maximum(then - 0.01, 0.0), t, one) for one in q.T])
    assert np.abs(run["q_believed"] - other).max() > 1e-7  # negative control: a hundredth of a tick


@pytest.mark.parametrize("d", [0, 1, 4])
def test_old_measurements_have_the_edge_of_stability_of_late_commands(d):
    """K T = 2 sin(π/(2(2d + 1))): around the loop it is all one where the time is spent."""

    def is_stable(share, ticks):
        path = ({"set": {"by": (1e-5, 1e-5), "for": 8.0}},)
        (run,) = Simulation([prepare(Scenario.model_validate({
            "name": "edge", "task": {"axes": ("x", "y")}, "target": {"path": path}, "plant": {"kind": "ideal"},
            "arm": {
                "model": ROOT / "models/planar_2link.xml", "site": "tip", "start": (0.5, -1.5),
                "encoder": {"delay": ticks * 0.01},
            },
            "control": {
                "period": 0.01, "feedback": share * formula(d) / 0.01, "inverse": {"method": "pseudoinverse"},
                "limits": {"on_excess": "none"},
            },
        }))]).run()  # fmt: skip
        error = np.linalg.norm(run["pose_error"], axis=1)
        return error[-200:].max() < error[200:400].max() and error[-200:].max() < 1e-4

    assert [is_stable(0.98, d), is_stable(1.02, d)] == [True, False]
    assert not is_stable(0.98, d + 1)  # negative control


def noisy(scenario, seed, *more):
    return prepare(
        scenario(*PLANAR, HOLD, f"arm.encoder={{noise: [1.0e-4, 0, 2.0e-3], seed: {seed}}}", *more)
    )


def test_noise_is_white_and_normal_with_the_deviation_that_is_asked_for(scenario):
    deviation = np.array([1e-4, 2e-3])
    (run,) = Simulation([noisy(scenario, 3, "control.feedback=0")]).run()
    noise = (run["q_believed"] - run["q"])[:, [0, 2]] / deviation
    count = len(noise)
    assert_array_equal(run["q_believed"][:, 1], run["q"][:, 1])
    # Each bound is missed by one of a thousand seeds, and this one is fixed.
    assert (np.abs(noise.mean(axis=0)) < -ndtri(5e-4) / np.sqrt(count)).all()
    squares = (noise**2).sum(axis=0)
    assert (chdtri(count, 0.9995) < squares).all() and (squares < chdtri(count, 5e-4)).all()
    assert not chdtri(count, 0.9995) < (1.1**2 * squares[0]) < chdtri(count, 5e-4)  # 10 % more is seen

    def whiteness(x):
        """Return Ljung and Box's statistic of the first ten lags: χ² of ten."""
        lags = np.arange(1, 11)
        r = np.array([x[k:] @ x[:-k] for k in lags]) / (x @ x)
        return count * (count + 2) * np.sum(r**2 / (count - lags))

    assert max(whiteness(x) for x in noise.T) < chdtri(10, 1e-3)
    assert whiteness(noise[1:, 0] + 0.3 * noise[:-1, 0]) > chdtri(10, 1e-3)  # negative control
    assert abs(noise[:, 0] @ noise[:, 1]) / count < -ndtri(5e-4) / np.sqrt(count)


def test_noise_is_that_of_its_seed_whoever_stands_beside_it(scenario):
    (alone,) = Simulation([noisy(scenario, 3)]).run()
    worlds = [
        noisy(scenario, 4),
        noisy(scenario, 3),
        prepare(scenario(*PLANAR, HOLD)),
        noisy(scenario, 3, "plant.joint_offset=0.01"),
    ]
    runs = Simulation(worlds).run()
    for name in COLUMNS:
        assert_array_equal(runs[1][name], alone[name])
    noise = [run["q_believed"] - run["q"] for run in (*runs, alone)]
    assert np.abs(noise[0] - noise[1]).max() > 1e-4
    # 1e-15: a rounding of q + noise
    assert_allclose(noise[3] + 0.01, noise[1], rtol=0, atol=1e-15)
    drawn = np.random.default_rng([3, 0]).standard_normal(noise[1].shape)
    assert_allclose(noise[1], np.array([1e-4, 0, 2e-3]) * drawn, rtol=0, atol=1e-15)


# An integrated state ----------------------------------------------------------------------------


def test_the_integral_of_the_commands_is_where_an_arm_is_that_does_them(simulate):
    _, measured = simulate(*PLANAR, SHORT)
    _, integrated = simulate(*PLANAR, SHORT, "control.state=integrated")
    # kinematics by MuJoCo and by the chain round differently, 1e-16 a tick
    assert_allclose(integrated["q"], measured["q"], rtol=0, atol=1e-12)
    assert_allclose(integrated["q_believed"], integrated["q"], rtol=0, atol=1e-12)


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


@pytest.mark.parametrize("state", ["measured", "integrated"])
def test_rate_servos_under_a_load_are_off_by_it_over_feedback_or_drift_without_end(simulate, state):
    kv, K, load_ = 200.0, 10.0, 4.0  # N·m·s/rad, 1/s, N; links of 1 m
    prepared, run = simulate(
        "control.inverse.method=inverse", f"control.feedback={K}", f"control.state={state}", f"plant.kv={kv}",
        f"plant.wrench=[0, {load_}, 0, 0, 0, 0]", "target.path=[{hold: {for: 2}}]",
    )  # fmt: skip

    def tip(q):
        return np.array([np.cos(q[0]) + np.cos(q.sum()), np.sin(q[0]) + np.sin(q.sum())])

    def jacobian(q):
        outer = np.array([-np.sin(q.sum()), np.cos(q.sum())])
        return np.column_stack([np.array([-np.sin(q[0]), np.cos(q[0])]) + outer, outer])

    def yielding(q):
        """Return the rates that the load makes servos give way with, (2,)."""
        return jacobian(q).T @ [0.0, load_] / kv

    wanted = tip(run["q"][0])
    if state == "measured":  # J⁻¹ K e = −Jᵀ f/kv
        still = lambda q: K * np.linalg.solve(jacobian(q), wanted - tip(q)) + yielding(q)  # noqa: E731
        at = fsolve(still, run["q"][0], xtol=1e-13)
        assert_allclose(run["q"][-1], at, rtol=0, atol=1e-7)  # 2 s are 20 time constants of 1/K: 2e-9 of 6 mm
        assert 1e-3 < np.linalg.norm(wanted - tip(at)) < 1e-2
    else:
        rate = np.diff(run["q"][-2:], axis=0)[0] / PERIOD
        # the drift itself is accelerated, by inertia over gain: 1e-3 of it
        assert_allclose(rate, yielding(run["q"][-1]), rtol=5e-3)
        assert_allclose(run["q_believed"][-1], run["q"][0], rtol=0, atol=1e-12)
        assert np.linalg.norm(run["pose_error"][-1, :2]) > 0.03


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


def test_lengths_that_the_law_knows_cost_nothing(simulate):
    _, run = simulate(*REACH, OFF.replace("plant", "arm"))
    assert np.abs(run["pose_error"][-1, :2]).max() < 1e-6


@pytest.mark.parametrize(
    "model", ["tests/models/telescope.xml", "tests/models/mimic.xml", "models/stanford.xml"]
)
@pytest.mark.parametrize("plant", ["ideal", "servo", "torque"])
def test_all_that_the_law_computes_is_of_the_arm_and_the_joints_that_it_believes(scenario, model, plant):
    known = load(ROOT / model)
    bodies = dict.fromkeys(known.body_names[2:4], 1.03)
    more = (
        f"arm.model={model}", "arm.site=null", "arm.start=home", f"plant.kind={plant}", "target.path=[{hold: {for: 0.1}}]",
        f"task.axes=[{'x, y' if 'telescope' in model else 'x, z'}]", f"plant.stretch={bodies}", "arm.encoder={noise: 1.0e-4, delay: 0.002}",
        "control.state=integrated", "plant.joint_offset=0.01", "control.inverse.method=pseudoinverse",
    )  # fmt: skip
    prepared = prepare(scenario(*more))
    (run,) = Simulation([prepared]).run()
    true = known.stretched(bodies)
    for t in (0, 40, len(run) - 1):
        J = prepared.task.matrix(known.jacobian(run["q_believed"][t]))
        assert_allclose(run["sigma"][t], np.linalg.svd(J, compute_uv=False), atol=1e-9)
        if plant == "ideal":  # followers follow exactly
            assert_allclose(run["pose"][t, :3], true.pose(run["q"][t])[:3], atol=1e-9)
    assert np.linalg.norm(run["pose_error"][0]) > 1e-3


def test_joints_beyond_where_they_are_thought_are_encoders_that_say_too_little(simulate):
    """Both begin at the same place; the path of one begins where the law takes it to be, the other's where it is."""
    there, delta = np.array([0.9, -1.7]), np.array([0.02, -0.03])
    jump = "target.path=[{set: {to: [1.2, 0.3], for: 0.5}}]"
    _, plant = simulate(f"arm.start={there.tolist()}", f"plant.joint_offset={delta.tolist()}", jump)
    _, encoder = simulate(
        f"arm.start={(there + delta).tolist()}", f"arm.encoder.offset={(-delta).tolist()}", jump
    )
    for name in ("q", "q_believed", "qdot_cmd", "pose"):
        assert_allclose(plant[name], encoder[name], rtol=0, atol=1e-9)
    _, held = simulate(
        f"arm.start={there.tolist()}",
        f"plant.joint_offset={delta.tolist()}",
        "target.path=[{hold: {for: 0.5}}]",
    )
    assert np.abs(held["qdot_cmd"]).max() < 1e-9  # its path begins where it believes to be
    assert np.abs(held["pose_error"][:, :2]).max() > 0.01


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


def test_worlds_that_keep_other_secrets_share_no_bit(scenario):
    secrets = (
        (), ("plant.friction={coulomb: 1, viscous: 2}",), ("plant.stretch.link_1=1.02",), ("plant.friction.viscous=0.5",),
        ("arm.encoder={noise: 1.0e-5, delay: 0.01}", "control.rate_filter=0.003"), ("control.state=integrated",),
    )  # fmt: skip
    worlds = [prepare(scenario("plant.kind=torque", SHORT, *one)) for one in secrets]
    alone = [Simulation([one]).run()[0] for one in worlds]
    for threads in (1, 2):
        for run, want in zip(Simulation(worlds, threads).run(), alone, strict=True):
            for name in COLUMNS:
                assert_array_equal(run[name], want[name])
    ends = [run["q"][-1].tobytes() for run in alone]
    assert len(set(ends)) == len(ends)
    few = Simulation(worlds, keep_columns=False)
    few.step()
    for card, run in zip(few.scorecards(), alone, strict=True):
        assert card["position_error.end"].value == run.scorecard["position_error.end"].value


# What cannot be ---------------------------------------------------------------------------------

SECOND = "control.nullspace.objective=secondary"
THREE = ("arm.model=models/planar_3link.xml", "arm.start=home")
IDLE = (*THREE, "arm.joints=[shoulder, wrist]")


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (("arm.encoder.noise=-1",), "--set arm.encoder.noise: … 0 … -1"),
        (("arm.encoder.delay=-1",), "--set arm.encoder.delay: … 0 … -1"),
        (("arm.encoder.noise=[1, 2, 3]",), "--set arm.encoder.noise: … 2 … (shoulder, elbow) … 3"),
        (("arm.encoder.resolution=1.0e-13",), "--set arm.encoder.resolution: … 1e-12 … 1e-13"),
        (("arm.encoder.noise=1.0e+7",), "--set arm.encoder.noise: … 1e+06 … 1e+07"),
        (("plant.joint_offset=2",), '--set plant.joint_offset: … "shoulder" … 3.0472 rad … 2.96706] rad; … start …'),
        (("plant.joint_offset=[1]",), "--set plant.joint_offset: … 2 … (shoulder, elbow) … 1"),
        (("plant.friction.coulomb=-1",), "--set plant.friction.coulomb: … 0 … -1"),
        (("plant.friction=2",), "--set plant.friction: … mapping, got 2; … coulomb, viscous"),
        (("plant.friction={viscous: [1, 2, 3]}",), "--set plant.friction: plant.friction.viscous: … 2 … 3"),
        (
            ("plant.kind=ideal", "plant.friction.viscous=1"),
            '--set plant.friction.viscous: plant.friction: "ideal" … plant.friction… servo, torque, model',
        ),
        (("plant.stretch.link_9=2",), '--set plant.stretch.link_9: … body "link_9" … link_1, link_2'),
        (("plant.stretch=2",), "--set plant.stretch: … mapping, got 2"),
        (("control.state=guessed",), '--set control.state: … "measured", "integrated", … "guessed"'),
        (("control.rate_filter=-1",), "--set control.rate_filter: … 0 … -1"),
        *(
            ((*IDLE, text), f"--set {text.partition('=')[0]}: {told}joint \"elbow\" … is not actuated, … actuate it, or leave {key} out")
            for text, key, told in (
                ("arm.encoder.delay=0.01", "arm.encoder", "arm.encoder: "), ("control.state=integrated", "control.state", ""),
                ("plant.stretch.link_1=1.01", "plant.stretch", "plant.stretch: "), ("plant.joint_offset=0.01", "plant.joint_offset", ""),
            )
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_line_with_the_way_out(scenario, overrides, told):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(*overrides))
    assert str(caught.value) == says(told)


def test_joints_before_the_site_of_a_second_task_are_to_be_driven_too(scenario, tmp_path):
    finger = '<body pos=".3 0 0"><joint name="grip" axis="0 1 0"/><geom size=".01" mass=".1"/><site name="end"/></body>'
    path = tmp_path / "fingered.xml"
    site = '<site name="hand" pos=".3 0 0"/>'
    text = DRIVEN.format(kp=1).replace(site, site + finger).replace('"-1.2 1.5"', '"-1.2 1.5 0"')
    path.write_text(text)
    shared = (
        f"arm={{model: {path}, site: hand}}",
        "task.axes=[x]",
        SECOND,
        "control.nullspace.secondary.axes=[z]",
    )
    prepare(scenario(*shared, "control.state=integrated"))
    prepare(scenario(*shared, "control.nullspace.secondary.site=end"))
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(*shared, "control.nullspace.secondary.site=end", "control.state=integrated"))
    assert str(caught.value) == says(
        f'--set control.state: joint "grip" of {path} … actuate it, or leave control.state out'
    )


def test_friction_that_an_option_of_the_model_leaves_out_is_refused(scenario, tmp_path):
    path = tmp_path / "flags.xml"
    path.write_text(
        DRIVEN.format(kp=1).replace(
            'gravity="0 0 -9.81"/>', 'gravity="0 0 0"><flag frictionloss="disable"/></option>'
        )
    )
    with pytest.raises(ScenarioError) as caught:
        prepare(
            scenario(
                f"arm={{model: {path}, site: hand}}",
                "task.axes=[x, z]",
                "plant.friction={coulomb: 1, viscous: 1}",
            )
        )
    assert str(caught.value) == says(
        f"--set plant.friction: plant.friction.coulomb: an option of {path} disables it; remove the option, …"
    )
