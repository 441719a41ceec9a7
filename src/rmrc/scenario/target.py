"""The target of a scenario: a path of lines, arcs, turns, steps, recorded motions and holds; its limits."""

from typing import Annotated, Literal

from rmrc.scenario import values as types
from rmrc.scenario.values import Choice, Section, key

Postures = Annotated[tuple[types.NameOrPositions, ...], types.count(1)]
PathFrame = Literal["world", "base", "site", "start"]
_ROTATIONS = ("turn", "tilt")


class Turn(Choice):
    """A rotation: by an angle about an axis, or to an orientation.

    Attributes:
        axis: axis of rotation
        angle: angle, counterclockwise about the axis
        to: final orientation, as a quaternion w x y z
        frame: its frame; null: that of the segment
    """

    counts = ((("axis", "to"), 1, 1), (("angle", "to"), 1, 1))
    axis: types.Direction | None = key(None, "1")
    angle: types.Angle | None = key(None, "rad")
    to: types.Quaternion | None = key(None, "1")
    frame: PathFrame | None = None


class Tilt(Choice):
    """The shortest rotation that brings an axis of the site to a direction.

    If they are opposite, the rotation is half a turn about the next axis: y for x, z for y, x for z.

    Attributes:
        axis: axis of the site, along its own axes
        to: direction to point it in
        frame: its frame; null: that of the segment
    """

    axis: types.Direction = key("z", "1")
    to: types.Direction = key(unit="1")
    frame: PathFrame | None = None


class Line(Choice):
    """A straight line of the site's origin.

    Attributes:
        to: end point: [x, y] (z stays) or [x, y, z]
        by: displacement: [dx, dy] or [dx, dy, dz]
        turn: rotation during the motion
        tilt: rotation during the motion that points an axis of the site
        frame: frame of its values; null: target.frame
    """

    counts = ((("to", "by"), 1, 1), (_ROTATIONS, 0, 1))
    to: types.Vector | None = key(None, "m")
    by: types.Vector | None = key(None, "m")
    turn: Turn | None = None
    tilt: Tilt | None = None
    frame: PathFrame | None = None


class Arc(Choice):
    """A circular arc of the site's origin.

    Attributes:
        center: [x, y] (z stays) or [x, y, z]
        axis: axis of the circle
        angle: angle, counterclockwise about the axis
        turn: rotation during the motion
        tilt: rotation during the motion that points an axis of the site
        frame: frame of its values; null: target.frame
    """

    counts = ((_ROTATIONS, 0, 1),)
    center: types.Vector = key(unit="m")
    axis: types.Direction = key("z", "1")
    angle: types.Angle = key(unit="rad")
    turn: Turn | None = None
    tilt: Tilt | None = None
    frame: PathFrame | None = None


class Set(Choice):
    """A set-point: the target jumps there and stays.

    Attributes:
        to: new position: [x, y] (z stays) or [x, y, z]
        by: step: [dx, dy] or [dx, dy, dz]
        turn: rotation during the motion
        tilt: rotation during the motion that points an axis of the site
        frame: frame of its values; null: target.frame
        duration: hold time there
    """

    counts = ((("to", "by"), 0, 1), (_ROTATIONS, 0, 1), (("to", "by", *_ROTATIONS), 1, 4))
    to: types.Vector | None = key(None, "m")
    by: types.Vector | None = key(None, "m")
    turn: Turn | None = None
    tilt: Tilt | None = None
    frame: PathFrame | None = None
    duration: types.Positive = key(unit="s", alias="for")


class Motion(Choice):
    """A recorded or teleoperated motion from a file.

    Attributes:
        path: CSV, Parquet or a run's npz, relative to the scenario's folder: t, and x y z qw qx qy qz, vx vy
            vz wx wy wz, or one column per joint
        columns: columns to follow; null: pose, q or twist, whichever comes first; or a map of t, x y z, qw qx
            qy qz, roll pitch yaw or rx ry rz, vx vy vz, wx wy wz, q (names, or * for the joint) to names with
            units, as {t: stamp ms}
        origin: `move` goes straight to the first pose; `start` shifts the motion to the start of the segment
        speed: speed relative to the recording; auto: slowed where target.limits require it
        interpolation: `spline` moves smoothly within target.limits; `hold` stays at each row; auto: spline,
            or hold where rows repeat and the spline would exceed target.limits
        gaps: without rows for more than 0.1 s and three periods: `stop` rests, then goes straight to the
            next; `interpolate` moves on
        frame: frame of points and directions; null: target.frame
    """

    path: types.MotionFile
    columns: types.TextOr[Literal["pose", "pose_ref", "twist", "q"], dict[str, types.Text]] | None = None
    origin: Literal["move", "start"] = key("move", alias="from")
    speed: types.PositiveOrAuto = key(1.0, "1")
    interpolation: Literal["auto", "spline", "hold"] = "auto"
    gaps: Literal["stop", "interpolate"] = "stop"
    frame: PathFrame | None = None


class Hold(Section):
    """A pause.

    Attributes:
        duration: duration
    """

    duration: types.Positive = key(unit="s", alias="for")


class Segment(Choice):
    """One segment of the path, by its only key.

    Attributes:
        line: go straight
        arc: go around a center
        turn: rotate in place
        tilt: rotate in place so that an axis of the site points in a direction
        set: step the target
        configurations: straight lines to the site's poses at configurations: keyframes, or joint positions
        file: follow a recorded motion
        hold: stay
    """

    counts = ((("line", "arc", "turn", "tilt", "set", "configurations", "file", "hold"), 1, 1),)
    line: Line | None = None
    arc: Arc | None = None
    turn: Turn | None = None
    tilt: Tilt | None = None
    set: Set | None = None
    configurations: Postures | None = key(None, "rad or m")
    file: Motion | None = None
    hold: Hold | None = None

    @property
    def name(self) -> str:
        """Its key."""
        return next(name for name, segment in self if segment is not None)


class TargetLimitsSection(Section):
    """Speed limits along the path.

    Attributes:
        velocity: largest speed
        acceleration: largest acceleration
        jerk: largest jerk; not of a recorded motion
        angular_velocity: largest angular speed
        angular_acceleration: largest angular acceleration
        angular_jerk: largest angular jerk, as `jerk`
    """

    velocity: types.Positive = key(0.25, "m/s")
    acceleration: types.Positive = key(1.0, "m/s²")
    jerk: types.Positive = key(10.0, "m/s³")
    angular_velocity: types.AngularVelocity = key(1.0, "rad/s")
    angular_acceleration: types.AngularAcceleration = key(4.0, "rad/s²")
    angular_jerk: types.AngularJerk = key(40.0, "rad/s³")


class TargetSection(Section):
    """Target motion of the site.

    Attributes:
        path: segments of the path, in order
        offset: offset of every absolute point of the path
        frame: frame of segments without one; site: at the start of the segment; start: the site at the start
            of the path
        limits: speed limits
    """

    path: Annotated[tuple[Segment, ...], types.count(1)]
    offset: types.Vector = key((0.0, 0.0, 0.0), "m")
    frame: PathFrame = "world"
    limits: TargetLimitsSection = TargetLimitsSection()
