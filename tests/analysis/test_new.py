"""A first scenario for an arm: it runs as it is, its numbers are scaled to the arm, and the singularity is the arm's."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import yaml

import rmrc
from project import ROOT
from rmrc.analysis.new import LEAST, SLACK
from rmrc.analysis.new_motion import begin, judged, moves
from rmrc.analysis.scaling import ASSUMED_RATE, clear_of_singularities, nearest_singularity, scales
from rmrc.arm import load
from rmrc.scenario.choices import PLANTS, Status
from stl import tetrahedron

QUICK = ["planar_2link", "spherical_wrist"]


def model(name):
    return ROOT / f"models/{name}.xml"


def gantry(tmp_path, rates=True):
    """Return a model of two slides at right angles, which has no singularity at all."""
    limit = 'ctrllimited="true" ctrlrange="-0.5 0.5"' if rates else ""
    text = f"""<mujoco><worldbody><body name="x"><joint name="x" type="slide" axis="1 0 0" range="-1 1" limited="true"/>
      <geom size="0.05"/><body name="y"><joint name="y" type="slide" axis="0 1 0" range="-1 1" limited="true"/>
      <geom size="0.04" contype="0" conaffinity="0"/><site name="tool"/></body></body></worldbody>
      <actuator><velocity joint="x" kv="10" {limit}/><velocity joint="y" kv="10" {limit}/></actuator></mujoco>"""
    path = tmp_path / "gantry.xml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", QUICK)
def test_what_is_written_runs_and_meets_what_it_expects_on_every_plant(rmrc, name):
    assert rmrc("new", str(model(name)), "-o", "mine.yaml")[0] == 0
    for plant in PLANTS.names:
        assert rmrc("run", "mine.yaml", "--no-record", "--quiet", "--set", f"plant.kind={plant}")[0] == 0


def test_bounds_are_of_the_worst_plant():
    """The two links' own drives are its servos; with gravity they sag, and the bounds are theirs."""
    found = rmrc.new(ROOT / "tests/models/drives/position.xml")
    assert found.scorecards.keys() == set(PLANTS.names)
    errors = {name: card["position_error.end"].value for name, card in found.scorecards.items()}
    assert max(errors, key=errors.get) == "model" and errors["model"] > 10.0 * errors["servo"]
    bound = found.scenario.expect["position_error.end"].below
    assert SLACK * errors["model"] <= bound <= 1.11 * SLACK * errors["model"] and bound > LEAST


@pytest.mark.parametrize("name", QUICK)
def test_it_damps_near_the_singularity_alone_and_no_rate_is_cut(name):
    found = rmrc.new(name)
    run = rmrc.run(found.scenario)
    damped = (run["status"] & Status.DAMPED) != 0
    least, below = run["sigma"][:, -1], found.scenario.control.inverse.damping.below
    assert not damped[least >= below].any() and damped[least < 0.99 * below].all()
    assert not damped[0] and damped.any() and (~damped).mean() > 0.2 and least.min() < 0.5 * below
    assert (np.abs(run["qdot_cmd"]) < found.scales.rate).all()
    assert not (run["status"] & (Status.RATE_LIMITED | Status.POSITION_LIMITED | Status.STUCK)).any()
    assert found.move.faults == () and "fault" not in found.text
    # the motion must go below half of ε
    for times, names in ((1.9, ("sigma_min stays above half of `below`",)), (2.1, ())):
        move = replace(found.move, epsilon=times * least.min())
        assert judged(found.scales, move, run).faults == names


@pytest.mark.parametrize("name", ["planar_2link", "puma560"])
def test_a_motion_aside_is_a_fifth_of_the_arms_size_long(name):
    """Its rotation counts with the task's length; four digits are written."""
    found = scales(load(model(name)))
    aside = [each for each in moves(found) if each.how == "aside"]
    for each in aside:
        way = np.linalg.norm([*each.by, *(found.task.length * each.turn)])
        assert way == pytest.approx(0.2 * found.size, rel=1e-3)
    assert len(aside) == 2  # there and back


