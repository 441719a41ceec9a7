"""A setting and what its runs come to."""

from rmrc.tuning.space import Setting, Structure
from rmrc.tuning.trials import STABLE, Outcome
from rmrc.tuning.tried import Tried


def test_a_margin_that_was_implied_and_is_found_to_be_missed_counts_at_once():
    """What is recommended is run with more feedback last of all, and may not be stable with it."""
    kept = Outcome(0.001, 1.0, 5.0, 0.4, 1.0, -0.1, "")
    one = Tried(Setting(Structure("inverse", "", "damp"), (20.0,)), {0: kept, 1: kept}, STABLE, True)
    assert one.keeps_limits and one.worst.error == 0.001
    one.bears = STABLE._replace(excess=1.0, missed="it is not stable")
    assert not one.keeps_limits and one.worst.missed == "it is not stable"
    one.bears = STABLE
    assert one.keeps_limits
    one.outcomes[2] = kept._replace(error=0.002)
    assert one.worst.error == 0.002
