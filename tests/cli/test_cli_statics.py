"""The verb `statics`: what it prints, its JSON, its exit codes, and every mistake in full."""

import json

import numpy as np
import pytest

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.statics.balance import balance
from wording import says

TWO, STANFORD = (str(ROOT / f"models/{name}.xml") for name in ("planar_2link", "stanford"))
STRETCHED = (TWO, "--q", "90 deg,0", "--wrench", "0,-1000,0")


def rows(out):
    """Return the cells of the lines of a table or text, split at two blanks or more."""
    return [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in out.splitlines()]


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
    assert out.count("Of the wrench alone.") == 2


def test_stretched_it_says_what_needs_no_torque_and_holds_it(rmrc):
    code, out, err = rmrc("statics", *STRETCHED, "--hold", "2")
    assert (code, err) == (0, "")
    assert "cannot move along y; a force along y needs no torque" in out
    assert (
        "met: still, and the actuator torques agree with statics; no actuator reached its torque limit."
        in " ".join(out.split())
    )


def test_what_is_too_much_is_said_and_is_not_held(rmrc):
    code, out, err = rmrc("statics", TWO, "--q", "0,60 deg", "--wrench", "0,-120,0")
    assert (code, err) == (0, "")  # it was asked, and answered
    cells = [line.split() for line in out.splitlines()]
    assert ["shoulder", "[N·m]", "-180.0", "180.0", "100.0", "-80.00", "EXCEEDED"] in cells
    code, out, _ = rmrc("statics", TWO, "--q", "0,60 deg", "--wrench", "0,-120,0", "--hold", "0.5")
    assert code == 1
    assert "MISSED: not still, the fastest joint moves at" in out
    assert "shoulder, elbow reached its torque limit." in " ".join(out.split())


@pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.long)])
def test_no_line_is_wider_than_100_columns_and_nothing_is_cut_off(rmrc, every):
    for model in sorted((ROOT / "models").glob("*.xml"))[::every]:
        code, out, _ = rmrc("statics", str(model), "--wrench", "1,-2,3,0.4,0.5,-0.6", "--gravity")
        assert code == 0
        assert max(map(len, out.splitlines())) <= 100
        assert "…" not in out
        for joint in arms.load(model).joints:
            assert sum(line.startswith(joint) for line in out.splitlines()) >= 3


def facts(rmrc, *arguments):
    code, out, err = rmrc("statics", *arguments, "--json")
    assert err == ""
    return code, json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def test_json_has_the_values_and_tables_say_whether_the_weight_is_among_them(rmrc):
    arguments = STANFORD, "--wrench", "5,-3,4,.5,.2,.4"
    code, found = facts(rmrc, *arguments, "--gravity", "--hold", "5")
    arm = arms.load(ROOT / "models/stanford.xml")
    borne = balance(arm, arm.configuration("home")[arm.wiring.qpos], [5, -3, 4, 0.5, 0.2, 0.4], gravity=True)
    assert code == 0 and found["site"] == "tool" and found["bears_weight"]
    for name in ("equivalent", "equilibrium", "gravity", "margin", "reaction", "driven"):
        assert found[name] == getattr(borne, name).tolist()
    assert found["held"]["agrees"] and np.allclose(found["held"]["measured"], borne.torque, atol=0.01)
    assert rmrc("statics", *arguments, "--gravity")[1].count("Of the wrench and of the weight.") == 2
    # Negative control: without --gravity drives and links bear less.
    _, floating = facts(rmrc, *arguments)
    assert floating["gravity"] == [0] * 6 and floating["held"] is None
    assert not np.allclose(floating["torque"], borne.torque, atol=0.01)
    assert np.linalg.norm(floating["reaction"][0][:3]) == pytest.approx(np.linalg.norm([5, 3, 4]))


def test_a_wrench_along_the_sites_axes_is_turned_into_the_worlds(rmrc):
    _, found = facts(rmrc, TWO, "--q", "30 deg,60 deg", "--wrench", "2,0,0,3,0,0", "--frame", "site")
    # at 90° the site's x is the world's y
    assert np.allclose(found["wrench"], [0, 2, 0, 0, 3, 0], rtol=0, atol=1e-12)
    assert np.allclose(found["equilibrium"], [-2 * np.cos(np.pi / 6), 0], rtol=0, atol=1e-12)


def test_the_wrench_at_another_site_is_told_with_both_transforms(rmrc):
    arguments = (STANFORD, "--site", "tool", "--at", "wrist", "--wrench", "0,0,-10", "--frame", "site")
    code, out, _ = rmrc("statics", *arguments)
    assert code == 0 and "The same wrench at wrist {A}, along its axes, from tool {B}" in out
    assert max(map(len, out.splitlines())) <= 100
    _, found = facts(rmrc, *arguments)
    assert found["at"]["site"] == "wrist"
    # Along the hand's own axis: no lever.
    assert np.allclose(found["at"]["wrench"], [0, 0, -10, 0, 0, 0], rtol=0, atol=1e-12)
    _, across = facts(rmrc, *arguments[:-3], "10,0,0", "--frame", "site")
    assert np.allclose(across["at"]["wrench"], [10, 0, 0, 0, 2.63, 0], rtol=0, atol=1e-12)  # 0.263 m · 10 N
    _, without = facts(rmrc, STANFORD, "--wrench", "1,2,3")
    assert without["at"] is None


MISTAKES = {
    "a wrench of 2": ([TWO, "--wrench", "1,2"], "wrench … 6 … fx, fy, fz, nx, ny, nz… (2,)"),
    "an angle": ([TWO, "--wrench", "1,2,3,4,5,60 deg"], "--wrench: … '60 deg'"),
    "infinite": ([TWO, "--wrench", "1,2,inf"], "--wrench: … ±1e+100… 'inf'"),
    "at a site of another body": (
        [STANFORD, "--wrench", "1,2,3", "--at", "wirst"],
        f'--at: "wirst" … site … {STANFORD} … "wrist"… "tool": wrist, tool',
    ),
    "beyond the limits": (
        [TWO, "--wrench", "1,2,3", "--q", "0,3", "--hold", "1"],
        '… hold: joint "elbow" … [-2.79253, 2.79253] rad … 3; …',
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_line_and_exit_code_2(rmrc, case):
    arguments, message = MISTAKES[case]
    code, out, err = rmrc("statics", *arguments)
    assert (code, out, err) == (2, "", says(f"rmrc: error: {message}\n"))


def test_what_diverges_exits_3_and_ctrl_c_130(rmrc, monkeypatch):
    code, out, err = rmrc("statics", TWO, "--wrench", "0,1e15,0", "--hold", "1")
    assert code == 3
    assert err.startswith("rmrc: error: diverged at tick ")
    assert f"MISSED: {err.removeprefix('rmrc: error: ').strip()}" in " ".join(out.split())

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("rmrc.analysis.statics.statics.hold_wrench", interrupted)
    code, _, err = rmrc("statics", TWO, "--wrench", "0,1,0", "--hold", "1")
    assert (code, err) == (130, "rmrc: interrupted\n")
