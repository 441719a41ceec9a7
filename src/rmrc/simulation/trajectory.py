"""A target path as a reference: pose and velocity of the site at every control tick.

A path is geometry times timing. Each segment is a curve over one parameter u from 0 to 1: the site's origin
at p(u), a straight line or a circular arc, and the orientation turned by φ u about one fixed axis. Points and
axes are given in the world, or in the frame of the arm's base, of the site where the segment starts, or of
the site where the path starts. Ruckig times u from rest to rest, jerk-limited and as fast as the limits allow
[Berscheid21], so that translation and rotation end together, and the segments follow one another without a
gap. It only gets point-to-point motions: it computes these locally, but would send way-points to a server. A
set-point is a step at rest, and a recorded motion has its own timing.

The limits hold for the norms of the Cartesian vectors. Along an arc of radius r, at speed ṡ,

    |p̈|² = s̈² + (ṡ²/r)²,   |p⃛|² = (s⃛ − ṡ³/r²)² + (3 ṡ s̈/r)²,

so `_along` gives s̈ and s⃛ the rest beside the centripetal parts. A target outside the workspace is not an
error here: this module knows no arm.

Only this module uses ruckig.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import ruckig
from numpy.typing import ArrayLike, NDArray

from rmrc.scenario import (
    ArcSegment,
    ConfigurationsSegment,
    FileSegment,
    HoldSegment,
    LineSegment,
    PathFrame,
    Segment,
    Set,
    SetSegment,
    TargetLimitsSection,
    Tilt,
    TiltSegment,
    Turn,
    TurnSegment,
)
from rmrc.scenario import Motion as MotionFile
from rmrc.simulation.motion import SLACK, Motion, needed, read_motion
from rmrc.simulation.reference import PHASES, PIECE, Reference, end
from rmrc.support.errors import TargetError
from rmrc.support.spatial import (
    ORIGIN,
    log_rotation,
    normalize,
    pose_inverse,
    pose_product,
    quat_conjugate,
    quat_multiply,
    quat_to_matrix,
)

Array = NDArray[np.float64]

# Smaller lengths [m] and angles [rad] are rounding of a pose, not motions to follow.
_SMALLEST = 1e-9

# Ten million ticks are 2.8 h at 1 kHz, and 1.7 GB: more is an error of units.
_MOST_TICKS = 10_000_000

# A duration that is a whole number of periods, except rounding, gets no further tick. The sums of
# durations of `_MOST_TICKS` periods are rounded to 1e-9 of a period.
_TICK_ROUNDING = 1e-6


class Places(NamedTuple):
    """Things other than the world that a path may refer to.

    Attributes:
        base: Pose of the arm's base, (7,).
        joints: Names of the joints.
        pose_at: Returns the pose of the site, (7,), at joint positions, (n,), or at a keyframe.
    """

    base: Array = ORIGIN
    joints: tuple[str, ...] = ()
    pose_at: Callable[[str | Sequence[float] | Array], Array] = lambda _: ORIGIN


def make_reference(
    segments: Sequence[Segment],
    limits: TargetLimitsSection,
    start_pose: ArrayLike,
    period: float,
    offset: Sequence[float] = (),
    frame: PathFrame = "world",
    places: Places = Places(),  # noqa: B008 - a tuple
) -> Reference:
    """Time a path, to be sampled at every control tick.

    Args:
        segments: The path, `scenario.target.path`; each piece starts where the one before ends.
        limits: Limits of the norms of velocity, acceleration and jerk, linear and angular.
        start_pose: Pose of the site at the start, [p, quat w x y z], (7,) [m, 1]; the first sample, to the
            bit, unless the path starts with a step.
        period: The control period [s].
        offset: Offset of the absolute points of the path, `scenario.target.offset`, (2,) or (3,) [m].
        frame: Frame of the segments that name none, `scenario.target.frame`.
        places: Other things that the segments refer to.

    Returns:
        The reference; the last sample is the end of the path, at rest.

    Raises:
        TargetError: A segment has no extent or is not finite, a limit or the period is not > 0,
            the path needs more than ten million periods, or a file is unusable or too fast.

    >>> path = [LineSegment(line={"by": (0.1, 0)}), HoldSegment(hold={"for": 0.5})]
    >>> start = [0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]
    >>> reference = make_reference(path, TargetLimitsSection(), start, period=0.01)
    >>> reference.duration, reference.pose[-1, :3].round(12)
    (1.25, array([0.6, 0. , 0.3]))
    """
    pose = _checked(segments, limits, start_pose, period)
    path = _Path(limits, offset, frame, places, pose)
    for i, segment in enumerate(segments):
        path.follow(i, segment)
    pieces = np.concatenate(path.pieces)
    with np.errstate(over="ignore"):  # an endless path is refused below
        starts = np.cumsum([0.0, *pieces["phases"][:, -1, 0]])
    ticks = _intervals(float(starts[-1]), period) + 1
    # a tick on the border of two segments belongs to the later one
    borders = [0, *(min(_first_tick(start, period), ticks - 1) for start in starts[1:-1]), ticks]
    pieces["start"], pieces["first"], pieces["last"] = starts[:-1], borders[:-1], borders[1:]
    recorded = []
    for i, motion in path.motions.items():
        first, last, began = borders[i], borders[i + 1], starts[i]
        time = period * np.arange(first, last) - began
        if last == ticks:
            time[-1] = motion.time[-1]  # the end itself, not a rounding before it
        recorded.append((first, motion.at(np.clip(time, 0.0, motion.time[-1]))))
    return Reference(ticks, period, pieces, tuple(recorded))


def _first_tick(start: float, period: float) -> int:
    """Return the first tick that is not before a time; rounding may move the quotient to its neighbor."""
    nearest = round(start / period)
    return next(tick for tick in range(nearest - 1, nearest + 3) if period * tick >= start)


def _checked(
    segments: Sequence[Segment], limits: TargetLimitsSection, start_pose: ArrayLike, period: float
) -> Array:
    """Return the start pose, or raise the fault of the arguments."""
    if not segments:
        raise TargetError("target.path: must have at least 1 item, got 0")
    values = {f"target.limits.{name}": value for name, value in limits}
    for name, value in (values | {"control.period": period}).items():
        if not 0 < value < math.inf:
            raise TargetError(f"{name}: must be finite and > 0, got {value:g}")
    pose = np.array(start_pose, dtype=float)
    # Quaternions of a simulator are of length 1 to rounding; 1e-9 leaves room for it.
    if pose.shape != (7,) or not np.isfinite(pose).all() or abs(np.linalg.norm(pose[3:]) - 1) > 1e-9:
        shown = ", ".join(f"{x:g}" for x in pose.flat)
        raise TargetError(f"start_pose: must be [x, y, z] and a unit quaternion, got [{shown}]")
    return pose


def _intervals(duration: float, period: float) -> int:
    """Return how many periods cover a duration, at least 1."""
    count = duration / period
    if not count <= _MOST_TICKS:
        raise TargetError(
            f"target.path: takes {duration:g} s, which is {count:.9g} control periods of {period:g} s "
            f"and more than {_MOST_TICKS}; raise target.limits or control.period, or shorten the path"
        )
    return max(1, math.ceil(count - _TICK_ROUNDING))


# Geometry ----------------------------------------------------------------------------------------


class _Curve(NamedTuple):
    """A segment without its timing.

    Attributes:
        place: The segment's key.
        length: Length of the curve [m].
        radius: Infinite unless it is an arc [m].
        angle: Angle of the turn [rad].
        end: Pose at u = 1, (7,).
    """

    place: str
    length: float
    radius: float
    angle: float
    end: Array


class _Path:
    """A path under construction: its pieces, and its present end."""

    def __init__(
        self, limits: TargetLimitsSection, offset: Sequence[float], frame: PathFrame, places: Places,
        start: Array,
    ) -> None:  # fmt: skip
        self._limits, self._offset, self._frame = limits, (*offset, 0.0, 0.0, 0.0)[:3], frame
        self._places, self._start, self._pose = places, start, start
        self.pieces: list[NDArray[np.void]] = []
        self.motions: dict[int, Motion] = {}

    @np.errstate(over="ignore", invalid="ignore")  # `_curve` reports results that are not finite
    def follow(self, index: int, segment: Segment) -> None:
        """Add a segment."""
        (kind,) = type(segment).model_fields
        self._index, place = index, f"target.path[{index}].{kind}"
        if isinstance(segment, HoldSegment):
            self._add(_still(self._pose), _pause(segment.hold.duration))
        elif isinstance(segment, SetSegment):
            self._step(place, segment.set)
        elif isinstance(segment, FileSegment):
            self._play(place, segment.file)
        elif isinstance(segment, ConfigurationsSegment):
            self._visit(place, segment.configurations)
        else:
            self._curve(place, segment)

    def _add(self, piece: NDArray[np.void], phases: Array) -> None:
        piece["phases"], piece["segment"] = phases, self._index
        self.pieces.append(piece)

    def _origin(self, frame: PathFrame | None) -> Array | None:
        """Return the pose of a frame, None for the world, whose coordinates need no change."""
        frames = {"base": self._places.base, "site": self._pose, "start": self._start}
        return frames.get(frame or self._frame)

    def _point(self, point: tuple[float, ...], frame: PathFrame | None) -> Array:
        """Return a point of 2 or 3 values in the world; a missing z stays as it is in the frame."""
        origin = self._origin(frame)
        if any(self._offset) and (frame or self._frame) in ("world", "base"):
            point = tuple(x + d for x, d in zip(point, self._offset, strict=False))
        if origin is None:
            return _filled(point, self._pose)
        own = _filled(point, pose_product(pose_inverse(origin), self._pose))
        return np.asarray(origin[:3] + quat_to_matrix(origin[3:]) @ own)

    def _vector(self, vector: Array, frame: PathFrame | None) -> Array:
        origin = self._origin(frame)
        return vector if origin is None else np.asarray(quat_to_matrix(origin[3:]) @ vector)

    def _straight(
        self, to: tuple[float, ...] | None, by: tuple[float, ...] | None, frame: PathFrame | None
    ) -> Array:
        """Return the straight way to a point, or by a vector."""
        if by is not None:
            return self._vector(np.array([*by, 0.0][:3]), frame)
        return np.zeros(3) if to is None else self._point(to, frame) - self._pose[:3]

    def _rotation(self, turn: Turn | None, tilt: Tilt | None, frame: PathFrame | None) -> tuple[Array, float]:
        """Return unit axis and angle of a turn or a tilt; `to` takes the shortest way."""
        if tilt is not None:
            own = _direction(tilt.axis)
            to = self._vector(_direction(tilt.to), tilt.frame or frame)
            return _tilt(quat_to_matrix(self._pose[3:]), own, to)
        if turn is None:
            return np.array([0.0, 0.0, 1.0]), 0.0
        frame = turn.frame or frame
        if turn.axis is not None and turn.angle is not None:
            return self._vector(_direction(turn.axis), frame), turn.angle
        assert turn.to is not None  # the schema requires one of both forms
        origin, to = self._origin(frame), normalize(turn.to)
        return _shortest(to if origin is None else quat_multiply(origin[3:], to), self._pose[3:])

    def _curve(self, place: str, segment: LineSegment | ArcSegment | TurnSegment | TiltSegment) -> None:
        straight, spoke, normal, sweep = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
        turn: Turn | None = None
        tilt: Tilt | None = None
        frame: PathFrame | None = None
        if isinstance(segment, LineSegment):
            line = segment.line
            turn, tilt, frame = line.turn, line.tilt, line.frame
            straight = self._straight(line.to, line.by, frame)
        elif isinstance(segment, ArcSegment):
            arc = segment.arc
            turn, tilt, frame, sweep = arc.turn, arc.tilt, arc.frame, arc.angle
            normal = self._vector(_direction(arc.axis), frame)
            spoke = _spoke(place, self._point(arc.center, frame), normal, self._pose)
        elif isinstance(segment, TurnSegment):
            turn = segment.turn
        else:
            tilt = segment.tilt
        way = _Way(straight, spoke, normal, sweep, *self._rotation(turn, tilt, frame))
        self._move(place, way, on_the_spot=isinstance(segment, TurnSegment | TiltSegment))

    def _move(self, place: str, way: "_Way", *, on_the_spot: bool = False) -> None:
        curve, piece = _curve(place, way, self._pose, on_the_spot)
        self._add(piece, _rest_to_rest(curve, self._limits))
        self._pose = curve.end

    def _go(self, place: str, pose: Array) -> None:
        """Go straight to a pose, unless it is the present one."""
        nothing, straight = np.zeros(3), pose[:3] - self._pose[:3]
        axis, angle = _shortest(pose[3:], self._pose[3:])
        if np.linalg.norm(straight) >= _SMALLEST or abs(angle) >= _SMALLEST:
            is_turn = bool(np.linalg.norm(straight) < _SMALLEST)
            self._move(place, _Way(straight, nothing, nothing, 0.0, axis, angle), on_the_spot=is_turn)

    def _visit(self, place: str, configurations: Sequence[str | tuple[float, ...]]) -> None:
        """Go to the poses of some configurations."""
        before = len(self.pieces)
        for i, one in enumerate(configurations):
            try:
                pose = self._places.pose_at(one)
            except TargetError as error:
                raise TargetError(f"{place}[{i}]: {error}") from None
            self._go(place, pose)
        if len(self.pieces) == before:
            raise TargetError(f"{place}: has length 0, the site is already there; to pause write hold")

    def _step(self, place: str, step: Set) -> None:
        nothing, straight = np.zeros(3), self._straight(step.to, step.by, step.frame)
        way = _Way(straight, nothing, nothing, 0.0, *self._rotation(step.turn, step.tilt, step.frame))
        self._pose = _curve(place, way, self._pose, None)[0].end
        self._add(_still(self._pose), _pause(step.duration))

    def _play(self, place: str, file: MotionFile) -> None:
        """Follow a recorded motion, from its first pose or from the present end of the path."""
        origin = self._origin(file.frame)
        origin = ORIGIN if origin is None else origin
        back, places = pose_inverse(origin), self._places
        try:
            motion = read_motion(
                file.path, file.columns, places.joints, lambda q: pose_product(back, places.pose_at(q)),
                pose_product(back, self._pose),
            )  # fmt: skip
        except TargetError as error:
            raise TargetError(f"{place}.path: {error}") from None
        poses = pose_product(origin, motion.pose)
        if file.origin == "start":
            turns = quat_multiply(poses[:, 3:], quat_multiply(quat_conjugate(poses[0, 3:]), self._pose[3:]))
            poses = np.hstack([poses[:, :3] - poses[0, :3] + self._pose[:3], turns])
        else:
            self._go(place, poses[0])
        if poses[0, 3:] @ self._pose[3:] < 0:
            poses[:, 3:] *= -1.0
        speed = 1.0 if file.speed == "auto" else file.speed
        motion = self._within_limits(place, Motion(motion.time / speed, poses), file)
        self.motions[len(self.pieces)] = motion
        self._add(_still(poses[0]), _pause(float(motion.time[-1])))
        self._pose = poses[-1]

    def _within_limits(self, place: str, motion: Motion, file: MotionFile) -> Motion:
        """Return a motion within the limits, also between its rows, or raise the factor of its excess."""
        factor, what = needed(motion, self._limits)
        if file.speed == "auto":
            return motion.slowed(max(1.0, factor))
        if factor > 1.0 + SLACK:
            speed = file.speed / factor
            digits = 2 - math.floor(math.log10(speed))  # three of them, rounded down
            speed = math.floor(speed * 10.0**digits) / 10.0**digits
            raise TargetError(f"{place}: {what}; write speed: {speed:g} or speed: auto, or raise the limit")
        return motion


class _Way(NamedTuple):
    """The shape of a segment as in `PIECE`; `normal` is the axis of an arc."""

    straight: Array
    spoke: Array
    normal: Array
    sweep: float
    axis: Array
    angle: float


def _still(pose: Array) -> NDArray[np.void]:
    """Return a piece that stays at a pose, (1,)."""
    piece = np.zeros(1, PIECE)
    piece["pose"], piece["axis"] = pose, (0.0, 0.0, 1.0)
    return piece


def _curve(place: str, way: _Way, start: Array, on_the_spot: bool | None) -> tuple[_Curve, NDArray[np.void]]:
    """Return the geometry of a segment from a pose, and its piece, (1,); None: any size is valid."""
    piece = _still(start)
    tangent = np.cross(way.normal, way.spoke) if way.sweep else way.spoke
    (one,) = piece
    one["straight"], one["sweep"], one["angle"] = way.straight, way.sweep, way.angle
    one["spoke"], one["tangent"], one["axis"] = way.spoke, tangent, way.axis
    length = np.linalg.norm(way.straight + way.sweep * tangent)
    radius = np.linalg.norm(way.spoke) if way.sweep else math.inf
    curve = _Curve(place, float(length), float(radius), way.angle, end(piece))
    if not np.isfinite([length, way.angle, *curve.end]).all():
        raise TargetError(f"{place}: is not finite; use smaller numbers")
    if on_the_spot is False and curve.length < _SMALLEST:
        raise TargetError(
            f"{place}: has length 0, from {_show(start[:3])} to the same point; to pause write "
            "hold, to rotate in place write turn"
        )
    if on_the_spot and abs(way.angle) < _SMALLEST:
        raise TargetError(f"{place}: has angle 0; remove it, or write hold to pause")
    return curve, piece


def _spoke(place: str, center: Array, normal: Array, start: Array) -> Array:
    """Return the vector from the circle's center to the start, normal to its axis."""
    way = start[:3] - center
    spoke: Array = way - (way @ normal) * normal
    if np.linalg.norm(spoke) < _SMALLEST:
        raise TargetError(
            f"{place}: starts at {_show(start[:3])}, on the axis of the circle: radius 0; move "
            "the center, or write turn to rotate in place"
        )
    return spoke


