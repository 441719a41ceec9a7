"""A parcel: all files that a sweep needs, unpacked below a folder where its runs find them."""

import threading

from project import ROOT
from rmrc.scenario import load
from rmrc.study.plan import plan_of
from rmrc.study.runs import Runs, pack
from stl import tetrahedron


def test_a_worker_that_sees_no_file_makes_the_same_rows_with_packages_tools_and_recorded_motions(tmp_path):
    project, path = tmp_path / "project", tmp_path / "project/scenarios/quick.yaml"
    for name in ("meshes/inner", "models", "scenarios"):
        (project / name).mkdir(parents=True)
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
    here = Runs(parcel).rows(range(4), threading.Event())
    parcel.unpack(tmp_path / "worker")
    project.rename(tmp_path / "hidden")
    there = Runs(parcel, tmp_path / "worker")
    arm = there.prepare(3).arm
    assert arm.path.is_relative_to(tmp_path / "worker")
    assert arm.model.nmesh > 0 and arm.model.body_mass[-1] == 2.0
    assert repr(there.rows(range(4), threading.Event())) == repr(here)  # with NaN
    assert here[0]["tau.peak"] != here[2]["tau.peak"]  # negative control: of another tool
