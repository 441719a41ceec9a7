"""The path of a target: lines, arcs, turns and holds, as a scenario has them."""

from typing import Annotated, Self

from pydantic import ConfigDict, Discriminator, Tag, field_validator, model_validator

from rmrc.scenario.values import Angle, Choice, Direction, Positive, Quaternion, Section, Vector, key, rule
from rmrc.scenario.wording import listed


class Turn(Choice):
    """A rotation: by an angle about an axis, or to an orientation; world axes."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {"required": ["axis", "angle"], "maxProperties": 2},
                {"required": ["to"], "maxProperties": 1},
            ]
        }
    )
    axis: Direction | None = key("the axis turned about, along world axes", None, "1")
    angle: Angle | None = key("how far, counterclockwise about the axis", None, "rad")
    to: Quaternion | None = key("the orientation turned to, as a quaternion w x y z", None, "1")

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        given = self.given("axis", "angle", "to")
        if given not in (["axis", "angle"], ["to"]):
            raise rule(f"must have either axis and angle, or to, got {listed(given)}")
        return self


class Line(Choice):
    """A straight line of the site's origin."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["to"]}, {"required": ["by"]}]})
    to: Vector | None = key("where it ends: [x, y], which keeps z, or [x, y, z]", None, "m")
    by: Vector | None = key("how far it goes: [dx, dy] or [dx, dy, dz]", None, "m")
    turn: Turn | None = key("a rotation made on the way", None)

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        given = self.given("to", "by")
        if len(given) != 1:
            raise rule(f"must have exactly one of to, by, got {listed(given)}")
        return self


class Arc(Choice):
    """A circular arc of the site's origin."""

    center: Vector = key("the center: [x, y], which keeps z, or [x, y, z]", unit="m")
    axis: Direction = key("the axis of the circle, along world axes", "z", "1")
    angle: Angle = key("how far, counterclockwise about the axis; 360 deg: a full circle", unit="rad")
    turn: Turn | None = key("a rotation made on the way", None)

    @field_validator("angle")
    @classmethod
    def _some(cls, angle: float) -> float:
        if angle == 0:
            raise rule("must not be 0")
        return angle


class Hold(Section):
    """A pause."""

    duration: Positive = key("how long", unit="s", alias="for")


class LineSegment(Section):
    """One piece of the path: `{line: ...}`."""

    line: Line = key("go straight")


class ArcSegment(Section):
    """One piece of the path: `{arc: ...}`."""

    arc: Arc = key("go around a center")


class TurnSegment(Section):
    """One piece of the path: `{turn: ...}`."""

    turn: Turn = key("turn on the spot")


class HoldSegment(Section):
    """One piece of the path: `{hold: ...}`."""

    hold: Hold = key("stay")


SEGMENTS = {"line": LineSegment, "arc": ArcSegment, "turn": TurnSegment, "hold": HoldSegment}


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
    | Annotated[HoldSegment, Tag("<hold>")],
    Discriminator(
        _segment_tag,
        custom_error_type="segment",
        custom_error_message=f"must have exactly one of {', '.join(SEGMENTS)}",
    ),
]
