"""A parcel: all files that a sweep needs, unpacked below a folder where its runs find them."""

import threading

import pytest

from project import ROOT
from rmrc.scenario import Scenario, load
from rmrc.study.plan import plan_of
from rmrc.study.runs import Runs, pack
from stl import tetrahedron

TEXT = """
name: quick
arm: {model: ../models/arm.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.004, 0.0]}}]}
sweep: {vary: {control.feedback: [5, 6]}}
"""


@pytest.fixture
def path(tmp_path):
    """Return a scenario beside its model, which includes a file of a third folder and has a mesh."""
    for name in ("project/models", "project/scenarios", "project/parts", "worker"):
        (tmp_path / name).mkdir(parents=True)
    text = (ROOT / "models/planar_2link.xml").read_text().replace("common/world.xml", "../parts/world.xml")
    asset = '<asset><mesh name="t" file="t.stl"/></asset><worldbody><geom type="mesh" mesh="t" pos="0 0 -2"/></worldbody>'
    (tmp_path / "project/models/arm.xml").write_text(text.replace("</mujoco>", f"{asset}</mujoco>"))
    (tmp_path / "project/models/t.stl").write_bytes(tetrahedron(0.2))
    (tmp_path / "project/parts/world.xml").write_text((ROOT / "models/common/world.xml").read_text())
    path = tmp_path / "project/scenarios/quick.yaml"
    path.write_text(TEXT)
    return path


def rows_there(parcel, tmp_path):
    """Return the rows of two runs made here, and made by a worker that does not see the files."""
    here = Runs(parcel).rows([0, 1], threading.Event())
    parcel.unpack(tmp_path / "worker")
    (tmp_path / "project").rename(tmp_path / "hidden")
    there = Runs(parcel, tmp_path / "worker")
    assert there.prepare(0).arm.path.is_relative_to(tmp_path / "worker")
    return here, there.rows([0, 1], threading.Event())


@pytest.mark.parametrize("is_made", [False, True])
def test_rows_of_a_worker_that_sees_no_file_are_the_same(path, tmp_path, is_made):
    scenario = load(path)
    scenario = Scenario.model_validate(scenario.model_dump()) if is_made else scenario
    parcel = pack(scenario, plan_of(scenario))
    assert {file.name for file in parcel.files} == {"arm.xml", "world.xml", "t.stl"}
    here, there = rows_there(parcel, tmp_path)
    assert repr(here) == repr(there)  # with NaN
    assert here[0]["control.feedback"] != here[1]["control.feedback"]


def test_packages_tools_and_recorded_motions_are_packed_also_those_that_vary(path, tmp_path):
    project = tmp_path / "project"
    (project / "meshes/inner").mkdir(parents=True)
    (project / "meshes/inner/link.stl").write_bytes(tetrahedron(0.2))
    text = (ROOT / "tests/models/arm.urdf").read_text()
    (project / "models/arm.urdf").write_text(
        text.replace("package://arm_description/meshes", "package://meshes_of_arm/inner")
    )
    tool = '<mujoco><worldbody><body name="drill"><geom size=".02" mass="{}"/><site name="bit" pos="0 0 .1"/></body></worldbody></mujoco>'
    rows = "t,x,y,z,qw,qx,qy,qz\n0,0.5,0.5,0,1,0,0,0\n1,0.6,0.5,0,1,0,0,0\n"
    for i in (1, 2):
        (project / f"models/tool_{i}.xml").write_text(tool.format(i))
        (project / f"scenarios/{i}.csv").write_text(rows)
    path.write_text(
        "name: quick\narm: {model: ../models/arm.urdf, packages: {meshes_of_arm: ../meshes}, tool: {model: ../models/tool_1.xml}}\n"
        "task: {axes: [x, y]}\ntarget: {path: [{file: {path: 1.csv, speed: auto}}]}\n"
        "sweep: {vary: {arm.tool.model: [../models/tool_1.xml, ../models/tool_2.xml], "
        "'target.path[0].file.path': [1.csv, 2.csv]}}\n"
    )
    scenario = load(path)
    parcel = pack(scenario, plan_of(scenario))
    names = {"arm.urdf", "link.stl", "tool_1.xml", "tool_2.xml", "1.csv", "2.csv"}
    assert names <= {file.name for file in parcel.files}
    parcel.unpack(tmp_path / "worker")
    project.rename(tmp_path / "hidden")
    arm = Runs(parcel, tmp_path / "worker").prepare(3).arm
    assert arm.model.nmesh > 0
    assert arm.model.body_mass[-1] == 2.0
