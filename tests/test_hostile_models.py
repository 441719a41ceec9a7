"""Models that would crash, hang or mislead: each is refused in one line, before it takes time or memory."""

import os
import resource
import time

import numpy as np
import pytest

from rmrc import arm as arms
from rmrc.support.errors import ModelError
from stl import tetrahedron
from wording import says


def model(head="", world="", joint="", inertial="", tip="tip", tail="", geom=""):
    """Return an arm of two links as MJCF, with something odd about it."""
    return f"""<mujoco>{head}<worldbody>{world}
<body name="lower"><joint name="shoulder" axis="0 1 0" {joint}/>{inertial}<geom type="capsule" size="0.05 0.5" {geom}/>
<body name="upper" pos="0 0 1"><joint name="elbow" axis="0 1 0"/><geom type="capsule" size="0.05 0.5"/>
<site name="{tip}" pos="0 0 1"/></body></body></worldbody>{tail}</mujoco>"""


def refusal(path, text=None):
    """Return what is said about a model, without its path."""
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ModelError) as caught:
        arms.load(path)
    message = str(caught.value)
    assert message.isprintable() and message.startswith(f"{path}:")
    return message.removeprefix(f"{path}:").strip()


BALL = '<geom size="1"/>'
LENGTHS = '<compiler><lengthrange inttotal="1e30"/></compiler>'
REFUSED = {
    # of a NaN MuJoCo prints a line by itself, and compiles it
    "inertial": (model(inertial='<inertial pos="0 nan 0" mass="1" diaginertia="1 1 1"/>'), '2: inertial: pos … finite … "0 nan 0"'),
    "range": (model(joint='range="-inf inf"'), '2: joint "shoulder": range … finite … "-inf inf"'),

    "large": (model(joint='damping="1e300"'), '2: joint "shoulder": damping … 1e+30 … "1e300"'),
    "escape": (model(tip="t&#27;[31mip"), "… XML … character …: line 4, …"),

    "backwards": (model(tail='<keyframe><key name="a\u202eb"/></keyframe>'), '4: key "a\\u202eb": name … control characters …'),
    "bytes": (model(tip="t\xff").encode("latin-1"), "4: site … name … UTF-8 …"),
    # of a class that is not there MuJoCo makes a message, and prints it as a format: %n aborts the process
    "class": (model(joint='class="%s%n"'), '2: joint "shoulder": class … "%" … "%s%n"'),
    "replicated": (model(world=f'<replicate count="1000000">{BALL}</replicate>'), "1: geom: … 10000 elements … copy … 1000003 …"),
    "nested": (model(world='<replicate count="1000">' * 2 + BALL + "</replicate>" * 2), "1: geom: … 1001003 …"),
    "flex": (model(world='<flexcomp name="f" type="grid" count="1000 1000 1000" spacing="1 1 1" dim="3"/>'), "1: flexcomp: … 10000 …"),
    "search": (model(head=LENGTHS, tail='<actuator><muscle joint="elbow"/></actuator>'), '1: lengthrange: inttotal … 1000 … "1e30"'),
    "solver": (model(head='<option iterations="2000000000" tolerance="0"/>'), '1: option: iterations … 10000 … "2000000000"'),
    "memory": (model(head='<size memory="1000G"/>'), "… 4 GiB of memory"),

    "hfield": (model(head='<asset><hfield name="h" nrow="50000" ncol="50000" size="1 1 1 1"/></asset>'), "… 4 GiB of memory"),
    **{f"no XML {k}": (text, "…") for k, text in enumerate(["<a '", "<!--" * 50_000, "<a>" * 50_000])},
    "mesh": ('<mujoco><asset><mesh name="m" file="gone.stl"/></asset><worldbody><body><joint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>', "… meshdir …"),
    "fragment": ("<mujocoinclude/>", "… includes it"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_misleads_hangs_or_crashes_is_refused_at_once_in_one_line(tmp_path, capfd, case):
    text, message = REFUSED[case]
    before, limits = time.process_time(), resource.getrlimit(resource.RLIMIT_AS)
    assert refusal(tmp_path / "model.xml", text) == says(message)
    assert time.process_time() - before < 10.0  # the compiler would take minutes and more
    assert resource.getrlimit(resource.RLIMIT_AS) == limits
    assert capfd.readouterr().err == ""


POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:9f\nsize 84\n"
OTHERS = {
    "arm.sdf": ('<?xml version="1.0"?><sdf version="1.6"><model name="arm"/></sdf>', "… SDF … `sdf2mjcf …"),

    "arm.srdf": ('<robot name="arm"><disable_collisions link1="a" link2="b"/></robot>', "… SRDF … that URDF"),
    "arm.dae": ('<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"/>', "… COLLADA, a mesh …"),
    "arm.usda": ("#usda 1.0\n", "… USD … export …"),

    "link.STL": (b"\0" * 84, "… STL, a mesh …"),

    "arm.yaml": ("arm: {model: arm.urdf}\n", "… YAML … arm.model … `rmrc run` …"),
    "arm.urdf": (POINTER, "… a pointer of Git LFS … `git lfs pull` …"),
    "page.urdf": ("<!DOCTYPE html>\n<html><head><meta charset=utf-8></head>&nbsp;</html>", "… HTML … download …"),
    "arm.mjcf": (model(), "… give MJCF the ending .xml"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_another_format_is_named_with_the_way_out(tmp_path, name):
    text, message = OTHERS[name]
    assert refusal(tmp_path / name, text) == says(message)


def test_a_mesh_that_git_lfs_has_not_fetched_is_named(tmp_path):
    mesh = '<asset><mesh name="m" file="link.stl"/></asset>'
    text = model(head=mesh, world='<geom type="mesh" mesh="m"/>')
    (tmp_path / "link.stl").write_text(POINTER)
    assert refusal(tmp_path / "model.xml", text) == says("… Git LFS: link.stl; … `git lfs pull` …")
    (tmp_path / "link.stl").write_bytes(tetrahedron(1.0))
    arms.load(tmp_path / "model.xml")


def test_what_a_file_includes_is_looked_at_too(tmp_path):
    (tmp_path / "gains.xml").write_text("<mujoco>\n<option timestep='nan'/></mujoco>")
    (tmp_path / "model.xml").write_text(model(head='<include file="gains.xml"/>'))
    with pytest.raises(ModelError) as caught:
        arms.load(tmp_path / "model.xml")
    assert str(caught.value) == says(f'{tmp_path}/gains.xml:2: option: timestep … finite … "nan"')


@pytest.mark.parametrize("named", ["arm.xml", "other.xml"])
def test_a_model_that_is_attached_to_itself_is_refused(tmp_path, named):
    # MuJoCo reads it again and again, until its process dies.

    (tmp_path / "other.xml").write_text('<mujoco><asset><model name="m" file="arm.xml"/></asset></mujoco>')
    (tmp_path / "arm.xml").write_text(f'<mujoco><asset><model name="m" file="{named}"/></asset></mujoco>')
    with pytest.raises(ModelError, match=r'must name another file than itself, got "arm\.xml"'):
        arms.load(tmp_path / "arm.xml")


@pytest.mark.parametrize("name", ["🦾", "[red]tip[/red]", "t" * 10_000])
def test_other_names_are_names_and_comments_are_not_read(tmp_path, name):
    path = tmp_path / "model.xml"
    path.write_text(model(tip=name, head='<!-- -- <joint range="nan"/> -->'), "utf-8")
    assert arms.load(path).site == name


def test_an_actuator_that_moves_nothing_limits_nothing(tmp_path):
    actuators = """<actuator><velocity joint="elbow" gear="5e-324" ctrlrange="-1 1" forcerange="-1 1"/>
<motor joint="shoulder" gear="0" ctrlrange="-1 1"/><motor joint="shoulder" gear="2" ctrlrange="-3 3"/></actuator>"""
    path = tmp_path / "model.xml"
    path.write_text(model(tail=actuators))
    arm = arms.load(path)
    assert arm.rate_limit.tolist() == [np.inf, np.inf]
    assert arm.torque_limit.tolist() == [6.0, np.inf]


@pytest.mark.filterwarnings("default")  # MuJoCo warns of the first
@pytest.mark.parametrize(
    ("joint", "code", "error"),
    [
        ('armature="-1000"', 2, '… hold: joint "shoulder" … inertia … 0 … home … -990.021; …'),
        # a spring that is stretched by 1e29 rad turns the shoulder out of all numbers at once
        ('springref="1e29" stiffness="1e29"', 3, "diverged at tick 1 …"),
    ],
)
def test_an_arm_that_cannot_be_held_is_one_line(rmrc, tmp_path, joint, code, error):
    (tmp_path / "model.xml").write_text(model(joint=joint))
    ended, _, err = rmrc("statics", "model.xml", "--wrench", "1,2,3", "--hold", "0.3")
    assert ended == code
    assert err.splitlines()[-1] == says(f"rmrc: error: {error}")


def test_a_model_in_a_folder_that_is_not_utf8_is_refused_in_one_line(rmrc, tmp_path, monkeypatch):
    """Its name is ISO-8859-1; a relative path is all that MuJoCo gets."""
    folder = tmp_path / os.fsdecode(b"n\xff\xfeu")
    folder.mkdir()
    (folder / "arm.xml").write_text(model())
    with pytest.raises(ModelError, match="must have a path in UTF-8"):
        arms.load(folder / "arm.xml")
    monkeypatch.chdir(folder)
    assert rmrc("inspect", "arm.xml")[0] == 0
