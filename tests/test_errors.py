import pickle

import pytest

from rmrc.support import errors


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (errors.ScenarioError, ValueError),
        (errors.ModelError, ValueError),
        (errors.TargetError, ValueError),
        (errors.ClusterError, ConnectionError),
        (errors.DivergenceError, ArithmeticError),
    ],
)
def test_every_error_is_ours_and_a_fitting_builtin(kind, builtin):
    assert issubclass(kind, errors.RmrcError)
    assert issubclass(kind, builtin)
    assert kind.__name__ in errors.__doc__


def test_the_tree_in_the_docstring_is_the_whole_tree():
    classes = [v for v in vars(errors).values() if isinstance(v, type) and v is not type]
    ours = {c.__name__ for c in classes if issubclass(c, Exception) and not issubclass(c, Warning)}
    assert ours == {word for word in errors.__doc__.split() if word in ours | {"RmrcError"}}
    assert len(ours) == 7


def test_a_scenario_error_is_its_problems_one_a_line():
    error = errors.ScenarioError(["x.yaml:1:1: a: is wrong", "x.yaml:2:1: b: is wrong"])
    assert error.problems == ("x.yaml:1:1: a: is wrong", "x.yaml:2:1: b: is wrong")
    assert str(error) == "x.yaml:1:1: a: is wrong\nx.yaml:2:1: b: is wrong"


@pytest.mark.parametrize(
    "error",
    [errors.ScenarioError(["a", "b"]), errors.ModelError("no site"), errors.DivergenceError("t")],
)
def test_errors_survive_the_way_back_from_a_worker_process(error):
    back = pickle.loads(pickle.dumps(error))
    assert (type(back), str(back)) == (type(error), str(error))


@pytest.mark.parametrize(
    ("name", "suggestion"),
    [("velocty", '; did you mean "velocity"?'), ("zzz", ""), ("", "")],
)
def test_did_you_mean_suggests_the_nearest_option_or_nothing(name, suggestion):
    assert errors.did_you_mean(name, iter(["velocity", "jerk"])) == suggestion
