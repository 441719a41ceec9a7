"""Steps of a nudge: round, and there for every reach."""

import numpy as np
import pytest

pytest.importorskip("viser")

from rmrc.explore.hand import NUDGE, _round


@pytest.mark.parametrize(
    "reach", [1.0, np.nextafter(1.0, 0.0), np.nextafter(10.0, 0.0), 0.05, 0.85, 1.99, 20.0]
)
def test_every_reach_has_a_round_nudge(reach):
    step = _round(NUDGE * reach)
    assert step <= NUDGE * reach * (1.0 + 1e-9)
    assert step >= 0.4 * NUDGE * reach  # 1, 2, 5, 10: a factor of 2.5 at most
    assert float(f"{step:.0e}") == step
