"""`rmrc ik`: what it prints, its exit codes, and what it says of bad input, to the letter."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import arm as arms
from rmrc import textbook
from rmrc.analysis.ik import ik
from rmrc.analysis.ik.solve import goal_pose, solve_ik
from rmrc.law.task import choose
from wording import says

TWO, THREE = str(ROOT / "models/planar_2link.xml"), str(ROOT / "models/planar_3link.xml")
PUMA, TORUS = str(ROOT / "models/puma560.xml"), str(ROOT / "models/torus_3r_short.xml")

NOTES = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
<body><joint name="q1" axis="0 0 1"/><geom size="0.1"/>
<body pos="2 0 0"><joint name="q2" axis="0 0 1"/><geom size="0.1"/>
<body pos="1 0 0"><joint name="q3" axis="0 0 1"/><geom size="0.1"/><site name="tip" pos="1 0 0"/>
</body></body></body></worldbody></mujoco>"""


@pytest.fixture(autouse=True, scope="module")
def _compiled_before():
    # Else whichever test is first says that it compiles.
    task = choose(arms.load(ROOT / "models/planar_2link.xml"))
    solve_ik(task, goal_pose(task, [1.0, 1.0]))


FOUND = {}


@pytest.fixture
def asked_once(monkeypatch):
    """Have the same question searched once, for its table and its JSON, and for all tests."""
    search = ik.ik

    def ask(arm, **options):
        key = arm.path, repr(options)
        if key not in FOUND:
            FOUND[key] = search(arm, **options)
        return FOUND[key]

    monkeypatch.setattr(ik, "ik", ask)


def lines_are_short(out):
    return max(map(len, out.splitlines())) <= 100


def test_a_goal_that_is_reached(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "1,1")
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "Reached: planar_2link, tip"
    assert "shoulder  1.570796 rad  90.000" in out and "elbow    -1.570796 rad -90.000" in out
    assert lines_are_short(out)


def test_json_is_what_the_function_returns(rmrc):
    code, out, err = rmrc("ik", THREE, "--to", "0.5,0.3,120 deg", "--q", "10 deg,20 deg,30 deg", "--json")
    assert (code, err) == (0, "")
    facts = json.loads(out)
    task = choose(arms.load(ROOT / "models/planar_3link.xml"))
    found = solve_ik(task, goal_pose(task, [0.5, 0.3, np.radians(120)]), np.radians([10, 20, 30]))
    assert facts["found"] is True and facts["axes"] == ["x", "y", "rz"]
    assert facts["q"] == dict(zip(task.arm.joints, found.q.tolist(), strict=True))
    assert facts["pose"] == task.arm.pose(found.q).tolist()
    assert facts["error"] == found.error <= facts["tolerance"] == 1e-9
    assert facts["at_limit"] == {} and facts["beyond_limit"] == [] and "iterates" not in facts


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
    assert err == says(f"rmrc: not reached: {left:.6g} m and 0 rad … 201 starts; elbow … {side} limit\n")
    code, _, err = rmrc("ik", TWO, "--to", "0.2,0", "--no-limits")
    assert (code, err) == (0, "")


def test_newton_prints_the_iterates_of_the_notes(rmrc, tmp_path):
    (tmp_path / "notes.xml").write_text(NOTES)
    ask = (
        "ik", "notes.xml", "--to", "0.5,3.0,120 deg", "--q", "60 deg,30 deg,30 deg", "--method", "newton",
    )  # fmt: skip
    code, out, err = rmrc(*ask)
    assert (code, err) == (0, "")
    lines = [line.split() for line in out.splitlines()]
    q, h = lines.index(["|e|", "q1", "q2", "q3"]), lines.index(["h1", "h2", "h3"])
    # The first step in closed form, with the notes' J of l = (2, 1, 1).
    angles = np.radians([60, 30, 30])
    s, c = np.sin(np.cumsum(angles)), np.cos(np.cumsum(angles))
    lengths = np.array([2.0, 1.0, 1.0])
    J = np.array(
        [[-(lengths * s)[j:].sum() for j in range(3)], [(lengths * c)[j:].sum() for j in range(3)], [1, 1, 1]]
    )
    step = np.linalg.solve(J, [lengths @ c - 0.5, lengths @ s - 3.0, 0.0])
    assert lines[h + 2][1:] == [f"{value:.6f}" for value in step]
    assert lines[q + 3][2:] == [f"{value:.6f}" for value in angles - step]
    joints = [words[:2] for words in lines if len(words) > 2 and words[2] == "rad"]
    assert joints == [["q1", "0.698863"], ["q2", "1.431888"], ["q3", "-0.036356"]]
    assert lines_are_short(out)
    code, out, _ = rmrc(*ask, "--json")
    path = json.loads(out)["iterates"]
    # The notes' own digits.
    assert_allclose(path["h"][0], [0.5981, -1.6340, 1.0359], atol=5e-5)
    assert_allclose(path["q"][1], [0.4491, 2.1576, -0.5123], atol=1e-4)
    assert len(path["h"]) <= 6


