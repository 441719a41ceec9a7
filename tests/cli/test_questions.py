"""The verbs that ask about a model: what they print and leave, their JSON, their exit codes, and every mistake."""

import json
from dataclasses import fields

import numpy as np
import pytest
import yaml
from matplotlib.image import imread
from numpy.testing import assert_allclose

import rmrc as library
from project import ROOT
from rmrc import arm as arms
from rmrc import textbook
from rmrc.analysis.inspection import Inspection, inspect
from rmrc.analysis.statics import balance
from wording import says

TWO, STANFORD, SIX_THREE, TORUS = (
    str(ROOT / f"models/{name}.xml") for name in ("planar_2link", "stanford", "planar_6_3", "torus_3r_short")
)


@pytest.fixture
def facts(rmrc):
    """Return a function: arguments -> (exit code, the answer as JSON)."""

    def call(*arguments):
        code, out, _ = rmrc(*arguments, "--json")
        return code, json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))

    return call


ASKED = {
    "inspect": ("--joint-error", "0.001", "--frame", "base", "--length", "0.5"),
    "statics": ("--wrench", "1,-2,3,0.4,0.5,-0.6", "--gravity"),
    "check": (),
}


@pytest.mark.parametrize("verb", ASKED)
@pytest.mark.parametrize("name", ["fr3", "so101"])
def test_no_line_is_wider_than_100_columns_and_nothing_is_cut_off(rmrc, verb, name):
    code, out, _ = rmrc(verb, name, *ASKED[verb])
    assert code == 0 and "…" not in out and max(map(len, out.splitlines())) <= 100
    assert all(any(line.startswith(joint) for line in out.splitlines()) for joint in arms.load(
        ROOT / f"models/{name}.xml"
    ).joints)  # fmt: skip


# inspect -----------------------------------------------------------------------------------------


def test_inspect_without_a_configuration_is_at_home_and_its_table_has_j_and_the_limits(rmrc):
    at_home = rmrc("inspect", TWO)
    assert at_home[0] == 0
    assert at_home == rmrc("inspect", TWO, "--keyframe", "home")
    assert at_home == rmrc("inspect", TWO, "--q", "60 deg,-120 deg")
    # Links of 1 m at 60 and -60 deg: J of the elbow is (sin 60, cos 60); its limits are 160 deg.
    assert "elbow 0.8660 0.5000 0 0 0 1.000 -2.094 rad -2.793 2.793" in " ".join(at_home[1].split())
    code, _, err = rmrc("inspect", TWO, "--q", "0,3")
    assert (code, err) == (0, says("rmrc: warning: elbow = 3 … limits [-2.793, 2.793]\n"))


def test_the_json_of_inspect_has_the_attributes_of_the_answer(facts):
    error, q = [0.001, 0.001, 0.002, 0.001, 0.001, 0.001], [0.3, 1.0, 0.6, 0.7, 0.0, 0.2]
    code, printed = facts(
        "inspect", STANFORD, "--site", "wrist", "--q", "0.3,1,0.6,0.7,0,0.2", "--frame", "site",
        "--joint-error", ",".join(map(str, error)), "--length", "0.5",
    )  # fmt: skip
    arm = arms.load(ROOT / "models/stanford.xml", "wrist")
    found = inspect(arm, q, length=0.5, frame="site", joint_error=error)
    of_arm = {"model", "site", "assumed", "joints", "kinds", "units", "limits"}
    assert code == 0 and set(printed) == of_arm | {field.name for field in fields(Inspection)} - {"arm"}
    np.testing.assert_array_equal(printed["jacobian"], found.jacobian)
    np.testing.assert_array_equal(printed["lost"][0]["wrench"], found.lost[0].wrench)
    assert printed["condition"] is None and (printed["rank"], printed["rank_by_minors"]) == (5, 5)
    assert (printed["kinds"][2], printed["units"][2]) == ("slide", "m")


# ik ----------------------------------------------------------------------------------------------


def test_the_json_of_ik_is_what_mujoco_says(facts):
    code, found = facts("ik", "planar_3link", "--to", "0.5,0.3,120 deg", "--q", "10 deg,20 deg,30 deg")
    arm = arms.load(ROOT / "models/planar_3link.xml")
    pose = arm.pose(list(found["q"].values()))
    assert code == 0 and found["found"] is True and [*found["q"]] == list(arm.joints)
    assert found["pose"] == pose.tolist() and found["error"] <= found["tolerance"] == 1e-9
    assert_allclose(pose[:2], [0.5, 0.3], atol=1e-9)


