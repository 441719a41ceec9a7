"""URDF files: packages, meshes, masses, limits, joints that follow; beside MuJoCo's own reading of them."""

import json

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from project import ROOT
from replacing import replaced
from rmrc import arm as arms
from rmrc.recording.picture import shapes_of
from rmrc.support.errors import ModelError
from stl import tetrahedron
from wording import says

ARM = ROOT / "tests/models/arm.urdf"


@pytest.fixture
def folder(tmp_path):
    """A package with a mesh, and the file two folders below its top."""
    package = tmp_path / "ws/src/arm_v2"
    (package / "meshes").mkdir(parents=True)
    (package / "robots/urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>arm_description</name></package>")
    (package / "meshes/link.stl").write_bytes(tetrahedron(0.2))
    (package / "meshes/link.dae").write_text("<COLLADA/>")
    return package / "robots/urdf"


@pytest.fixture
def arm(folder):
    return arms.load(replaced(folder, ARM, {}))


def test_the_chain_and_its_pose_are_those_of_the_file(arm):
    """By the definition of URDF: each origin is a translation, then fixed x y z angles, then the joint."""
    assert (arm.site, arm.joints) == ("tool0", ("shoulder", "elbow"))
    q = np.array([0.3, -0.8])
    turn = Rotation.from_euler("z", q[0])
    elbow = turn * Rotation.from_euler("xyz", [0, 0.3, 0])
    bent = elbow * Rotation.from_euler("y", q[1])
    pose = arm.pose(q)
    assert_allclose(pose[:3], turn.apply([0.5, 0, 0]) + bent.apply([0.4, 0, 0]), atol=1e-15)
    whole = (bent * Rotation.from_euler("y", 1.5)).as_matrix()
    assert_allclose(Rotation.from_quat(pose[3:], scalar_first=True).as_matrix(), whole, atol=1e-15)


def test_limits_are_those_of_the_file_and_zero_is_none(arm):
    assert_allclose(arm.position_limit, [[-2, 1], [-np.inf, np.inf]])
    assert_allclose(arm.rate_limit, [1.5, np.inf])  # not 99, which is a transmission's
    assert_allclose(arm.torque_limit, [40, np.inf])


def test_a_joint_that_mimics_follows_by_an_equality(arm):
    model = arm.model
    assert model.neq == 1 and model.eq_type[0] == mujoco.mjtEq.mjEQ_JOINT
    assert [model.joint(i).name for i in (model.eq_obj1id[0], model.eq_obj2id[0])] == ["right", "left"]
    assert_allclose(model.eq_data[0, :5], [0.01, 1, 0, 0, 0])


def test_meshes_are_found_in_packages_and_those_that_cannot_be_read_are_left_out(arm):
    shapes = [shape for shape in shapes_of(arm) if shape.kind == "mesh"]
    assert len(shapes) == 1  # the .dae is not there
    # MuJoCo centers and turns it, as floats; distances between vertices stay, with the x axis scaled by a half
    ends = shapes[0].vertices
    spans = sorted(float(np.linalg.norm(ends[a] - ends[b])) for a in range(4) for b in range(a))
    diagonal = np.hypot(0.1, 0.2)
    assert_allclose(spans, [0.1, 0.2, 0.2, diagonal, diagonal, np.hypot(0.2, 0.2)], rtol=1e-6)
    assert arm.model.ngeom == 2  # the box is for contact, and has a better picture
    assert (
        arm.notes[0]
        == "body base is drawn without a missing mesh, or one in a format that MuJoCo cannot read"
    )


def test_a_link_without_mass_gets_the_least(arm):
    masses = {arm.model.body(i).name: arm.model.body_mass[i] for i in range(1, arm.model.nbody)}
    assert masses["upper"] == 2 and masses["lower"] == 1e-3 and masses["left_finger"] == 0.1
    assert_allclose(arm.model.body("lower").inertia, 1e-6)
    assert arm.notes[1].startswith("each link gets 0.001 kg and 1e-06 kg m^2 at least")


@pytest.mark.parametrize(
    ("moments", "balanced"),
    [
        ('ixx="0.1" iyy="0.2" izz="0.4"', [0.7 / 3] * 3),  # no body has it: 0.1 + 0.2 < 0.4
        ('ixx="0.1" iyy="0.2" izz="0.3"', [0.1, 0.2, 0.3]),  # a flat one
    ],
)  # fmt: skip
def test_an_inertia_that_no_body_can_have_is_balanced(folder, moments, balanced):
    arm = arms.load(replaced(folder, ARM, {'ixx="0.1" iyy="0.2" izz="0.2"': moments}))
    assert_allclose(np.sort(arm.model.body("upper").inertia), balanced, atol=1e-15)


