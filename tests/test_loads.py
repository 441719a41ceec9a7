"""What is put on an arm: contact, drives at their limits, and the load that gravity compensation bears.

The oracles are plain loops over MuJoCo, which look at `data.contact` and clamp forces by hand, and levers.
"""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from rmrc.scenario import Scenario
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

PERIOD, TIMESTEP = 0.002, 0.001
DOWN_AND_UP = ({"line": {"by": (0.0, 0.0, -0.3)}}, {"line": {"by": (0.0, 0.0, 0.3)}})
HOLD = ({"hold": {"for": 0.3}},)

FLOOR = '<geom name="floor" type="plane" size="2 2 .1" pos="0 0 -.2"/>'
CUBE = '<body name="cube" pos="0 1 -.17"><freejoint/><geom type="box" size=".02 .02 .02" mass=".1"/></body>'
# Fingers that close on each other, each on a slide that nothing drives: locked.
FINGERS = "".join(
    f'<body name="{name}" pos=".3 {y} 0"><joint name="{name}" type="slide" axis="0 1 0"/>'
    f'<geom type="box" size=".05 .01 .01" pos=".05 0 0" mass=".05"/></body>'
    for name, y in (("left", 0.0099), ("right", -0.0099))
)
LOCKED_AND_HELD = '<actuator><position joint="left" kp="500" kv="10"/></actuator>'


def arm(tmp_path, world=FLOOR, hand="", more="", joint="", q="0.2 0.6", name="arm"):
    """Write a model of two links above a floor, and return its path."""
    text = f"""<mujoco>
  <worldbody>{world}
    <body name="upper" pos="0 0 .2"><joint name="shoulder" axis="0 1 0" {joint}/>
      <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass="2"/>
      <body name="lower" pos=".4 0 0"><joint name="elbow" axis="0 1 0" {joint}/>
        <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0" mass="1"/><site name="hand" pos=".3 0 0"/>{hand}
      </body></body>
  </worldbody>{more}
</mujoco>"""
    path = tmp_path / f"{name}.xml"
    path.write_text(text)
    model = mujoco.MjModel.from_xml_string(text)
    qpos = np.array(model.qpos0)
    qpos[[model.joint(one).qposadr[0] for one in ("shoulder", "elbow")]] = [float(one) for one in q.split()]
    key = f'<keyframe><key name="home" qpos="{" ".join(map(str, qpos))}"/></keyframe>'
    path.write_text(text.replace("</mujoco>", f"{key}</mujoco>"))
    return path


def written(path, pieces=DOWN_AND_UP, expect=None, **plant):
    """Return a scenario as its file has it."""
    return {
        "name": "loaded", "arm": {"model": str(path), "site": "hand", "joints": ["shoulder", "elbow"]},
        "task": {"axes": ["x", "z"]}, "control": {"period": PERIOD, "feedback": 20.0},
        "target": {"path": list(pieces)}, "plant": {"kind": "servo", "timestep": TIMESTEP, **plant},
        "expect": expect or {},
    }  # fmt: skip


def run(*about, **options):
    prepared = prepare(Scenario.model_validate(written(*about, **options)))
    (done,) = Simulation([prepared]).run()
    assert done.divergence is None
    return done


