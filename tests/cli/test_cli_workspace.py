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
    assert rows["singular curves"][2:] == ["elbow", "2", "elbow", "1"]
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
        assert max(file["without_limits_share"].shape) == 60


@pytest.mark.usefixtures("undrawn")
def test_json_is_the_summary_and_nothing_else(workspace, tmp_path):
    code, out, err = workspace(SIX_THREE, "--cells", "60", "--json", "--out", "a", "--picture", "b/c.svg")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["without_limits"]["area"] == pytest.approx(72 * np.pi, rel=0.02)
    limited = facts["with_limits"]
    assert limited["y"] == pytest.approx([0.0, 9.0], abs=1e-6)
    assert limited["area"] == pytest.approx(63.617, abs=limited["area_accuracy"])
    assert facts["files"] == ["b/c.svg", "a/planar_6_3.workspace.npz"]
    assert all((tmp_path / name).is_file() for name in facts["files"])


@pytest.mark.usefixtures("undrawn")
def test_quiet_says_nothing(workspace, tmp_path):
    assert workspace(SIX_THREE, "--cells", "20", "-q", "--map", "condition") == (0, "", "")
    assert (tmp_path / "recordings/planar_6_3.workspace.png").is_file()


@pytest.mark.usefixtures("undrawn")
def test_the_options_reach_the_answer(workspace):
    options = ["--plane", "yz", "--axes", "x,y,z", "--length", "0.5", "--worst", "--samples", "1000"]
    code, out, _ = workspace(STANFORD, "--cells", "10", "--json", *options)
    facts = json.loads(out)
    assert code == 0
    assert (facts["map"], facts["labels"], facts["posture"]) == ("slice yz", ["y", "z"], "worst")
    assert (facts["axes"], facts["length"], max(facts["cells"])) == (["x", "y", "z"], 0.5, 10)
    assert facts["without_limits"]["singular_samples"]["singular"] > 0


@pytest.mark.usefixtures("undrawn")
def test_a_map_over_two_joints(workspace, tmp_path):
    code, out, err = workspace(STANFORD, "--over", "theta_2,theta_5", "--cells", "20", "--map", "condition")
    assert (code, err) == (0, "")
    assert "singular curves" in out
    assert sorted(p.name for p in (tmp_path / "recordings").iterdir()) == [
        "stanford.joints.npz", "stanford.joints.png",
    ]  # fmt: skip
    code, out, _ = workspace(
        STANFORD, "--over", "theta_2, theta_5", "--cells", "20", "--json", "--q", "0,0,0.5,0,0,0"
    )
    facts = json.loads(out)
    assert facts["labels"] == ["theta_2", "theta_5"] and facts["q"][2] == 0.5 and facts["cells"] == [20, 20]


@pytest.mark.usefixtures("undrawn")
def test_a_map_over_two_joints_has_no_determinant_where_j_is_not_square(workspace):
    out = workspace(STANFORD, "--over", "theta_2,theta_5", "--cells", "20", "--axes", "x,y,z")[1]
    title, *_, curves = out.partition("\n\n")[0].splitlines()
    assert title == "stanford.xml, site tool, over theta_2 and theta_5, rows x y z"  # on one line
    assert curves.split() == ["singular", "curves", "-"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SIX_THREE, "--picture", "a.gif"), "--picture a.gif: … .png, .svg or .pdf"),
        ((SIX_THREE, "--map", "beauty"), "--map … sigma_min, manipulability, condition… 'beauty'"),
        ((SIX_THREE, "--plane", "xz"), f'{SIX_THREE}: site "tip" … xy; … --plane … xz'),
        ((STANFORD, "--plane", "up"), "--plane … xy, xz, yz, rz … 'up'"),
        ((STANFORD, "--over", "theta_2"), "--over … two … joints … theta_1, theta_2, d_3… 'theta_2'"),
        ((STANFORD, "--over", "theta_2,theta_9"), "--over … theta_6; … 'theta_2,theta_9'"),
        ((STANFORD, "--over", "d_3,d_3"), "--over … two different joints … 'd_3,d_3'"),
        ((STANFORD, "--over", "theta_2,theta_5", "--plane", "xz"), "--over … --plane and --worst"),
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
    from rmrc.analysis.workspace import slices

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(slices, "zero_curves", interrupted)
    assert workspace(SIX_THREE, "--cells", "20") == (130, "", "rmrc: interrupted; nothing was written\n")
    assert not (tmp_path / "recordings").exists()