def test_a_goal_out_of_reach_exits_1_and_says_how_near_it_came_and_what_is_in_the_way(rmrc, facts):
    code, out, err = rmrc("ik", TWO, "--to", "0,3")
    assert (code, err) == (1, says("rmrc: not reached: 1 m and 0 rad … 201 starts\n"))
    assert out.splitlines()[0] == "Not reached; the nearest: planar_2link, tip"
    assert "shoulder 1.570796 rad 90.000" in out and "elbow    0.000000 rad  0.000" in out
    code, found = facts("ik", TWO, "--to", "0.2,0")
    left = 2 * np.cos(np.radians(80)) - 0.2  # two links of 1 m, folded by 160°
    assert code == 1 and list(found["at_limit"]) == ["elbow"]
    assert_allclose(found["position_error"], left, atol=1e-8)
    assert rmrc("ik", TWO, "--to", "0.2,0", "--no-limits")[0] == 0
    assert rmrc("ik", TWO, "--to", "0,2.000001")[0] == 1
    assert rmrc("ik", TWO, "--to", "0,2.000001", "--tolerance", "1e-5")[0] == 0


def test_newton_prints_the_equations_of_each_step(rmrc, facts):
    ask = ("ik", "selig_211", "--to", "0.5,3,120 deg", "--method", "newton")
    path = {key: np.array(values) for key, values in facts(*ask)[1]["iterates"].items()}
    for q, f, J in zip(path["q"], path["f"], path["J"], strict=True):
        assert_allclose(J, textbook.three_link_jacobian([2, 1, 1], q), atol=1e-12)
        beyond = textbook.three_link_position([2, 1, 1], q) - [0.5, 3.0, 2 * np.pi / 3]
        assert_allclose(f, beyond, atol=1e-12)
    # The notes' own digits.
    assert_allclose(path["h"][0], [0.5981, -1.6340, 1.0359], atol=5e-5)
    lines = [line.split() for line in rmrc(*ask)[1].splitlines()]
    begin = lines.index(["f", "J1", "J2", "J3"])
    # The source prints -0.059, -0.756, and -1.4603 for what is -1.3603.
    assert lines[begin + 5] == ["1", "x", "-0.0587", "-2.2441", "-1.3758", "-0.8660"]
    assert lines[begin + 6] == ["y", "-0.7559", "0.4413", "-1.3603", "-0.5000"]


def test_both_postures_of_two_links_are_listed_beside_each_other(rmrc):
    """The links are two sides of a square, from either corner."""
    code, out, err = rmrc("ik", TWO, "--to", "1,1", "--all")
    lines = [line.split() for line in out.splitlines()]
    assert (code, err) == (0, "") and out.startswith("planar_2link, tip: 2 postures; 2000 starts")
    assert ["shoulder", "rad", "0.0000", "1.5708"] in lines and ["elbow", "rad", "1.5708", "-1.5708"] in lines


def test_a_continuum_is_not_listed(rmrc, facts):
    ask = ("ik", TORUS, "--to", "0,0,0.7", "--all")
    code, out, _ = rmrc(*ask)
    assert code == 0 and out.splitlines()[0] == "torus_3r_short, tip: a continuum; 2000 starts"
    found = facts(*ask)[1]
    assert found["continuum"] is True and [each["freedom"] for each in found["postures"]] == [1]


# statics -----------------------------------------------------------------------------------------


def test_the_example_of_the_notes_is_printed_with_both_signs_in_words(rmrc):
    code, out, err = rmrc("statics", TWO, "--q", "0,60 deg", "--wrench", "0,-1,0")
    assert (code, err) == (0, "")
    assert "The wrench acts on the arm: force (0, -1, 0) N, moment (0, 0, 0) N·m, world axes." in out
    assert "Equivalent, Jᵀ F: torques with which the site presses on the world with this wrench." in out
    assert "Balancing, −Jᵀ F: torques that hold the arm still while this wrench acts on it." in out
    cells = [line.split() for line in out.splitlines()]
    assert ["shoulder", "[N·m]", "-1.500", "1.500", "100.0", "98.50", "ok"] in cells
    assert ["elbow", "[N·m]", "-0.5000", "0.5000", "50.00", "49.50", "ok"] in cells
    assert ["elbow", "0.8660", "0.5000", "0", "0", "0", "0.5000"] in cells  # along the link's own axes


