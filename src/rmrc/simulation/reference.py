"""A timed path as pieces, and its pose, twist and acceleration at any time, compiled.

A piece is a segment of a path: a curve over u from 0 to 1 with u over time in phases of constant jerk, or a
recorded motion, which is a spline over rows. `rmrc.simulation.trajectory` makes them. The last piece is the
rest at the end of the path; it lasts.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rmrc.law.compiling import Array, Record, compiled
from rmrc.law.kinematics import quat_product
from rmrc.support.brief import brief
from rmrc.support.spatial import ORIGIN

# Ruckig's seven phases, and rest after them.
PHASES = 8

# Ends of the columns of a sample: of the pose, the twist, and the acceleration.
POSE, TWIST, SAMPLE = 7, 13, 19

# Columns of a row of a recorded motion: its time, from 0 on [s], and from there to the next row the pose as a
# polynomial of the time since: its coefficients of degree 0 to 3. The last row is the end.
ROW = 1 + 4 * POSE

PIECE = np.dtype(
    [
        # its segment; the time from which the path follows it, and the time of its own start [s]
        ("segment", np.int64), ("since", np.float64), ("start", np.float64),
        # each phase: its start, from that of the piece on [s], and there u and its derivatives [1, ..., 1/s³]
        ("phases", np.float64, (PHASES, 5)),
        # its curve: p(u) = pose + straight·u + (cos θu − 1)·spoke + sin θu·tangent, turned by angle·u about
        # axis; spoke is from an arc's center to its start, tangent normal to it and to the axis of the arc;
        # in the world [m, rad], θ is the sweep
        ("pose", np.float64, (7,)), ("straight", np.float64, (3,)),
        ("spoke", np.float64, (3,)), ("tangent", np.float64, (3,)), ("sweep", np.float64),
        ("axis", np.float64, (3,)), ("angle", np.float64),
        # a recorded motion instead of a curve: its first row among those of the path, and how many; 0: none
        ("first_row", np.int64), ("rows", np.int64),
        # displacement of its poses, not of its twists: added to p, and multiplied from the left
        ("displacement", np.float64, (7,)),
    ]
)  # fmt: skip


def still(pose: Array) -> np.void:
    """Return a piece that stays at a pose, (7,), and ends at once."""
    (piece,) = np.zeros(1, PIECE)
    piece["pose"], piece["axis"], piece["displacement"] = pose, (0.0, 0.0, 1.0), ORIGIN
    piece["phases"][-1, 1] = 1.0
    return piece


def sampled(piece: np.void, rows: Array, times: Array) -> Array:
    """Return pose, twist and acceleration of a piece by itself at some times, (T, 19)."""
    out = np.empty((len(times), SAMPLE))
    sample(np.array([piece]), rows, times, out)
    return out


@brief
@dataclass(frozen=True, eq=False)
class Reference:
    """A target at each control tick, at rest at the first and at the last.

    Attributes:
        ticks: Number of control ticks, T.
        period: The control period [s].
        pieces: Pieces of the path, (p,) of `PIECE`.
        rows: Rows of its recorded motions, (r, 29), see `ROW`.
    """

    ticks: int
    period: float
    pieces: NDArray[np.void]
    rows: Array

    @property
    def duration(self) -> float:
        """Time of the last tick, the first one at the end of the path [s]."""
        return self.period * (self.ticks - 1)

    @cached_property
    def time(self) -> Array:
        """Time of each tick, k · period, (T,) [s]."""
        return self.period * np.arange(self.ticks, dtype=np.float64)

    @cached_property
    def segment(self) -> NDArray[np.int64]:
        """Index of the path segment, from 0, (T,)."""
        return self.pieces["segment"][np.searchsorted(self.pieces["since"], self.time, "right") - 1]

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
        return self._sampled(SAMPLE)[:, TWIST:]

    def _sampled(self, columns: int) -> Array:
        out = np.empty((self.ticks, columns))
        sample(self.pieces, self.rows, self.time, out)
        return out


# Compiled ---------------------------------------------------------------------------------------


@compiled
def read_reference(
    pieces: Record, rows: Array, period: float, path_tick: float, cursor: int, out: Array
) -> int:
    """Write the sample at a path tick; between two ticks it is interpolated.

    Quaternions are interpolated linearly and normalized: neighbors differ by a fraction of a degree, for
    which that equals the arc.

    Args:
        pieces: Pieces of the path, (p,).
        rows: Rows of its recorded motions, (r, 29).
        period: The control period [s].
        path_tick: Time along the path in ticks, from 0 to the last one.
        cursor: The piece that the call before returned, or 0; path ticks never fall.
        out: The first row is written, with pose, twist and acceleration; the second is used, (2, 19).

    Returns:
        The piece at that time.
    """
    tick = int(path_tick)
    part = path_tick - tick
    cursor = evaluate(pieces, rows, period * tick, cursor, out[0])
    if part > 0.0:
        evaluate(pieces, rows, period * (tick + 1), cursor, out[1])
        first, second = out[0], out[1]
        product = first[3] * second[3] + first[4] * second[4] + first[5] * second[5] + first[6] * second[6]
        for i in range(SAMPLE):
            goal = -second[i] if 3 <= i < POSE and product < 0.0 else second[i]
            first[i] += part * (goal - first[i])
        size = math.sqrt(first[3] ** 2 + first[4] ** 2 + first[5] ** 2 + first[6] ** 2)
        for i in range(3, POSE):
            first[i] /= size
    return cursor


@compiled
def sample(pieces: Record, rows: Array, times: Array, out: Array) -> None:
    """Write the first columns of samples, as many as there is room for, (T, k).

    Args:
        pieces: Pieces of the path, (p,).
        rows: Rows of its recorded motions, (r, 29).
        times: They rise, unless there is only one piece, (T,) [s].
        out: Pose, twist and acceleration, (T, k); written.
    """
    # No literal, for which numba would compile `evaluate` once more.
    cursor, row = int(np.int64(0)), np.empty(SAMPLE)
    for t in range(times.shape[0]):
        cursor = evaluate(pieces, rows, times[t], cursor, row)
        for i in range(out.shape[1]):
            out[t, i] = row[i]


@compiled
def evaluate(pieces: Record, rows: Array, time: float, cursor: int, out: Array) -> int:
    """Write pose, twist and acceleration at a time, (19,); return the piece there, see `read_reference`."""
    while cursor + 1 < pieces.shape[0] and time >= pieces[cursor + 1].since:
        cursor += 1
    piece = pieces[cursor]
    if piece.rows > 0:
        _follow(rows[piece.first_row : piece.first_row + piece.rows], time - piece.start, out)
    else:
        _move(piece, time - piece.start, out)
    shift = piece.displacement
    for i in range(3):
        out[i] += shift[i]
    turn, quat = (shift[3], shift[4], shift[5], shift[6]), (out[3], out[4], out[5], out[6])
    out[3], out[4], out[5], out[6] = quat_product(turn, quat)
    return cursor


@compiled
def _move(piece: Record, time: float, out: Array) -> None:
    """Write the sample of a curve, see `PIECE`."""
    number = 0
    while number + 1 < PHASES and time >= piece.phases[number + 1, 0]:
        number += 1
    phase = piece.phases[number]
    t, u, du, ddu, jerk = time - phase[0], phase[1], phase[2], phase[3], phase[4]
    u += t * (du + t * (ddu / 2 + t * jerk / 6))
    du += t * (ddu + t * jerk / 2)
    ddu += t * jerk
    sweep, angle = piece.sweep, piece.angle
    sine, cosine, half_sine = math.sin(sweep * u), math.cos(sweep * u), math.sin(0.5 * sweep * u)
    lost = 2 * (half_sine * half_sine)  # 1 − cos θ, which keeps its digits for small θ
    for i in range(3):
        straight, spoke, tangent, axis = piece.straight[i], piece.spoke[i], piece.tangent[i], piece.axis[i]
        slope = straight + sweep * (cosine * tangent - sine * spoke)
        centripetal = sweep * sweep * (cosine * spoke + sine * tangent)
        out[i] = straight * u - lost * spoke + sine * tangent + piece.pose[i]
        out[7 + i], out[10 + i] = slope * du, angle * axis * du
        out[13 + i], out[16 + i] = slope * ddu - centripetal * (du * du), angle * axis * ddu
    c, s = math.cos(0.5 * (angle * u)), math.sin(0.5 * (angle * u))
    turn = (c, s * piece.axis[0], s * piece.axis[1], s * piece.axis[2])
    quat = (piece.pose[3], piece.pose[4], piece.pose[5], piece.pose[6])
    out[3], out[4], out[5], out[6] = quat_product(turn, quat)


@compiled
def _follow(rows: Array, time: float, out: Array) -> None:
    """Write the sample of a recorded motion, (r, 29), which is at rest before and after.

    Its quaternion Q is normalized, and the angular velocity is that of the normalized one:

        ω = 2 Im(Q̇ Q*)/|Q|²,   ω̇ = 2 Im(Q̈ Q*)/|Q|² − 2 ω (Q̇ · Q)/|Q|²
    """
    time = min(max(time, 0.0), rows[-1, 0])
    low, high = 0, rows.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if rows[middle, 0] <= time else (low, middle)
    row, t = rows[low], time - rows[low, 0]
    for i in range(3):
        out[i], out[7 + i], out[13 + i] = _polynomial(row[1 + i :], t)
    (w, dw, ddw), (x, dx, ddx) = _polynomial(row[4:], t), _polynomial(row[5:], t)
    (y, dy, ddy), (z, dz, ddz) = _polynomial(row[6:], t), _polynomial(row[7:], t)
    square = w * w + x * x + y * y + z * z
    size, growth = math.sqrt(square), 2.0 * (w * dw + x * dx + y * dy + z * dz) / square
    out[3], out[4], out[5], out[6] = w / size, x / size, y / size, z / size
    back = (2.0 * w / square, -2.0 * x / square, -2.0 * y / square, -2.0 * z / square)
    _, out[10], out[11], out[12] = quat_product((dw, dx, dy, dz), back)
    _, out[16], out[17], out[18] = quat_product((ddw, ddx, ddy, ddz), back)
    for i in range(3):
        out[16 + i] -= growth * out[10 + i]


@compiled
def _polynomial(row: Array, t: float) -> tuple[float, float, float]:
    """Return a component of the pose and its two derivatives at a time since a row, which begins with it."""
    a, b, c, d = row[0], row[POSE], row[2 * POSE], row[3 * POSE]
    return a + t * (b + t * (c + t * d)), b + t * (2.0 * c + t * 3.0 * d), 2.0 * c + t * 6.0 * d
