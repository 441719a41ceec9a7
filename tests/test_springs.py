"""Springs of joints: the actuators carry them, as they carry weight, or it is told that they do not.

The oracle is the springs as they are written.
"""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from physics import moved

# A slide under a hinge, which an arm of two joints moves in a plane; a third joint follows the hinge.
ARM = """<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="0" type="capsule" size=".03"/></default>
<worldbody><body pos="0 0 .5"><joint name="slide" type="slide" axis="1 0 0" range="-.3 .3" {slide}/>
<geom fromto="0 0 0 .2 0 0" mass="2"/><body><joint name="hinge" axis="0 1 0" range="-2 2" {hinge}/>
<geom fromto="0 0 0 .4 0 0" mass="1"/><site name="tip" pos=".4 0 0"/>
<body pos=".2 0 0"><joint name="side" axis="0 1 0" {side}/><geom fromto="0 0 0 0 .1 0" mass=".2"/></body></body></body>
</worldbody>{tendon}<equality><joint joint1="side" joint2="hinge" polycoef=".1 -2 0 0 0"/></equality>{more}
<keyframe><key name="home" qpos=".05 -.6 1.3"/></keyframe></mujoco>"""
SLIDE, HINGE, SIDE = 0.05, -0.6, 1.3  # where they start
TENDON = """<tendon><fixed stiffness="300" springlength=".1"><joint joint="slide" coef="1"/>
<joint joint="hinge" coef=".5"/></fixed></tendon>"""
# What is written, and the torques at the start by hand: −stiffness · (q − springref), with polynomials of MuJoCo 4.
# The follower's counts −2 times at the hinge; the tendon's force acts with the coefficients.
SPRINGS = {
    "slide": ({"slide": 'stiffness="500" springref=".2"'}, (500.0 * (SLIDE - 0.2), 0.0)),
    "hinge": ({"hinge": 'stiffness="40" springref=".5"'}, (0.0, 40.0 * (HINGE - 0.5))),
    "follower": ({"side": 'stiffness="30" springref=".3"'}, (0.0, -2.0 * 30.0 * (SIDE - 0.3))),
    "polynomial": (
        {"hinge": 'stiffness="40 8 20" springref=".5"'},
        (0.0, 40.0 * (HINGE - 0.5) + 8.0 * (HINGE - 0.5) ** 2 + 20.0 * (HINGE - 0.5) ** 3),
    ),
    "tendon": ({"tendon": TENDON}, tuple(c * 300.0 * (SLIDE + 0.5 * HINGE - 0.1) for c in (1.0, 0.5))),
}


@pytest.fixture
def write(tmp_path):
    def write(**parts):
        text = ARM.format_map(dict.fromkeys(("slide", "hinge", "side", "tendon", "more"), "") | parts)
        (tmp_path / "arm.xml").write_text(text)
        return tmp_path / "arm.xml"

    return write


def ran(path, kind, by=(0.06, 0.0, -0.05), **plant):
    """Return a world, and what it did: a move of the tip, if any, and a pause."""
    move = ({"line": {"by": by}},) if any(by) else ()
    limits, inverse = {"velocity": 0.1, "acceleration": 0.5, "jerk": 5.0}, {"method": "inverse"}
    path_of_tip = (*move, {"hold": {"for": 0.1}})
    return moved(path, kind, path_of_tip, control={"inverse": inverse}, limits=limits, **plant)


@pytest.mark.parametrize(
    ("kind", "name"),
    [*(("servo", name) for name in SPRINGS), ("torque", "follower"), ("torque", "polynomial")],
)
def test_an_arm_at_rest_gives_what_its_springs_take_and_stays(write, kind, name):
    parts, torques = SPRINGS[name]
    prepared, run = ran(write(**parts), kind, by=(0.0, 0.0, 0.0))
    # the equality gives way to the follower's spring by 5e-5 rad
    assert_allclose(run["tau"][-1], torques, rtol=0, atol=1e-4 * max(map(abs, torques)))
    assert_allclose(run["q"], np.broadcast_to([SLIDE, HINGE], run["q"].shape), rtol=0, atol=1e-6)
    assert not any("spring" in one.text for one in prepared.assumed)
    if kind == "servo":  # negative control
        prepared, run = ran(
            write(**parts), kind, by=(0.0, 0.0, 0.0), gravity_compensation=False, gravity=(0.0, 0.0, 0.0)
        )
        assert np.abs(run["q"][-1] - [SLIDE, HINGE]).max() > 1e-4
        told = prepared.springs
        assert told in [one.text for one in prepared.assumed if one.is_otherwise]
        moved = [joint for joint, torque in zip(prepared.arm.joints, torques, strict=True) if torque]
        assert re.findall("slide|hinge", told) == moved
        for torque in filter(None, torques):
            assert f"{abs(torque):.3g} N" in told