def test_the_json_of_statics_has_the_values_with_and_without_the_weight(facts):
    ask = ("statics", STANFORD, "--wrench", "5,-3,4,.5,.2,.4")
    code, found = facts(*ask, "--gravity", "--hold", "5")
    arm = arms.load(ROOT / "models/stanford.xml")
    borne = balance(arm, arm.configuration("home")[arm.wiring.qpos], [5, -3, 4, 0.5, 0.2, 0.4], gravity=True)
    assert code == 0 and found["site"] == "tool" and found["bears_weight"]
    for name in ("equivalent", "equilibrium", "gravity", "margin", "reaction", "driven"):
        assert found[name] == getattr(borne, name).tolist()
    assert found["held"]["agrees"] and np.allclose(found["held"]["measured"], borne.torque, atol=0.01)
    # Negative control: without --gravity drives and links bear less.
    floating = facts(*ask)[1]
    assert floating["gravity"] == [0] * 6 and floating["held"] is None
    assert not np.allclose(floating["torque"], borne.torque, atol=0.01)
    assert np.linalg.norm(floating["reaction"][0][:3]) == pytest.approx(np.linalg.norm([5, 3, 4]))


def test_what_is_too_much_is_not_held_and_what_diverges_exits_3(rmrc):
    code, out, _ = rmrc("statics", TWO, "--q", "0,60 deg", "--wrench", "0,-120,0", "--hold", "0.5")
    assert code == 1 and "MISSED: not still, the fastest joint moves at" in out
    assert "shoulder, elbow reached its torque limit." in " ".join(out.split())
    code, out, err = rmrc("statics", TWO, "--wrench", "0,1e15,0", "--hold", "1")
    assert code == 3 and err.startswith("rmrc: error: diverged at tick ")
    assert f"MISSED: {err.removeprefix('rmrc: error: ').strip()}" in " ".join(out.split())


# workspace ---------------------------------------------------------------------------------------


def test_workspace_leaves_a_picture_and_prints_a_table(rmrc, tmp_path):
    code, out, err = rmrc("workspace", SIX_THREE, "--cells", "60")
    assert (code, err) == (0, "")
    assert "planar_6_3.xml, site tip, slice xy, rows x y" in out and "area [m²]" in out
    rows = {line.partition("  ")[0]: line.split() for line in out.splitlines()}
    # The circle of 9 m, and what the limits leave: from q1 = 135 deg and the forearm level, and from both at 0.
    assert rows["x [m]"][2:] == ["-9.000", "to", "9.000", "-7.243", "to", "9.000"]
    assert rows["y [m]"][2:] == ["-9.000", "to", "9.000", "0", "to", "9.000"]
    assert rows["singular_curves"][1:] == ["elbow", "2", "elbow", "1"]
    (file,) = (tmp_path / "recordings").iterdir()
    assert out.endswith(f"wrote recordings/{file.name}\n") and imread(file).shape[0] > 500


@pytest.mark.usefixtures("undrawn")
def test_the_json_of_workspace_is_its_summary_and_options_reach_it(facts, tmp_path):
    code, found = facts("workspace", SIX_THREE, "--cells", "60", "-o", "b/c.svg")
    assert code == 0 and found["without_limits"]["area"] == pytest.approx(72 * np.pi, rel=0.02)
    limited = found["with_limits"]
    assert limited["area"] == pytest.approx(63.617, abs=limited["area_accuracy"])
    assert found["files"] == ["b/c.svg"] and (tmp_path / "b/c.svg").is_file()
    options = ["--plane", "yz", "--axes", "x,y,z", "--length", "0.5", "--samples", "1000", "--cells", "10"]
    found = facts("workspace", STANFORD, *options)[1]
    assert found["slice"] == "yz" and {"y", "z"} < set(found["with_limits"])
    assert (found["axes"], found["length"], max(found["cells"])) == (["x", "y", "z"], 0.5, 10)


# check and new -----------------------------------------------------------------------------------