def test_newton_prints_the_equations_of_each_step(rmrc):
    ask = ("ik", "selig_211", "--to", "0.5,3,120 deg", "--method", "newton")
    code, out, _ = rmrc(*ask, "--json")
    path = {key: np.array(values) for key, values in json.loads(out)["iterates"].items()}
    for q, f, J in zip(path["q"], path["f"], path["J"], strict=True):
        assert_allclose(J, textbook.three_link_jacobian([2, 1, 1], q), atol=1e-12)
        beyond = textbook.three_link_position([2, 1, 1], q) - [0.5, 3.0, 2 * np.pi / 3]
        assert_allclose(f, beyond, atol=1e-12)
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
    assert code == 1
    assert err == says("rmrc: not reached: Newton's … limits … shoulder; … --method damped … --no-limits\n")
    assert "Not reached; the end of the steps: planar_2link, tip" in out and "beyond" in out
    code, out, err = rmrc("ik", TWO, "--to", "0,3", "--method", "newton")
    assert code == 1 and lines_are_short(out)
    assert err == says("rmrc: not reached: … rad … 50 … Newton's … --method damped\n")


def test_damped_iterates_come_with_their_damping(rmrc):
    code, out, _ = rmrc("ik", PUMA, "--to-q", "0.2,-1,1,0.3,0.4,0.5", "--iterates")
    assert code == 0 and "λ" in out and lines_are_short(out)
    code, out, _ = rmrc("ik", PUMA, "--to-q", "0.2,-1,1,0.3,0.4,0.5", "--iterates", "--json")
    path = json.loads(out)["iterates"]
    assert len(path["damping"]) == len(path["h"]) == len(path["error"]) - 1 == len(path["q"]) - 1


@pytest.mark.usefixtures("asked_once")
def test_all_postures_side_by_side(rmrc):
    ask = ("ik", PUMA, "--to-q", "0.2,-1,1,0.3,0.4,0.5", "--all", "--no-limits")
    code, out, err = rmrc(*ask)
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "puma560, tool: 8 postures; 2000 starts"
    assert lines_are_short(out)
    facts = json.loads(rmrc(*ask, "--json")[1])
    assert len(facts["postures"]) == 8 and facts["continuum"] is False
    own = [list(one["q"].values()) for one in facts["postures"]]
    assert np.abs(np.array(own) - [0.2, -1, 1, 0.3, 0.4, 0.5]).max(axis=1).min() < 1e-9
    assert all(one["freedom"] == 0 and one["starts"] > 0 for one in facts["postures"])


@pytest.mark.usefixtures("asked_once")
def test_a_continuum_is_not_listed(rmrc):
    code, out, _ = rmrc("ik", TORUS, "--to", "0,0,0.7", "--all")
    assert code == 0
    assert out.splitlines()[0] == (
        "torus_3r_short, tip: a continuum; the table shows its posture nearest to the start; 2000 starts"
    )
    assert lines_are_short(out)
    facts = json.loads(rmrc("ik", TORUS, "--to", "0,0,0.7", "--all", "--json")[1])
    assert facts["continuum"] is True and [one["freedom"] for one in facts["postures"]] == [1]


