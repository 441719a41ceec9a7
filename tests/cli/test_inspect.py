"""The verb `inspect`: what it prints, as tables and as JSON, and how it refuses."""

import json
from dataclasses import fields

import numpy as np
import pytest

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect.inspection import Inspection, inspect
from wording import says

TWO, STANFORD = str(ROOT / "models/planar_2link.xml"), str(ROOT / "models/stanford.xml")


def test_without_a_configuration_it_is_home_and_the_table_has_j_and_the_limits(rmrc):
    at_home = rmrc("inspect", TWO)
    assert at_home[0] == 0
    assert at_home == rmrc("inspect", TWO, "--keyframe", "home")
    assert at_home == rmrc("inspect", TWO, "--q", "60 deg,-120 deg")
    # Links of 1 m at 60 and -60 deg: J of the elbow is (sin 60, cos 60); its limits are 160 deg.
    assert "elbow 0.8660 0.5000 0 0 0 1.000 -2.094 rad -2.793 2.793" in " ".join(at_home[1].split())


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
def test_tables_are_at_most_100_columns_for_all_models_and_options(rmrc, every):
    for path in sorted((ROOT / "models").glob("*.xml"))[::every]:
        errors = ",".join(["0.001"] * arms.load(path).n)
        code, out, _ = rmrc(
            "inspect", str(path), "--joint-error", errors, "--frame", "base", "--length", "0.5"
        )
        assert code == 0 and "…" not in out
        assert max(map(len, out.splitlines())) <= 100


def test_json_has_the_attributes_of_the_answer_and_no_number_that_is_not_finite(rmrc):
    arm, q = arms.load(ROOT / "models/stanford.xml", "wrist"), [0.3, 1.0, 0.6, 0.7, 0.0, 0.2]
    code, out, err = rmrc(
        "inspect", STANFORD, "--site", "wrist", "--q", "0.3,1,0.6,0.7,0,0.2", "--frame", "site",
        "--joint-error", "0.001,0.001,0.002,0.001,0.001,0.001", "--length", "0.5", "--json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    printed = json.loads(out, parse_constant=pytest.fail)
    found = inspect(arm, q, length=0.5, frame="site", joint_error=[0.001, 0.001, 0.002, 0.001, 0.001, 0.001])
    of_arm = {"model", "site", "assumed", "joints", "kinds", "units", "limits"}
    assert set(printed) == of_arm | {field.name for field in fields(Inspection)} - {"arm"}
    np.testing.assert_array_equal(printed["jacobian"], found.jacobian)
    np.testing.assert_array_equal(printed["lost"][0]["wrench"], found.lost[0].wrench)
    assert printed["condition"] is None and (printed["rank"], printed["rank_by_minors"]) == (5, 5)
    assert (printed["kinds"][2], printed["units"][2]) == ("slide", "m")
    assert printed["task"] == {"rows": ["x", "y", "z", "rx", "ry", "rz"], "frame": "world", "length": 0.5}


def test_the_picture_is_a_file(rmrc, tmp_path):
    code, _, _ = rmrc("inspect", TWO, "--q", "0,1", "-o", "new/arm.svg")
    assert code == 0 and "= 0, 1.000" in (tmp_path / "new/arm.svg").read_text("utf-8")


def test_one_joint_error_is_for_all_joints_of_one_kind(rmrc):
    one = rmrc("inspect", TWO, "--joint-error", "0.1 deg", "--json")
    assert one == rmrc("inspect", TWO, "--joint-error", "0.1 deg, 0.1 deg", "--json")
    assert json.loads(one[1])["tip_error"]["joints"] == [np.radians(0.1)] * 2
    told = says("rmrc: error: joint error … 6 … theta_1, theta_2, d_3, theta_4, theta_5, theta_6… (1,)\n")
    assert rmrc("inspect", STANFORD, "--joint-error", "0.1 deg") == (2, "", told)


def test_outside_of_limits_is_a_warning_and_no_error(rmrc):
    code, _, err = rmrc("inspect", TWO, "--q", "0,3")
    assert (code, err) == (0, says("rmrc: warning: elbow = 3 … limits [-2.793, 2.793]\n"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--q", "0"], "q … 2 … shoulder, elbow… (1,)"),
        (["--q", "0,nan"], '--q: … "60 deg" … "nan"'),
        (["--q", "0,0", "--keyframe", "home"], "… q or keyframe…"),
        (["--keyframe", "hom"], '{model}: … keyframe "hom" … "home"… home'),
        (["--q", "0,1e300"], "--q: … ±1e+06… '1e300'"),
        (["--length", "nan"], "--length … 1e-06 and 1e+06… nan"),
        (["--axes", "x,x"], "--axes: … x y z rx ry rz… once each… x,x"),
        (["--site", "tpi"], '{model}: … site "tpi" … "tip"… tip'),
        (["--body", "link_2", "--site", "tip"], "… --site or --body …"),
        (["--frame", "wrld"], 'frame: … "wrld" … "world"… world base site'),
        (["--joint-error", "1,2,3"], "joint error … 2 … shoulder, elbow… (3,)"),
        (["-o", "a.jpg"], "--output a.jpg: … .pdf … .png … .svg"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(rmrc, tmp_path, arguments, message):
    assert rmrc("inspect", TWO, *arguments) == (2, "", says(f"rmrc: error: {message.format(model=TWO)}\n"))
    assert list(tmp_path.iterdir()) == []
