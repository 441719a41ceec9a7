"""A timed path, and its pose at every control tick: from pieces to samples, compiled.

A piece is a segment of a path in time: a curve over u from 0 to 1, and u over time in phases of constant
jerk. `rmrc.simulation.trajectory` makes them.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.support.brief import brief

# Ruckig's seven phases, and rest after them.
PHASES = 8

# Ends of the columns of a sample: of the pose, the twist, and the acceleration if requested.
POSE, TWIST, ACCELERATION = 7, 13, 19

PIECE = np.dtype(
    [
        # its segment, its ticks, [first, last), and its start [s]
        ("segment", np.int64), ("first", np.int64), ("last", np.int64), ("start", np.float64),
        # each phase: its start, from that of the piece on [s], and there u and its derivatives [1, ..., 1/s³]
        ("phases", np.float64, (PHASES, 5)),
        # its curve: p(u) = pose + straight·u + (cos θu − 1)·spoke + sin θu·tangent, turned by angle·u about
        # axis; spoke is from an arc's center to its start, tangent normal to it and to the axis of the arc;
        # in the world [m, rad], θ is the sweep
        ("pose", np.float64, (7,)), ("straight", np.float64, (3,)),
        ("spoke", np.float64, (3,)), ("tangent", np.float64, (3,)), ("sweep", np.float64),
        ("axis", np.float64, (3,)), ("angle", np.float64),
    ]
)  # fmt: skip


@brief
@dataclass(frozen=True, eq=False)
class Reference:
    """A target at each control tick, at rest at the first and at the last.

    The timing is known; the samples are made on first use.

    Attributes:
        ticks: Number of control ticks, T.
        period: The control period [s].
        pieces: Pieces of the segments of the path, (p,) of `PIECE`.
        recorded: Motions that are not pieces: the first tick of each, and pose, twist and its derivative from
            there on, (t, 19). The piece in its place stands still.
    """

    ticks: int
    period: float
    pieces: NDArray[np.void]
    recorded: tuple[tuple[int, Array], ...] = ()

    @cached_property
    def time(self) -> Array:
        """Time of each tick, k · period, (T,) [s]."""
        return self.period * np.arange(self.ticks, dtype=np.float64)

    @cached_property
    def samples(self) -> Array:
        """Pose and twist at each tick, (T, 13)."""
        return self._sampled(TWIST)

    @property
    def pose(self) -> Array:
        """Pose of the site in the world, [p, quat w x y z], (T, 7) [m, 1]; the quaternion never jumps."""
        return self.samples[:, :POSE]

    @property
    def twist(self) -> Array:
        """[v; ω] of the site's origin along world axes, (T, 6) [m/s, rad/s]."""
        return self.samples[:, POSE:]

    @cached_property
    def acceleration(self) -> Array:
        """Time derivative of the twist, (T, 6) [m/s², rad/s²]."""
        return self._sampled(ACCELERATION)[:, TWIST:]

    @cached_property
    def segment(self) -> NDArray[np.int64]:
        """Index of the path segment, from 0, (T,)."""
        return np.repeat(self.pieces["segment"], self.pieces["last"] - self.pieces["first"])

    @property
    def duration(self) -> float:
        """Time of the last tick, the first one at the end of the path [s]."""
        return self.period * (self.ticks - 1)

    def write(self, out: Array) -> None:
        """Write `samples`, (T, 13); they are kept only if they were used before."""
        if "samples" in self.__dict__:
            out[:] = self.samples
        else:
            self._write(out)

    def _sampled(self, columns: int) -> Array:
        out = np.empty((self.ticks, columns))
        self._write(out)
        return out

    def _write(self, out: Array) -> None:
        _write(self.pieces, self.period, out)
        for first, rows in self.recorded:
            out[first : first + len(rows)] = rows[:, : out.shape[1]]


def end(piece: NDArray[np.void]) -> Array:
    """Return the end pose of a piece, (7,).

    Args:
        piece: One piece, (1,) of `PIECE`, not timed yet; times are written so that it ends at once.
    """
    out = np.empty((1, TWIST))
    piece["first"], piece["last"], piece["start"], piece["phases"] = 0, 1, 0.0, (0.0, 1.0, 0.0, 0.0, 0.0)
    _write(piece, 0.0, out)
    return out[0, :POSE]


def _write(pieces: NDArray[np.void], period: float, out: Array) -> None:
    machine_code(sample, pieces, period, out)(pieces, period, out)


# Compiled ---------------------------------------------------------------------------------------


@entry
def sample(pieces: Record, period: float, out: Array) -> None:
    """Write a path's samples at each tick, see `PIECE`.

    Args:
        pieces: Pieces of the path, (p,).
        period: The control period [s].
        out: Pose and twist, (T, 13), or the acceleration as well, (T, 19); written.
    """
    for i in range(pieces.shape[0]):
        piece = pieces[i]
        phase = 0
        for t in range(piece.first, piece.last):
            time = period * t - piece.start
            if t == out.shape[0] - 1:
                time = piece.phases[PHASES - 1, 0]  # the end itself, not a rounding before it
            while phase + 1 < PHASES and time >= piece.phases[phase + 1, 0]:
                phase += 1
            _write_row(piece, piece.phases[phase], time, out[t])


@compiled
def _write_row(piece: Record, phase: Array, time: float, out: Array) -> None:
    since, u, du, ddu, jerk = phase[0], phase[1], phase[2], phase[3], phase[4]
    t = time - since
    u += t * (du + t * (ddu / 2 + t * jerk / 6))
    du += t * (ddu + t * jerk / 2)
    ddu += t * jerk
    # cos θ − 1 = −2 sin² θ/2 keeps its digits for small θ
    sine, cosine, lost = 0.0, 1.0, 0.0
    if piece.sweep != 0.0:
        theta, half = piece.sweep * u, math.sin(0.5 * piece.sweep * u)
        sine, cosine, lost = math.sin(theta), math.cos(theta), 2 * (half * half)
    for i in range(3):
        straight, spoke, tangent, axis = piece.straight[i], piece.spoke[i], piece.tangent[i], piece.axis[i]
        slope = straight + piece.sweep * (cosine * tangent - sine * spoke)
        out[i] = straight * u - lost * spoke + sine * tangent + piece.pose[i]
        out[7 + i], out[10 + i] = slope * du, piece.angle * axis * du
        if out.shape[0] > TWIST:
            centripetal = piece.sweep * piece.sweep * (cosine * spoke + sine * tangent)
            out[13 + i], out[16 + i] = slope * ddu - centripetal * (du * du), piece.angle * axis * ddu
    w, x, y, z = piece.pose[3], piece.pose[4], piece.pose[5], piece.pose[6]
    if piece.angle != 0.0:
        half = 0.5 * (piece.angle * u)
        c, s = math.cos(half), math.sin(half)
        a, b, d = s * piece.axis[0], s * piece.axis[1], s * piece.axis[2]
        w, x, y, z = (
            c * w - a * x - b * y - d * z,
            c * x + a * w + b * z - d * y,
            c * y - a * z + b * w + d * x,
            c * z + a * y - b * x + d * w,
        )
    out[3], out[4], out[5], out[6] = w, x, y, z
