"""A timed path as pieces, and its pose, twist and acceleration at each control tick.

A piece is a segment of a path: a curve over u from 0 to 1 with u over time in phases of constant jerk, or a
recorded motion, which is a spline. `rmrc.simulation.trajectory` makes them. The last piece is the rest at the
end of the path; it lasts.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rmrc.law.compiling import Method, Record, at, carray, compiled, pointer
from rmrc.law.kinematics import quat_product, turn_of
from rmrc.support.spatial import Array, exp_rotation, quat_multiply
from rmrc.support.text import brief

# Ends of the columns of a sample: of the pose, of the twist, and of the acceleration.
POSE, TWIST, ACCELERATION = 7, 13, 19
# Numbers before those of a piece, before the phases of a curve, in a phase, and in an interval of a spline.
HEAD, SHAPE, PHASE, INTERVAL = 3, 21, 5, 1 + 4 * POSE
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

    @property
    def numbers(self) -> Array:
        """The numbers that `sample_curve` reads."""
        shape = self.pose, self.straight, self.spoke, self.tangent, [self.sweep], self.axis, [self.angle]
        return np.concatenate([*shape, self.phases.ravel()])

    def at(self, times: Array) -> Array:
        """Return pose, twist and acceleration at times since its start, (T, 19)."""
        samples = np.empty((len(times), ACCELERATION))
        sample_piece(False, self.numbers, times, samples)
        return samples


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

    @property
    def numbers(self) -> Array:
        """The numbers that `sample_spline` reads."""
        return np.concatenate([self.times, self.coefficients.ravel()])

    def slowed(self, factor: float) -> "Spline":
        """Return the same motion in a time that is longer by a factor."""
        powers = np.arange(4.0)[:, None, None]
        return Spline(factor * self.times, self.coefficients / factor**powers)

    def at(self, times: Array) -> Array:
        """Return pose, twist and acceleration at times since its start, (T, 19)."""
        samples = np.empty((len(times), ACCELERATION))
        sample_piece(True, self.numbers, times, samples)
        return samples


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
    def numbers(self) -> Array:
        """The pieces as `sample_path` reads them."""
        parts = list[Array]()
        for start, piece in zip(self.starts, self.pieces, strict=True):
            parts += [np.array([start, isinstance(piece, Spline), len(piece.numbers)]), piece.numbers]
        return np.concatenate(parts)

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
        samples = np.empty((min(BLOCK, self.ticks - first), TWIST))
        sample_path(self.numbers, self.period, first, samples)
        return samples

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


# Samples -----------------------------------------------------------------------------------------


@compiled
def sample_path(path: Array, period: float, first: int, samples: Array) -> None:
    """Write pose and twist at consecutive ticks.

    Args:
        path: Its pieces in a row: start [s], whether it is a spline, how many numbers, these numbers.
        period: The control period [s].
        first: The first tick.
        samples: (T, 13).
    """
    head, size = 0, int(path[2])
    for i in range(len(samples)):
        time = period * (first + i)
        while head + HEAD + size < len(path) and path[head + HEAD + size] <= time:
            head += HEAD + size
            size = int(path[head + 2])
        numbers, since = path[head + HEAD : head + HEAD + size], time - path[head]
        if path[head + 1] != 0.0:
            sample_spline(numbers, since, samples[i])
        else:
            sample_curve(numbers, since, samples[i])


@Method
def sample_reference(world: Record) -> None:
    """Write the samples of all ticks where a world reads them; its path is at `engine.path`."""
    engine = world.engine
    samples = carray(pointer(engine.reference), (engine.path_ticks, TWIST), np.float64)
    sample_path(at(engine.path, engine.path_size), world.period, 0, samples)


@compiled
def sample_piece(is_spline: bool, numbers: Array, times: Array, samples: Array) -> None:
    """Write pose, twist and acceleration of a piece at times since its start, (T, 19)."""
    for i in range(len(times)):
        if is_spline:
            sample_spline(numbers, times[i], samples[i])
        else:
            sample_curve(numbers, times[i], samples[i])


@compiled
def sample_curve(curve: Array, time: float, sample: Array) -> None:
    """Write pose and twist of a curve, and its acceleration where the sample has room for it."""
    phase = SHAPE
    while phase + PHASE < len(curve) and curve[phase + PHASE] <= time:
        phase += PHASE
    t, jerk, sweep, angle = time - curve[phase], curve[phase + 4], curve[16], curve[20]
    u = curve[phase + 1] + t * (curve[phase + 2] + t * (curve[phase + 3] / 2.0 + t * jerk / 6.0))
    du = curve[phase + 2] + t * (curve[phase + 3] + t * jerk / 2.0)
    ddu = curve[phase + 3] + t * jerk
    sine, cosine, half = math.sin(sweep * u), math.cos(sweep * u), math.sin(0.5 * sweep * u)
    lost = 2.0 * half * half  # 1 − cos θ, which keeps its digits for small θ
    for i in range(3):
        straight, spoke, tangent, turn = curve[7 + i], curve[10 + i], curve[13 + i], angle * curve[17 + i]
        slope = straight + sweep * (cosine * tangent - sine * spoke)
        sample[i] = straight * u - lost * spoke + sine * tangent + curve[i]
        sample[POSE + i], sample[POSE + 3 + i] = slope * du, turn * du
        if len(sample) > TWIST:
            centripetal = sweep * sweep * (cosine * spoke + sine * tangent)
            sample[TWIST + i] = slope * ddu - centripetal * du * du
            sample[TWIST + 3 + i] = turn * ddu
    w, s = math.cos(0.5 * angle * u), math.sin(0.5 * angle * u)
    turned = quat_product((w, s * curve[17], s * curve[18], s * curve[19]), turn_of(curve))
    sample[3], sample[4], sample[5], sample[6] = turned


@compiled
def sample_spline(spline: Array, time: float, sample: Array) -> None:
    """Write pose and twist of a recorded motion, and its acceleration where the sample has room for it.

    Its quaternion Q is normalized, and the angular velocity is that of the normalized one:

        ω = 2 Im(Q̇ Q*)/|Q|²,   ω̇ = 2 Im(Q̈ Q*)/|Q|² − 2 ω (Q̇ · Q)/|Q|²
    """
    rows = (len(spline) - 1) // INTERVAL  # that have an interval behind them
    time = min(max(time, 0.0), spline[rows])
    row, end = 0, rows  # the last row that is not later
    while end - row > 1:
        middle = (row + end) // 2
        if spline[middle] <= time:
            row = middle
        else:
            end = middle
    t, first, degree = time - spline[row], rows + 1 + POSE * row, POSE * rows
    for i in range(3):
        sample[i], sample[POSE + i], rise = cubic(spline, first + i, degree, t)
        if len(sample) > TWIST:
            sample[TWIST + i] = rise
    w, dw, ddw = cubic(spline, first + 3, degree, t)
    x, dx, ddx = cubic(spline, first + 4, degree, t)
    y, dy, ddy = cubic(spline, first + 5, degree, t)
    z, dz, ddz = cubic(spline, first + 6, degree, t)
    square = w * w + x * x + y * y + z * z
    size, back = (
        math.sqrt(square),
        (2.0 * w / square, -2.0 * x / square, -2.0 * y / square, -2.0 * z / square),
    )
    sample[3], sample[4], sample[5], sample[6] = w / size, x / size, y / size, z / size
    velocity = quat_product((dw, dx, dy, dz), back)
    acceleration = quat_product((ddw, ddx, ddy, ddz), back)
    shrinks = 2.0 * (w * dw + x * dx + y * dy + z * dz) / square
    for i in range(3):
        sample[POSE + 3 + i] = velocity[1 + i]
        if len(sample) > TWIST:
            sample[TWIST + 3 + i] = acceleration[1 + i] - shrinks * velocity[1 + i]


@compiled
def cubic(spline: Array, first: int, degree: int, t: float) -> tuple[float, float, float]:
    """Return a polynomial and its two derivatives; its coefficients are some numbers apart."""
    a, b, c, d = spline[first], spline[first + degree], spline[first + 2 * degree], spline[first + 3 * degree]
    return a + t * (b + t * (c + t * d)), b + t * (2.0 * c + t * 3.0 * d), 2.0 * c + t * 6.0 * d
