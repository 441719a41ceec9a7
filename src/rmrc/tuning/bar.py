"""Stopping rule: a run ends, without further perturbed scenarios, once its setting cannot count any more."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.tuning.front import Point, front

# Errors within this share of the smallest one count as equal, as other scenarios differ by more.
ALIKE = 0.02
# Peak rates and times within this share are the same to the displayed digits.
SAME = 1e-3
# A setting that is better by less than this share neither gets more runs nor keeps a search going.
NEW = 1e-2
# Errors above this multiple of the smallest one are of no use to anybody.
FAR = 10.0

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bar:
    """The results known to be possible: another setting must reach them.

    Attributes:
        rates: Peak rates of the front, ascending [rad/s].
        errors: Its errors, descending [m].
        wanted: Largest useful error [m].
    """

    rates: _Array
    errors: _Array
    wanted: float

    @classmethod
    def of(cls, points: Sequence[Point], own: Iterable[Point]) -> "Bar | None":
        """Return the stopping rule from known results; None without any.

        Args:
            points: Settings that keep all limits on all perturbed scenarios.
            own: Result of the setting as written, if it does; errors up to its own are useful.
        """
        if not points:
            return None
        kept = np.array([points[i][:2] for i in front(points)])
        rates, errors = kept[:, 0], np.minimum.accumulate(kept[:, 1])
        return cls(rates, errors, max(FAR * float(errors[-1]), *(one.error for one in own), 0.0))

    def beats(self, rate: _Array, error: _Array, rival: _Array, alike: float = 0.0) -> NDArray[np.bool_]:
        """Return whether settings can be abandoned, (w,), because further runs cannot improve them.

        A setting that may have the smallest error of its inverse continues, so that the comparison of
        inverses is fair.

        Args:
            rate: Peak rate so far, (w,).
            error: Error so far, (w,).
            rival: Smallest known error of the same inverse, (w,).
            alike: Multiple of the smallest error up to which none is abandoned, as it may be the smoothest.
        """
        at = np.searchsorted(self.rates, rate * (1.0 + NEW), side="right")
        least = np.maximum(np.append(math.inf, self.errors)[at], rival)
        is_better = (least > error * (1.0 + NEW)) | (error <= alike * self.errors[-1])
        result: NDArray[np.bool_] = (error > self.wanted) | ~is_better
        return result
