"""Threads side by side: the interpreter is left as it was found."""

import gc
import sys

import pytest

from rmrc.support.threads import side_by_side


def settings():
    """Return what of the interpreter is changed while threads step."""
    return sys.getswitchinterval(), gc.get_freeze_count() > 10_000  # Python itself freezes some hundred


@pytest.fixture
def before():
    """Return the settings before, which hold again after the test, whatever it left."""
    gc.unfreeze()  # whatever another test froze
    found = settings()
    yield found
    sys.setswitchinterval(found[0])
    gc.unfreeze()


def test_pools_that_overlap_leave_the_interpreter_as_the_first_found_it(before):
    first, second = side_by_side(1), side_by_side(1)
    first.__enter__()
    changed = settings()
    second.__enter__()
    first.__exit__(None, None, None)
    assert settings() == changed  # the second still steps
    second.__exit__(None, None, None)
    assert settings() == before
    assert changed[0] < before[0] and changed[1] > before[1]


@pytest.mark.usefixtures("before")
def test_what_a_caller_froze_stays_frozen():
    gc.freeze()
    count = gc.get_freeze_count()
    with side_by_side(1):  # some of them may be freed meanwhile
        assert 0.9 * count < gc.get_freeze_count() <= count
    assert 0.9 * count < gc.get_freeze_count() <= count
