"""The path of a target: lines, arcs, turns, steps, recorded motions and holds."""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Discriminator, Tag, field_validator, model_validator

from rmrc.scenario.values import (
    Angle,
    Choice,
    Direction,
    MotionFile,
    NameOrPositions,
    Positive,
    PositiveOrAuto,
    Quaternion,
    Section,
    Vector,
    count,
    key,
    rule,
)
from rmrc.scenario.wording import listed

PathFrame = Literal["world", "base", "site", "start"]

_TURN, _TILT = "rotation during the motion", "rotation during the motion that points an axis of the site"
_FRAME = "frame of its points and directions; null: target.frame"
_OWN_FRAME = "its frame; null: the frame of its line, arc or set, or target.frame"


class Turn(Choice):
    """A rotation: by an angle about an axis, or to an orientation."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {"required": ["axis", "angle"], "not": {"required": ["to"]}},
                {"required": ["to"], "not": {"anyOf": [{"required": ["axis"]}, {"required": ["angle"]}]}},
            ]
        }
    )
    axis: Direction | None = key("axis of rotation, along the axes of its frame", None, "1")
    angle: Angle | None = key("angle, counterclockwise about the axis", None, "rad")
    to: Quaternion | None = key("final orientation, as a quaternion w x y z", None, "1")
    frame: PathFrame | None = key(_OWN_FRAME, None)

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        given = self.given("axis", "angle", "to")
        if given not in (["axis", "angle"], ["to"]):
            raise rule(f"must have either axis and angle, or to, got {listed(given)}")
        return self


class Tilt(Choice):
    """The shortest rotation that brings an axis of the site to a direction.

    If they are opposite, the rotation is half a turn about the next axis: y for x, z for y, x for z.
    """

    axis: Direction = key("the axis of the site, along its own axes", "z", "1")
    to: Direction = key("direction to point in, along the axes of its frame", unit="1")
    frame: PathFrame | None = key(_OWN_FRAME, None)


class _Way(Choice):
    """A segment with translation and optional rotation."""

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if len(self.given("turn", "tilt")) > 1:
            raise rule("must have at most one of turn, tilt, got both")
        return self


class Line(_Way):
    """A straight line of the site's origin."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["to"]}, {"required": ["by"]}]})
    to: Vector | None = key("end point: [x, y], which keeps z, or [x, y, z]", None, "m")
    by: Vector | None = key("displacement: [dx, dy] or [dx, dy, dz]", None, "m")
    turn: Turn | None = key(_TURN, None)
    tilt: Tilt | None = key(_TILT, None)
    frame: PathFrame | None = key(_FRAME, None)

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        given = self.given("to", "by")
        if len(given) != 1:
            raise rule(f"must have exactly one of to, by, got {listed(given)}")
        return self


class Arc(_Way):
    """A circular arc of the site's origin."""

    center: Vector = key("center: [x, y], which keeps z, or [x, y, z]", unit="m")
    axis: Direction = key("axis of the circle, along the axes of its frame", "z", "1")
    angle: Angle = key("angle, counterclockwise about the axis; 360 deg: a full circle", unit="rad")
    turn: Turn | None = key(_TURN, None)
    tilt: Tilt | None = key(_TILT, None)
    frame: PathFrame | None = key(_FRAME, None)

    @field_validator("angle")
    @classmethod
    def _some(cls, angle: float) -> float:
        if angle == 0:
            raise rule("must not be 0")
        return angle


class Hold(Section):
    """A pause."""

    duration: Positive = key("duration", unit="s", alias="for")


