"""The verb `workspace`: what it leaves, what it says, and its exit codes."""

import json

import numpy as np
import pytest
from matplotlib.image import imread

from project import ROOT
from wording import says

SIX_THREE = str(ROOT / "models/planar_6_3.xml")
STANFORD = str(ROOT / "models/stanford.xml")


@pytest.fixture
def workspace(rmrc):
    """Return a function: arguments -> (exit code, stdout, stderr) of `rmrc workspace`."""

    def call(*arguments):
        return rmrc("workspace", *arguments)

    return call


def test_it_leaves_a_picture_and_arrays_and_prints_a_table(workspace, tmp_path):
    code, out, err = workspace(SIX_THREE, "--cells", "60")
    assert (code, err) == (0, "")
    assert "planar_6_3.xml, site tip, slice xy, rows x y" in out
    assert "without limits" in out and "area of the slice [m²]" in out
    rows = {
        line[: line.index("  ", 3)].strip(): line.split() for line in out.splitlines() if "  " in line[3:]
    }
    # The circle of 9 m, and what the limits leave: from q1 = 135 deg and the forearm level, and from both at 0.
    assert rows["x [m]"][2:] == ["-9.000", "to", "9.000", "-7.243", "to", "9.000"]
    assert rows["y [m]"][2:] == ["-9.000", "to", "9.000", "0", "to", "9.000"]
    assert rows["σ_min [1], best posture"][4:] == ["0", "to", "3.000", "0", "to", "3.000"]
    assert rows["condition κ [1], best posture"].count("inf") == 2
    assert out.count("singular curves") == 2
    assert (
        rows["better end from cells of [m]"][-1] == "0.3051"
    )  # 18 m are 59, with a half to spare at both ends
    assert out.endswith(
        "wrote recordings/planar_6_3.workspace.png\nwrote recordings/planar_6_3.workspace.npz\n"
    )
    folder = tmp_path / "recordings"
    assert sorted(p.name for p in folder.iterdir()) == [
        "planar_6_3.workspace.npz",
        "planar_6_3.workspace.png",
    ]
    assert imread(folder / "planar_6_3.workspace.png").shape[0] > 500
    with np.load(folder / "planar_6_3.workspace.npz") as file:
        assert max(file["free_reached"].shape) == 60


@pytest.mark.usefixtures("undrawn")
def test_json_is_the_summary_and_nothing_else(workspace, tmp_path):
    code, out, err = workspace(SIX_THREE, "--cells", "60", "--json", "--out", "a", "--picture", "b/c.svg")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["without_limits"]["area"] == pytest.approx(72 * np.pi, rel=0.02)
    limited = facts["with_limits"]
    assert limited["y"] == pytest.approx([0.0, 9.0], abs=1e-9) and limited["extent_accuracy"] <= 1e-9
    assert limited["extent_is_at_least"] is False and limited["condition"][1] is None
    assert limited["sigma_min"][0] == 0.0 and limited["worst_from"]["sigma_min"] == "singular"
    assert facts["files"] == ["b/c.svg", "a/planar_6_3.workspace.npz"]
    assert all((tmp_path / name).is_file() for name in facts["files"])


@pytest.mark.usefixtures("undrawn")
def test_quiet_says_nothing(workspace, tmp_path):
    assert workspace(SIX_THREE, "--cells", "20", "-q", "--map", "postures") == (0, "", "")
    assert (tmp_path / "recordings/planar_6_3.workspace.png").is_file()


OPTIONS = ["--plane", "yz", "--through", "0.3,0,0", "--axes", "x,y,z", "--length", "0.5", "--worst"]


def test_samples_axes_through_and_worst_reach_the_computation(workspace, monkeypatch):
    asked = {}

    def ask(_, **options):
        asked.update(options)
        raise KeyboardInterrupt

    monkeypatch.setattr("rmrc.analysis.workspace.workspace.workspace", ask)
    code, *_ = workspace(STANFORD, "--cells", "10", "--samples", "1000", "--json", *OPTIONS)
    assert code == 130
    assert asked.pop("through").tolist() == [0.3, 0.0, 0.0] and len(asked.pop("q")) == 6
    assert callable(asked.pop("on_samples"))
    assert asked == {
        "plane": "yz", "samples": 1000, "worst": True, "axes": ("x", "y", "z"), "task_frame": None,
        "length": 0.5, "cells": 10,
    }  # fmt: skip


