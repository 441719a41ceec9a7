"""The geometry of a chain of joints, as forward kinematics needs it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.screws import joint_screw

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """The arm's geometry with all its joints at 0, as forward kinematics needs it.

    It has an axis for each joint, and for each follower; both halves of a screw have one axis.

    Attributes:
        names: Names of the joint on each axis, outward, ℓ of them.
        leader: The joint of the arm that moves it, (ℓ,).
        ratio: Its motion for each rad or m of that joint, (ℓ,).
        pitch: As `Arm.pitch`, (ℓ,).
        axis: Unit vectors in the world, (ℓ, 3).
        step: From a point on the previous axis (the first: the world's origin) to one on this axis, (ℓ, 3)
            [m].
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
        """Return the displacement of each axis from its zero position, (ℓ,), for positions (n,)."""
        return np.asarray(self.ratio * np.asarray(q, dtype=np.float64)[self.leader])

    @cached_property
    def reach(self) -> float:
        """Largest distance of the site from the point on the first axis [m]; 0 where an axis slides.

        The link from each point to the next has a constant length, whatever the joint positions, so no sum of
        these vectors is longer than the sum of the lengths. An arm whose points cannot be on one line reaches
        less far.
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
        gather = np.zeros((len(self.leader), n))
        gather[np.arange(len(self.leader)), self.leader] = self.ratio
        return np.asarray(values @ gather)


def kinds_of(pitch: Array) -> tuple[str, ...]:
    """Return `hinge`, `slide` or `screw` of joints with these pitches, (n,)."""
    return tuple("slide" if np.isinf(h) else "screw" if h else "hinge" for h in pitch)
