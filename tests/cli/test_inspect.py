"""The verb `inspect`: what it prints, as tables and as JSON, and how it refuses."""

import json

import numpy as np
import pytest

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect.inspection import inspect
from rmrc.analysis.inspect.report import KEYS, report
from wording import says

TWO, STANFORD = str(ROOT / "models/planar_2link.xml"), str(ROOT / "models/stanford.xml")


def finite(value):
    """Return whether a JSON value has no number that is not finite."""
    if isinstance(value, dict):
        return all(map(finite, value.values()))
    if isinstance(value, list):
        return all(map(finite, value))
    return not isinstance(value, float) or np.isfinite(value)


def test_it_tells_what_is_lost_at_full_reach(rmrc):
    code, out, err = rmrc("inspect", TWO, "--q", "0, 0 deg")
    assert (code, err) == (0, "")
    for words in (
        "planar_2link.xml, site tip",
        "cannot move along x; a force along x needs no torque",
        "shoulder and elbow turn against each other, 1 : -2, without moving x and y of the site",
        "rank by sigma; by minors 1 of 2; 1",
        "velocities propagated outward, link to link",
    ):
        assert words in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 100


def test_without_a_configuration_it_is_home(rmrc):
    at_home = rmrc("inspect", TWO)
    assert (
        at_home
        == rmrc("inspect", TWO, "--keyframe", "home")
        == rmrc("inspect", TWO, "--q", "60 deg,-120 deg")
    )
    assert "lost          nothing: the arm can move and turn in all directions of the task" in at_home[1]


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
def test_tables_are_at_most_100_columns_for_all_models_and_options(rmrc, every):
    for path in sorted((ROOT / "models").glob("*.xml"))[::every]:
        arm = arms.load(path)
        errors = ",".join(["0.001"] * arm.n)
        code, out, _ = rmrc("inspect", str(path), "--joint-error", errors, "--wrench", "1,2,3,-4,5e3,6",
                            "--frame", "base", "--length", "0.5")  # fmt: skip
        assert code == 0
        assert max(map(len, out.splitlines())) <= 100
        assert "…" not in out
        given = ", ".join(f"0.00100 {unit}" for unit in arm.units)
        assert f"Errors of the site for joint errors dq of {given}" in " ".join(out.split())
        for joint in arm.joints:
            assert out.count(joint) >= 4  # joints, J, torques, reactions


