"""A model as a linter sees it: each fault is found, by its code, and a model without it is not blamed."""

import json
import re

import numpy as np
import pytest

import rmrc
from project import ROOT
from rmrc.analysis.check import CODES, difference
from rmrc.analysis.scaling import scales
from rmrc.arm import load
from rmrc.arm.inventory import contacts, other_joints
from rmrc.results.scorecard import Figure
from rmrc.scenario.choices import PLANTS

# Three links of 0.4 m in space; what is in braces is varied.
SOUND = {
    "compiler": '<compiler angle="radian"/>',
    "first": 'axis="0 0 1" range="-3 3"',
    "second": 'axis="0 1 0" range="-2 2"',
    "third": 'axis="0 1 0" range="-2.5 2.5"',
    "geom": "",
    "more": "",
    "actuator": "".join(
        f'<velocity joint="{name}" kv="50" ctrllimited="true" ctrlrange="-2 2" forcelimited="true" '
        'forcerange="-200 200"/>' for name in "abc"
    ),
    "home": "0.1 0.3 1.2",
    "limited": 'limited="true"',
    "contact": '<contact><exclude body1="one" body2="three"/></contact>',
    "extra": "",
}  # fmt: skip


def written(tmp_path, **changes):
    part = SOUND | changes
    keyframe = f'<keyframe><key name="home" qpos="{part["home"]}"/></keyframe>' if part["home"] else ""
    text = f"""<mujoco>{part["compiler"]}<worldbody>
      <body name="one"><joint name="a" {part["limited"]} {part["first"]}/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".03"/>
      <body name="two" pos="0 0 .4"><joint name="b" limited="true" {part["second"]}/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/>
      <body name="three" pos=".4 0 0"><joint name="c" limited="true" {part["third"]}/>
      <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/>{part["geom"]}<site name="tool" pos=".4 0 0"/>
      {part["more"]}</body></body></body>{part["extra"]}</worldbody>
      <actuator>{part["actuator"]}</actuator>{part["contact"]}{keyframe}</mujoco>"""
    path = tmp_path / "arm.xml"
    path.write_text(text)
    return path


def ball(gap):
    """Return a ball in the world that is some way off the end of the last link at home [m]."""
    x, z = 0.4 * (np.cos(0.3) + np.cos(1.5)), 0.4 * (1.0 - np.sin(0.3) - np.sin(1.5))
    far = 0.1 + 0.03 + gap
    x, z = x + far * np.cos(1.5), z - far * np.sin(1.5)
    return f'<geom name="ball" size=".1" pos="{x * np.cos(0.1)} {x * np.sin(0.1)} {z}"/>'


# What each code is found in: one change of the sound model.
NO_LIMITS = '<motor joint="a"/><motor joint="b"/><motor joint="c"/>'
FAULTS = {
    "home-outside-limits": {"home": "0.1 0.3 2.9"},
    "home-contact": {"geom": '<geom name="elbow" type="sphere" size=".36" pos="-.2 0 0"/>', "contact": ""},
    "home-touch": {"extra": ball(-0.0005)},
    "diverged": {"third": 'axis="0 1 0" range="-2.5 2.5" damping="-1e9"'},
    "rank-deficient": {"second": 'axis="0 0 1" range="-2 2"'},
    "range-suspicious": {"compiler": '<compiler angle="degree"/>', "home": "0 0.01 0.02"},
    "scale-suspicious": {"geom": '<geom size="60" contype="0" conaffinity="0" mass="1"/>'},
    "home-singular": {"home": "0.1 0.3 0"},
    "rate-limit-missing": {"actuator": NO_LIMITS},
    "torque-limit-missing": {"actuator": NO_LIMITS},
    "motion-contact": {"extra": ball(0.001)},
    "torque-saturated": {"actuator": SOUND["actuator"].replace("-200 200", "-.01 .01")},
    "spring-load": {"third": 'axis="0 1 0" range="-2.5 2.5" stiffness="5"'},
    "plant-differs": {"third": 'axis="0 1 0" range="-2.5 2.5" stiffness="500"'},
    "plant-refused": {"actuator": ""},
    "follower-slip": {
        "extra": '<body pos="3 3 3"><joint name="d" axis="0 1 0"/><geom size=".1" pos=".5 0 0"/></body>',
        "home": "0.1 0.3 1.2 1.2",
        "contact": '<equality><joint joint1="d" joint2="c" solref=".1 1"/></equality>' + SOUND["contact"],
    },
    "range-missing": {"first": 'axis="0 0 1"', "limited": ""},
    "no-home": {"home": ""},
    "frame": {"more": '<site name="other"/>'},
}  # fmt: skip
# What a motion is not needed for, which is most of the time of a check.
STILL = FAULTS.keys() - {
    "diverged", "plant-differs", "plant-refused", "motion-contact", "torque-saturated", "spring-load",
    "follower-slip",
}  # fmt: skip


def found_in(path, **options):
    return {finding.code: finding for finding in rmrc.check(path, **options).findings}


