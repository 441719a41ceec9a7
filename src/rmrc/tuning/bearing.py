"""Stable feedback found so far: no setting is tried with more than its inverse tolerated."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

from rmrc.tuning.bar import NEW
from rmrc.tuning.space import FEEDBACK, Setting, Space, rounded

# If an inverse has not been stable at all yet, the next feedback is smaller by this factor.
_LESS = 0.8
# The probe ends this near to the stability limit. Others are then tried with this share of the stable
# feedback, because their limits differ a little. Up to that share, stability of an inverse with as much
# feedback need not be tested: if no g(σ) σ is above 1, the feedback decides. With these methods some g(σ) σ
# is above 1.
NEAR, _SAFE, _ABOVE_1 = 1.01, 0.995, ("transpose", "jparse")


@dataclass
class Bearing:
    """Tested feedback of loops, and its stability.

    Delays determine the stable feedback of a loop, and all inverses share them. An untested inverse is
    therefore assumed to tolerate as much as a tested one.

    Attributes:
        probed: Results of the setting that was tested first, by feedback.
        asked: Results of each inverse, by feedback.
    """

    probed: dict[float, bool] = field(default_factory=dict)
    asked: dict[Hashable, dict[float, bool]] = field(default_factory=dict)

    @property
    def edge(self) -> tuple[float, float]:
        """Largest stable feedback of the probed setting, or 0, and the smallest unstable one above it."""
        return _edge(self.probed)

    def add(self, setting: Setting, bears: bool) -> None:
        """Add the result of a setting."""
        of_inverse = self.asked.setdefault(setting.structure.inverse, {})
        of_inverse[setting.feedback] = bears

    def implies(self, setting: Setting) -> bool:
        """Return whether a setting is stable because its inverse was stable with as much feedback."""
        own = self.asked.get(setting.structure.inverse, {})
        borne = max((value for value, bears in own.items() if bears), default=0.0)
        failed = min((value for value, bears in own.items() if not bears), default=math.inf)
        is_within = setting.feedback <= min(borne, self._safe or _SAFE * borne) and setting.feedback < failed
        return is_within and setting.structure.method not in _ABOVE_1

    def to_ask(self, settings: Sequence[Setting]) -> list[Setting]:
        """Return the settings to test first: the one with the highest feedback of each inverse."""
        by_feedback = sorted(settings, key=lambda one: -one.feedback)  # in the given order, if equal
        return list({one.structure.inverse: one for one in reversed(by_feedback)}.values())

    @property
    def _safe(self) -> float:
        """Feedback to try with any inverse after the probe; 0: none was stable."""
        return rounded(_SAFE * self.edge[0])

    @property
    def expected(self) -> float:
        """Estimated feedback at the stability limit; 0: unknown."""
        low, high = self.edge
        return math.sqrt(low * high) if low > 0.0 and high < math.inf else low

    def within(self, setting: Setting, space: Space) -> Setting:
        """Return a setting with no more feedback than its inverse is known to tolerate.

        Excessive feedback is replaced by a value between the largest stable and the smallest unstable one,
        which closes in on the limit.
        """
        return self.all_within([setting], space)[0]

    def all_within(self, settings: Sequence[Setting], space: Space) -> list[Setting]:
        """Return settings of one inverse, each as `within` does."""
        if not settings:
            return []
        high, less = self._limit(settings[0].structure.inverse)
        return [one if one.feedback < high else with_feedback(one, less, space) for one in settings]

    def _limit(self, inverse: Hashable) -> tuple[float, float]:
        """Return the feedback above which it is replaced for an inverse, and the replacement."""
        own = self.asked.get(inverse, {})
        low, high = _edge(self.probed | own if all(own.values()) else own)
        if all(own.values()) and self.edge[1] <= self.edge[0] * NEAR:
            low = high = self._safe
        less = low if high <= low * (1.0 + NEW) else math.sqrt(low * high) if low else _LESS * high
        return high, less


def with_feedback(setting: Setting, feedback: float, space: Space) -> Setting:
    """Return a setting with another feedback, or the largest below it that is allowed, if there is one."""
    allowed = [one for one in space.only.get(FEEDBACK, (rounded(feedback),)) if one <= feedback * (1.0 + NEW)]
    at = setting.structure.keys.index(FEEDBACK)
    numbers = (*setting.numbers[:at], max(allowed, default=setting.numbers[at]), *setting.numbers[at + 1 :])
    return Setting(setting.structure, numbers)


def _edge(asked: dict[float, bool]) -> tuple[float, float]:
    """Return the largest stable value, 0 without one, and the smallest unstable one above it."""
    low = max((value for value, bears in asked.items() if bears), default=0.0)
    return low, min((value for value in asked if value > low), default=math.inf)
