"""The path of a target: lines, arcs, turns, steps, recorded motions and holds, as a scenario has them."""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Discriminator, Tag, field_validator, model_validator

from rmrc.scenario.values import (
    Angle,
    Choice,
    Count,
    Direction,
    MotionFile,
    NameOrPositions,
    Positive,
    PositiveOrAuto,
    Quaternion,
    Section,
    Vector,
    key,
    rule,
)
from rmrc.scenario.wording import listed

PathFrame = Literal["world", "base", "site", "start"]

_TURN, _TILT = "a rotation made on the way", "a rotation made on the way that points an axis of the site"
_FRAME = "the frame that its points and directions are in; null: target.frame"
_OWN_FRAME = "the frame that it is in; null: that of its line, arc or set, or target.frame"


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
    axis: Direction | None = key("the axis turned about, along the axes of its frame", None, "1")
    angle: Angle | None = key("how far, counterclockwise about the axis", None, "rad")
    to: Quaternion | None = key("the orientation turned to, as a quaternion w x y z", None, "1")
    frame: PathFrame | None = key(_OWN_FRAME, None)

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        given = self.given("axis", "angle", "to")
        if given not in (["axis", "angle"], ["to"]):
            raise rule(f"must have either axis and angle, or to, got {listed(given)}")
        return self


class Tilt(Choice):
    """The shortest rotation that brings an axis of the site to a direction.

    Where they are opposite, it is half a turn about the axis that follows: y for x, z for y, x for z.
    """

    axis: Direction = key("the axis of the site, along its own axes", "z", "1")
    to: Direction = key("where it shall point, along the axes of its frame", unit="1")
    frame: PathFrame | None = key(_OWN_FRAME, None)


class _Way(Choice):
    """What goes somewhere, and may turn the site on the way."""

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if len(self.given("turn", "tilt")) > 1:
            raise rule("must have at most one of turn, tilt, got both")
        return self


class Line(_Way):
    """A straight line of the site's origin."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["to"]}, {"required": ["by"]}]})
    to: Vector | None = key("where it ends: [x, y], which keeps z, or [x, y, z]", None, "m")
    by: Vector | None = key("how far it goes: [dx, dy] or [dx, dy, dz]", None, "m")
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

    center: Vector = key("the center: [x, y], which keeps z, or [x, y, z]", unit="m")
    axis: Direction = key("the axis of the circle, along the axes of its frame", "z", "1")
    angle: Angle = key("how far, counterclockwise about the axis; 360 deg: a full circle", unit="rad")
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

    duration: Positive = key("how long", unit="s", alias="for")


class Set(_Way):
    """A set-point: the target steps to it at once, and stays."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [{"required": [name]} for name in ("to", "by", "turn", "tilt")],
            "not": {"required": ["to", "by"]},
        }
    )
    to: Vector | None = key("where the target steps: [x, y], which keeps z, or [x, y, z]", None, "m")
    by: Vector | None = key("how far it steps: [dx, dy] or [dx, dy, dz]", None, "m")
    turn: Turn | None = key(_TURN, None)
    tilt: Tilt | None = key(_TILT, None)
    frame: PathFrame | None = key(_FRAME, None)
    duration: Positive = key("how long it stays there", unit="s", alias="for")

    @model_validator(mode="after")
    def _some_step(self) -> Self:
        given = self.given("to", "by", "turn", "tilt")
        if not given or given[:2] == ["to", "by"]:
            raise rule(f"must have to or by, or turn or tilt, or one of each, got {listed(given)}")
        return self


class Motion(Choice):
    """A recorded or teleoperated motion, out of a file."""

    path: MotionFile = key(
        "a CSV or Parquet file with the column t and x y z qw qx qy qz, or vx vy vz wx wy wz, or one for "
        "each joint by its name; or the npz file of a run; a relative path starts at the scenario's folder"
    )
    columns: Literal["pose", "pose_ref", "twist", "q"] | None = key(
        "what of the file is followed; null: the first that it has of pose, q, twist", None
    )
    origin: Literal["move", "start"] = key(
        "how it begins: move, straight to its first pose; start, where the piece starts, which shifts it all",
        "move",
        alias="from",
    )
    speed: PositiveOrAuto = key(
        "how many times as fast as recorded; auto: as recorded, or as much slower as target.limits ask for",
        1.0,
        "1",
    )
    frame: PathFrame | None = key(_FRAME, None)


class LineSegment(Section):
    """One piece of the path: `{line: ...}`."""

    line: Line = key("go straight")


class ArcSegment(Section):
    """One piece of the path: `{arc: ...}`."""

    arc: Arc = key("go around a center")


class TurnSegment(Section):
    """One piece of the path: `{turn: ...}`."""

    turn: Turn = key("turn on the spot")


class TiltSegment(Section):
    """One piece of the path: `{tilt: ...}`."""

    tilt: Tilt = key("turn on the spot so that an axis of the site points in a direction")


class SetSegment(Section):
    """One piece of the path: `{set: ...}`."""

    set: Set = key("step the target")


class ConfigurationsSegment(Section):
    """One piece of the path: `{configurations: ...}`."""

    configurations: Annotated[tuple[NameOrPositions, ...], Count(1)] = key(
        "go straight to the pose that the site has at each, one after the other: a keyframe's name, or "
        "positions of the joints",
        unit="rad or m",
    )


class FileSegment(Section):
    """One piece of the path: `{file: ...}`."""

    file: Motion = key("follow a recorded motion")


class HoldSegment(Section):
    """One piece of the path: `{hold: ...}`."""

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
