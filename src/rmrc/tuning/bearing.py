"""How much feedback loops were seen to bear: nothing is tried with more than its inverse bore."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

from rmrc.tuning.bar import NEW
from rmrc.tuning.space import FEEDBACK, Setting, Space, rounded

# Where an inverse has borne nothing yet, the next is less by this share.
_LESS = 0.8
# How near probing comes to the edge, and what share of the feedback that was borne is tried then with others,
# whose edges differ a little.
# Up to that share, what an inverse has borne with as much feedback need not be asked: where no g(σ) σ is
# above 1, it is the feedback that decides. With these some is.
NEAR, _SAFE, _ABOVE_1 = 1.01, 0.995, ("transpose", "jparse")


@dataclass
class Bearing:
    """Feedback that was asked of loops, and whether they bore it.

    What a loop bears is decided by its delays, which all inverses have in common. So an inverse of which
    nothing is known is taken to bear what another one did.

    Attributes:
        probed: Of the setting that was asked first, by feedback.
        asked: Of each inverse, by feedback.
    """

    probed: dict[float, bool] = field(default_factory=dict)
    asked: dict[Hashable, dict[float, bool]] = field(default_factory=dict)

    @property
    def edge(self) -> tuple[float, float]:
        """The most that was borne of what was probed, or 0, and the least above it that was not."""
        return _edge(self.probed)

    def add(self, setting: Setting, bears: bool) -> None:
        """Take into account what a setting bore."""
        of_inverse = self.asked.setdefault(setting.structure.inverse, {})
        of_inverse[setting.feedback] = bears

    def implies(self, setting: Setting) -> bool:
        """Say whether a setting bears what is asked, because its inverse has borne as much feedback."""
        own = self.asked.get(setting.structure.inverse, {})
        borne = max((value for value, bears in own.items() if bears), default=0.0)
        failed = min((value for value, bears in own.items() if not bears), default=math.inf)
        is_within = setting.feedback <= min(borne, self._safe or _SAFE * borne) and setting.feedback < failed
        return is_within and setting.structure.method not in _ABOVE_1

    def to_ask(self, settings: Sequence[Setting]) -> list[Setting]:
        """Return which of several settings to ask first: that of each inverse with the highest feedback."""
        by_feedback = sorted(settings, key=lambda one: -one.feedback)  # as they are, where it is equal
        return list({one.structure.inverse: one for one in reversed(by_feedback)}.values())

    @property
    def _safe(self) -> float:
        """What may be tried with any inverse after what was probed; 0: nothing was borne."""
        return rounded(_SAFE * self.edge[0])

    @property
    def expected(self) -> float:
        """What a loop may be at its edge with, as a feedback; 0: nothing is known."""
        low, high = self.edge
        return math.sqrt(low * high) if low > 0.0 and high < math.inf else low

    def within(self, setting: Setting, space: Space) -> Setting:
        """Return a setting with no more feedback than its inverse may bear, as far as is known.

        Where it has too much, it gets what is between the most that was borne and the least that was not, so
        that one closes in on the edge.
        """
        own = self.asked.get(setting.structure.inverse, {})
        low, high = _edge(self.probed | own if all(own.values()) else own)
        if all(own.values()) and self.edge[1] <= self.edge[0] * NEAR:
            low = high = self._safe
        if setting.feedback < high:
            return setting
        less = low if high <= low * (1.0 + NEW) else math.sqrt(low * high) if low else _LESS * high
        return with_feedback(setting, less, space)


def with_feedback(setting: Setting, feedback: float, space: Space) -> Setting:
    """Return a setting with another feedback, or the largest below it that is allowed, if there is one."""
    allowed = [one for one in space.only.get(FEEDBACK, (rounded(feedback),)) if one <= feedback * (1.0 + NEW)]
    at = setting.structure.keys.index(FEEDBACK)
    numbers = (*setting.numbers[:at], max(allowed, default=setting.numbers[at]), *setting.numbers[at + 1 :])
    return Setting(setting.structure, numbers)


def _edge(asked: dict[float, bool]) -> tuple[float, float]:
    """Return the most that was borne, 0 if nothing was, and the least above it that was not."""
    low = max((value for value, bears in asked.items() if bears), default=0.0)
    return low, min((value for value in asked if value > low), default=math.inf)
