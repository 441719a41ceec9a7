"""The proportions of an arm: the length and the damping of a law where nobody gives them.

    L      rms distance of the site from the hinges' axes: a radian of a hinge moves the site by L
    σ_m    the usual σ_min: its median over configurations within the limits
    ε      σ_m/3: the law damps where the arm has lost two thirds of its usual mobility
    λ_max  ε/√2: with λ² = (1 − (σ/ε)²) λ_max² it is the least at which σ/(σ² + λ²) never exceeds 1/ε

L is 1 m where it would only change the unit of σ: if no row of the task is linear, or if all are and the
joints are of one kind. ε is then in this unit. A median needs few configurations, and the shipped arms are
below a third of it in 11 to 25 % of random ones. An arm whose σ never changes is never damped.

The gain of a direction is g(σ) = σ/(σ² + λ²). With λ_max = c ε, σ² + λ² = (1 − c²) σ² + c² ε², so that g is
largest at σ = c ε/√(1 − c²), where it is 1/(2 c ε √(1 − c²)): 1/ε for c = 1/√2, and more for smaller c. For
the same largest gain, a smaller c needs a larger ε, damps more often, and loses as much of the motion.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Configurations: the median of σ_min over them is known to 7 % for the shipped arms, L to 2 %.
COUNT = 128
# The share of the usual σ_min below which the law damps, and λ_max over that.
SHARE, RATIO = 1.0 / 3.0, math.sqrt(0.5)
# A site nearer than this to all axes is on them [m].
ON_AXES = 1e-6


@dataclass(frozen=True, eq=False)
class Proportions:
    """An arm at configurations that cover its joints' ranges evenly.

    Attributes:
        q: Joint positions, (COUNT, n).
        jacobian: J of the site along world axes, (COUNT, 6, n).
        distance: L [m]; 1 for an arm without hinges, or with a site on all of their axes.
        has_both: Whether some of the joints are hinges and some slides.
    """

    q: Array
    jacobian: Array
    distance: float
    has_both: bool

    def length(self, rows: Iterable[int]) -> float:
        """Return the characteristic length of a task with these rows of the twist [m]."""
        are_linear = {row < 3 for row in rows}
        return self.distance if len(are_linear) == 2 or (True in are_linear and self.has_both) else 1.0


def proportions(
    lower: Array, upper: Array, is_slide: NDArray[np.bool_], jacobian_at: Callable[[Array], Array]
) -> Proportions:
    """Return the proportions of an arm, the same at every call.

    Args:
        lower: Lower ends of the joints' ranges, (n,).
        upper: Upper ends, (n,).
        is_slide: Whether each joint slides, (n,).
        jacobian_at: Returns J at joint positions.
    """
    q = lower + (upper - lower) * even_points(COUNT, len(lower))
    jacobian = np.array([jacobian_at(at) for at in q])
    hinges = jacobian[:, :3, ~is_slide]
    distance = math.sqrt(float((hinges**2).sum(axis=1).mean())) if hinges.size else 0.0
    length = tidy(distance) if distance > ON_AXES else 1.0
    return Proportions(q, jacobian, length, bool(is_slide.any() and not is_slide.all()))


def even_points(count: int, n: int) -> Array:
    """Return points that cover a unit cube evenly, (count, n) [Roberts18].

    They are multiples, modulo 1, of the powers of 1/g, where g is the root of g^(n+1) = g + 1.
    """
    g = 2.0
    for _ in range(60):  # each step takes at least half of the distance
        g = (1.0 + g) ** (1.0 / (n + 1.0))
    steps = g ** -np.arange(1.0, n + 1.0)
    return np.asarray((0.5 + np.arange(1.0, count + 1.0)[:, None] * steps) % 1.0)


def damping_below(usual: float) -> float:
    """Return ε for a usual σ_min."""
    return tidy(SHARE * usual)


def damping_maximum(below: float) -> float:
    """Return λ_max for ε, rounded up, so that no gain exceeds 1/ε."""
    return tidy(RATIO * below, up=True)


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