def _shortest(to: Array, start: Array) -> tuple[Array, float]:
    """Return unit axis and angle of the shortest turn from one orientation to another."""
    rotvec = log_rotation(quat_multiply(to, quat_conjugate(start)))
    angle = float(np.linalg.norm(rotvec))
    if angle == 0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    axis = rotvec / angle
    # Both directions of a half turn are equally short: rounding must not choose between them. The first
    # large component becomes positive; one is at least 1/√3, and 0.55 is no component of a
    # tidy axis.
    if angle > math.pi - _SMALLEST and axis[np.argmax(np.abs(axis) > 0.55)] < 0:
        return -axis, 2 * math.pi - angle
    return axis, angle


def _tilt(R: Array, own: Array, to: Array) -> tuple[Array, float]:
    """Return unit axis and angle of the shortest turn that brings an axis of a body R to a direction."""
    now = R @ own
    square = np.cross(now, to)
    sine = float(np.linalg.norm(square))
    if sine < _SMALLEST:  # there already, or half a turn about the axis below
        after = np.eye(3)[(np.argmax(np.abs(own)) + 1) % 3]
        return R @ normalize(after - (after @ own) * own), 0.0 if now @ to > 0 else math.pi
    return square / sine, math.atan2(sine, float(now @ to))


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

    Ruckig gets a unit of time in which all limits on u are at least 1: it has absolute
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
        return _pause(unit)  # too long: `_intervals` reports it
    motion, trajectory = ruckig.InputParameter(1), ruckig.Trajectory(1)
    motion.current_position, motion.target_position = [0.0], [1.0]
    # u̇ never passes 1/unit: one of the three limits allows no more on a way of 1. A limit
    # 200 times less strict than the strictest counts as 200: this slows the motion by at most 0.1 %, and
    # ruckig's first step sometimes fails for jerks above 1e8.
    ratios = [min(unit / time, 200.0) for time in times]
    motion.max_velocity = [min(ratios[0], 2.0)]
    motion.max_acceleration = [ratios[1] ** 2]
    reason = ""
    # Where two of ruckig's cases meet, as at a length of 2 a³/j², it may find neither, but it does nearby.
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