def test_a_package_can_be_a_folder_of_its_name_or_be_given(tmp_path):
    (tmp_path / "ws/arm_description/meshes").mkdir(parents=True)
    (tmp_path / "ws/robots").mkdir()
    mesh = tmp_path / "ws/arm_description/meshes/link.stl"
    mesh.write_bytes(tetrahedron(0.2))
    path = replaced(tmp_path / "ws/robots", ARM, {})
    assert arms.load(path).model.nmesh == 1
    assert arms.files(path) == sorted([mesh, path])
    (tmp_path / "else").mkdir()
    path = replaced(tmp_path / "else", ARM, {})
    lost = arms.load(path)
    assert lost.model.nmesh == 0
    assert lost.notes[0].startswith("package arm_description was not found above the file; give --package")
    given = arms.load(path, packages={"arm_description": tmp_path / "ws/arm_description"})
    assert given.model.nmesh == 1


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({'<link name="tool0"/>': '<xacro:gripper parent="tool0"/>'},
         "arm.urdf: is a xacro file, which must be expanded first: xacro arm.urdf > arm.expanded.urdf"),
        ({'upper="1"': 'upper="nan"'}, "arm.urdf:6: limit: upper must be finite"),
        ({'izz="0.2"': 'izz="-0.1"'}, "inertia must have positive eigenvalues' in fullinertia Element name 'upper'"),
    ],
)  # fmt: skip
def test_what_will_not_do_is_one_line(folder, changes, says):
    with pytest.raises(ModelError) as caught:
        arms.load(replaced(folder, ARM, changes))
    assert says in str(caught.value) and "\n" not in str(caught.value)


LIMIT = '<limit lower="-2" upper="1" velocity="1.5" effort="40"/>'


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (LIMIT, '<limit lower="2" upper="1" effort="40"/>', "only if its <limit> has lower and a larger upper: shoulder (2 to 1)"),
        (LIMIT, f'{LIMIT}<safety_controller soft_lower_limit="-1" soft_upper_limit="0.5"/>', "soft limits … shoulder (-1 to 0.5)"),
        ('velocity="1.5"', 'velocity="1.5" drake:acceleration="3"', "drake:acceleration of <limit> is not used … shoulder (3)"),
        ('effort="40"', 'effort="-40"', "the sign of effort in <limit> is not used: shoulder (-40)"),
        ('velocity="1.5"', 'velocity="-1.5"', "velocity of <limit> is not used … shoulder (-1.5)"),
        ('velocity="0" effort="0"', 'lower="-1" upper="1"', "of a continuous joint are not used: elbow (-1 to 1)"),
        ('mimic joint="left"', 'mimic joint="lost"', '<mimic> is not used, as the file has no such joint that moves: right ("lost")'),
        ('rpy="0 0.3 0"', 'rpy="0 30 0"', "rpy of <origin> is read in rad, and seems to be in degrees: elbow (0 30 0)"),
    ],
)  # fmt: skip
def test_data_of_a_joint_that_are_not_used_are_told(folder, arm, old, new, told):
    robot = {"<robot ": '<robot xmlns:drake="http://drake.mit.edu" '}
    changed = arms.load(replaced(folder, ARM, robot | {old: new}))
    assert [str(line) for line in changed.notes if line not in arm.notes] == [says(f"… {told}")]


BOX = '<collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.1 0.1"/></geometry></collision>'
HEAVY = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
RANGE = '<limit lower="-1" upper="1" effort="100" velocity="2"/>'


def test_assumed_masses_are_told_where_torques_are(rmrc, tmp_path):
    """The weight of 5 kg, 0.25 m from the first hinge: its torque is wrong by as much as the mass is."""
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4} 0 0"/><axis xyz="0 1 0"/>{5}</joint>'
    joints = joint.format("j1", "revolute", "l0", "l1", 0, RANGE) + joint.format(
        "j2", "revolute", "l1", "l2", 0.5, RANGE
    )
    links = f'<link name="l0">{BOX}</link><link name="l1">{BOX}</link><link name="l2">{HEAVY}</link><link name="tool0"/>'
    tool = joint.format("t", "fixed", "l2", "tool0", 0.5, "")
    (tmp_path / "two.urdf").write_text(f'<robot name="two">{links}{joints}{tool}</robot>')
    line = "masses that the file lacks are assumed, 5 kg in all: l1 5 kg"
    code, out, err = rmrc("statics", "two.urdf", "--wrench", "0,0,0", "--gravity", "--json")
    assert code == 0 and line in err
    assert_allclose(json.loads(out)["gravity"], [-9.81 * (5 * 0.25 + 2 * 0.5), 0.0], atol=1e-12)
    assert line in rmrc("new", "two.urdf")[2]


def test_links_that_are_within_each_other_at_home_do_not_touch_and_others_do(folder):
    """Boxes of 0.3 m around hinges in a row, 0.1, 0.1 and 0.35 m apart: the first two joints leave three boxes
    within the first and each other, the last is free of all; folded at the second hinge, it comes to the first two."""
    box = '<collision><geometry><box size="0.3 0.3 0.3"/></geometry></collision>'
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(f'<link name="l{i}">{mass}{box}</link>' for i in range(4))
    hinges = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/><origin xyz="{x} 0 0"/>'
        '<axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>'
        for i, x in ((1, 0.1), (2, 0.1), (3, 0.35))
    )
    path = folder / "boxes.urdf"
    path.write_text(f'<robot name="r">{links}{hinges}</robot>')
    arm = arms.load(path)
    (ignored,) = [note for note in arm.notes if note.startswith("ignoring contacts ")]
    assert ignored.endswith(" at home: l0 and l1, l0 and l2")
    for fold, touching in ((0.0, set()), (2.5, {("l0", "l3"), ("l1", "l3")})):
        data = mujoco.MjData(arm.model)
        data.qpos[:] = [0.0, fold, 0.0]
        mujoco.mj_forward(arm.model, data)
        met = {tuple(arm.model.body(arm.model.geom_bodyid[g]).name for g in c.geom) for c in data.contact}
        assert met == touching
