"""The frame that is controlled where none is named, and one that is put on a body or a tool."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from project import ROOT
from replacing import replaced
from rmrc import arm as arms
from rmrc.scenario.sections import ToolSection

MODELS = ROOT / "tests/models"


@pytest.mark.parametrize(
    ("changes", "site", "why"),
    [
        # of sites on a finger, at a camera, on an axis and far down the arm none will do: the palm has the frame
        ({}, "palm", 'body "palm" is controlled, chosen by its name'),
        ({'body name="palm"': 'body name="x1"'}, "x1", 'body "x1" is controlled, chosen as the last before'),
        ({"hand_camera": "here"}, "here", 'site "here" is controlled, chosen as the only one on the last link'),
        # one jaw without a branch is a finger by its name, of body or of joint
        ({'<body name="right">': '<!--', 'name="grip_r"/></body>': "-->", 'name="left"': 'name="moving_jaw"'}, "palm", ""),

    ],
)  # fmt: skip
def test_the_hand_is_controlled_and_never_a_finger(tmp_path, changes, site, why):
    path = replaced(tmp_path, MODELS / "gripper.xml", changes)
    arm = arms.load(path)
    assert (arm.site, arm.joints) == (site, ("j1", "j2", "j3"))
    (note,) = arm.notes
    assert why in note
    assert 'site "ee_y"' in note or "ee_y" in changes  # what else there is


def urdf_of(tmp_path, *branches):
    """Return a URDF: each branch has the link where it begins, and its links; one without a joint is fixed."""
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    links, joints = ['<link name="base"/>'], []
    for branch in branches:
        for parent, words in pairwise(branch):
            name, _, follows = words.partition(" follows ")
            parent_link = parent.partition(" follows ")[0]
            kind = "fixed" if name.endswith(("tool0", "tip", "flange")) else "revolute"
            mimic = f'<mimic joint="{follows}_joint"/>' if follows else ""
            links.append(f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>')
            joints.append(
                f'<joint name="{name}_joint" type="{kind}"><parent link="{parent_link}"/>'
                f'<child link="{name}"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" '
                f'velocity="2"/>{mimic}</joint>'
            )
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="robot">{"".join(links + joints)}</robot>')
    return path


SIX = ("base", "l1", "l2", "l3", "l4", "l5", "l6")
PLANAR = ("base", "x", "y", "yaw")


@pytest.mark.parametrize(
    ("branches", "site", "n", "left_out"),
    [
        # balancer rods follow joints of the arm; without a mimic there may be more of them than of the arm's
        ([(*SIX, "tool0"), *(("l2", f"rod{k} follows l{k}") for k in (2, 3, 4))], "tool0", 6, ""),

        ([(*SIX, "tool0"), ("l1", *"abcdefg")], "tool0", 6, "--body g"),

        ([SIX, ("l6", "camera_tilt"), ("l6", "jaw")], "l6", 6, "--body jaw"),
        # a branch that no name explains is a warning, and so is a joint behind the tool, unless it is a jaw's
        ([SIX, ("l4", "pan", "tilt")], "l4", 4, "l5_joint, l6_joint of a longer chain; take all of it by --body l6 "),

        ([(*SIX, "tool0"), ("l6", "a_finger"), ("l6", "b_finger")], "tool0", 6, ""),
        # names of a gripper in a wrist, and of one that may be either
        ([(*SIX[:5], "gripper_a", "gripper_base", "tool0")], "tool0", 6, ""),

        # robots that are fingers
        ([("base", "finger_upper", "finger_lower", "finger_tip")], "finger_tip", 2, ""),

    ],
)  # fmt: skip
def test_the_tool_is_on_the_longest_chain_and_what_is_left_out_is_a_warning(
    tmp_path, branches, site, n, left_out
):
    path = urdf_of(tmp_path, *branches)
    arm = arms.load(path)
    assert (arm.site, arm.n) == (site, n)
    warnings = [note for note in arm.notes if getattr(note, "level", "") == "warning"]
    assert len(warnings) == bool(left_out) and left_out in "".join(warnings)
    if left_out:  # the command does what it says, and who names the frame hears no warning
        whole = arms.load(path, body=warnings[0].partition("--body ")[2].split()[0])
        assert whole.n >= n and not [note for note in whole.notes if "longer chain" in note]


@pytest.fixture
def data():
    model = mujoco.MjModel.from_xml_path(str(MODELS / "gripper.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = [0.4, -0.7, 0.3, 0.0, 0.0]
    mujoco.mj_forward(model, data)
    return data


def pose_of(arm):
    pose = arm.pose([0.4, -0.7, 0.3])
    return pose[:3], Rotation.from_quat(pose[3:], scalar_first=True)


@pytest.mark.parametrize(
    ("turned", "mass"),
    [
        ({"orientation": (0.1, 0.2, 0.3)}, {}),
        (
            {"orientation": (1.0, 2.0, 3.0, 4.0)},
            {"mass": 0.7, "center": (0.0, 0.01, 0.05), "inertia": (3e-3, 4e-3, 5e-3)},
        ),
    ],
)
def test_a_tool_is_a_frame_and_a_mass_on_a_body(data, turned, mass):
    tool = ToolSection(body="palm", position=(0.1, 0.2, 0.3), **turned, **mass)
    arm = arms.load(MODELS / "gripper.xml", tool=tool)
    position, turn = pose_of(arm)
    palm = Rotation.from_matrix(data.body("palm").xmat.reshape(3, 3))
    assert_allclose(position, data.body("palm").xpos + palm.apply([0.1, 0.2, 0.3]), atol=1e-15)
    values = turned["orientation"]
    is_quaternion = len(values) == 4
    own = (
        Rotation.from_quat(values, scalar_first=True) if is_quaternion else Rotation.from_euler("xyz", values)
    )
    assert_allclose(turn.as_matrix(), (palm * own).as_matrix(), atol=1e-14)
    # the weight that the drives bear more is m g at the center of mass: J^T f, by differences of its height
    plain = arms.load(MODELS / "gripper.xml", body="palm")
    q, h, m = np.array([0.4, -0.7, 0.3]), 1e-6, mass.get("mass", 0.0)
    more = arm.rest_torques(q)[0] - plain.rest_torques(q)[0]

    def height(at):
        pose = arm.pose(at)
        return (
            pose[:3] + Rotation.from_quat(pose[3:], scalar_first=True).apply(mass.get("center", (0, 0, 0)))
        )[2]

    slope = [(height(q + h * e) - height(q - h * e)) / (2 * h) for e in np.eye(3)]
    assert_allclose(more, m * 9.81 * np.array(slope), atol=1e-8)


def test_a_tool_may_be_another_model_with_joints_meshes_and_keyframes(tmp_path):
    """The gripper of one file on the arm of another is what MuJoCo's own <attach> makes of both."""
    (tmp_path / "hand").mkdir()
    hand = tmp_path / "hand/hand.xml"
    hand.write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body name="palm" pos="0 0 0.1"><freejoint/><geom size="0.1"/>'
        '<site name="pinch" pos="0.2 0 0"/><site name="other" pos="0 1 0"/><body name="f"><joint name="f" type="slide" range="0 0.1"/>'
        '<geom size="0.1"/></body></body></worldbody><keyframe><key name="open" qpos="0 0 0 1 0 0 0 0.05"/></keyframe></mujoco>'
    )
    path = ROOT / "models/planar_3link.xml"
    tool = ToolSection(body="link_3", position=(1.0, 0.0, 0.0), orientation=(0.0, 0.5, 0.0), model=hand)
    arm = arms.load(path, tool=tool)
    assert arm.site == "tool_pinch" and arm.n == 3
    assert arms.load(path, tool=tool.model_copy(update={"site": "other"})).site == "tool_other"
    home = arm.configuration("home")
    assert_allclose(home, [*arms.load(path).configuration("home"), 0.0])
    assert "tool_open" not in arm.keyframes  # it says nothing of the arm
    pose, link = arm.pose(home[:3]), arms.load(path, body="link_3").pose(home[:3])
    turn = Rotation.from_quat(link[3:], scalar_first=True)
    inner = Rotation.from_euler("y", 0.5)
    # the palm's own place is that of its floating body in the file
    assert_allclose(
        pose[:3], link[:3] + turn.apply(np.array([1.0, 0.0, 0.0]) + inner.apply([0.2, 0, 0.1])), atol=1e-15
    )