def pairs_by_mujoco(path, done):
    """Return at each tick the pairs of bodies that touch, one of them the arm's, by MuJoCo at the same qpos."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, found = mujoco.MjData(model), []
    names = [model.body(b).name for b in range(model.nbody)]
    own = {"upper", "lower", "left", "right"}
    for qpos in done["qpos"]:
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        touching = (
            (names[model.geom_bodyid[a]], names[model.geom_bodyid[b]])
            for a, b in data.contact.geom[: data.ncon]
        )
        found.append({frozenset(pair) for pair in touching if own & set(pair)})
    return found


def is_in_contact(done):
    return done["status"] & Status.CONTACT > 0


def test_contact_is_where_a_plain_loop_finds_one(tmp_path):
    path = arm(tmp_path, FLOOR + CUBE)
    done = run(path)
    wanted = np.array([bool(pairs) for pairs in pairs_by_mujoco(path, done)])
    assert 50 < np.count_nonzero(wanted) < len(done) - 50
    assert_array_equal(is_in_contact(done), wanted)
    card = done.scorecard
    assert card["contact.time"].value == pytest.approx(np.count_nonzero(wanted) * PERIOD, rel=1e-12)
    assert card["contact.first_time"].value == done["time"][wanted.argmax()]
    assert card["contact.first_bodies"].value == "lower – floor"


def test_a_hand_that_is_closed_from_the_start_rests_and_a_floor_does_not(tmp_path):
    closed = run(arm(tmp_path, "", FINGERS, LOCKED_AND_HELD), HOLD)
    assert not is_in_contact(closed).any()
    assert closed.resting == (("left", "right"),)
    low = run(arm(tmp_path, FLOOR.replace("-.2", "-.01"), q="0 0.7", name="low"), HOLD)
    assert is_in_contact(low).all() and low.resting == ()
    assert low.scorecard["contact.first_bodies"].value == "lower – floor"


def test_drives_are_at_their_limit_where_a_plain_loop_clamps_them(tmp_path):
    weightless = '<option gravity="0 0 0"/>'
    free = run(arm(tmp_path, "", more=weightless, name="free"))
    most = 0.5 * free.scorecard["tau.peak"].value
    path = arm(tmp_path, "", more=weightless, joint=f'actuatorfrcrange="-{most} {most}"')
    done, kv = run(path), prepare(Scenario.model_validate(written(path))).plant.kv
    spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep, spec.option.integrator = TIMESTEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for key in list(spec.keys):
        spec.delete(key)
    for joint, gain in zip(done.joints, kv, strict=True):
        servo = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_velocity(kv=gain)
        servo.forcelimited, servo.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-most, most]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = done["qpos"][0]
    clamped = [np.zeros(2, bool)]
    for command in done["qdot_cmd"][:-1]:
        data.ctrl[:] = command
        for _ in range(round(PERIOD / TIMESTEP)):
            asked = kv * (command - data.qvel)  # what a drive without a limit gives
            mujoco.mj_step(model, data)
        clamped.append(np.abs(asked) >= most)
    is_limited = np.any(clamped, axis=1)
    assert 5 < np.count_nonzero(is_limited) < len(done) - 50
    assert_array_equal(done["status"] & Status.TORQUE_LIMITED > 0, is_limited)
    card, first = done.scorecard, int(np.argmax(is_limited))
    assert card["torque_limited.first_time"].value == done["time"][first]
    assert card["torque_limited.first_joint"].value == done.joints[int(np.argmax(clamped[first]))]
    assert card["tau.share_of_limit"].value == pytest.approx(1.0, abs=1e-12)
    assert not (free["status"] & Status.TORQUE_LIMITED).any()  # negative control


def test_what_compensation_bears_is_the_weight_at_its_levers(tmp_path):
    path = arm(tmp_path, "", joint='actuatorfrcrange="-40 40"', q="-0.3 0.8")
    on, off = (run(path, HOLD, gravity_compensation=is_on) for is_on in (True, False))
    # m g x of both links about each joint; a positive turn about y moves the links down
    a, ab = -0.3, 0.5
    at_elbow = 1.0 * 9.81 * 0.15 * np.cos(ab)
    at_shoulder = at_elbow + 9.81 * np.cos(a) * (2.0 * 0.2 + 1.0 * 0.4)
    weight = np.array([-at_shoulder, -at_elbow])
    # With it the arm stays where it is to rounding; without it the servos give way by 1 mrad, and settle.
    assert_allclose(on["tau_gravity"][-1], weight, rtol=1e-9)
    assert_allclose(off["tau"][-1], weight, rtol=5e-3)
    assert np.abs(on["tau"]).max() < 1e-3 * np.abs(weight).max()
    assert not off["tau_gravity"].any()
    shares = [one.scorecard["tau_total.share_of_limit"].value for one in (on, off)]
    assert shares[0] == pytest.approx(at_shoulder / 40.0, rel=1e-9)
    assert shares[1] == pytest.approx(at_shoulder / 40.0, rel=0.05)  # before it settles
    assert on.scorecard["tau.share_of_limit"].value < 0.01 * shares[0]
    ideal = run(path, HOLD, kind="ideal")
    assert not ideal["tau_gravity"].any()
