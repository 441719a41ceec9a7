"""The tables and the picture of a search: what is shown of a front, what a setting costs, what is marked."""

import re
from itertools import pairwise

import pytest

from rmrc.tuning.figure import draw_front
from rmrc.tuning.tables import MOST_ROWS, Row, sheets, shown

BEST, SECOND, OWN = (
    Row("recommended", "filtered", "feedback 20", 0.001, 2.0, 5.0),
    Row("second best", "jparse, stop", "gamma 0.1", 0.002, 1.0, 5.0),
    Row("as written", "damped, constant", "maximum 0.1", 0.004, 4.0, 4.0),
)


def test_a_front_is_shown_evenly_up_to_the_largest_error_that_has_a_name():
    front = [Row("", "damped", "", 1.0 / rate, rate, 5.0) for rate in range(1, 1001)]
    rows = shown(front, [BEST, SECOND, OWN])
    assert len(rows) == MOST_ROWS
    assert (rows[0].peak_rate, rows[-1].peak_rate) == (250, 1000)  # 1/250 is 0.004
    steps = {b.peak_rate - a.peak_rate for a, b in pairwise(rows)}
    assert max(steps) - min(steps) <= 1
    # what has a name is always among them
    named = [one._replace(name="recommended") if one.peak_rate == 990 else one for one in front]
    assert [one for one in shown(named, [BEST, SECOND, OWN]) if one.name == ""] == rows
    assert BEST.name in {one.name for one in shown(named, [BEST, SECOND, OWN])}
    assert shown(front[:3], [BEST]) == front[:3]  # nothing is near: all of it
    # rows that look alike are shown once
    a, b = front[1], front[1]._replace(name="as written", error=front[1].error + 1e-6)
    assert shown([b, a, front[2]], [OWN._replace(error=9.0)]) == [b, front[2]]
    assert shown([a, b, front[2]], [OWN._replace(error=9.0)]) == [b, front[2]]


def test_costs_are_ratios_and_differences_to_each_other_setting():
    *_, costs = sheets("x", [("a", "b")], [BEST], [BEST, SECOND, OWN])
    assert costs.rows == [
        ("second best", "x 0.5000", "-0.001 m", "x 2.000", "+1 rad/s", "x 1.000", "+0 s"),
        ("as written", "x 0.2500", "-0.003 m", "x 0.5000", "-2 rad/s", "x 1.250", "+1 s"),
    ]


@pytest.mark.parametrize("limits", [[], [0.5, 3.0, 100.0]])
def test_the_picture_marks_what_has_a_name_and_draws_the_limits_in_range(tmp_path, limits):
    marks = [BEST, SECOND, OWN]
    worse = SECOND._replace(words="jparse", peak_rate=2.0, error=0.9)
    path = tmp_path / "front.svg"
    draw_front("a$b", [*marks, worse], [SECOND, BEST], marks, limits, path)
    text = path.read_text()
    for said in ("recommended: filtered", "second best: jparse, stop", "as written: damped, constant", "front",
                 "largest tracking error [m]", "largest rate of a joint [rad/s]", "a$b: settings"):  # fmt: skip
        assert said in text
    assert ("rate limit of a joint" in text) == bool(limits)
    assert len(set(re.findall(r"line2d_\d+", text))) > 5
    if not limits:
        again = tmp_path / "again.svg"
        draw_front("a$b", [*marks, worse], [SECOND, BEST], marks, limits, again)
        assert again.read_bytes() == path.read_bytes()
