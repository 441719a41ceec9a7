"""Machine code is found again by types: what numba tells apart is never the same kind."""

from itertools import combinations

import numba
import numpy as np

from rmrc.control.compiled import _kind
from rmrc.control.records import tick_type, world_type


def test_arguments_that_are_of_one_kind_are_of_one_type():
    table = np.zeros((4, 4))
    shown = table.view()
    shown.flags.writeable = False
    misaligned = np.ndarray((2,), np.float64, np.zeros(17, np.uint8)[1:].data)
    worlds = np.zeros(2, world_type(2))
    arguments = [
        0, 2**63, 0.0, False, (1, 2), (1, 2.0), table, table.T, table[::2], table[:, ::2], shown, table[0],
        misaligned, table.astype(np.float32), worlds, worlds[0], np.zeros(1, world_type(3))[0],
        np.zeros(2, tick_type(2)), np.zeros((2, 2), tick_type(2)),
    ]  # fmt: skip
    for one, other in combinations(arguments, 2):
        assert (_kind(one) == _kind(other)) <= (numba.typeof(one) == numba.typeof(other)), (one, other)
    # negative control: what has another value or another memory alone is of one kind
    assert (
        _kind(table.copy()) == _kind(table) and _kind(worlds[1]) == _kind(worlds[0]) and _kind(7) == _kind(0)
    )
