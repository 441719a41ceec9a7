"""The verbs `check` and `new`: what they print and write, their exit codes, and how they refuse."""

import json
import re

import pytest
import yaml

import rmrc as library
from project import ROOT

TWO = str(ROOT / "models/planar_2link.xml")
BEYOND = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 0 1" range="1 2" limited="true"/>
<geom size=".1"/><site name="tool" pos="1 0 0"/></body></worldbody>
<keyframe><key name="home" qpos="0"/></keyframe></mujoco>"""


@pytest.fixture
def rmrc(rmrc):
    """Return a function as that of all tests, without what a verb says while it takes more than a second."""

    def call(*arguments):
        code, out, err = rmrc(*arguments)
        return code, out, re.sub(r"^rmrc: [a-z ]+ \.\.\.\n", "", err, flags=re.MULTILINE)

    return call


def test_check_tells_that_nothing_must_be_mended(rmrc):
    code, out, err = rmrc("check", TWO)
    assert (code, err) == (0, "")
    for words in (
        "planar_2link.xml: 2 joints",
        "Findings: none with errors",
        "torque ok",
    ):
        assert words in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 100


def test_check_exits_with_1_where_something_must_be_mended(rmrc, tmp_path):
    (tmp_path / "x.xml").write_text(BEYOND)
    code, out, err = rmrc("check", "x.xml")
    said = " ".join(out.split())
    assert (code, err) == (1, "") and "Findings: 1 with errors" in said
    assert "joint a is at 0 at home, outside its range [1, 2]" in said
    code, out, _ = rmrc("check", "x.xml", "--json")
    assert code == 1 and json.loads(out)["ready"] is False


def test_the_json_of_check_is_that_of_the_function(rmrc):
    code, out, err = rmrc("check", TWO, "--json")
    told = json.loads(out)
    found = library.check(TWO)
    assert (code, err) == (0, "")
    assert [one["code"] for one in told["findings"]] == [finding.code for finding in found.findings]
    assert told["sigma"] == found.sigma.tolist()
    assert told["motions"][0]["joint_rate.peak"] == found.motions[0].scorecard["joint_rate.peak"].value


def test_check_takes_the_joints_that_are_driven(rmrc):
    code, out, _ = rmrc("check", TWO, "--joints", "shoulder", "--json")
    assert code == 0 and [each["joint"] for each in json.loads(out)["joints"]] == ["shoulder"]


def test_new_writes_a_scenario_in_this_folder_and_says_how_to_run_it(rmrc, tmp_path):
    code, out, err = rmrc("new", TWO)
    assert (code, err) == (0, "")
    assert "wrote planar_2link.yaml" in out and "run planar_2link.yaml" in out
    assert [path.name for path in tmp_path.iterdir()] == ["planar_2link.yaml"]
    assert yaml.safe_load((tmp_path / "planar_2link.yaml").read_text())["arm"]["site"] == "tip"
    assert rmrc("run", "planar_2link.yaml", "--no-record", "-q")[0] == 0


def test_nothing_is_overwritten_unless_forced(rmrc, tmp_path):
    (tmp_path / "mine.yaml").write_text("mine")
    code, out, err = rmrc("new", TWO, "-o", "mine.yaml")
    told = "mine.yaml: already exists; give another by -o, or overwrite it by --force"
    assert (code, out, err) == (2, "", f"rmrc: error: {told}\n")
    assert (tmp_path / "mine.yaml").read_text() == "mine"
    assert rmrc("new", TWO, "-o", "mine.yaml", "--force", "-q")[:2] == (0, "")
    assert (tmp_path / "mine.yaml").read_text().startswith("# A first scenario")


def test_new_prints_the_same_to_stdout(rmrc, tmp_path):
    code, out, err = rmrc("new", TWO, "-o", "-")
    assert (code, err, list(tmp_path.iterdir())) == (0, "", [])
    assert rmrc("new", TWO, "-q")[0] == 0
    assert (tmp_path / "planar_2link.yaml").read_text() == out


def test_the_model_is_found_from_the_folder_of_the_file(rmrc, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models/x.xml").write_text(BEYOND.replace("1 2", "-1 2"))
    assert rmrc("new", "models/x.xml", "-o", "mine/deep/x.yaml", "-q")[0] == 0
    assert yaml.safe_load((tmp_path / "mine/deep/x.yaml").read_text())["arm"]["model"] == "../../models/x.xml"
    assert rmrc("run", "mine/deep/x.yaml", "--no-record", "-q")[0] == 0


@pytest.mark.parametrize("plant", ["ideal", "torque"])
def test_the_plant_is_that_which_is_asked_for(rmrc, plant):
    code, out, _ = rmrc("new", TWO, "-o", "-", "--plant", plant)
    assert code == 0 and yaml.safe_load(out)["plant"] == {"kind": plant}


REFUSED = {
    "no such plant": (["new", TWO, "--plant", "x"], "plant must be one of ideal, servo, torque"),
    "no such site": (["new", TWO, "--site", "hand"], 'has no site "hand"'),
    "no such model": (["check", "none.xml"], "none.xml: no such model file"),
    "no such joint": (["check", TWO, "--joints", "wrist"], 'no hinge or slide joint "wrist"'),
    "a folder": (["new", TWO, "-o", "."], ".: is a directory"),
    "two things for stdout": (["new", TWO, "-o", "-", "--json"], "give -o - or --json, not both"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_one_line_and_exit_code_2(rmrc, tmp_path, case):
    arguments, told = REFUSED[case]
    code, out, err = rmrc(*arguments)
    assert (code, out) == (2, "") and told in err and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
