"""A target path as a reference: where the site shall be, and how fast, at every control tick.

A path is geometry times timing. Each segment is a curve over one parameter u from 0 to 1: the
site's origin at p(u), a straight line or a circular arc, and the orientation turned by φ u about
one fixed world axis. Ruckig times u from rest to rest, jerk-limited and as fast as the limits
allow [Berscheid21], so that translation and rotation end together, and the segments follow one
another without a gap. Only point-to-point motions are asked of it: they are computed here, while
its way-points would be sent to a server.

The limits hold for the norms of the Cartesian vectors. Along an arc of radius r, at speed ṡ,

    |p̈|² = s̈² + (ṡ²/r)²,   |p⃛|² = (s⃛ − ṡ³/r²)² + (3 ṡ s̈/r)²,

so `_along` gives s̈ and s⃛ what the centripetal parts leave. A target outside the workspace is no
error here: this module knows no arm.

This module alone knows ruckig.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import ruckig
from numpy.typing import ArrayLike, NDArray

from rmrc.scenario import (
    Arc,
    ArcSegment,
    HoldSegment,
    Line,
    LineSegment,
    TargetLimitsSection,
    Turn,
    TurnSegment,
)
from rmrc.simulation.reference import PHASES, PIECE, Reference, end
from rmrc.support.errors import TargetError
from rmrc.support.spatial import log_rotation, normalize, quat_conjugate, quat_multiply

Array = NDArray[np.float64]
Segment = LineSegment | ArcSegment | TurnSegment | HoldSegment

# Shorter lengths [m] and smaller angles [rad] are rounding of a pose, not something to follow.
_SMALLEST = 1e-9

# Ten million ticks are 2.8 h at 1 kHz, and 1.7 GB: more is a slip of a unit.
_MOST_TICKS = 10_000_000

# A duration that is a whole number of periods, but for rounding, gets no tick more. The sums of
# durations of `_MOST_TICKS` periods are rounded to 1e-9 of a period.
_TICK_ROUNDING = 1e-6


def make_reference(
    segments: Sequence[Segment],
    limits: TargetLimitsSection,
    start_pose: ArrayLike,
    period: float,
    offset: Sequence[float] = (),
) -> Reference:
    """Time a path, to be sampled at every control tick.

    Args:
        segments: The path, `scenario.target.path`; each piece starts where the one before ends.
        limits: Of the norms of velocity, acceleration and jerk, linear and angular.
        start_pose: Of the site, [p, quat w x y z], (7,) [m, 1]; the first sample, to the bit.
        period: The control period [s].
        offset: Of the absolute points of the path, `scenario.target.offset`, (2,) or (3,) [m].

    Returns:
        The reference; the last sample is the end of the path, at rest.

    Raises:
        TargetError: A segment has no extent or is not finite, a limit or the period is not > 0,
            or the path needs more than ten million periods.

    >>> path = [LineSegment(line={"by": (0.1, 0)}), HoldSegment(hold={"for": 0.5})]
    >>> start = [0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]
    >>> reference = make_reference(path, TargetLimitsSection(), start, period=0.01)
    >>> reference.duration, reference.pose[-1, :3].round(12)
    (1.25, array([0.6, 0. , 0.3]))
    """
    pose = _checked(segments, limits, start_pose, period)
    moved = _moved(segments, offset)
    pieces = np.zeros(len(moved), PIECE)
    for i, segment in enumerate(moved):
        curve = _curve(f"target.path[{i}]", segment, pose, pieces[i : i + 1])
        if isinstance(segment, HoldSegment):
            pieces[i]["phases"] = _pause(segment.hold.duration)
        else:
            pieces[i]["phases"] = _rest_to_rest(curve, limits)
        pose = curve.end
    with np.errstate(over="ignore"):  # what takes forever is refused below
        starts = np.cumsum([0.0, *pieces["phases"][:, -1, 0]])
    ticks = _intervals(float(starts[-1]), period) + 1
    # a tick on the border of two segments belongs to the later one
    borders = [0, *(min(_first_tick(start, period), ticks - 1) for start in starts[1:-1]), ticks]
    pieces["start"], pieces["first"], pieces["last"] = starts[:-1], borders[:-1], borders[1:]
    return Reference(ticks, period, pieces)


def _first_tick(start: float, period: float) -> int:
    """Return the first tick that is not before a time: the quotient may be rounded to a tick beside it."""
    nearest = round(start / period)
    return next(tick for tick in range(nearest - 1, nearest + 3) if period * tick >= start)


def _checked(
    segments: Sequence[Segment], limits: TargetLimitsSection, start_pose: ArrayLike, period: float
) -> Array:
    """Return the start pose, or raise what is wrong with the arguments."""
    if not segments:
        raise TargetError("target.path: must have at least 1 item, got 0")
    values = {f"target.limits.{name}": value for name, value in limits}
    for name, value in (values | {"control.period": period}).items():
        if not 0 < value < math.inf:
            raise TargetError(f"{name}: must be finite and > 0, got {value:g}")
    pose = np.array(start_pose, dtype=float)
    # Quaternions of a simulator are of length 1 to rounding; 1e-9 leaves room for theirs.
    if pose.shape != (7,) or not np.isfinite(pose).all() or abs(np.linalg.norm(pose[3:]) - 1) > 1e-9:
        shown = ", ".join(f"{x:g}" for x in pose.flat)
        raise TargetError(f"start_pose: must be [x, y, z] and a unit quaternion, got [{shown}]")
    return pose


def _intervals(duration: float, period: float) -> int:
    """Return how many periods cover a duration, 1 at least."""
    count = duration / period
    if not count <= _MOST_TICKS:
        raise TargetError(
            f"target.path: takes {duration:g} s, which is {count:.9g} control periods of "
            f"{period:g} s and more than {_MOST_TICKS}; raise target.limits or control.period, "
            "or shorten the path"
        )
    return max(1, math.ceil(count - _TICK_ROUNDING))


def _moved(segments: Sequence[Segment], offset: Sequence[float]) -> Sequence[Segment]:
    """Return the path with its absolute points written further by an offset; a point of 2 values keeps z."""
    if not any(offset):
        return segments

    def further(point: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(x + d for x, d in zip(point, (*offset, 0.0), strict=False))

    moved: list[Segment] = []
    for segment in segments:
        if isinstance(segment, LineSegment) and segment.line.to is not None:
            line = segment.line.model_copy(update={"to": further(segment.line.to)})
            moved.append(LineSegment(line=line))
        elif isinstance(segment, ArcSegment):
            arc = segment.arc.model_copy(update={"center": further(segment.arc.center)})
            moved.append(ArcSegment(arc=arc))
        else:
            moved.append(segment)
    return moved


# Geometry ----------------------------------------------------------------------------------------


class _Curve(NamedTuple):
    """A segment without its timing.

    Attributes:
        place: The segment's key.
        length: Of the curve [m].
        radius: Infinite unless it is an arc [m].
        angle: Of the turn [rad].
        end: Pose at u = 1, (7,).
    """

    place: str
    length: float
    radius: float
    angle: float
    end: Array


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is an error below
def _curve(place: str, segment: Segment, start: Array, piece: NDArray[np.void]) -> _Curve:
    """Return the geometry of a segment that starts at a pose, and write it into a piece, (1,)."""
    straight, spoke, normal, sweep = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    turn: Turn | None = None
    (kind,) = type(segment).model_fields
    place = f"{place}.{kind}"
    if isinstance(segment, LineSegment):
        turn, straight = segment.line.turn, _displacement(segment.line, start)
    elif isinstance(segment, ArcSegment):
        turn, sweep, normal = segment.arc.turn, segment.arc.angle, _direction(segment.arc.axis)
        spoke = _spoke(place, segment.arc, normal, start)
    elif isinstance(segment, TurnSegment):
        turn = segment.turn
    axis, angle = _rotation(turn, start) if turn else (np.array([0.0, 0.0, 1.0]), 0.0)
    tangent = np.cross(normal, spoke) if sweep else spoke
    (one,) = piece
    one["pose"], one["straight"], one["sweep"], one["angle"] = start, straight, sweep, angle
    one["spoke"], one["tangent"], one["axis"] = spoke, tangent, axis
    length, radius = np.linalg.norm(straight + sweep * tangent), np.linalg.norm(spoke) if sweep else math.inf
    curve = _Curve(place, float(length), float(radius), angle, end(piece))
    if not np.isfinite([length, angle, *curve.end]).all():
        raise TargetError(f"{place}: is not finite; use smaller numbers")
    if isinstance(segment, LineSegment | ArcSegment) and curve.length < _SMALLEST:
        raise TargetError(
            f"{place}: has length 0, from {_show(start[:3])} to the same point; to pause write "
            "hold, to turn on the spot write turn"
        )
    if isinstance(segment, TurnSegment) and abs(angle) < _SMALLEST:
        raise TargetError(f"{place}: has angle 0; remove it, or write hold to pause")
    return curve


def _displacement(line: Line, start: Array) -> Array:
    if line.by is not None:
        return np.array([*line.by, 0.0][:3])
    assert line.to is not None  # the schema requires one of them
    return _filled(line.to, start) - start[:3]


def _spoke(place: str, arc: Arc, normal: Array, start: Array) -> Array:
    """Return the way from the circle's center to the start, square to its axis."""
    way = start[:3] - _filled(arc.center, start)
    spoke: Array = way - (way @ normal) * normal
    if np.linalg.norm(spoke) < _SMALLEST:
        raise TargetError(
            f"{place}: starts at {_show(start[:3])}, on the axis of the circle: radius 0; move "
            "the center, or write turn to turn on the spot"
        )
    return spoke