BEYOND = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 0 1" range="1 2" limited="true"/>
<geom size=".1"/><site name="tool" pos="1 0 0"/></body></worldbody>
<keyframe><key name="home" qpos="0"/></keyframe></mujoco>"""


def test_check_exits_with_1_where_something_must_be_mended(rmrc, facts, tmp_path):
    (tmp_path / "x.xml").write_text(BEYOND)
    code, out, _ = rmrc("check", "x.xml")
    told = " ".join(out.split())
    assert code == 1 and "Findings: 1 with errors" in told
    assert "joint a is at 0 at home, outside its range [1, 2]" in told
    assert facts("check", "x.xml")[1]["ready"] is False
    code, found = facts("check", TWO)
    assert code == 0 and found["ready"] and found["sigma"] == library.check(TWO).sigma.tolist()


def test_new_writes_a_scenario_that_runs_and_overwrites_nothing_unless_forced(rmrc, tmp_path):
    code, out, _ = rmrc("new", TWO)
    assert code == 0 and "wrote planar_2link.yaml" in out and "run planar_2link.yaml" in out
    assert [path.name for path in tmp_path.iterdir()] == ["planar_2link.yaml"]
    assert rmrc("run", "planar_2link.yaml", "--no-record", "-q")[0] == 0
    (tmp_path / "mine.yaml").write_text("mine")
    told = "mine.yaml: already exists; give another by -o, or overwrite it by --force"
    assert rmrc("new", TWO, "-o", "mine.yaml") == (2, "", f"rmrc: error: {told}\n")
    assert (tmp_path / "mine.yaml").read_text() == "mine"
    assert rmrc("new", TWO, "-o", "mine.yaml", "--force", "-q")[:2] == (0, "")
    assert (tmp_path / "mine.yaml").read_text().startswith("# A first scenario")


def test_the_model_of_a_new_scenario_is_found_from_the_folder_of_its_file(rmrc, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models/x.xml").write_text(BEYOND.replace("1 2", "-1 2"))
    assert rmrc("new", "models/x.xml", "-o", "mine/deep/x.yaml", "-q")[0] == 0
    assert yaml.safe_load((tmp_path / "mine/deep/x.yaml").read_text())["arm"]["model"] == "../../models/x.xml"
    assert rmrc("run", "mine/deep/x.yaml", "--no-record", "-q")[0] == 0


# Mistakes ----------------------------------------------------------------------------------------

MISTAKES = [
    (["inspect", TWO, "--q", "0"], "q … 2 … shoulder, elbow… (1,)"),
    (["inspect", TWO, "--keyframe", "hom"], f'{TWO}: … keyframe "hom" … "home"… home'),
    (["inspect", TWO, "--q", "0,1e300"], "--q: … ±1e+06… '1e300'"),
    (["inspect", TWO, "--site", "tpi"], f'{TWO}: … site "tpi" … "tip"… tip'),
    (["inspect", TWO, "-o", "a.jpg"], "--output a.jpg: … .pdf … .png … .svg"),
    (["ik", TWO], "… to… x, y… to_q"),
    (["ik", TWO, "--to", "1,nan"], '--to: … "60 deg" … "nan"'),
    # whose values would be taken for those of x and y
    (["ik", TWO, "--axes", "y,x", "--to", "1,2"], "--axes: … x y z rx ry rz… in this order… y,x"),
    (["ik", TWO, "--to", "1,1", "--tolerance", "inf"], "--tolerance … 1e-12 and 1… inf"),
    (["statics", TWO, "--wrench", "1,2,3,4,5,60 deg"], "--wrench: … '60 deg'"),
    (
        ["statics", STANFORD, "--wrench", "1,2,3", "--at", "wirst"],
        f'--at: "wirst" … site … {STANFORD} … "wrist"… "tool": wrist, tool',
    ),
    (
        ["statics", TWO, "--wrench", "1,2,3", "--q", "0,3", "--hold", "1"],
        '… hold: joint "elbow" … [-2.79253, 2.79253] rad … 3; …',
    ),
    (["workspace", SIX_THREE, "--map", "beauty"], "… --map… beauty … sigma_min … manipulability…"),
    (["workspace", SIX_THREE, "--plane", "xz"], f'{SIX_THREE}: site "tip" … xz; choose from xy'),
    (["new", TWO, "--site", "hand"], '… has no site "hand"…'),
    (["check", TWO, "--joints", "wrist"], '… no hinge or slide joint "wrist"…'),
    (["new", TWO, "-o", "-", "--json"], "give -o - or --json, not both: …"),
]


@pytest.mark.parametrize(("arguments", "line"), MISTAKES)
def test_a_mistake_is_one_line_with_exit_code_2_and_leaves_nothing(rmrc, tmp_path, arguments, line):
    assert rmrc(*arguments) == (2, "", says(f"rmrc: error: {line}\n"))
    assert list(tmp_path.iterdir()) == []
