"""A parcel: all files that a sweep needs, laid out so that they find each other, and nothing outside."""

import gc
import os
from dataclasses import replace
from pathlib import Path

import pytest

from project import ROOT
from rmrc.arm import files, load_asked
from rmrc.scenario import Scenario, changes_of, draft_of, load
from rmrc.study.parcel import Unpacked, pack
from rmrc.study.rows import fingerprint
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Problem
from stl import tetrahedron
from wording import says

TEXT = """
name: quick
arm: {model: ../models/arm.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.004, 0.0]}}]}
"""
TETRAHEDRON = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def path(tmp_path):
    """Return a scenario beside its model, which includes a file of a third folder."""
    text = (ROOT / "models/planar_2link.xml").read_text()
    for name in ("models", "scenarios", "parts"):
        (tmp_path / name).mkdir()
    (tmp_path / "parts/world.xml").write_text((ROOT / "models/common/world.xml").read_text())
    (tmp_path / "models/arm.xml").write_text(text.replace("common/world.xml", "../parts/world.xml"))
    path = tmp_path / "scenarios/quick.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture
def set_aside():
    """Set aside what other tests left, in which to look for garbage takes a second."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("set_aside")
def test_a_model_is_packed_with_all_that_it_includes_and_unpacked_where_it_finds_it(path, tmp_path):
    parcel = pack(draft_of(path, ["sweep.vary.control.feedback=[5, 6]"]))
    assert set(parcel.files) == {"models/arm.xml", "parts/world.xml"}
    for one in (path, *tmp_path.glob("*/*.xml")):
        one.unlink()
    (tmp_path / "worker").mkdir()
    there = Unpacked(parcel, str(tmp_path / "worker"))
    assert there.study.prepare(changes_of({"control.feedback": 6})).scenario.control.feedback == 6
    assert there.study.prepare(changes_of({"control.feedback": 6})).arm.path.is_relative_to(
        tmp_path / "worker"
    )
    told = there.told(Problem((), f"{there.folder}/models/arm.xml: is wrong"))
    assert str(told) == f"{tmp_path}/models/arm.xml: is wrong"
    del there
    gc.collect()
    assert list((tmp_path / "worker").iterdir()) == []  # removed with what held it


def test_the_parcel_of_a_scenario_made_in_python_finds_its_model_there(path, tmp_path):
    made = Scenario.model_validate(load(path).model_dump())
    (tmp_path / "worker").mkdir()
    there = Unpacked(pack(made.draft), str(tmp_path / "worker"))
    for one in tmp_path.glob("*/*.xml"):
        one.unlink()
    prepared = there.study.prepare(changes_of({"control.feedback": 6}))
    assert prepared.scenario.control.feedback == 6
    assert prepared.arm.path.is_relative_to(tmp_path / "worker")


def test_meshes_textures_and_height_fields_are_among_the_files_of_a_model(tmp_path):
    (tmp_path / "meshes").mkdir()
    for name in ("meshes/t.obj", "meshes/h.png", "t.png"):
        (tmp_path / name).write_text(TETRAHEDRON)
    (tmp_path / "arm.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="m" file="t.obj"/>'
        '<hfield name="h" file="h.png" size="1 1 1 1"/><texture name="t" type="2d" file="t.png"/></asset></mujoco>'
    )
    found = {str(file.relative_to(tmp_path)) for file in files(tmp_path / "arm.xml")}
    assert found == {"arm.xml", "meshes/t.obj", "meshes/h.png", "t.png"}
    (tmp_path / "broken.xml").write_text("<mujoco>")
    assert files(tmp_path / "broken.xml") == [tmp_path / "broken.xml"]


@pytest.mark.parametrize("name", ["../outside.xml", "a/../../outside.xml", "/outside.xml"])
def test_no_file_of_a_parcel_leaves_its_folder(path, tmp_path, name):
    parcel = pack(draft_of(path, ["sweep.vary.control.feedback=[5, 6]"]))
    (folder := tmp_path / "worker").mkdir()
    with pytest.raises(ValueError, match="must not write outside its folder"):
        Unpacked(replace(parcel, files={name: b"<mujoco/>"}), str(folder))
    assert not (folder / "outside.xml").exists()
    assert not Path(os.sep, "outside.xml").exists()


def test_a_linked_model_finds_what_lies_beside_its_own_file(path, tmp_path):
    (tmp_path / "scenarios/link.xml").symlink_to(tmp_path / "models/arm.xml")
    overrides = ["sweep.vary.arm.model=[link.xml, ../models/arm.xml]"]
    parcel = pack(draft_of(path, overrides))
    assert parcel.models["link.xml"] == parcel.models["../models/arm.xml"]
    assert Unpacked(parcel).study.prepare(changes_of({"arm.model": "link.xml"})).arm.joints == (
        "shoulder",
        "elbow",
    )


@pytest.mark.parametrize("key", ["arm.model", "arm"])
def test_a_file_that_a_varied_model_includes_is_part_of_the_sweep(path, tmp_path, key):
    (tmp_path / "models/other.xml").write_text((tmp_path / "models/arm.xml").read_text())
    models = ["../models/arm.xml", "../models/other.xml"]
    start = "site: tip, start: [60 deg, -120 deg]"
    values = models if key == "arm.model" else [f"{{model: {model}, {start}}}" for model in models]
    overrides = [f"sweep.vary.{key}=[{', '.join(values)}]"]
    Sweep(path, overrides, tmp_path / "out").check()
    assert Sweep(path, overrides, tmp_path / "out").is_checked
    world = tmp_path / "parts/world.xml"
    text = world.read_text()
    world.write_text(text.replace("<mujoco", "<!-- another light --><mujoco", 1))
    with pytest.raises(ScenarioError) as caught:
        Sweep(path, overrides, tmp_path / "out")
    assert str(caught.value) == says(f"{tmp_path}/out/quick.sweep: … (sweep … --out")
    world.write_text(text)
    assert Sweep(path, overrides, tmp_path / "out").is_checked  # negative control: it was that file


def test_a_models_fingerprint_is_of_what_it_is_and_not_of_where_it_lies(path, tmp_path):
    prints = []
    for place in ("a", "b/c", "a-path-so-long-that-the-memory-of-the-model-is-larger/" * 3):
        (folder := tmp_path / place).mkdir(parents=True)
        (folder / "t.obj").write_text(TETRAHEDRON)
        asset = '<asset><mesh name="t" file="t.obj"/></asset><worldbody><geom type="mesh" mesh="t" pos="0 0 -2"/></worldbody>'
        text = (ROOT / "models/planar_2link.xml").read_text().replace("common/", f"{ROOT}/models/common/")
        (folder / "arm.xml").write_text(text.replace("</mujoco>", f"{asset}</mujoco>"))
        sweep = Sweep(path, [f"arm.model={folder}/arm.xml", "sweep.vary.control.feedback=[5, 6]"], tmp_path)
        prints.append(fingerprint(sweep._prepare(0).arm))
    assert len(set(prints)) == 1
    (folder / "arm.xml").write_text(
        text.replace("</mujoco>", f"{asset}</mujoco>").replace("0 0 -2", "0 0 -3")
    )
    sweep = Sweep(path, [f"arm.model={folder}/arm.xml", "sweep.vary.control.feedback=[5, 6]"], tmp_path)
    assert fingerprint(sweep._prepare(0).arm) != prints[0]


def test_the_packages_of_a_urdf_and_the_model_of_a_tool_are_packed(tmp_path):
    for name in ("robot", "mesh_package/meshes", "tools", "worker"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "mesh_package/meshes/link.stl").write_bytes(tetrahedron(0.2))
    text = (
        (ROOT / "tests/models/arm.urdf")
        .read_text()
        .replace("package://arm_description", "package://meshes_of_arm")
    )
    (tmp_path / "robot/arm.urdf").write_text(text)
    tool = '<mujoco><worldbody><body name="drill"><geom size=".02" mass="{}"/><site name="bit" pos="0 0 .1"/></body></worldbody></mujoco>'
    for mass in (1, 2):
        (tmp_path / f"tools/{mass}.xml").write_text(tool.format(mass))
    (tmp_path / "quick.yaml").write_text(
        "name: quick\narm: {model: robot/arm.urdf, packages: {meshes_of_arm: mesh_package}, tool: {model: tools/1.xml}}\n"
        "task: {axes: [x, y]}\ntarget: {path: [{hold: {for: 0.01}}]}\n"
    )
    draft = draft_of(tmp_path / "quick.yaml", ["sweep.vary={arm.tool.model: [tools/1.xml, tools/2.xml]}"])
    parcel = pack(draft)
    assert {"robot/arm.urdf", "mesh_package/meshes/link.stl", "tools/1.xml", "tools/2.xml"} <= set(
        parcel.files
    )
    before = Sweep(draft.scenario())._identify()
    (tmp_path / "tools/2.xml").write_text(tool.format(3))
    assert Sweep(draft.scenario())._identify() != before
    meshes = load_asked(draft.scenario().arm).model.nmesh
    for name in ("robot/arm.urdf", "mesh_package/meshes/link.stl", "tools/1.xml", "tools/2.xml"):
        (tmp_path / name).unlink()
    there = Unpacked(parcel, str(tmp_path / "worker"))
    arm = there.study.prepare(changes_of({"arm.tool.model": "tools/2.xml"})).arm
    assert arm.model.nmesh == meshes > 0
    assert arm.model.body_mass[-1] == 2.0


def test_a_recorded_motion_is_packed_and_its_contents_are_part_of_the_sweep(path, tmp_path):
    rows = "t,x,y,z,qw,qx,qy,qz\n0,0.5,0.5,0,1,0,0,0\n1,0.6,0.5,0,1,0,0,0\n"
    for name in ("a.csv", "b.csv"):
        (tmp_path / "scenarios" / name).write_text(rows)
    changes = [
        "target.path=[{file: {path: a.csv, speed: auto}}]",
        "sweep.vary={'target.path[0].file.path': [a.csv, b.csv]}",
    ]
    draft = draft_of(path, changes)
    assert draft.motions == ["a.csv", "b.csv"]
    before = Sweep(draft.scenario())._identify()
    parcel = pack(draft)
    assert {"scenarios/a.csv", "scenarios/b.csv"} < set(parcel.files)
    (tmp_path / "scenarios/b.csv").write_text(rows.replace("0.6", "0.7"))
    assert Sweep(draft.scenario())._identify() != before
    for one in tmp_path.glob("scenarios/*"):
        one.unlink()
    (tmp_path / "worker").mkdir()
    there = Unpacked(parcel, str(tmp_path / "worker"))
    prepared = there.study.prepare(changes_of({"target.path[0].file.path": "b.csv"}))
    assert abs(prepared.reference.pose[-1, 0] - 0.6) < 1e-12
