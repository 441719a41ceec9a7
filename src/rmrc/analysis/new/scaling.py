"""Numbers of a scenario scaled to an arm: rate limits, damping and speed, from the arm alone.

L, ε and λ are those of a law where nobody gives them, see `rmrc.arm.geometry`; ε is at most half of the
σ_min at the start. The speed s is 0.8 ε r: joint rates are at most s/ε, so that the feedback has a fifth of
the rate limits r to itself.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import survey
from rmrc.arm import Arm
from rmrc.arm.geometry import damping_below, tidy
from rmrc.law.task import Array, Task, choose

# Share of the rate limits for the path; the feedback has the rest.
PATH_SHARE = 0.8
# Rate of a hinge whose model gives none [rad/s]: the order of magnitude for arms as large as a person's.
ASSUMED_RATE = 2.0
# σ_min at the start over ε, so that the law does not damp there.
CLEAR = 2.0
# Distance to keep from limits, as a share of the range.
MARGIN = 0.02


@dataclass(frozen=True, eq=False)
class Scales:
    """The scales of an arm.

    Attributes:
        task: Rows that the arm can move independently, with its length.
        rate: Limits, (n,) [rad/s or m/s].
        is_assumed: Which of them the model does not give, (n,).
        lower: Positions that are clear of the limits, (n,); -inf without one.
        upper: Likewise; inf without one.
        is_length_given: Whether the caller gave the length.
    """

    task: Task
    rate: Array
    is_assumed: NDArray[np.bool_]
    lower: Array
    upper: Array
    is_length_given: bool = False

    @cached_property
    def below(self) -> float:
        """ε; 0 if the joints do not move the site."""
        return damping_below(self.task.usual_sigma)

    @property
    def size(self) -> float:
        """The length of its motions [m]: L, or the rms distance of the site where L is only a unit."""
        is_linear = self.task.rows[-1] < 3
        return self.task.arm.proportions.distance if is_linear else self.task.length

    def sigma_at(self, q: Array) -> float:
        """Return σ_min at joint positions (n,)."""
        return float(survey(self.task, q[None]).sigma[0, -1])

    @property
    def slowest(self) -> float:
        """Smallest rate limit, sliding joints over L [rad/s]."""
        return float((self.rate / self.task.joint_scale).min())


def scales(arm: Arm, length: float | None = None) -> Scales:
    """Return the scales of an arm.

    Args:
        arm: The arm; its site and joints are those of the scenario.
        length: Characteristic length [m]; None: that of the arm.
    """
    task, own = choose(arm, length=length), arm.rate_limit
    assumed = np.where(arm.is_slide, tidy(ASSUMED_RATE * task.length), ASSUMED_RATE)
    lower, upper = arm.position_limit.T
    within = np.where(np.isfinite(upper - lower), MARGIN * (upper - lower), 0.0)
    return Scales(task, np.where(np.isfinite(own), own, assumed), ~np.isfinite(own),
                  lower + within, upper - within, length is not None)  # fmt: skip