def test_the_size_is_the_rms_distance_of_the_site_from_the_axes():
    """Of two links of 1 m: distance 1 from the elbow, 2 + 2 cos θ₂ squared from the shoulder."""
    found = scales(load(model("planar_2link")))
    low, high = load(model("planar_2link")).position_limit[1]
    mean = 2.0 + 2.0 * (np.sin(high) - np.sin(low)) / (high - low)
    assert abs(found.size - np.sqrt((1.0 + mean) / 2.0)) < 0.05  # two digits, and 128 configurations
    assert found.task.length == 1.0  # linear rows alone: σ is in meters


@pytest.mark.parametrize(
    ("name", "joint", "away"), [("planar_2link", 1, 120.0), ("puma560", 4, 30.0), ("torus_3r", 2, 100.0)]
)
def test_the_nearest_singularity_is_that_of_the_closed_form(name, joint, away):
    """The elbow stretched, the middle axis of the wrist in line, the torus at its rim: a joint at 0."""
    arm = load(model(name))
    found, home = scales(arm), arm.configuration("home")[arm.wiring.qpos]
    near = nearest_singularity(found, home)
    assert near.is_singular and abs(near.q[joint]) < 1e-5
    assert abs(np.linalg.norm((near.q - home) / found.task.joint_scale) - np.radians(away)) < 1e-3
    lower, upper = arm.position_limit.T
    assert (near.q >= lower).all() and (near.q <= upper).all()
    # what is lost there costs no torque
    assert np.abs(arm.jacobian(near.q).T @ near.wrench).max() < 1e-5 * np.linalg.norm(near.wrench)


@pytest.mark.parametrize("name", ["ur5e", "puma560", "planar_3link"])
def test_a_start_aside_of_a_singularity_is_clear_of_it_and_near(name):
    """The σ_min of a draw within 1 rad is 2 ε or a little more, and 2.7 to 8 ε at its best."""
    arm = load(model(name))
    found = scales(arm)
    start = np.clip(np.zeros(arm.n), found.lower, found.upper)
    assert found.sigma_at(start) < 1e-6
    q = clear_of_singularities(found, start)
    sigma = np.linalg.svd(found.task.matrix(arm.jacobian(q)), compute_uv=False)[-1]
    assert 2.0 <= sigma / found.below < 2.4 and (q >= found.lower).all() and (q <= found.upper).all()


def test_an_arm_without_a_singularity_goes_aside_and_missing_limits_are_assumed(tmp_path):
    found = rmrc.new(gantry(tmp_path))
    assert found.move.how == "aside" and not found.move.nearest.is_singular and not found.problem
    run = rmrc.run(found.scenario)
    assert not (run["status"] & Status.DAMPED).any() and run.is_complete
    assert found.move.faults == ("it meets no singularity",) and found.move.faults[0] in found.text
    assert "rate limits: the model's" in found.text and found.scenario.control.limits.rate == (0.5, 0.5)
    missing = rmrc.new(gantry(tmp_path, rates=False))
    assert "# rate limits: ASSUMED 2 rad/s" in missing.text
    assert missing.scenario.control.limits.rate == (ASSUMED_RATE,) * 2  # times a length of 1 m


def test_a_singular_home_is_not_where_it_starts():
    arm = load(model("planar_2link"))
    assert begin(scales(arm))[1]
    arm.keyframes["home"][arm.wiring.qpos] = 0.0  # stretched
    found = scales(arm)
    start, is_home = begin(found)
    assert not is_home and found.sigma_at(start) >= 1.5 * found.below