class Set(_Way):
    """A set-point: the target jumps there and stays."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [{"required": [name]} for name in ("to", "by", "turn", "tilt")],
            "not": {"required": ["to", "by"]},
        }
    )
    to: Vector | None = key("new target position: [x, y], which keeps z, or [x, y, z]", None, "m")
    by: Vector | None = key("step of the target: [dx, dy] or [dx, dy, dz]", None, "m")
    turn: Turn | None = key(_TURN, None)
    tilt: Tilt | None = key(_TILT, None)
    frame: PathFrame | None = key(_FRAME, None)
    duration: Positive = key("hold time there", unit="s", alias="for")

    @model_validator(mode="after")
    def _some_step(self) -> Self:
        given = self.given("to", "by", "turn", "tilt")
        if not given or given[:2] == ["to", "by"]:
            raise rule(f"must have to or by, or turn or tilt, or one of each, got {listed(given)}")
        return self


class Motion(Choice):
    """A recorded or teleoperated motion from a file."""

    path: MotionFile = key(
        "CSV or Parquet file with the column t and x y z qw qx qy qz, or vx vy vz wx wy wz, or one column "
        "per joint, by joint name; or the npz file of a run; relative paths start at the scenario's folder"
    )
    columns: Literal["pose", "pose_ref", "twist", "q"] | None = key(
        "columns to follow; null: the first that the file has of pose, q, twist", None
    )
    origin: Literal["move", "start"] = key(
        "beginning: `move` goes straight to its first pose; `start` shifts the motion to the start of the "
        "segment",
        "move",
        alias="from",
    )
    speed: PositiveOrAuto = key(
        "speed relative to the recording; auto: as recorded, slowed where target.limits require it",
        1.0,
        "1",
    )
    frame: PathFrame | None = key(_FRAME, None)


class LineSegment(Section):
    """One segment of the path: `{line: ...}`."""

    line: Line = key("go straight")


class ArcSegment(Section):
    """One segment of the path: `{arc: ...}`."""

    arc: Arc = key("go around a center")


class TurnSegment(Section):
    """One segment of the path: `{turn: ...}`."""

    turn: Turn = key("rotate in place")


class TiltSegment(Section):
    """One segment of the path: `{tilt: ...}`."""

    tilt: Tilt = key("rotate in place so that an axis of the site points in a direction")


class SetSegment(Section):
    """One segment of the path: `{set: ...}`."""

    set: Set = key("step the target")


class ConfigurationsSegment(Section):
    """One segment of the path: `{configurations: ...}`."""

    configurations: Annotated[tuple[NameOrPositions, ...], count(1)] = key(
        "go in straight lines to the site's pose at each of these configurations: a keyframe's name, or "
        "joint positions",
        unit="rad or m",
    )


class FileSegment(Section):
    """One segment of the path: `{file: ...}`."""

    file: Motion = key("follow a recorded motion")


class HoldSegment(Section):
    """One segment of the path: `{hold: ...}`."""

    hold: Hold = key("stay")


SEGMENTS = {
    "line": LineSegment, "arc": ArcSegment, "turn": TurnSegment, "tilt": TiltSegment, "set": SetSegment,
    "configurations": ConfigurationsSegment, "file": FileSegment, "hold": HoldSegment,
}  # fmt: skip


def _segment_tag(value: object) -> str | None:
    names = type(value).model_fields if isinstance(value, Section) else value
    if isinstance(names, dict) and len(names) == 1:
        (name,) = names
        return f"<{name}>" if name in SEGMENTS else None
    return None


Segment = Annotated[
    Annotated[LineSegment, Tag("<line>")]
    | Annotated[ArcSegment, Tag("<arc>")]
    | Annotated[TurnSegment, Tag("<turn>")]
    | Annotated[TiltSegment, Tag("<tilt>")]
    | Annotated[SetSegment, Tag("<set>")]
    | Annotated[ConfigurationsSegment, Tag("<configurations>")]
    | Annotated[FileSegment, Tag("<file>")]
    | Annotated[HoldSegment, Tag("<hold>")],
    Discriminator(
        _segment_tag,
        custom_error_type="segment",
        custom_error_message=f"must have exactly one of {', '.join(SEGMENTS)}",
    ),
]
