import pickle

import pytest

from rmrc.support import errors
from rmrc.support.problems import Origin, Problem


def test_every_error_is_ours_and_a_builtin():
    for kind in errors.RmrcError.__subclasses__():
        assert issubclass(kind, ValueError | ConnectionError | ArithmeticError) or "rmrc." in kind.__module__


def test_a_scenario_error_is_its_problems_one_a_line():
    problems = [
        Problem(("a", 0), "is wrong", Origin("x.yaml", 1, 2)),
        Problem(("b", "c"), "is wrong", Origin("--set b.c", key="b.c"), who="run 3"),
    ]
    error = errors.ScenarioError(problems)
    assert error.problems == tuple(problems)
    assert str(error) == "x.yaml:1:2: a[0]: is wrong\nrun 3: --set b.c: is wrong"
    assert str(errors.ScenarioError.about("x.sweep", "is gone")) == "x.sweep: is gone"


@pytest.mark.parametrize("error", [errors.ScenarioError.about("a", "b"), errors.ModelError("no site")])
def test_errors_survive_the_way_back_from_a_worker_process(error):
    back = pickle.loads(pickle.dumps(error))
    assert (type(back), str(back)) == (type(error), str(error))


@pytest.mark.parametrize(("name", "suggestion"), [("velocty", '; did you mean "velocity"?'), ("", "")])
def test_did_you_mean_suggests_the_nearest_option_or_nothing(name, suggestion):
    assert errors.did_you_mean(name, iter(["velocity", "jerk"])) == suggestion
