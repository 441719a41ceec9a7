"""A timed path as pieces, and its pose, twist and acceleration at each control tick.

A piece is a segment of a path: a curve over u from 0 to 1 with u over time in phases of constant jerk, or a
recorded motion, which is a spline. `rmrc.simulation.trajectory` makes them. The last piece is the rest at the
end of the path; it lasts.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.support.brief import brief
from rmrc.support.spatial import exp_rotation, quat_conjugate, quat_from_axis_angle, quat_multiply

Array = NDArray[np.float64]

# Ends of the columns of a sample: of the pose, and of the twist.
POSE, TWIST = 7, 13
# Ticks whose samples a world holds at most: a megabyte.
BLOCK = 10_000


class Curve:
    """A line or an arc, with a turn: a rest at a pose, until it gets an extent.

    p(u) = pose + straight·u + (cos θu − 1)·spoke + sin θu·tangent, turned by angle·u about an axis.

    Attributes:
        pose: Pose at u = 0, (7,).
        straight: Displacement along a line [m].
        spoke: From the center of an arc to its start [m].
        tangent: Normal to the spoke and to the axis of the arc, as long as the spoke [m].
        sweep: Angle θ of the arc [rad].
        axis: Unit axis of the turn.
        angle: Angle of the turn [rad].
        phases: Start of each phase, and there u and its derivatives, (p, 5) [s, 1, ..., 1/s³]; the last one
            is the rest at the end.
    """

    def __init__(self, pose: Array, duration: float = 0.0) -> None:
        """Rest at a pose for some time [s]."""
        self.pose, self.axis, self.phases = pose, np.eye(3)[2], np.array([[duration, 1.0, 0.0, 0.0, 0.0]])
        self.straight, self.spoke, self.tangent = np.zeros((3, 3))
        self.sweep = self.angle = 0.0

    @property
    def duration(self) -> float:
        """Time from its start to its end [s]."""
        return float(self.phases[-1, 0])

    def at(self, times: Array) -> Array:
        """Return pose, twist and acceleration at times since its start, (T, 19)."""
        number = np.searchsorted(self.phases[:, 0], times, "right") - 1
        start, u, du, ddu, jerk = self.phases[np.maximum(number, 0)].T[:, :, None]
        t, spoke, tangent, sweep = times[:, None] - start, self.spoke, self.tangent, self.sweep
        u = u + t * (du + t * (ddu / 2 + t * jerk / 6))
        du = du + t * (ddu + t * jerk / 2)
        ddu = ddu + t * jerk
        sine, cosine = np.sin(sweep * u), np.cos(sweep * u)
        lost = 2 * np.sin(0.5 * sweep * u) ** 2  # 1 − cos θ, which keeps its digits for small θ
        slope = self.straight + sweep * (cosine * tangent - sine * spoke)
        centripetal = sweep * sweep * (cosine * spoke + sine * tangent)
        position = self.straight * u - lost * spoke + sine * tangent + self.pose[:3]
        quat = quat_multiply(quat_from_axis_angle(self.axis, self.angle * u[:, 0]), self.pose[3:])
        turn = self.angle * self.axis
        return np.hstack(
            [position, quat, slope * du, turn * du, slope * ddu - centripetal * du**2, turn * ddu]
        )


class Spline(NamedTuple):
    """A recorded motion, which is at rest before and after.

    Attributes:
        times: Of its rows, from 0 on, (r,) [s].
        coefficients: Of degree 0 to 3, of the pose from each row to the next, (4, r − 1, 7).
    """

    times: Array
    coefficients: Array

    @property
    def duration(self) -> float:
        """Time from its start to its end [s]."""
        return float(self.times[-1])

    def slowed(self, factor: float) -> "Spline":
        """Return the same motion in a time that is longer by a factor."""
        powers = np.arange(4.0)[:, None, None]
        return Spline(factor * self.times, self.coefficients / factor**powers)

    def at(self, times: Array) -> Array:
        """Return pose, twist and acceleration at times since its start, (T, 19).

        Its quaternion Q is normalized, and the angular velocity is that of the normalized one:

            ω = 2 Im(Q̇ Q*)/|Q|²,   ω̇ = 2 Im(Q̈ Q*)/|Q|² − 2 ω (Q̇ · Q)/|Q|²
        """
        times = np.clip(times, 0.0, self.duration)
        row = np.searchsorted(self.times[:-1], times, "right") - 1
        t, (a, b, c, d) = (times - self.times[row])[:, None], self.coefficients[:, row]
        pose, rate, rise = a + t * (b + t * (c + t * d)), b + t * (2 * c + t * 3 * d), 2 * c + t * 6 * d
        Q, dQ, ddQ = pose[:, 3:], rate[:, 3:], rise[:, 3:]
        square = np.sum(Q * Q, axis=1, keepdims=True)
        back = quat_conjugate(2.0 * Q / square)
        w = quat_multiply(dQ, back)[:, 1:]
        dw = quat_multiply(ddQ, back)[:, 1:] - 2.0 * w * np.sum(Q * dQ, axis=1, keepdims=True) / square
        return np.hstack([pose[:, :3], Q / np.sqrt(square), rate[:, :3], w, rise[:, :3], dw])


@brief
@dataclass(eq=False)
class Reference:
    """A target at each control tick, at rest at the first and at the last.

    Attributes:
        ticks: Number of control ticks, T.
        period: The control period [s].
        pieces: Pieces of the path.
        starts: Start of each piece, (p,) [s].
        notes: What was assumed about the files of recorded motions, one line each.
    """

    ticks: int
    period: float
    pieces: tuple[Curve | Spline, ...]
    starts: Array
    notes: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time of the last tick, the first one at the end of the path [s]."""
        return self.period * (self.ticks - 1)

    @cached_property
    def time(self) -> Array:
        """Time of each tick, k · period, (T,) [s]."""
        return self.period * np.arange(self.ticks, dtype=np.float64)

    @cached_property
    def samples(self) -> Array:
        """Pose and twist at each tick, (T, 13)."""
        return np.concatenate([self._sampled(first) for first in range(0, self.ticks, BLOCK)])

    @property
    def pose(self) -> Array:
        """Pose of the site in the world, [p, quat w x y z], (T, 7) [m, 1]; the quaternion never jumps."""
        return self.samples[:, :POSE]

    @property
    def twist(self) -> Array:
        """[v; ω] of the site's origin along world axes, (T, 6) [m/s, rad/s]."""
        return self.samples[:, POSE:]

    def block(self, first: int) -> Array:
        """Return pose and twist at BLOCK ticks from one on, or at all to the end; short paths keep theirs."""
        if self.ticks <= BLOCK or "samples" in vars(self):
            return self.samples[first : first + BLOCK]
        return self._sampled(first)

    def _sampled(self, first: int) -> Array:
        time = self.period * np.arange(first, min(first + BLOCK, self.ticks), dtype=np.float64)
        number, out = np.searchsorted(self.starts, time, "right") - 1, np.empty((len(time), TWIST))
        for i in np.unique(number):
            out[number == i] = self.pieces[i].at(time[number == i] - self.starts[i])[:, :TWIST]
        return out

    def displaced(self, first: int, last: int, offset: Array) -> "Reference":
        """Return a path whose poses, but not twists, are displaced for some ticks.

        Args:
            first: The first tick.
            last: One past the last.
            offset: [p; φ] added to the poses, along world axes, (6,) [m, rad].
        """
        other, samples, quat = replace(self), self.samples.copy(), slice(3, POSE)
        samples[first:last, :3] += offset[:3]
        samples[first:last, quat] = quat_multiply(exp_rotation(offset[3:]), samples[first:last, quat])
        other.samples = samples
        return other