def test_no_posture_at_all_exits_1(rmrc):
    code, out, err = rmrc("ik", TWO, "--to", "0,3", "--all")
    assert code == 1 and "Not reached; the nearest" in out
    assert err == says("rmrc: not reached: 1 m and 0 rad … 201 starts\n")
    facts = json.loads(rmrc("ik", TWO, "--to", "0,3", "--all", "--json")[1])
    assert facts["found"] is False and facts["postures"] == []
    assert_allclose(facts["position_error"], 1.0, atol=1e-12)


def test_the_orientation_can_be_a_quaternion(rmrc):
    arm = arms.load(ROOT / "models/puma560.xml")
    pose = arm.pose([0.2, -1, 1, 0.3, 0.4, 0.5])
    # In any length, and of either sign: both say the same.
    to, quat = (",".join(map(str, part)) for part in (pose[:3], -2.0 * pose[3:]))
    code, out, _ = rmrc("ik", PUMA, "--to", to, "--quat", quat, "--json")
    facts = json.loads(out)
    assert code == 0
    assert_allclose(facts["pose"][:3], pose[:3], atol=1e-9)
    assert_allclose(abs(np.dot(facts["pose"][3:], pose[3:])), 1.0, atol=1e-12)


def test_the_tolerance_is_the_users(rmrc):
    ask = ("ik", TWO, "--to", "0,2.000001", "--json")
    assert rmrc(*ask)[0] == 1
    assert rmrc(*ask, "--tolerance", "1e-5")[0] == 0


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ((), "… --to … x, y … --to-q"),
        (("--to", "1"), "--to … 2 … x, y … 1: '1'"),
        (("--to", "1,2,3"), "--to … 2 … x, y … 3: '1,2,3'"),
        (("--to", "1,nan"), '--to, y: … "60 deg" … "nan"'),
        (("--to", "1,1e999"), '--to, y: … "60 deg" … "1e999"'),
        (("--to", "1,2e6"), "--to, y: … ±1e+06 … '2e6'"),
        # whose values would be taken for those of x and y
        (("--axes", "y,x", "--to", "1,2"), "--axes: … x y z rx ry rz … y,x; … x,y"),
        (("--axes", "x,u", "--to", "1,2"), '--axes: … "u" … x y z rx ry rz'),
        (("--to-q", "1"), "--to-q … 2 … shoulder, elbow … 1: '1'"),
        (("--to", "1,1", "--to-q", "1,1"), "… --to-q … --to and --quat …"),
        (("--to", "1,1", "--quat", "0,0,0,0"), "--quat … zero … '0,0,0,0'"),
        (("--to", "1,1", "--quat", "1,0"), "--quat … 4 … w, x, y, z … 2: '1,0'"),
        (("--quat", "1,0,0,0"), "--quat … --to … x, y"),
        (("--to", "1,1", "--q", "1,1", "--keyframe", "home"), "… --q or --keyframe …"),
        (("--to", "1,1", "--tolerance", "inf"), "--tolerance … 1e-12 and 1 … inf"),
        (("--to", "1,1", "--length", "inf"), "--length … 1e-06 and 1e+06 … inf"),
        (("--to", "1,1", "--all", "--iterates"), "… --all or --iterates …"),
        (("--to", "1,1", "--all", "--method", "newton"), "… --all or --method newton …"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(rmrc, options, line):
    assert rmrc("ik", TWO, *options) == (2, "", says(f"rmrc: error: {line}\n"))


def test_an_unknown_site_is_told(rmrc):
    told = says(f'rmrc: error: {TWO}: … site "top" … "tip"… tip\n')
    assert rmrc("ik", TWO, "--to", "1,1", "--site", "top") == (2, "", told)


def test_the_goal_of_the_rows_that_count_alone(rmrc):
    code, out, _ = rmrc("ik", PUMA, "--axes", "x,y,z", "--to", "0.3,0.4,0.5", "--json")
    facts = json.loads(out)
    assert code == 0 and facts["axes"] == ["x", "y", "z"]
    assert_allclose(facts["pose"][:3], [0.3, 0.4, 0.5], atol=1e-9)


def test_a_joint_without_limits_has_none(rmrc):
    out = rmrc("ik", TWO, "--to", "1,1", "--no-limits")[1]
    (shoulder,) = (line for line in out.splitlines() if line.startswith("shoulder"))
    assert shoulder.split()[-2:] == ["none", "none"]
