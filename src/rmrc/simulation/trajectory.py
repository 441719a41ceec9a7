"""A target path as a reference: pose and velocity of the site at any time.

A path is geometry times timing. Each segment is a curve over one parameter u from 0 to 1: the site's origin
at p(u), a straight line or a circular arc, and the orientation turned by φ u about one fixed axis. Points and
axes are given in the world, or in the frame of the arm's base, of the site where the segment starts, or of
the site where the path starts. Ruckig times u from rest to rest, jerk-limited and as fast as the limits allow
[Berscheid21], so that translation and rotation end together, and the segments follow one another without a
gap. It only gets point-to-point motions: it computes these locally, but would send way-points to a server. A
set-point is a step at rest, and a recorded motion has its own timing.

The limits hold for the norms of the Cartesian vectors. Along an arc of radius r, at speed ṡ,

    |p̈|² = s̈² + (ṡ²/r)²,   |p⃛|² = (s⃛ − ṡ³/r²)² + (3 ṡ s̈/r)²,

so `_along` gives s̈ and s⃛ what the centripetal parts leave. A target outside the workspace is not an error
here: this module knows no arm.

Only this module uses ruckig.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import ruckig
from numpy.typing import ArrayLike

from rmrc.scenario import TargetLimitsSection, TargetSection
from rmrc.scenario.target import Arc, Line, Motion, PathFrame, Set, Tilt, Turn
from rmrc.simulation.motion import SLACK, eased, gaps, held, is_held, needed, read_motion, spline
from rmrc.simulation.reference import POSE, Curve, Reference, Spline
from rmrc.support import spatial
from rmrc.support.errors import TargetError
from rmrc.support.spatial import ORIGIN, Array, normalize, rotate
from rmrc.support.text import listed

# Points of a curve that are checked.
_SHARES = np.linspace(0.0, 1.0, 17)

# Smaller lengths [m] and angles [rad] are rounding of a pose, not motions to follow.
_SMALLEST = 1e-9

# Ten million ticks are 2.8 h at 1 kHz, and 1.7 GB: more is an error of units.
_MOST_TICKS = 10_000_000

# A duration that is a whole number of periods, except rounding, gets no further tick. The sums of
# durations of `_MOST_TICKS` periods are rounded to 1e-9 of a period.
_TICK_ROUNDING = 1e-6

# No motion has a mean jerk beyond it that counts [m/s³ or rad/s³].
_NO_JERK_LIMIT = 1e6


class Places(NamedTuple):
    """Things other than the world that a path may refer to.

    Attributes:
        base: Pose of the arm's base, (7,).
        joints: Names of the joints.
        pose_at: Returns the pose of the site, (7,), at joint positions, (n,), or at a keyframe.
        axes: Axes of the task.
        check: Called with the number of a segment and points of the site on it, (k, 3); raises if they are
            senseless.
    """

    base: Array = ORIGIN
    joints: tuple[str, ...] = ()
    pose_at: Callable[[str | Sequence[float] | Array], Array] = lambda _: ORIGIN
    axes: tuple[str, ...] = spatial.AXES
    check: Callable[[int, Array], None] = lambda *_: None


def make_reference(target: TargetSection, start_pose: ArrayLike, period: float, places: Places) -> Reference:
    """Time a path, to be evaluated at every control tick.

    Args:
        target: The path, whose segments start where the one before ends, and its limits.
        start_pose: Pose of the site at the start, [p, quat w x y z], (7,) [m, 1]; the first sample, to the
            bit, unless the path starts with a step.
        period: The control period [s].
        places: Other things that the segments refer to.

    Returns:
        The reference; the last sample is the end of the path, at rest.

    Raises:
        TargetError: A segment has no extent or is not finite, the path needs more than ten million periods,
            or a file is unusable or too fast.

    >>> target = TargetSection.model_validate({"path": [{"line": {"by": [0.1, 0]}}, {"hold": {"for": 0.5}}]})
    >>> start = [0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]
    >>> reference = make_reference(target, start, 0.01, Places())
    >>> reference.duration, reference.pose[-1, :3].round(12)
    (1.25, array([0.6, 0. , 0.3]))
    """
    path = _Path(target, places, np.array(start_pose, dtype=float))
    for i, segment in enumerate(target.path):
        try:
            path.number = i
            path.follow(segment.name, getattr(segment, segment.name))
        except TargetError as error:
            raise TargetError(f"target.path[{i}].{segment.name}: {error}") from None
    path.hold(0.0)
    with np.errstate(over="ignore"):  # an endless path is refused below
        starts = np.cumsum([0.0, *(piece.duration for piece in path.pieces[:-1])])
    duration = float(starts[-1])
    count = duration / period
    if not count <= _MOST_TICKS:
        raise TargetError(
            f"target.path: takes {duration:g} s, which is {count:.9g} control periods of {period:g} s "
            f"and more than {_MOST_TICKS}; raise target.limits or control.period, or shorten the path"
        )
    last = max(1, math.ceil(count - _TICK_ROUNDING))
    starts = np.minimum(starts, period * last)  # the last tick is the end itself, not a rounding before it
    return Reference(last + 1, period, tuple(path.pieces), starts, tuple(path.notes))


class _Path:
    """A path under construction: its pieces and its present end."""

    def __init__(self, target: TargetSection, places: Places, start: Array) -> None:
        self._target, self._places, self._start, self.pose = target, places, start, start
        self.pieces: list[Curve | Spline] = []
        self.notes: list[str] = []
        self.number = 0

    @np.errstate(over="ignore", invalid="ignore")  # `_end` reports results that are not finite
    def follow(self, name: str, value: Any) -> None:
        """Add a segment by the name of its only key, and its value."""
        match name:
            case "hold":
                self.hold(value.duration)
            case "set":
                self.pose, _ = self._end(self._straight(value))
                self.hold(value.duration)
            case "line":
                self._move(self._straight(value), must_travel=True)
            case "arc":
                self._move(self._arc(value), must_travel=True)
            case "turn":
                self._move(self._turned(value, None))
            case "tilt":
                self._move(self._turned(None, value))
            case "configurations":
                if not sum(self._go(self._places.pose_at(configuration)) for configuration in value):
                    raise TargetError("has length 0, the site is already there; to pause write hold")
            case "file":
                self._play(value)

    def hold(self, duration: float) -> None:
        """Add a rest at the present end [s]."""
        self.pieces.append(Curve(self.pose, duration))

    # Frames

    def _origin(self, frame: PathFrame | None) -> Array:
        """Return the pose of a frame in the world, (7,)."""
        poses = {"world": ORIGIN, "base": self._places.base, "site": self.pose, "start": self._start}
        return poses[frame or self._target.frame]

    def _vector(self, vector: ArrayLike, frame: PathFrame | None) -> Array:
        return rotate(self._origin(frame)[3:], vector)

    def _point(self, values: tuple[float, ...], frame: PathFrame | None) -> Array:
        """Return a point of 2 or 3 values in the world; a missing z stays as it is in the frame."""
        origin, count = self._origin(frame), len(values)
        point = spatial.pose_product(spatial.pose_inverse(origin), self.pose)[:3]
        point[:count] = values
        if (frame or self._target.frame) in ("world", "base"):
            point[:count] += [*self._target.offset, 0.0][:count]
        return origin[:3] + self._vector(point, frame)

    # Curves: pieces from the present end that are not timed yet

    def _turned(self, turn: Turn | None, tilt: Tilt | None, frame: PathFrame | None = None) -> Curve:
        curve = Curve(self.pose)
        if tilt is not None:
            to = self._vector(_direction(tilt.to), tilt.frame or frame)
            curve.axis, curve.angle = _tilt(self.pose[3:], _direction(tilt.axis), to)
        elif turn is not None and turn.to is not None:
            to = spatial.quat_multiply(self._origin(turn.frame or frame)[3:], normalize(turn.to))
            curve.axis, curve.angle = _shortest(to, self.pose[3:])
        elif turn is not None and turn.axis is not None:
            curve.axis = self._vector(_direction(turn.axis), turn.frame or frame)
            curve.angle = turn.angle or 0.0
        return curve

    def _straight(self, way: Line | Set) -> Curve:
        curve = self._turned(way.turn, way.tilt, way.frame)
        if way.by is not None:
            curve.straight = self._vector([*way.by, 0.0][:3], way.frame)
        elif way.to is not None:
            curve.straight = self._point(way.to, way.frame) - self.pose[:3]
        return curve

    def _arc(self, arc: Arc) -> Curve:
        curve = self._turned(arc.turn, arc.tilt, arc.frame)
        normal = self._vector(_direction(arc.axis), arc.frame)
        spoke = self.pose[:3] - self._point(arc.center, arc.frame)
        spoke -= (spoke @ normal) * normal
        if np.linalg.norm(spoke) < _SMALLEST:
            raise TargetError(
                f"starts at {_show(self.pose)}, on the axis of the circle: radius 0; move "
                "the center, or write turn to rotate in place"
            )
        curve.sweep, curve.spoke, curve.tangent = arc.angle, spoke, np.cross(normal, spoke)
        return curve

    def _end(self, curve: Curve) -> tuple[Array, float]:
        """Return the end pose of a curve that is not timed yet, (7,), and its length [m]."""
        curve.phases = np.eye(5)[2:3]  # u is the time
        end = curve.at(np.ones(1))[0, :POSE]
        length = float(np.linalg.norm(curve.straight + curve.sweep * curve.tangent))
        if not np.isfinite([length, *end]).all():
            raise TargetError("is not finite; use smaller numbers")
        self._places.check(self.number, curve.at(_SHARES)[:, :3])
        return end, length

    def _move(self, curve: Curve, must_travel: bool = False) -> None:
        """Add a curve from rest to rest, as fast as the limits allow."""
        end, length = self._end(curve)
        angle = abs(curve.angle)
        radius = float(np.linalg.norm(curve.spoke)) if curve.sweep else math.inf
        if (length if must_travel else max(length, angle)) < _SMALLEST:
            raise TargetError(
                f"has {'length' if must_travel else 'angle'} 0, at {_show(self.pose)}; "
                "to pause write hold, to rotate in place write turn"
            )
        curve.phases = _rest_to_rest(length, radius, angle, self._target.limits)
        self.pieces.append(curve)
        self.pose = end

    # Poses in turn

    def _go(self, pose: Array) -> bool:
        """Go straight to a pose; return whether it is another one than the present."""
        curve = Curve(self.pose)
        curve.straight = pose[:3] - self.pose[:3]
        curve.axis, curve.angle = _shortest(pose[3:], self.pose[3:])
        is_another = bool(np.linalg.norm(curve.straight) >= _SMALLEST or curve.angle >= _SMALLEST)
        if is_another:
            self._move(curve)
        return is_another

    def _play(self, file: Motion) -> None:
        """Follow a recorded motion, from its first pose or from the present end of the path."""
        places, origin = self._places, self._origin(file.frame)
        try:
            time, poses, notes = read_motion(
                file, places.joints, places.pose_at, origin, self.pose, places.axes
            )
        except TargetError as error:
            raise TargetError(f'"{file.path}": {error}') from None
        for note in notes:
            self._note(file, note)
        if file.origin == "start":
            turn = spatial.quat_multiply(spatial.quat_conjugate(poses[0, 3:]), self.pose[3:])
            poses[:, :3] += self.pose[:3] - poses[0, :3]
            poses[:, 3:] = spatial.quat_multiply(poses[:, 3:], turn)
        self._places.check(self.number, poses[:, :3])
        if file.origin != "start":
            self._go(poses[0])
        if poses[0, 3:] @ self.pose[3:] < 0:
            poses[:, 3:] *= -1.0
        self._play_rows(file, time, poses)

    def _play_rows(self, file: Motion, time: Array, poses: Array) -> None:
        """Follow the rows of a motion, which begins at the present end of the path."""
        limits, before, count = self._target.limits, gaps(time), len(time)
        ends = [0, *(before + 1 if file.gaps == "stop" else []), count]
        parts = [(slice(first, end), (first > 0, end < count)) for first, end in pairwise(ends)]
        speed, holds = (1.0 if file.speed == "auto" else file.speed), file.interpolation == "hold"
        if not holds:
            factor, reason = needed(spline(time / speed, poses), limits)
            if len(parts) > 1:  # perhaps it is too fast in its gaps alone, or by the jerk where it is cut
                cut = limits.model_copy(update=dict.fromkeys(("jerk", "angular_jerk"), _NO_JERK_LIMIT))
                motions = (spline(time[rows] / speed, poses[rows], moves) for rows, moves in parts)
                within = max(needed(motion, cut) for motion in motions if motion.duration)
                factor, reason = min((factor, reason), within)
            if file.speed == "auto":
                speed /= factor
            elif factor > 1.0 + SLACK:
                holds = file.interpolation == "auto" and is_held(time, poses)
                if not holds:
                    raise TargetError(
                        f"{reason}; write speed: {speed / factor:.3g} or speed: auto, or interpolation: hold "
                        "if the rows are steps or noisy, or raise the limit"
                    )
                self._note(file, "its rows repeat like those of a held signal, so interpolation: hold")
        begin, due = self._duration(), time / speed
        if holds:
            self.pieces.append(held(due, poses))
        for rows, moves in () if holds else parts:
            self.hold(max(0.0, begin + due[rows.start] - self._duration()))
            self._go(poses[rows.start])
            self.pieces.append(eased(due[rows], poses[rows], limits, moves))
            self.pose = poses[rows.stop - 1]
        self.pose = poses[-1]
        if len(before):
            where = (f"{time[row + 1] - time[row]:.3g} s after {time[row]:.4g} s" for row in before)
            does = "stays" if holds else "stops" if len(parts) > 1 else "moves on"
            self._note(file, f"no rows for {listed(where, 3)}: the target {does} there")

    def _note(self, file: Motion, text: str) -> None:
        self.notes.append(f"{file.path.name}: {text}")

    def _duration(self) -> float:
        return sum(piece.duration for piece in self.pieces)


def _shortest(to: Array, start: Array) -> tuple[Array, float]:
    """Return unit axis and angle of the shortest turn from one orientation to another."""
    rotvec = spatial.log_rotation(spatial.quat_multiply(to, spatial.quat_conjugate(start)))
    angle = float(np.linalg.norm(rotvec))
    if angle == 0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    axis = rotvec / angle
    # Both directions of a half turn are equally short: rounding must not choose between them. The first
    # large component becomes positive; one is at least 1/√3, and 0.55 is no component of a tidy axis.
    if angle > math.pi - _SMALLEST and axis[np.argmax(np.abs(axis) > 0.55)] < 0:
        return -axis, 2 * math.pi - angle
    return axis, angle


def _tilt(quat: Array, axis: Array, to: Array) -> tuple[Array, float]:
    """Return unit axis and angle of the shortest turn that brings an axis of a body to a direction."""
    now = rotate(quat, axis)
    normal = np.cross(now, to)
    sine = float(np.linalg.norm(normal))
    if sine < _SMALLEST:  # there already, or half a turn about the axis below
        after = np.eye(3)[(np.argmax(np.abs(axis)) + 1) % 3]
        return rotate(quat, normalize(after - (after @ axis) * axis)), 0.0 if now @ to > 0 else math.pi
    return normal / sine, math.atan2(sine, float(now @ to))


def _direction(axis: str | tuple[float, ...]) -> Array:
    return np.eye(3)["xyz".index(axis)] if isinstance(axis, str) else normalize(axis)


def _show(pose: Array) -> str:
    return f"[{', '.join(f'{x:g}' for x in pose[:3])}]"


# Timing ------------------------------------------------------------------------------------------


def _rest_to_rest(length: float, radius: float, angle: float, limits: TargetLimitsSection) -> Array:
    """Return the phases of a `Curve` of the fastest u, from rest at 0 to rest at 1, within the limits.

    Ruckig gets a unit of time in which all limits on u are at least 1: it has absolute
    tolerances, and fails for lengths or times far from 1.

    Args:
        length: Length of the curve [m].
        radius: Its radius, infinite for a line [m].
        angle: Angle of the turn, not negative [rad].
        limits: Limits of the target.

    Raises:
        TargetError: Ruckig fails.
    """
    linear = _along(limits, radius)
    angular = limits.angular_velocity, limits.angular_acceleration, limits.angular_jerk
    times = [max(length / linear[i], angle / angular[i]) ** (1 / (i + 1)) for i in range(3)]
    unit = max(times)
    phases = np.zeros((8, 5))  # seven of ruckig, and the rest
    phases[-1] = unit, 1.0, 0.0, 0.0, 0.0
    if unit == math.inf:
        return phases  # too long: `make_reference` reports it
    motion, trajectory = ruckig.InputParameter(1), ruckig.Trajectory(1)
    motion.current_position, motion.target_position = [0.0], [1.0]
    # u̇ never passes 1/unit: one of the three limits allows no more on a way of 1. A limit
    # 200 times less strict than the strictest counts as 200: this slows the motion by at most 0.1 %, and
    # ruckig's first step sometimes fails for jerks above 1e8.
    ratios = [min(unit / time, 200.0) for time in times]
    motion.max_velocity = [min(ratios[0], 2.0)]
    motion.max_acceleration = [ratios[1] ** 2]
    # Where two of ruckig's cases meet, as at a length of 2 a³/j², it may find neither, but it does nearby.
    for share in (1.0, 1.0 - 1e-12):
        motion.max_jerk = [share * ratios[2] ** 3]
        try:
            ruckig.Ruckig(1).calculate(motion, trajectory)
            break
        except (ruckig.RuckigError, ValueError) as error:  # ValueError: a result without a name
            reason = str(error).replace("[ruckig]", "").strip().split(", dof")[0]
    else:
        raise TargetError(f"cannot be timed: {reason}")
    ((profile,),) = trajectory.profiles
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
