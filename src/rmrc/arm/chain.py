"""The geometry of a chain of joints: what forward kinematics needs, and no more."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.screws import joint_screw

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """The arm's geometry with all its joints at 0: what forward kinematics needs, and no more.

    It has an axis for each joint, and for each joint that follows one; both halves of a screw have one axis.

    Attributes:
        names: Names of the joint on each axis, outward, ℓ of them.
        leader: Which joint of the arm moves it, (ℓ,).
        ratio: How far, for each rad or m of that joint, (ℓ,).
        pitch: As `Arm.pitch`, (ℓ,).
        axis: Unit vectors in the world, (ℓ, 3).
        step: From a point on the axis before (the first: the world's origin) to one on this axis, (ℓ, 3) [m].
        tip_step: From the last of these points to the site, (3,) [m].
        tip_quat: Orientation of the site, (4,).
    """

    names: tuple[str, ...]
    leader: NDArray[np.int64]
    ratio: Array
    pitch: Array
    axis: Array
    step: Array
    tip_step: Array
    tip_quat: Array

    def positions(self, q: ArrayLike) -> Array:
        """Return how far each axis is from where it is with all joints at 0, (ℓ,), for positions (n,)."""
        return np.asarray(self.ratio * np.asarray(q, dtype=np.float64)[self.leader])

    @property
    def reach(self) -> float:
        """How far the site can be from the point on the first axis at most [m]; 0 where an axis slides.

        From each point to the next is one link of constant length, however the joints are turned: no sum of
        such steps is longer than that of their lengths. An arm whose points do not come to lie on a line
        comes less far.
        """
        steps = np.vstack([self.step[1:], self.tip_step])
        return float(np.linalg.norm(steps, axis=1).sum()) if not self.pitch.any() else 0.0

    @cached_property
    def screws(self) -> tuple[tuple[float, ...], ...]:
        """Screws [ω; v at the world's origin] of the axes, per unit of the joint that moves each, (ℓ, 6)."""
        found = self.ratio[:, None] * joint_screw(self.axis, np.cumsum(self.step, axis=0), self.pitch)
        return tuple(map(tuple, found.tolist()))

    @property
    def kinds(self) -> tuple[str, ...]:
        """`hinge`, `slide` or `screw` of each axis."""
        return kinds_of(self.pitch)

    def gathered(self, values: Array, n: int) -> Array:
        """Return the sums over the axes of each joint, times their ratios, (..., n), of values (..., ℓ)."""
        if len(self.names) == n:
            return values
        sums = np.zeros((*values.shape[:-1], n))
        for a, (leader, ratio) in enumerate(zip(self.leader, self.ratio, strict=True)):
            sums[..., leader] += ratio * values[..., a]
        return sums


def kinds_of(pitch: Array) -> tuple[str, ...]:
    """Return `hinge`, `slide` or `screw` of joints with these pitches, (n,)."""
    return tuple("slide" if np.isinf(h) else "screw" if h else "hinge" for h in pitch)