def _rotation(turn: Turn, start: Array) -> tuple[Array, float]:
    """Return unit axis and angle of a turn; `to` takes the shortest way."""
    if turn.axis is not None and turn.angle is not None:
        return _direction(turn.axis), turn.angle
    assert turn.to is not None  # the schema requires one of both forms
    rotvec = log_rotation(quat_multiply(normalize(turn.to), quat_conjugate(start[3:])))
    angle = float(np.linalg.norm(rotvec))
    if angle == 0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    axis = rotvec / angle
    # Both ways of a half turn are the shortest: rounding must not choose between them. The first
    # large component shall be positive; one is at least 1/√3, and 0.55 is no component of a
    # tidy axis.
    if angle > math.pi - _SMALLEST and axis[np.argmax(np.abs(axis) > 0.55)] < 0:
        return -axis, 2 * math.pi - angle
    return axis, angle


def _direction(axis: str | tuple[float, ...]) -> Array:
    return np.eye(3)["xyz".index(axis)] if isinstance(axis, str) else normalize(axis)


def _filled(point: tuple[float, ...], start: Array) -> Array:
    """Return a point of 2 or 3 values; z is kept where it is missing."""
    return np.array([*point, start[2]][:3])


def _show(point: Array) -> str:
    return f"[{', '.join(f'{x:g}' for x in point)}]"


