"""What an arm stands on, where it starts, and files that consist of others."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from replacing import replaced
from rmrc import arm as arms
from rmrc.support.errors import ModelError
from stl import tetrahedron

MODELS = ROOT / "tests/models"
FLOATING = MODELS / "floating.xml"


def test_a_base_that_floats_stands_where_its_keyframe_has_it():
    """Everything is where MuJoCo has it in that keyframe of the file itself; things that float go on floating."""
    arm = arms.load(FLOATING)
    author = mujoco.MjModel.from_xml_path(str(FLOATING))
    data = mujoco.MjData(author)
    key = author.key("near").id  # "far" has a joint beyond its limit
    mujoco.mj_resetDataKeyframe(author, data, key)
    mujoco.mj_forward(author, data)
    assert arm.joints == ("turn", "palm_joint") and arm.model.nq == 9  # two, and seven of the cube
    home = arm.configuration("home")
    assert_allclose(home, data.qpos[7:])
    ours = mujoco.MjData(arm.model)
    ours.qpos[:] = home
    mujoco.mj_forward(arm.model, ours)
    # the author's quaternion is 0.6 0 0.8 0 of norm 1
    assert_allclose(ours.xpos, data.xpos, atol=1e-14)
    assert_allclose(ours.xmat, data.xmat, atol=1e-14)
    full = np.zeros((6, author.nv))
    mujoco.mj_jacBody(author, data, full[:3], full[3:], author.body("palm").id)
    assert_allclose(arm.jacobian(home[:2]), full[:, 6:8], atol=1e-14)
    # the controls of the author's actuators stay with their keyframes
    assert_allclose(arm.model.key("near").ctrl, [0.5])
    assert arm.notes[1:] == (
        'joints without a name are called "palm_joint"',
        'body "base" has a free joint in the file; it is fixed where keyframe "near" has it',
        'there is no keyframe home; "near" replaces it, the first within limits',
    )


@pytest.mark.parametrize(
    ("changes", "home", "note"),
    [
        ({}, [0.5, 0.1], '"near" replaces it, the first within limits'),

        ({'"far"': '"home"'}, [3.0, 0.0], ""),  # as its author wants it
        (None, [0.5, 0.1], "number 0, which has no name"),  # the only one
        ({'qpos="1 2 3 0.6 0 0.8 0 0.5': 'qpos="1 2 3 0.6 0 0.8 0 2'}, [0.0, 0.0], ""),  # neither is within
    ],
)  # fmt: skip
def test_home_is_the_keyframe_of_that_name_or_the_only_one_or_one_within_limits(
    tmp_path, changes, home, note
):
    if changes is None:
        text = FLOATING.read_text()
        first = text[text.index('<key name="far"') : text.index('<key name="near"')]
        changes = {first: "", 'name="near" ': ""}
    arm = arms.load(replaced(tmp_path, FLOATING, changes))
    assert_allclose(arm.configuration("home")[:2], home)
    told = [each for each in arm.notes if "keyframe home" in each]
    assert (note in told[0]) if note else not told


def test_joints_may_be_named_in_any_order_and_go_outward():
    arm = arms.load(MODELS / "gripper.xml", body="palm", joints=["j3", "j1"])
    assert arm.joints == ("j1", "j3")
    assert arm.notes == ("list joints, and values for them, from the base outward: j1, j3",)
    with pytest.raises(ModelError, match='joint "j1" is listed twice'):
        arms.load(MODELS / "gripper.xml", body="palm", joints=["j1", "j1"])


def test_a_file_that_attaches_another_works_from_any_folder(tmp_path, monkeypatch):
    """Meshes lie beside the file that is attached; MuJoCo's own model is the oracle."""
    (tmp_path / "there/parts/meshes").mkdir(parents=True)
    for name in ("attached.xml", "parts/part.xml"):
        (tmp_path / "there" / name).write_bytes((MODELS / name).read_bytes())
    (tmp_path / "there/parts/meshes/part.stl").write_bytes(tetrahedron(0.1))
    (tmp_path / "here").mkdir()
    oracle = mujoco.MjModel.from_xml_path(str(tmp_path / "there/attached.xml"))
    monkeypatch.chdir(tmp_path / "here")
    arm = arms.load(Path("../there/attached.xml"))
    assert arm.site == "p_tcp" and arm.joints == ("base", "p_part")
    assert_allclose(arm.model.mesh_vert, oracle.mesh_vert)
    assert_allclose(arm.adapted(None, 0.001, gravity_compensation=False).mesh_vert, oracle.mesh_vert)
    names = {file.name for file in arms.files((tmp_path / "there/attached.xml").resolve())}
    assert names == {"attached.xml", "part.xml", "part.stl"}
