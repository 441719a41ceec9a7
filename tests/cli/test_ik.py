"""`rmrc ik`: what it prints, its exit codes, and what it says of bad input, to the letter."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import arm as arms
from rmrc import textbook
from wording import says

TWO, THREE = str(ROOT / "models/planar_2link.xml"), str(ROOT / "models/planar_3link.xml")
PUMA, TORUS = str(ROOT / "models/puma560.xml"), str(ROOT / "models/torus_3r_short.xml")


def lines_are_short(out):
    return max(map(len, out.splitlines())) <= 100


def test_a_goal_that_is_reached(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "1,1")
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "Reached: planar_2link, tip"
    assert "shoulder  1.570796 rad  90.000" in out and "elbow    -1.570796 rad -90.000" in out
    assert lines_are_short(out)


def test_json_is_what_mujoco_says(rmrc):
    code, out, err = rmrc("ik", THREE, "--to", "0.5,0.3,120 deg", "--q", "10 deg,20 deg,30 deg", "--json")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    arm = arms.load(ROOT / "models/planar_3link.xml")
    pose = arm.pose(list(facts["q"].values()))
    assert facts["found"] is True and facts["axes"] == ["x", "y", "rz"] and [*facts["q"]] == list(arm.joints)
    assert facts["pose"] == pose.tolist() and facts["error"] <= facts["tolerance"] == 1e-9
    assert_allclose(pose[:2], [0.5, 0.3], atol=1e-9)
    assert facts["at_limit"] == {} and "iterates" not in facts and "postures" not in facts


def test_a_goal_out_of_reach_exits_1_and_says_how_near_it_came(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "0,3")
    assert code == 1
    assert err == says("rmrc: not reached: 1 m and 0 rad … 201 starts\n")
    assert out.splitlines()[0] == "Not reached; the nearest: planar_2link, tip"
    assert "shoulder 1.570796 rad 90.000" in out and "elbow    0.000000 rad  0.000" in out
    assert lines_are_short(out)


def test_the_limits_in_the_way_are_named(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "0.2,0", "--json")
    assert code == 1
    facts = json.loads(out)
    (side,) = facts["at_limit"].values()
    assert list(facts["at_limit"]) == ["elbow"]
    assert side == ("upper" if facts["q"]["elbow"] > 0 else "lower")
    left = 2 * np.cos(np.radians(80)) - 0.2  # two links of 1 m, folded by 160°
    assert_allclose(facts["position_error"], left, atol=1e-8)
    assert err == says(f"rmrc: not reached: {left:.6g} m and 0 rad … 201 starts; … elbow … {side}…\n")
    code, _, err = rmrc("ik", TWO, "--to", "0.2,0", "--no-limits")
    assert (code, err) == (0, "")


def test_newton_prints_the_equations_of_each_step(rmrc):
    ask = ("ik", "selig_211", "--to", "0.5,3,120 deg", "--method", "newton")
    code, out, _ = rmrc(*ask, "--json")
    path = {key: np.array(values) for key, values in json.loads(out)["iterates"].items()}
    for q, f, J in zip(path["q"], path["f"], path["J"], strict=True):
        assert_allclose(J, textbook.three_link_jacobian([2, 1, 1], q), atol=1e-12)
        beyond = textbook.three_link_position([2, 1, 1], q) - [0.5, 3.0, 2 * np.pi / 3]
        assert_allclose(f, beyond, atol=1e-12)
    # The notes' own digits.
    assert_allclose(path["h"][0], [0.5981, -1.6340, 1.0359], atol=5e-5)
    assert_allclose(path["q"][1], [0.4491, 2.1576, -0.5123], atol=1e-4)
    assert len(path["h"]) <= 6
    for h, f, J in zip(path["h"], path["f"], path["J"], strict=False):
        assert_allclose(J @ h, f, atol=1e-9)
    code, out, _ = rmrc(*ask)
    lines = [line.split() for line in out.splitlines()]
    begin = lines.index(["f", "J1", "J2", "J3"])
    # The source prints -0.059, -0.756, and -1.4603 for what is -1.3603.
    assert lines[begin + 5] == ["1", "x", "-0.0587", "-2.2441", "-1.3758", "-0.8660"]
    assert lines[begin + 6] == ["y", "-0.7559", "0.4413", "-1.3603", "-0.5000"]
    code, out, _ = rmrc("ik", PUMA, "--to-q", "0.2,-1,1,0.3,0.4,0.5", "--method", "newton")
    assert lines_are_short(out)


def test_newton_that_fails_says_so(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "-1.999,0", "--q", "2.9,0.4", "--method", "newton")
    assert code == 1 and "beyond" in out
    assert err == says("rmrc: not reached: … 6 steps … Newton's … --method damped … shoulder (beyond)\n")
    code, out, err = rmrc("ik", TWO, "--to", "0,3", "--method", "newton")
    assert code == 1 and lines_are_short(out)
    assert err == says("rmrc: not reached: … rad … 50 … Newton's … --method damped …\n")


def test_all_postures_side_by_side(rmrc):
    ask = ("ik", PUMA, "--to-q", "0.2,-1,1,0.3,0.4,0.5", "--all", "--no-limits")
    code, out, err = rmrc(*ask)
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "puma560, tool: 8 postures; 2000 starts"
    assert lines_are_short(out)


def test_a_continuum_is_not_listed(rmrc):
    code, out, _ = rmrc("ik", TORUS, "--to", "0,0,0.7", "--all")
    assert code == 0
    assert out.splitlines()[0] == "torus_3r_short, tip: a continuum; 2000 starts"
    assert "rank 2 with 3 joints" in out and lines_are_short(out)
    facts = json.loads(rmrc("ik", TORUS, "--to", "0,0,0.7", "--all", "--json")[1])
    assert facts["continuum"] is True and [one["freedom"] for one in facts["postures"]] == [1]


def test_no_posture_at_all_exits_1(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "0,3", "--all")
    assert code == 1 and "Not reached; the nearest" in out
    assert err == says("rmrc: not reached: 1 m and 0 rad … 201 starts\n")
    facts = json.loads(rmrc("ik", TWO, "--to", "0,3", "--all", "--json")[1])
    assert facts["found"] is False and facts["postures"] == []
    assert_allclose(facts["position_error"], 1.0, atol=1e-12)


def test_the_tolerance_is_the_users(rmrc):
    ask = ("ik", TWO, "--to", "0,2.000001", "--json")
    assert rmrc(*ask)[0] == 1
    assert rmrc(*ask, "--tolerance", "1e-5")[0] == 0


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ((), "… to… x, y… to_q"),
        (("--to", "1"), "… 2 … x, y… 1…"),
        (("--to", "1,nan"), '--to: … "60 deg" … "nan"'),
        (("--to", "1,2e6"), "--to: … ±1e+06… '2e6'"),
        # whose values would be taken for those of x and y
        (("--axes", "y,x", "--to", "1,2"), "--axes: … x y z rx ry rz… in this order… y,x"),
        (("--to-q", "1"), "to_q … 2 … shoulder, elbow… (1,)"),
        (("--to", "1,1", "--quat", "0,0,0,0"), "quat … zero … 0, 0, 0, 0"),
        (("--to", "1,1", "--q", "1,1", "--keyframe", "home"), "… q or keyframe…"),
        (("--to", "1,1", "--tolerance", "inf"), "--tolerance … 1e-12 and 1… inf"),
        (("--to", "1,1", "--all", "--method", "newton"), '… all … "damped"… "newton"'),
    ],
)
def test_bad_input_is_one_line(rmrc, options, line):
    assert rmrc("ik", TWO, *options) == (2, "", says(f"rmrc: error: {line}\n"))