def test_a_sound_model_has_nothing_to_be_mended(tmp_path):
    found = rmrc.check(written(tmp_path))
    assert found.is_ready and found.findings == ()


@pytest.mark.parametrize(("half", "is_told"), [(0.05, True), (0.07, False)])
def test_ranges_of_six_degrees_and_less_are_told(tmp_path, half, is_told):
    axes = {"first": "0 0 1", "second": "0 1 0", "third": "0 1 0"}
    parts = {name: f'axis="{axis}" range="-{half} {half}"' for name, axis in axes.items()}
    assert ("range-suspicious" in found_in(written(tmp_path, **parts, home="0 0.01 0.02"))) == is_told


def test_a_plant_differs_by_a_hundred_times_the_ideal_error_or_a_rate_beyond_its_limit():
    """An ideal error below a millionth of the arm's size counts as that."""
    found = scales(load(ROOT / "models/planar_2link.xml"))
    joint, limit, least = found.task.arm.joints[0], found.rate[0], 1e-6 * found.size

    def told(error, ideal, rate=0.0):
        cards = [
            {"position_error.max": Figure(value, "m", "")}
            | {f"joint_rate.{name}.peak": Figure(0.0, "rad/s", "") for name in found.task.arm.joints}
            for value in (error, ideal)
        ]
        cards[0][f"joint_rate.{joint}.peak"] = Figure(rate, "rad/s", "")
        return difference(found, *cards)

    assert told(0.99, 0.01) == told(99.0 * least, 0.0) == told(0.0, 0.0, 1.04 * limit) == ""
    assert "is 101 times that of the ideal plant" in told(1.01, 0.01)
    assert "is 101 times that of the ideal plant" in told(101.0 * least, 0.0)
    assert f"{joint} moves at" in told(0.0, 0.0, 1.06 * limit)


@pytest.mark.parametrize("code", sorted(FAULTS))
def test_each_fault_is_found_by_its_code_with_a_way_out(tmp_path, monkeypatch, code):
    if code in STILL:
        monkeypatch.setattr("rmrc.analysis.check.motions", lambda *_: ())
    found = found_in(written(tmp_path, **FAULTS[code]))
    assert code in found and found[code].level == CODES[code]
    assert found[code].way or found[code].level == "note"
    assert "\n" not in found[code].text


def test_every_code_is_tried():
    # what was assumed: below; data of a URDF: tests/test_urdf.py, tests/test_controlled_frame.py
    elsewhere = {"joint-idle", "base-fixed", "assumed", "range-reversed", "unused", "frame-short"}
    assert FAULTS.keys() | elsewhere == CODES.keys()


def test_what_was_assumed_is_told_by_findings_alone(rmrc, tmp_path):
    """A base that floats, no keyframe, joints without a name and no site: each is a note, and no other line."""
    text = written(tmp_path, home="").read_text()
    base = '<body name="base"><freejoint/><geom size=".1" contype="0" conaffinity="0"/>'
    floating = text.replace('<body name="one">', f'{base}<body name="one">')
    floating = floating.replace("</worldbody>", "</body></worldbody>").replace('name="b" ', "")
    floating = re.sub(r"<actuator>.*</actuator>|<site [^>]*>", "", floating, flags=re.DOTALL)
    (tmp_path / "floating.xml").write_text(floating)
    code, out, err = rmrc("check", "floating.xml", "--joints", "two_joint,c", "--json")
    found = {finding["code"]: finding["text"] for finding in json.loads(out)["findings"]}
    assert code == 0 and "note" not in err
    assert 'body "base" has a free joint' in found["base-fixed"] and '"two_joint"' in found["assumed"]
    assert 'body "three" is controlled' in found["frame"] and "no-home" in found
    assert "joint a moves the site" in found["joint-idle"]


def test_a_shipped_model_is_ready():
    found = rmrc.check("puma560")
    assert found.is_ready and [motion.plant for motion in found.motions] == list(PLANTS.names)
    for motion in found.motions:
        assert not motion.refused and motion.scorecard["completed"].value == 1.0
        assert motion.scorecard["duration"].value == pytest.approx(1.0, abs=2e-3)


def test_a_contact_that_no_joint_of_the_arm_can_undo_is_no_fault(tmp_path):
    """A gripper's fingers: both move with the last link, and touch each other."""
    fingers = "".join(
        f'<body name="f{i}" pos=".45 0 0"><joint name="f{i}" type="slide" axis="0 1 0" range="-.1 .1"/>'
        '<geom size=".02" mass=".01"/></body>' for i in range(2)
    )  # fmt: skip
    path = written(tmp_path, more=fingers, home=f"{SOUND['home']} 0 0")
    arm = load(path)
    (met,) = contacts(arm, arm.configuration("home")[None])
    assert not met.is_moved and {"home-contact", "home-touch"}.isdisjoint(found_in(path))
    assert other_joints(arm) == ("f0", "f1")
