"""A name that is not there, looked up in Python, gets a line with the one that is meant, as in a scenario."""

import pytest

import rmrc
from wording import says


@pytest.mark.parametrize(
    ("look", "line"),
    [
        (lambda runs: runs["feedback=6"], "… feedback=6… feedback=5…"),
        (lambda runs: runs["feedback=5"].scorecard["joint_rate.max"], "… joint_rate.max… joint_rate.peak…"),
    ],
)
def test_a_column_a_metric_or_a_run_that_is_not_there(look, line):
    still = rmrc.load("line_tracking").set({"target.path": [{"hold": {"for": 0.01}}]})
    with pytest.raises(KeyError) as caught:
        look(rmrc.compare(still, {"control.feedback": [5, 10]}))
    assert caught.value.args[0] == says(line)


def test_an_argument_that_a_function_does_not_have():
    with pytest.raises(TypeError) as caught:
        rmrc.Controller("ur5e", method="dls")
    assert str(caught.value) == says("Controller … method… control={'inverse': {'method': 'damped'}}")