# Timing ------------------------------------------------------------------------------------------


def _pause(duration: float) -> Array:
    """Return the phases of `PIECE` of a time at u = 0."""
    phases = np.zeros((PHASES, 5))
    phases[-1, :2] = duration, 1.0
    return phases


def _rest_to_rest(curve: _Curve, limits: TargetLimitsSection) -> Array:
    """Return the phases of `PIECE` of the fastest u, from rest at 0 to rest at 1, within the limits.

    Ruckig is asked in a unit of time in which all limits on u are at least 1: it has absolute
    tolerances, and fails for lengths or times far from 1.
    """
    along, length, angle = _along(limits, curve.radius), curve.length, abs(curve.angle)
    times = (
        max(length / along[0], angle / limits.angular_velocity),
        max(length / along[1], angle / limits.angular_acceleration) ** (1 / 2),
        max(length / along[2], angle / limits.angular_jerk) ** (1 / 3),
    )
    unit = max(times)
    if unit == math.inf:
        return _pause(unit)  # too long: `_intervals` says so
    motion, trajectory = ruckig.InputParameter(1), ruckig.Trajectory(1)
    motion.current_position, motion.target_position = [0.0], [1.0]
    # u̇ never passes 1/unit: that is what one of the three limits allows on a way of 1. A limit
    # 200 times less strict than the strictest counts as 200: no slower by more than 0.1 %, and
    # ruckig's first step fails now and then for jerks above 1e8.
    ratios = [min(unit / time, 200.0) for time in times]
    motion.max_velocity = [min(ratios[0], 2.0)]
    motion.max_acceleration = [ratios[1] ** 2]
    reason = ""
    # Where two of ruckig's cases meet, as at a length of 2 a³/j², it may find neither: not so beside it.
    for share in (1.0, 1.0 - 1e-12):
        motion.max_jerk = [share * ratios[2] ** 3]
        try:
            ruckig.Ruckig(1).calculate(motion, trajectory)
            break
        except (ruckig.RuckigError, ValueError) as error:  # ValueError: a result without a name
            reason = str(error).replace("[ruckig]", "").strip().split(", dof")[0]
    else:
        raise TargetError(f"{curve.place}: cannot be timed: {reason}")
    ((profile,),) = trajectory.profiles
    phases = _pause(0.0)
    phases[:, 0] = unit * np.cumsum([0.0, *profile.t])
    phases[:-1, 1:] = np.transpose([profile.p[:7], profile.v[:7], profile.a[:7], profile.j])
    phases[:-1, 1:] *= unit ** -np.arange(4.0)
    return phases


def _along(limits: TargetLimitsSection, radius: float) -> tuple[float, float, float]:
    """Return limits on ṡ, s̈ and s⃛ that keep the vectors within theirs on an arc.

    With V, A, J for the bounds of ṡ, |s̈|, |s⃛| and v, a, j for those of the vectors:
    V = min(v, √(0.8 a r), ∛(0.4 j r²)) leaves A = √(a² − (V²/r)²) >= 0.6 a; A is also kept below
    0.6 j r/(3 V), which leaves J = √(j² − (3 V A/r)²) − V³/r² >= 0.8 j − 0.4 j = 0.4 j. So the
    vectors stay in their limits even if V, A and J came together. On a line, r = ∞, nothing is
    lost: V = v, A = a, J = j.
    """
    v, a, j = limits.velocity, limits.acceleration, limits.jerk
    V = min(v, (0.8 * a) ** 0.5 * radius**0.5, (0.4 * j) ** (1 / 3) * radius ** (2 / 3))
    rate = V / radius
    A = a * math.sqrt(1 - (V * rate / a) ** 2)
    if rate > 0:
        A = min(A, 0.2 * j / rate)
    J = j * (math.sqrt(1 - (3 * A * rate / j) ** 2) - V * rate * rate / j)
    return V, A, J