def test_json_is_what_the_function_finds_with_the_keys_that_are_documented(rmrc):
    arm = arms.load(ROOT / "models/stanford.xml", "wrist")
    q, wrench = [0.3, 1.0, 0.6, 0.7, 0.0, 0.2], [0.0, 0, -10, 0, 1, 0]
    code, out, err = rmrc(
        "inspect", STANFORD, "--site", "wrist", "--q", "0.3,1,0.6,0.7,0,0.2", "--frame", "site", "--length", "0.5",
        "--joint-error", "0.001,0.001,0.002,0.001,0.001,0.001", "--wrench", "0,0,-10,0,1,0", "--json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    printed = json.loads(out)
    found = inspect(arm, q, length=0.5, frame="site", wrench=wrench,
                        joint_error=[0.001, 0.001, 0.002, 0.001, 0.001, 0.001])  # fmt: skip
    assert printed == json.loads(json.dumps(report(found).json, allow_nan=False))
    assert set(printed) == set(KEYS)
    np.testing.assert_array_equal(printed["jacobian"], found.jacobian)
    assert printed["condition"] is None and printed["rank"] == {"by_singular_values": 5, "by_minors": 5}
    assert printed["joints"][2]["kind"] == "slide" and printed["joints"][2]["unit"] == "m"
    assert len(printed["statics"]["reactions"]) == 6 and finite(printed)


def test_json_without_options_limits_or_a_value_has_null(rmrc, tmp_path):
    (tmp_path / "free.xml").write_text(
        '<mujoco><worldbody><body><joint name="a" axis="0 0 1"/><geom size="0.1"/>'
        '<site name="s" pos="1 0 0"/></body></worldbody></mujoco>'
    )
    code, out, _ = rmrc("inspect", "free.xml", "--axes", "x,y", "--json")
    printed = json.loads(out)
    assert code == 0 and finite(printed)
    assert printed["joints"][0]["limits"] == [None, None] and printed["joints"][0]["room"] is None
    for key in ("determinant", "tip_error", "statics"):
        assert printed[key] is None
    assert printed["euler_rates"]["analytic_jacobian"] is None
    assert printed["ellipsoids"][0]["force"][1] is None


def test_several_configurations_follow_one_another(rmrc):
    code, out, _ = rmrc("inspect", TWO, "--q", "0,0", "--q", "0,1", "--json")
    one, other = json.loads(out)
    assert code == 0 and (len(one["lost"]), len(other["lost"])) == (1, 0)
    code, out, _ = rmrc("inspect", TWO, "--q", "0,0", "--q", "0,1")
    assert out.count("planar_2link.xml, site tip") == 2


def test_one_joint_error_is_for_all_joints_of_one_kind(rmrc):
    one = rmrc("inspect", TWO, "--joint-error", "0.1 deg", "--json")
    assert one == rmrc("inspect", TWO, "--joint-error", "0.1 deg, 0.1 deg", "--json")
    assert json.loads(one[1])["tip_error"]["joints"] == [np.radians(0.1)] * 2


def test_outside_of_limits_is_a_warning_and_no_error(rmrc):
    code, out, err = rmrc("inspect", TWO, "--q", "0,3")
    assert (code, err) == (0, says("rmrc: warning: elbow = 3 … limits: … upper … 2.793\n"))
    assert "outside by 0.2075 rad" in out
    code, out, err = rmrc("inspect", TWO, "--q", "0,2.7")
    assert (code, err) == (0, "") and "only 0.09253 rad to its limit" in out


def test_a_picture_is_drawn(rmrc, tmp_path):
    code, _, err = rmrc("inspect", TWO, "--q", "0,0", "--q", "0,1", "--picture", "new/arm.svg")
    assert (code, err) == (0, "")
    assert "2: $q$ = 0, 1.000" in (tmp_path / "new/arm.svg").read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--q", "0"], "--q … 2 … shoulder, elbow … 1: '0'"),
        (["--q", "0,nan"], '--q, elbow: … "60 deg" … "nan"'),
        (["--q", "0,0", "--keyframe", "home"], "… --q or --keyframe …"),
        (["--keyframe", "hom"], '{model}: … keyframe "hom" … "home"… home'),
        (["--keyframe", ""], '{model}: … keyframe "" … home'),
        (["--q", "0,1e300"], "--q, elbow: … ±1e+06 … '1e300'"),
        (["--joint-error", "1e200"], "--joint-error, joint: … ±1e+06 … '1e200'"),
        (["--length", "nan"], "--length … 1e-06 and 1e+06 … nan"),
        (["--axes", "x,x"], "--axes: … x y z rx ry rz … x,x; … x"),
        (["--site", "tpi"], '{model}: … site "tpi" … "tip"… tip'),
        (["--body", "link"], '{model}: … body "link" … "link_2"… base, link_1, link_2'),
        (["--body", "link_2", "--site", "tip"], "… --site or --body …"),
        (["--package", "a=gone"], "--package … NAME=FOLDER … 'a=gone'"),
        (["--axes", "x,q"], '--axes: … "q" … x y z rx ry rz'),
        (["--frame", "wrld"], 'frame: … "wrld" … "world"… world base site'),
        (["--joint-error", "1,2,3"], "--joint-error … 2 … shoulder, elbow … 3: '1,2,3'"),
        (["--wrench", "1,2"], "--wrench … 6 … fx,fy,fz [N] … nx,ny,nz [N·m] … 3 … 2: '1,2'"),
        (["--picture", "a.jpg"], "--picture a.jpg: … .png, .svg or .pdf"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(rmrc, tmp_path, arguments, message):
    assert rmrc("inspect", TWO, *arguments) == (2, "", says(f"rmrc: error: {message.format(model=TWO)}\n"))
    assert list(tmp_path.iterdir()) == []


def test_one_joint_error_for_joints_of_two_kinds_is_refused(rmrc):
    told = says("rmrc: error: --joint-error 0.1 deg: … theta_1, theta_2, d_3, theta_4, theta_5, theta_6\n")
    assert rmrc("inspect", STANFORD, "--joint-error", "0.1 deg") == (2, "", told)
