"""What the verbs do with files as their authors wrote them: a frame, packages, and what was assumed."""

import json

import mujoco
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from stl import tetrahedron

MODELS = ROOT / "tests/models"
FINGERS = str(MODELS / "gripper.xml")

SCENARIO = """\
name: own
arm: {{model: {model}{more}}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.01, 0.0]}}}}]}}
plant: {{kind: {plant}}}
"""


def test_what_was_assumed_is_said_once_and_is_in_the_json(rmrc):
    code, out, err = rmrc("inspect", FINGERS, "--json")
    assert code == 0
    (note,) = json.loads(out)["assumed"]
    assert note.startswith(
        'body "palm" is controlled, chosen by its name; others: site "mark", site "hand_camera"'
    )
    assert err == f"rmrc: note: {note}\n"


@pytest.mark.parametrize("verb", ["inspect", "ik", "statics"])
def test_a_body_is_asked_about_by_each_question(rmrc, verb):
    arguments = {"ik": ["--to-q", "0.1,0.2,0.3"], "statics": ["--wrench", "1,2,3"]}.get(verb, [])
    code, out, err = rmrc(verb, FINGERS, "--body", "palm", "--json", *arguments)
    assert code == 0 and "note" not in err
    assert json.loads(out)["site"] == "palm"
    if verb == "inspect":
        data = mujoco.MjData(mujoco.MjModel.from_xml_path(FINGERS))
        mujoco.mj_forward(data.model, data)
        assert_allclose(json.loads(out)["pose"][:3], data.body("palm").xpos, atol=1e-15)


def test_a_package_is_found_by_its_option_and_by_its_key(rmrc, tmp_path):
    (tmp_path / "parts/meshes").mkdir(parents=True)
    (tmp_path / "parts/meshes/link.stl").write_bytes(tetrahedron(0.2))
    (tmp_path / "arm.urdf").write_bytes((MODELS / "arm.urdf").read_bytes())
    _, _, err = rmrc("inspect", "arm.urdf")
    assert "note: package arm_description was not found above the file; give --package" in err
    code, _, err = rmrc("inspect", "arm.urdf", "--package", "arm_description=parts")
    assert code == 0 and "package" not in err
    (tmp_path / "own.yaml").write_text(
        SCENARIO.format(model="arm.urdf", more=", packages: {arm_description: parts}", plant="ideal")
    )
    code, _, err = rmrc("run", "own.yaml", "--quiet", "--no-record")
    assert code == 0 and "package" not in err
    facts = json.loads((tmp_path / "recordings/own.json").read_text())
    notes = facts["assumed"][:3]  # behind them stands what the run has otherwise than the model
    assert [note.split()[0] for note in notes] == ["body", "each", "body"]
    assert facts["scenario"]["arm"]["packages"] == {"arm_description": str(tmp_path / "parts")}
    for note in notes:
        assert err.count(f"rmrc: note: {note}\n") == 1


@pytest.mark.parametrize("plant", ["ideal", "servo", "torque"])
def test_a_scenario_without_a_frame_runs_and_names_it(rmrc, tmp_path, plant):
    (tmp_path / "own.yaml").write_text(SCENARIO.format(model=MODELS / "floating.xml", more="", plant=plant))
    code, _, err = rmrc("run", "own.yaml", "--quiet", "--no-record")
    assert code == 0
    assert 'note: body "palm" is controlled, chosen by its name' in err
    assert 'note: body "base" has a free joint in the file; it is fixed where keyframe "near" has it' in err


@pytest.mark.usefixtures("undrawn")
def test_tools_are_swept_and_each_run_has_its_own(rmrc, tmp_path):
    """Poses of the tool at the start differ by its length; worlds with other tools share no model."""
    (tmp_path / "own.yaml").write_text(
        SCENARIO.format(
            model=FINGERS, more=", tool: {body: palm, position: [0, 0, 0.1], mass: 0.2}", plant="servo"
        )
    )
    code, _, err = rmrc("sweep", "own.yaml", "--vary", "arm.tool.mass=0.1,5.0", "--quiet")
    assert (code, "error" in err) == (0, False)
    code, _, _ = rmrc("compare", "own.yaml", "--vary", "arm.tool.mass=0.1,5.0", "--no-record", "--quiet")
    assert code == 0
    light, heavy = json.loads((tmp_path / "recordings/own.compare.json").read_text())["variants"]
    assert light["scorecard"]["tau"] != heavy["scorecard"]["tau"]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (", body: plam", 'own.yaml:2:{column}: arm.body: {model}: has no body "plam"; did you mean "palm"?'),
        (", tool: {body: plam}", 'arm.tool.body: {model}: has no body "plam"'),
        (", tool: {model: none.xml}", 'arm.tool.model: no such file "'),
    ],
)
def test_a_frame_that_is_not_there_is_told_at_its_key(rmrc, tmp_path, more, says):
    (tmp_path / "own.yaml").write_text(SCENARIO.format(model=FINGERS, more=more, plant="ideal"))
    code, _, err = rmrc("run", "own.yaml")
    column = len(f"arm: {{model: {FINGERS}, body: ") + 1
    assert (code, err.count("\n")) == (2, 1)
    assert says.format(model=FINGERS, column=column) in err
