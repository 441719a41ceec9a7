"""How functions are compiled: as numba compiles them, in less time, and numba is left as it was."""

from contextlib import suppress

import numba
import numpy as np
import pytest
from numba.core.types.functions import BaseFunction

from rmrc.law.linking import WholeCompiler, typing_remembered


def mixed(number, whole):
    """Return what a number and an integer make by operators of several types, one after the other."""
    total = 0.0
    for i in range(whole):
        total += number * i - i // 2 + (number if i % 3 == 0 else -i) ** 2 / (i + 1)
    return total


def test_remembered_typing_confuses_no_types():
    with typing_remembered():
        ours = numba.njit(pipeline_class=WholeCompiler)(mixed)
        found = [ours(number, 10) for number in (3, 0.1, np.float32(0.1))]
    own = numba.njit(mixed)
    assert found == [own(number, 10) for number in (3, 0.1, np.float32(0.1))]
    assert found[:2] == [mixed(3, 10), mixed(0.1, 10)]
    assert found[1] != found[2]  # or the types would make no difference


def test_numba_types_calls_in_its_own_way_again():
    own = BaseFunction.get_call_type
    with suppress(KeyError), typing_remembered():
        assert BaseFunction.get_call_type is not own
        raise KeyError  # as where something cannot be compiled
    assert BaseFunction.get_call_type is own


def test_what_cannot_be_compiled_says_in_which_step():
    with pytest.raises(
        numba.TypingError, match=r"Failed in nopython mode pipeline \(step: nopython frontend\)"
    ):
        numba.njit(pipeline_class=WholeCompiler)(lambda number: number.missing)(1.0)