@pytest.mark.long
@pytest.mark.usefixtures("undrawn")
def test_the_summary_tells_samples_axes_through_and_worst(workspace):
    code, out, _ = workspace(STANFORD, "--cells", "10", "--samples", "1000", "--json", *OPTIONS)
    facts = json.loads(out)
    assert code == 0
    assert (facts["slice"], facts["origin"], facts["posture"]) == ("yz", [0.3, 0.0, 0.0], "worst")
    assert (facts["axes"], facts["length"], facts["method"]) == (["x", "y", "z"], 0.5, "samples")
    assert facts["without_limits"]["postures"] is None
    assert facts["without_limits"]["extent_is_at_least"] is True


@pytest.mark.usefixtures("undrawn")
def test_a_map_over_two_joints(workspace, tmp_path):
    code, out, err = workspace(STANFORD, "--over", "theta_2,theta_5", "--cells", "20", "--map", "condition")
    assert (code, err) == (0, "")
    assert "curves of det J = 0" in out
    assert sorted(p.name for p in (tmp_path / "recordings").iterdir()) == [
        "stanford.joints.npz", "stanford.joints.png",
    ]  # fmt: skip
    code, out, _ = workspace(
        STANFORD, "--over", "theta_2, theta_5", "--cells", "20", "--json", "--q", "0,0,0.5,0,0,0"
    )
    facts = json.loads(out)
    assert facts["over"] == ["theta_2", "theta_5"] and facts["q"][2] == 0.5 and facts["cells"] == [20, 20]


@pytest.mark.usefixtures("undrawn")
def test_a_map_over_two_joints_has_no_determinant_where_j_is_not_square(workspace):
    out = workspace(STANFORD, "--over", "theta_2,theta_5", "--cells", "20", "--axes", "x,y,z")[1]
    title, *_, curves = out.partition("\n\n")[0].splitlines()
    assert title == "stanford.xml, site tool, over theta_2 and theta_5, rows x y z"  # on one line
    assert curves.split() == ["curves", "of", "det", "J", "=", "0", "-"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SIX_THREE, "--picture", "a.gif"), "--picture a.gif: … .png, .svg or .pdf"),
        ((SIX_THREE, "--map", "beauty"), "--map … sigma_min, manipulability, condition, postures … 'beauty'"),
        ((SIX_THREE, "--plane", "xz"), f'{SIX_THREE}: site "tip" … xy; … --plane … xz'),
        ((STANFORD, "--plane", "up"), "--plane … xy, xz, yz, rz … 'up'"),
        ((STANFORD, "--through", "1,2"), "--through … 3 … x, y, z … 2: '1,2'"),
        ((STANFORD, "--map", "postures"), "--map postures: 4 joints … rz; … two …"),
        ((STANFORD, "--over", "theta_2"), "--over … two joints … theta_1,theta_2 … 'theta_2'"),
        (
            (STANFORD, "--over", "theta_2,theta_9"),
            '--over: … joint "theta_9" … "theta_6"… theta_1, theta_2, d_3, theta_4, theta_5, theta_6',
        ),
        ((STANFORD, "--over", "d_3,d_3"), '--over … two … joints … "d_3" …'),
        (
            (STANFORD, "--over", "theta_2,theta_5", "--plane", "xz"),
            "--over … --plane, --through, --worst and --map postures",
        ),
        ((STANFORD, "--plane", "xy", "--through", "0,0,9"), "… slice xy through (0, 0, 9); … --through"),
        ((STANFORD, "--q", "0", "--keyframe", "home"), "… --q or --keyframe …"),
        ((STANFORD, "--axes", "x,w"), '--axes: … "w" … x y z rx ry rz'),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(workspace, tmp_path, arguments, message):
    code, out, err = workspace(*arguments)
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: {message}\n")
    assert not (tmp_path / "recordings").exists()


def test_ctrl_c_leaves_nothing_and_exits_130(workspace, tmp_path, monkeypatch):
    from rmrc.analysis.workspace import search as module

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "zero_curves", interrupted)
    assert workspace(SIX_THREE, "--cells", "20") == (130, "", "rmrc: interrupted; nothing was written\n")
    assert not (tmp_path / "recordings").exists()
