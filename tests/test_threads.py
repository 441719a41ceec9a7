"""Threads side by side: the interpreter is left as it was."""

import sys

from rmrc.support.threads import side_by_side


def test_a_pool_leaves_the_interpreter_as_it_was():
    before = sys.getswitchinterval()
    with side_by_side(2) as pool:
        assert list(pool.map(abs, [-1, 2])) == [1, 2]
        assert sys.getswitchinterval() < before
    assert sys.getswitchinterval() == before
