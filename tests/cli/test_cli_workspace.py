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


def test_it_leaves_a_picture_and_prints_a_table(workspace, tmp_path):
    code, out, err = workspace(SIX_THREE, "--cells", "60")
    assert (code, err) == (0, "")
    assert "planar_6_3.xml, site tip, slice xy, rows x y" in out
    assert "area [m²]" in out
    rows = {line.partition("  ")[0]: line.split() for line in out.splitlines()}
    # The circle of 9 m, and what the limits leave: from q1 = 135 deg and the forearm level, and from both at 0.
    assert rows["x [m]"][2:] == ["-9.000", "to", "9.000", "-7.243", "to", "9.000"]
    assert rows["y [m]"][2:] == ["-9.000", "to", "9.000", "0", "to", "9.000"]
    assert rows["singular_curves"][1:] == ["elbow", "2", "elbow", "1"]
    assert out.endswith("wrote recordings/planar_6_3.workspace.png\n")
    (file,) = (tmp_path / "recordings").iterdir()
    assert imread(file).shape[0] > 500


@pytest.mark.usefixtures("undrawn")
def test_json_is_the_summary_and_nothing_else(workspace, tmp_path):
    code, out, err = workspace(SIX_THREE, "--cells", "60", "--json", "-o", "b/c.svg")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["without_limits"]["area"] == pytest.approx(72 * np.pi, rel=0.02)
    limited = facts["with_limits"]
    assert limited["y"] == pytest.approx([0.0, 9.0], abs=1e-6)
    assert limited["area"] == pytest.approx(63.617, abs=limited["area_accuracy"])
    assert facts["files"] == ["b/c.svg"] and (tmp_path / "b/c.svg").is_file()


@pytest.mark.usefixtures("undrawn")
def test_quiet_says_nothing(workspace, tmp_path):
    assert workspace(SIX_THREE, "--cells", "20", "-q", "--map", "manipulability") == (0, "", "")
    assert (tmp_path / "recordings/planar_6_3.workspace.png").is_file()


@pytest.mark.usefixtures("undrawn")
def test_the_options_reach_the_answer(workspace):
    options = ["--plane", "yz", "--axes", "x,y,z", "--length", "0.5", "--samples", "1000"]
    code, out, _ = workspace(STANFORD, "--cells", "10", "--json", *options)
    facts = json.loads(out)
    assert code == 0
    assert facts["slice"] == "yz" and {"y", "z"} < set(facts["with_limits"])
    assert (facts["axes"], facts["length"], max(facts["cells"])) == (["x", "y", "z"], 0.5, 10)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SIX_THREE, "-o", "a.gif"), "--output a.gif: … .pdf … .png … .svg"),
        ((SIX_THREE, "--map", "beauty"), "… --map… beauty … sigma_min … manipulability…"),
        ((SIX_THREE, "--plane", "xz"), f'{SIX_THREE}: site "tip" … xz; choose from xy'),
        ((STANFORD, "--plane", "up"), "… --plane… up … xy … rz…"),
        ((STANFORD, "--q", "0", "--keyframe", "home"), "… q or keyframe…"),
        ((STANFORD, "--axes", "x,w"), "--axes: … x y z rx ry rz… x,w"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(workspace, tmp_path, arguments, message):
    code, out, err = workspace(*arguments)
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: {message}\n")
    assert not (tmp_path / "recordings").exists()


def test_ctrl_c_leaves_nothing_and_exits_130(workspace, tmp_path, monkeypatch):
    from rmrc.analysis.workspace.workspace import Search

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Search, "singular", interrupted)
    assert workspace(SIX_THREE, "--cells", "20") == (130, "", "rmrc: interrupted\n")
    assert not (tmp_path / "recordings").exists()
