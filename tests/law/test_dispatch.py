"""What was chosen by name is called by its code, and a choice without a function is found at import."""

import numpy as np
import pytest

from rmrc.law import jit
from rmrc.law.jit import compiled, dispatch
from rmrc.scenario.choices import Choice, Choices

TOYS = Choices(
    "toy.kind", "", "double", (Choice("double", ""), Choice("idle", "", acts=False), Choice("square", ""))
)
RECORD = np.dtype([("toy_kind", np.int64)])


@compiled
def double(world, number) -> float:  # noqa: ARG001 - as all are called
    return 2.0 * number


@compiled
def square(world, number) -> float:  # noqa: ARG001
    return number * number


def shorter(number) -> float:
    return number


@pytest.mark.parametrize(("name", "want"), [("double", 10.0), ("idle", 0.0), ("square", 25.0)])
def test_the_function_of_the_name_is_called(name, want):
    chosen = jit._compile(dispatch(TOYS, like=double))
    world = np.zeros(1, RECORD)
    world["toy_kind"] = TOYS.code(name)
    assert chosen(world[0], 5.0) == want


@pytest.mark.parametrize("name", ["missing", "shorter", "np"])
def test_a_choice_without_its_function_is_refused(name):
    choices = Choices("toy.kind", "", "double", (Choice("double", ""), Choice(name, "")))
    with pytest.raises(ImportError) as caught:
        dispatch(choices, like=double)
    assert str(caught.value) == (
        f"{__name__} must have a compiled function {name}(world, number), which control.toy.kind: {name} stands for"
    )


def test_every_list_of_choices_is_dispatched_in_its_module():
    # The codes that compiled code compares with are those that a record is written with: by another way than dispatch.
    from rmrc.law import damping, inverses, limits, nullspace, policies, priority
    from rmrc.scenario.choices import CHOICES

    dispatched = [one for one in CHOICES if any(option.acts for option in one.options)]
    assert {one.key for one in CHOICES} - {one.key for one in dispatched} == {
        "inverse.metric"
    }  # a flag is enough
    modules = dict(zip(dispatched, (inverses, damping, nullspace, priority, limits, policies), strict=True))
    chains = (
        "gains",
        "scheduled",
        "wished_rates",
        "solve_by_priority",
        "confine_by_choice",
        "near_singularity",
    )
    for (choices, module), chain in zip(modules.items(), chains, strict=True):
        function = getattr(module, chain).py_func
        called = {
            name.removeprefix("do_"): value for name, value in function.__globals__.items() if "do_" in name
        }
        assert list(called) == [one.name for one in choices.options if one.acts]
        assert all(value is getattr(module, name) for name, value in called.items())
