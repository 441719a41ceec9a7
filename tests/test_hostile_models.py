"""Models that would crash, hang or mislead: each is refused in one line, before it takes time or memory."""

import resource
import time

import numpy as np
import pytest

from rmrc import arm as arms
from rmrc.support.errors import ModelError
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


    "bytes": (model(tip="t\xff").encode("latin-1"), "4: site … name … UTF-8 …"),
    # of a class that is not there MuJoCo makes a message, and prints it as a format: %n aborts the process
    "class": (model(joint='class="%s%n"'), '2: joint "shoulder": class … "%" … "%s%n"'),
    "replicated": (model(world=f'<replicate count="1000000">{BALL}</replicate>'), "1: geom: … 10000 elements … copy … 1000003 …"),
    "flex": (model(world='<flexcomp name="f" type="grid" count="1000 1000 1000" spacing="1 1 1" dim="3"/>'), "1: flexcomp: … 10000 …"),
    "solver": (model(head='<option iterations="2000000000" tolerance="0"/>'), '1: option: iterations … 10000 … "2000000000"'),

    **{f"no XML {k}": (text, "…") for k, text in enumerate(["<a '", "<!--" * 50_000, "<a>" * 50_000])},
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

    "arm.usda": ("#usda 1.0\n", "… USD … export …"),


    "arm.urdf": (POINTER, "… a pointer of Git LFS … `git lfs pull` …"),
    "page.urdf": ("<!DOCTYPE html>\n<html><head><meta charset=utf-8></head>&nbsp;</html>", "… HTML … download …"),
    "arm.mjcf": (model(), "… give MJCF the ending .xml"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_another_format_is_named_with_the_way_out(tmp_path, name):
    text, message = OTHERS[name]
    assert refusal(tmp_path / name, text) == says(message)


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


def test_an_actuator_that_moves_nothing_limits_nothing(tmp_path):
    actuators = """<actuator><velocity joint="elbow" gear="5e-324" ctrlrange="-1 1" forcerange="-1 1"/>
<motor joint="shoulder" gear="0" ctrlrange="-1 1"/><motor joint="shoulder" gear="2" ctrlrange="-3 3"/></actuator>"""
    path = tmp_path / "model.xml"
    path.write_text(model(tail=actuators))
    arm = arms.load(path)
    assert arm.rate_limit.tolist() == [np.inf, np.inf]
    assert arm.torque_limit.tolist() == [6.0, np.inf]