def test_a_robot_of_a_package_without_sites_gets_a_scenario_that_runs(rmrc, tmp_path):
    """A URDF whose package is given, whose fingers branch from the last link, and which has no keyframe."""
    package = tmp_path / "elsewhere"
    (package / "meshes").mkdir(parents=True)
    (package / "meshes/link.stl").write_bytes(tetrahedron(0.2))
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot/arm.urdf").write_text((ROOT / "tests/models/arm.urdf").read_text())
    given = ["--package", f"arm_description={package}", "--body", "lower"]
    assert rmrc("check", "robot/arm.urdf", *given)[0] == 0
    assert rmrc("new", "robot/arm.urdf", *given, "-o", "mine/arm.yaml", "-q")[0] == 0
    section = yaml.safe_load((tmp_path / "mine/arm.yaml").read_text())
    assert section["arm"]["body"] == "lower" and "site" not in section["arm"]
    assert section["arm"]["packages"] == {"arm_description": "../elsewhere"}
    assert section["control"]["limits"]["rate"] == [1.5, ASSUMED_RATE]  # of the file, where it tells one
    code, _, err = rmrc("run", "mine/arm.yaml", "--no-record", "-q")
    assert code == 0, err


# Bodies within each other ---------------------------------------------------------------------------

# A base whose shape holds the last link; the link is no child of it, so MuJoCo pushes them apart.
WITHIN = """<mujoco><worldbody><body name="base"><joint name="a" axis="0 0 1" range="-170 170" limited="true"/>
  <geom size="{size}" mass="1"/><body name="upper" pos="0 0 {height}"><joint name="b" axis="0 1 0" range="-120 120" limited="true"/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".5"/><body name="lower" pos=".3 0 0"><joint name="c" axis="0 1 0" range="-120 120" limited="true"/>
  <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3"/><site name="tip" pos=".2 0 0"/></body></body></body></worldbody>
  <keyframe><key name="home" qpos="0 -0.6 0.9"/></keyframe></mujoco>"""
FAULTY = WITHIN.format(size=".7", height=".02")


def test_bodies_within_each_other_are_told_by_new_and_missed_by_the_run(rmrc, tmp_path):
    """MuJoCo's own contacts at the start say that they are; without the overlap both verbs are content."""
    (tmp_path / "arm.xml").write_text(FAULTY)
    code, out, err = rmrc("new", "arm.xml")
    text = (tmp_path / "arm.yaml").read_text()
    start = yaml.safe_load(text)["arm"]["start"]
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(FAULTY))
    data.qpos[:] = model.key("home").qpos if start == "home" else start
    mujoco.mj_forward(model, data)
    assert min(contact.dist for contact in data.contact) < 0.0
    assert code == 1 and "bodies penetrate each other at the start" in err.splitlines()[-1]
    assert "bodies penetrate each other" in " ".join(out.split())
    assert (
        "contact.time: {equals: 0, within: 0}" in text
        and "faults of the motion" in text.partition("name:")[0]
    )
    code, _, err = rmrc("run", "arm.yaml", "--no-record", "-q")
    assert code == 1 and "missed: contact." in err
    assert rmrc("new", "arm.xml", "-o", "-")[0] == 1
    (tmp_path / "sound.xml").write_text(WITHIN.format(size=".05", height=".1"))
    assert rmrc("new", "sound.xml", "-q")[0] == rmrc("run", "sound.yaml", "--no-record", "-q")[0] == 0


def test_the_first_lines_say_which_joints_tool_and_masses_are_assumed(tmp_path):
    text = FAULTY.replace('<site name="tip" pos=".2 0 0"/>', '<body name="hand" pos=".2 0 0"/>')
    path = tmp_path / "arm.xml"
    path.write_text(
        text.replace('mass=".3"', "").replace('size=".7"', 'size=".05"').replace("0 0 .02", "0 0 .1")
    )
    first = rmrc.new(path).text.partition("name:")[0].splitlines()
    told = dict(line.removeprefix("# ").split(": ", 1) for line in first[1:] if not line.startswith("#   "))
    assert told["joints"] == "all on the chain: a, b, c" and 'body "hand"' in told["tool"]
    # a capsule of 0.2 m and radius 0.02 m, full of water
    mass = 1000.0 * (np.pi * 0.02**2 * 0.2 + 4.0 / 3.0 * np.pi * 0.02**3)
    assert told["masses"] == f"ASSUMED, from shapes of 1000 kg/m^3: lower {mass:.3g} kg"
    two = rmrc.new(path, joints=["b", "c"]).assumed
    assert two["joints"] == "b, c; not driven: a"
    assert rmrc.new("puma560").assumed["masses"] == "those of the file"
