"""Tables of an inspection: what is hard to see from the command line."""

from dataclasses import replace

import numpy as np
import pytest

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect.inspection import inspect
from rmrc.analysis.inspect.report import report
from rmrc.show.sheets import number


def table(found, title):
    (sheet,) = [sheet for sheet in report(found).sheets if sheet.title.startswith(title)]
    return {row[0]: row[1:] for row in sheet.rows}


@pytest.fixture
def stanford():
    arm = arms.load(ROOT / "models/stanford.xml")
    return inspect(arm, arm.configuration("home")[arm.wiring.qpos], wrench=[1, 2, 3, 0, 0, 0])


def test_ranks_that_disagree_are_told(stanford):
    row = "rank by sigma; by minors"
    assert table(stanford, "The task")[row] == ("6 of 6; 6",)
    other = replace(stanford, rank_by_minors=5)
    assert table(other, "The task")[row] == ("6 of 6; 5 (they disagree: sigma is at the threshold)",)
    assert table(replace(stanford, rank_by_minors=None), "The task")[row] == (
        "6 of 6; not counted: too many",
    )


def test_a_fault_in_a_route_is_printed(stanford):
    faulty = replace(stanford, disagreement={**stanford.disagreement, "screws": 0.08})
    assert table(faulty, "J by other methods")["screws of the joint axes, product of exponentials"] == (
        "0.08000",
    )


def test_numbers_of_j_are_a_line_a_joint(stanford):
    for joint, column in zip(stanford.arm.joints, stanford.jacobian.T, strict=True):
        printed = table(stanford, "J of the site's origin")[joint]
        assert [float(text) for text in printed] == pytest.approx(column, rel=1e-3, abs=1e-12)


def test_slides_are_told_from_hinges(stanford):
    joints, torques = table(stanford, "stanford.xml"), table(stanford, "Torques")
    assert (joints["d_3"][0], joints["d_3"][2], joints["d_3"][3]) == ("slide", "m", "-")
    assert (joints["theta_1"][0], joints["theta_1"][2]) == ("hinge", "rad")
    assert (torques["d_3"][2], torques["theta_1"][2]) == ("N", "N m")
    assert torques["d_3"][0] == number(stanford.balance.equilibrium[2])


def test_a_joint_is_near_its_limit_within_a_twentieth_of_its_range():
    arm = arms.load(ROOT / "models/planar_2link.xml")  # the elbow has 160 deg to either side
    notes = [
        table(inspect(arm, [0, np.radians(160 - way)]), "planar_2link.xml")["elbow"][6] for way in (15, 17)
    ]
    assert notes == ["only 0.2618 rad to its limit", ""]


def test_a_lost_direction_holds_any_force():
    found = inspect(arms.load(ROOT / "models/planar_2link.xml"), [0, 0])
    assert table(found, "Half axes") == {
        "along y": ("2.236 m/s", "0.4472 N"),
        "along x": ("0 m/s", "any"),
    }


def test_a_joint_without_limits_has_none(stanford):
    free = replace(stanford.arm, position_limit=np.full((6, 2), [-np.inf, np.inf]))
    assert table(replace(stanford, arm=free), "stanford.xml")["theta_1"][4:] == ("none", "none", "")
