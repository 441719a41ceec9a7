"""A model as a linter sees it: each fault is found, by its code, and a model without it is not blamed."""

import json
import re

import mujoco
import numpy as np
import pytest

import rmrc
from project import ROOT
from rmrc.analysis.check.findings import CODES
from rmrc.arm import load
from rmrc.arm.inventory import contacts, other_joints
from rmrc.scenario.choices import PLANTS

SHIPPED = sorted(path.stem for path in (ROOT / "models").glob("*.xml"))
QUICK = ["planar_2link", "puma560"]

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
    "contact": '<contact><exclude body1="one" body2="three"/></contact>',
    "option": "",
    "extra": "",
}  # fmt: skip


def written(tmp_path, **changes):
    part = SOUND | changes
    keyframe = f'<keyframe><key name="home" qpos="{part["home"]}"/></keyframe>' if part["home"] else ""
    text = f"""<mujoco>{part["compiler"]}<option {part["option"]}/><worldbody>
      <body name="one"><joint name="a" limited="true" {part["first"]}/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".03"/>
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
    "follower-slip": {
        "extra": '<body pos="3 3 3"><joint name="d" axis="0 1 0"/><geom size=".1" pos=".5 0 0"/></body>',
        "home": "0.1 0.3 1.2 1.2",
        "contact": '<equality><joint joint1="d" joint2="c" solref=".1 1"/></equality>' + SOUND["contact"],
    },
    "range-missing": {"first": 'axis="0 0 1" range="-3 3" limited="false"'},
    "no-home": {"home": ""},
    "frame": {"more": '<site name="other"/>'},
    "actuator-other": {"actuator": SOUND["actuator"] + '<general site="tool" gear="0 0 0 0 0 0"/>'},
    "joint-other": {"extra": '<body name="thing" pos="3 3 3"><freejoint name="float"/><geom size=".1"/></body>'},
}  # fmt: skip
# What is found in a second of motion, most of the time of a check; the others are found without.
MOVED = {"diverged", "plant-differs", "motion-contact", "torque-saturated", "spring-load", "follower-slip"}
ALWAYS = {"axes"}


def found_in(path, **options):
    return {finding.code: finding for finding in rmrc.check(path, **options).findings}


def test_a_sound_model_has_nothing_to_be_mended(tmp_path):
    found = rmrc.check(written(tmp_path))
    assert found.is_ready and {finding.code for finding in found.findings} == ALWAYS


@pytest.mark.parametrize("code", sorted(FAULTS.keys() - ALWAYS))
def test_each_fault_is_found_by_its_code_with_a_way_out(tmp_path, monkeypatch, code):
    if code not in MOVED:
        monkeypatch.setattr("rmrc.analysis.check.check.motions", lambda *_: ())
    changes = dict(FAULTS[code])
    if "limited" in changes.get("first", ""):
        path = written(tmp_path)
        path.write_text(path.read_text().replace('name="a" limited="true"', 'name="a" limited="false"'))
    elif code == "joint-other":
        path = written(tmp_path, **changes, home=f"{SOUND['home']} 3 3 3 1 0 0 0")
    else:
        path = written(tmp_path, **changes)
    found = found_in(path)
    assert code in found and found[code].level == CODES[code][0]
    assert found[code].way or found[code].level == "note"
    assert "\n" not in found[code].text


def test_an_idle_joint_is_told(tmp_path):
    found = found_in(written(tmp_path), joints=["b", "c"])
    assert "joint a (hinge) moves the site" in found["joint-idle"].text


def test_a_plant_that_refuses_is_told():
    """The model plant needs actuators that move each joint."""
    found = found_in(ROOT / "tests/models/gripper.xml")["plant-refused"]
    assert found.text.startswith("the model plant refuses it: ")


def test_every_code_is_tried():
    never = {"plant-refused", "mujoco-warning"}  # of actuators, and of MuJoCo: below
    # of what was assumed: below; of data of a URDF: tests/test_urdf.py
    assumed = {"base-fixed", "assumed", "range-reversed", "unused", "frame-short"}
    assert FAULTS.keys() | ALWAYS | {"joint-idle"} | never | assumed == CODES.keys()


def test_what_was_assumed_is_told_by_findings_alone(rmrc, tmp_path):
    """A base that floats, no keyframe, joints without a name and no site: each is a note, and no other line."""
    text = written(tmp_path, home="").read_text()
    base = '<body name="base"><freejoint/><geom size=".1" contype="0" conaffinity="0"/>'
    floating = text.replace('<body name="one">', f'{base}<body name="one">')
    floating = floating.replace("</worldbody>", "</body></worldbody>").replace('name="b" ', "")
    floating = re.sub(r"<actuator>.*</actuator>|<site [^>]*>", "", floating, flags=re.DOTALL)
    (tmp_path / "floating.xml").write_text(floating)
    code, out, err = rmrc("check", "floating.xml", "--json")
    found = {finding["code"]: finding["text"] for finding in json.loads(out)["findings"]}
    assert code == 0 and "note" not in err
    assert 'body "base" has a free joint' in found["base-fixed"] and '"two_joint"' in found["assumed"]
    assert 'body "three" is controlled' in found["frame"] and "no-home" in found


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(one, marks=pytest.mark.long) for one in SHIPPED if one not in QUICK)]
)
def test_the_shipped_models_are_ready(name):
    found = rmrc.check(name)
    assert found.is_ready
    # σ at home by MuJoCo's own J and LAPACK
    model = found.arm.model
    data = mujoco.MjData(model)
    data.qpos[:] = found.arm.configuration("home")
    mujoco.mj_forward(model, data)
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], model.site(found.arm.site).id)
    task = found.scales.task
    own = [model.jnt_dofadr[model.joint(joint).id] for joint in found.arm.joints]
    if not found.arm.followers:
        scaled = J[task.rows][:, own] * task.row_scale[:, None] * task.joint_scale
        assert np.allclose(np.linalg.svd(scaled, compute_uv=False), found.sigma, atol=1e-12)
    assert {motion.plant for motion in found.motions} == set(PLANTS.names)
    assert not [motion.plant for motion in found.motions if motion.refused]
    for motion in (motion for motion in found.motions if not motion.refused):
        assert motion.scorecard["duration"].value == pytest.approx(1.0, abs=2e-3)
        assert motion.scorecard["completed"].value == 1.0


def test_what_touches_is_what_mujoco_finds(tmp_path):
    path = written(tmp_path, **FAULTS["home-contact"])
    arm = load(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = model.key("home").qpos
    mujoco.mj_forward(model, data)
    expected = {
        (frozenset(model.geom(int(g)).name or f"geom{g}" for g in one.geom), round(-one.dist, 12))
        for one in data.contact if one.dist < 0.0
    }  # fmt: skip
    found = contacts(arm, arm.configuration("home")[None])
    assert {(frozenset(one.geoms), round(one.depth, 12)) for one in found} == expected and expected
    assert [one.depth for one in found] == sorted((one.depth for one in found), reverse=True)
    excluded = written(tmp_path, geom=FAULTS["home-contact"]["geom"])
    assert len(contacts(load(excluded), arm.configuration("home")[None])) < len(expected)


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
    assert [one.name for one in other_joints(arm)] == ["f0", "f1"]


SPRINGS = """<mujoco><compiler angle="radian" autolimits="true"/><option integrator="implicitfast"/>
<default><geom contype="0" conaffinity="0"/></default><worldbody>
<body pos="0 0 .5"><joint name="j1" axis="0 1 0" range="-3 3" damping=".5" {first}/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="2"/>
<body pos=".4 0 0"><joint name="j2" axis="0 1 0" range="-2.8 2.8" damping=".3" {second}/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".025" mass="1"/>
<site name="tip" pos=".3 0 0"/></body></body></worldbody>
<actuator>{drives}</actuator><keyframe><key name="home" qpos=".5 -1.2"/></keyframe></mujoco>"""
RATES = '<velocity joint="j1" kv="300" ctrlrange="-.3 .3"/><velocity joint="j2" kv="150" ctrlrange="-.3 .3"/>'
WEAK = RATES.replace("kv=", 'forcerange="-1 1" kv=')
SOFT = '<position joint="j1" kp="300" dampratio="1"/><position joint="j2" kp="100" dampratio="1"/>'


@pytest.mark.parametrize(
    ("first", "second", "drives", "cause"),
    [
        ('stiffness="60" springref=".5"', 'stiffness="40"', RATES, "spring-load"),
        ("", 'stiffness="400"', RATES, "spring-load"),
        ("", "", WEAK, "torque-saturated"),
        ("", "", SOFT, "the model's own drives"),
    ],
)
def test_a_plant_that_errs_a_hundred_times_more_than_the_ideal_one_is_told_with_its_cause(
    tmp_path, first, second, drives, cause
):
    """The errors are compared with those of runs of the same motion: the metrics of the answer."""
    (tmp_path / "arm.xml").write_text(SPRINGS.format(first=first, second=second, drives=drives))
    checked = rmrc.check(tmp_path / "arm.xml")
    card = {motion.plant: motion.scorecard for motion in checked.motions}
    errors = {plant: figures["position_error.max"].value for plant, figures in card.items()}
    told = {
        finding.text.split()[2]: finding.text
        for finding in checked.findings
        if finding.code == "plant-differs"
    }
    far = {plant for plant, error in errors.items() if error > 100.0 * errors["ideal"]}
    assert "model" in far and far <= told.keys() and cause in told["model"]
    beyond = {
        plant
        for plant, figures in card.items()
        if figures["joint_rate.peak"].value > 1.05 * checked.scales.rate.max()
    }
    assert told.keys() <= far | beyond


def test_plants_that_follow_are_not_blamed(tmp_path):
    """The negative control: the same arm with motors and no springs."""
    drives = '<motor joint="j1"/><motor joint="j2"/>'
    (tmp_path / "arm.xml").write_text(SPRINGS.format(first="", second="", drives=drives))
    checked = rmrc.check(tmp_path / "arm.xml")
    assert "plant-differs" not in {finding.code for finding in checked.findings}
    assert len(checked.motions) == len(PLANTS.names)


@pytest.mark.parametrize("name", ["planar_2link", "planar_3link", "puma560"])
def test_inspect_check_and_a_new_scenario_scale_sigma_alike(name):
    """Also where a scenario states a length of its own: σ of its first tick is that of `inspect` and `check`."""
    made = rmrc.new(name, length=0.7)
    checked, inspected = rmrc.check(made.scenario), rmrc.inspect(made.scenario)
    assert checked.scales.task.length == inspected.task.length == made.scenario.task.length == 0.7
    assert made.move.is_home
    np.testing.assert_allclose(checked.sigma, inspected.sigma, rtol=1e-12)
    np.testing.assert_allclose(rmrc.run(made.scenario)["sigma"][0], checked.sigma, rtol=1e-9)
    assert rmrc.new(made.scenario).scenario.task.length == 0.7
    assert (
        rmrc.check(name).scales.task.length
        == rmrc.inspect(name).task.length
        == rmrc.new(name).scenario.task.length
    )


def test_the_motion_is_that_of_its_seed(tmp_path):
    path = written(tmp_path)
    peaks = [
        [motion.scorecard["joint_rate.peak"].value for motion in rmrc.check(path, seed=seed).motions]
        for seed in (1, 1, 2)
    ]
    assert peaks[0] == peaks[1] != peaks[2]


def test_warnings_of_mujoco_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr("rmrc.simulation.simulation.Simulation.warnings", lambda _: [{"CONTACTFULL": 3}])
    found = found_in(written(tmp_path))
    assert "CONTACTFULL, 3 times" in found["mujoco-warning"].text


def test_warnings_are_those_of_the_engine(tmp_path):
    """A load beyond all bounds counts as a bad state in MuJoCo's own counters."""
    from rmrc.scenario import loads
    from rmrc.simulation.prepare import prepare
    from rmrc.simulation.simulation import Simulation

    one = loads(
        f"name: x\narm: {{model: {written(tmp_path)}, site: tool}}\ntask: {{axes: [x, y, z]}}\n"
        "target: {path: [{hold: {for: 0.01}}]}\n"
    )
    simulation = Simulation([prepare(one), prepare(one.set({"plant.wrench": [0, 1e15, 0, 0, 0, 0]}))])
    simulation.run()
    fine, bad = simulation.warnings()
    assert fine == {}
    assert bad and all(name.startswith("BADQ") and count > 0 for name, count in bad.items())
