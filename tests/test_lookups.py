"""A name that is not there, looked up in Python, gets a line with the one that is meant, as in a scenario."""

import pytest

import rmrc
from wording import says


@pytest.fixture(scope="module")
def runs():
    return rmrc.compare("line_tracking", {"control.feedback": [5, 10]})


@pytest.mark.parametrize(
    ("look", "line"),
    [
        (lambda runs: runs["feedback=6"], "… feedback=6… feedback=5…"),
        (lambda runs: runs["feedback=5"]["q_dot"], "… q_dot… qdot…"),
        (lambda runs: runs["feedback=5"]["sigma.min"], '… "sigma.min"; … run.scorecard["sigma.min"]'),
        (lambda runs: runs["feedback=5"].scorecard["joint_rate.max"], "… joint_rate.max… joint_rate.peak…"),
        (lambda runs: runs["feedback=5"].scorecard["zzz"], "… zzz… metrics begin with joint_rate, …"),
    ],
)  # fmt: skip
def test_a_column_a_metric_or_a_run_that_is_not_there(runs, look, line):
    with pytest.raises(KeyError) as caught:
        look(runs)
    assert caught.value.args[0] == says(line)
    assert "joint_rate.max" not in runs["feedback=5"].scorecard


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: rmrc.Controller("ur5e", method="dls"), "Controller … method… control={'inverse': {'method': 'damped'}}"),
        (lambda: rmrc.Law(2, 2, feedback=3), "Law … feedback… control={'feedback': 3}"),
        (lambda: rmrc.Controller("ur5e", sites="x"), "Controller … sites… site…"),
        (lambda: rmrc.run("blow_up", rate=2), "run … rate… {'control.limits.rate': 2}…"),
        (lambda: rmrc.compare("blow_up", varry={}), "compare … varry… vary…"),
        (lambda: rmrc.sweep("blow_up", thread=1), "sweep … thread… threads…"),
        (lambda: rmrc.tune("blow_up", run=1), "tune … run… runs…"),
    ],
)  # fmt: skip
def test_an_argument_that_a_function_does_not_have(call, line):
    with pytest.raises(TypeError) as caught:
        call()
    assert str(caught.value) == says(line)


def test_an_inverse_by_the_name_of_another_tool():
    with pytest.raises(ValueError, match="write damped"):
        rmrc.resolve_rates([[1.0, 0.0], [0.0, 1.0]], [1.0, 1.0], "dls")


def test_a_mistake_within_a_function_stays_as_it_is():
    with pytest.raises(TypeError, match="missing 1 required positional"):
        rmrc.run()
