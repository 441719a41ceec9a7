"""Numbers of a control law scaled to an arm: length, rate limits, damping and speed, from the arm alone.

    L    rms distance of the site from the hinges' axes: a radian of a hinge moves the site by L
    ε    σ_min is below it in a quarter of the configurations within the limits; or half of that at the start
    λ    ε/√2: with λ² = (1 − (σ/ε)²) λ_max² it is the least at which σ/(σ² + λ²) never exceeds 1/ε
    s    0.8 ε r: joint rates are at most s/ε, so that the feedback has a fifth of the rate limits r to itself

The gain of a direction is g(σ) = σ/(σ² + λ²). With λ_max = c ε, σ² + λ² = (1 − c²) σ² + c² ε², so that g is
largest at σ = c ε/√(1 − c²), where it is 1/(2 c ε √(1 − c²)): 1/ε for c = 1/√2, and more for smaller c.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import jacobians, survey
from rmrc.arm import Arm
from rmrc.law.task import Array, Task, choose

# Number of configurations for the distribution of σ_min: a share of a quarter is known to 0.7 %.
SAMPLES = 4096
# Share of the configurations within the limits in which the law may damp.
DAMPED_SHARE = 0.25
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
        sigma: σ_min over configurations within the limits, ascending.
        lower: Positions that are clear of the limits, (n,); -inf without one.
        upper: Likewise; inf without one.
        is_length_given: Whether the caller gave the length.
    """

    task: Task
    rate: Array
    is_assumed: NDArray[np.bool_]
    sigma: Array
    lower: Array
    upper: Array
    is_length_given: bool = False

    @property
    def quartile(self) -> float:
        """First quartile of σ_min."""
        return float(np.quantile(self.sigma, DAMPED_SHARE))

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
        length: Characteristic length [m]; None: the rms distance of the site from the hinges' axes.
    """
    q = arm.sampled(SAMPLES)
    rows = choose(arm)
    found = _length(rows, q) if rows.rows[0] < 3 else 1.0
    task = choose(arm, rows.axes, found if length is None else length)
    own = arm.rate_limit
    assumed = np.where(arm.is_slide, tidy(ASSUMED_RATE * task.length), ASSUMED_RATE)
    lower, upper = arm.position_limit.T
    within = np.where(np.isfinite(upper - lower), MARGIN * (upper - lower), 0.0)
    sigma = np.sort(survey(task, q).sigma[:, -1])
    return Scales(task, np.where(np.isfinite(own), own, assumed), ~np.isfinite(own), sigma,
                  lower + within, upper - within, length is not None)  # fmt: skip


def _length(task: Task, q: Array) -> float:
    """Return the rms distance of the site from the axes of the hinges over configurations (N, n) [m]."""
    _, J = jacobians(task, q)
    hinges = ~task.arm.is_slide
    distance = np.linalg.norm(J[:, :3][:, :, hinges], axis=1)
    found = math.sqrt(float(np.mean(distance**2))) if hinges.any() else 0.0
    return tidy(found) if found > 0.0 else 1.0


def tidy(value: float, digits: int = 2, up: bool = False) -> float:
    """Return a number of few digits, nearest or not smaller.

    >>> tidy(0.4382), tidy(0.4312, up=True), tidy(0.0)
    (0.44, 0.44, 0.0)
    """
    if value == 0.0 or not math.isfinite(value):
        return value
    power = digits - 1 - math.floor(math.log10(abs(value)))
    found = round(value, power)
    return round(found + 10.0**-power, power) if up and found < value else found
