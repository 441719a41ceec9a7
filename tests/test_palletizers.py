"""Arms whose followers carry a load through their equalities, in MuJoCo's physics: they move as the ideal arm does.

The oracles are the equalities as they are written, the ideal plant, and a plain loop over MuJoCo.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from physics import moved
from rmrc.scenario.choices import Status

START = (0.2, 0.4, 0.3)
FINGER = """<body pos="0 .02 0"><joint name="finger" type="slide" axis="0 1 0"/>
<inertial pos="0 0 0" mass=".01" diaginertia="1e-6 1e-6 1e-6"/></body>"""
FOLLOWS = '<joint joint1="finger" joint2="q3" polycoef="0.01 0.02 0 0 0"/>'


def palletizer(size, mass, wrist, rules=((0.0, -1.0), (0.1, -1.0)), softness="", hand="", finger="", more=""):
    """Return an arm whose carrier q2b follows the shoulder, and whose wrist q3b follows the elbow.

    Args:
        size: Its lengths, as multiples of a desktop arm's.
        mass: Of its links, as multiples of that of its turret [kg].
        wrist: Mass and inertia of carrier and wrist [kg, kg·m²].
        rules: Offset and ratio of both followers.
        softness: Of both equalities.
        hand: What the wrist carries.
        finger: An equality of it.
        more: More of the model.
    """
    inertia, small = (
        0.002 * mass * size**2,
        f'mass="{wrist[0]}" diaginertia="{wrist[1]} {wrist[1]} {wrist[1]}"',
    )
    big = f'diaginertia="{inertia} {inertia} {inertia}"'
    first, second = (f'polycoef="{offset} {ratio} 0 0 0" {softness}' for offset, ratio in rules)
    return f"""<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default><worldbody>
<body pos="0 0 .1"><joint name="q1" axis="0 0 1"/><inertial pos="0 0 .05" mass="{mass}" {big}/>
<body><joint name="q2" axis="0 1 0"/><inertial pos="0 0 {0.07 * size}" mass="{0.4 * mass}" {big}/>
<body pos="0 0 {0.135 * size}"><joint name="q2b" axis="0 1 0"/><inertial pos="0 0 0" {small}/>
<body><joint name="q3" axis="0 1 0"/><inertial pos="{0.08 * size} 0 0" mass="{0.3 * mass}" {big}/>
<body pos="{0.147 * size} 0 0"><joint name="q3b" axis="0 1 0"/><inertial pos="0 0 0" {small}/>
<site name="tip" pos=".06 0 -.05"/>{hand}</body></body></body></body></body></worldbody>
<equality><joint joint1="q2b" joint2="q2" {first}/><joint joint1="q3b" joint2="q3" {second}/>{finger}</equality>
{more}</mujoco>"""


def drives(element, gain=""):
    return "".join(f'<{element} joint="q{j}" {gain}/>' for j in (1, 2, 3))


ARMS = {
    "ratio two with offsets": {
        "size": 1.0, "mass": 1.0, "wrist": (0.05, 1e-4), "rules": ((0.3, -2.0), (-0.2, 1.5))
    },
    "light wrist, soft as written, finger": {
        "size": 1.0, "mass": 1.0, "wrist": (0.005, 1e-6), "softness": 'solref=".05 1"', "hand": FINGER,
        "finger": FOLLOWS,
    },
    "links of 10 kg": {"size": 4.0, "mass": 25.0, "wrist": (10.0, 0.02)},
}  # fmt: skip


def ran(path, kind, **plant):
    """Return a world, and what it did: a short straight move of the tip and a pause."""
    path_of_tip = ({"line": {"by": (0.03, 0.02, 0.02)}}, {"hold": {"for": 0.2}})
    return moved(
        path, kind, path_of_tip, arm={"start": START}, axes=("x", "y", "z"), **plant,
        control={"inverse": {"method": "pseudoinverse"}}, limits={"velocity": 0.1, "acceleration": 0.5, "jerk": 5.0},
    )  # fmt: skip


def gap(model, qpos):
    """Return how far followers are from their equalities, at most, (T,): model is the author's, whose qpos0 is 0."""
    gaps = []
    for first, second, rule in zip(model.eq_obj1id, model.eq_obj2id, model.eq_data[:, :5], strict=True):
        follower, leader = (qpos[:, model.jnt_qposadr[joint]] for joint in (first, second))
        gaps.append(np.abs(follower - np.polynomial.Polynomial(rule)(leader)))
    return np.max(gaps, axis=0)


def error(run):
    """Return the largest distance from the path [m]."""
    return np.linalg.norm(run["pose_error"][:, :3], axis=1).max()


@pytest.fixture
def write(tmp_path):
    def write(**about):
        (tmp_path / "arm.xml").write_text(palletizer(**about))
        return tmp_path / "arm.xml"

    return write


@pytest.mark.parametrize("about", ARMS.values(), ids=ARMS)
def test_it_keeps_its_path_as_the_ideal_arm_does_on_every_plant(write, about):
    """Within 0.1 mm, and 0.4 mm where the author's servos lag by M q̈/kv or by their time constant of some ms."""
    _, ideal = ran(write(**about), "ideal")
    assert ideal["slip"].max() < 1e-12
    inertia = about["mass"] * about["size"] ** 2
    own = {
        drives("motor"): 1e-4, drives("velocity", f'kv="{5.0 * inertia}"'): 4e-4,
        drives("position", f'kp="{2000.0 * inertia}" dampratio="1"'): 4e-4,
    }  # fmt: skip
    plants = [
        ("servo", "", 1e-4),
        ("torque", "", 1e-4),
        *(("model", element, most) for element, most in own.items()),
    ]
    if "softness" in about:  # on the author's own plant what he wrote stays: see below
        plants = plants[:2]
    for kind, element, most in plants:
        path = write(**about, more=f"<actuator>{element}</actuator>")
        prepared, run = ran(path, kind, gravity_compensation=True)
        assert error(run) - error(ideal) < most, (kind, element)
        assert_allclose(run["slip"], gap(prepared.arm.model, run["qpos"]), atol=1e-15)
        assert run["slip"].max() < 2e-6
        assert not (run["status"] & (Status.SLIPPED | Status.RATE_LIMITED)).any()
        assert np.abs(run["qdot"] - ideal["qdot"]).max() < 0.05
