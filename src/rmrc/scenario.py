"""A scenario: YAML checked whole and turned into frozen sections, SI and radians inside.

`load` and `loads` either return a `Scenario` or raise one `ScenarioError` with every mistake, a
line each, sorted by place:

    scenarios/x.yaml:7:13: control.inverse.damping.maximum: must be > 0, got -1

The keys of a file are the fields of the sections below, with unit, default and meaning; nothing
else lists them. A file is untrusted: only plain YAML values are built, and its size, its depth and
the number of its values (aliases counted as often as they are used) are bounded.

This module alone knows YAML and pydantic. A section made directly in Python reports a pydantic
error; a file or a text never does.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    Tag,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic.config import JsonDict
from pydantic_core import ErrorDetails, PydanticCustomError, core_schema

from rmrc.errors import ScenarioError, did_you_mean

# A scenario is a page of text. The bounds are far above that and far below what takes a second.
_MAX_BYTES = 2**20
_MAX_VALUES = 10_000
_MAX_DEPTH = 50

# A direction is normalized by its user; below this length its squares would vanish or be noise.
_SHORTEST = 1e-9

_Key = tuple[str | int, ...]
_Mark = tuple[int, int] | str  # line and column from 1, or the KEY of a `--set KEY=VALUE`


# Places ------------------------------------------------------------------------------------------


class _Mistake(NamedTuple):
    """One mistake: at which key, what, and where if that is not the key's own place."""

    key: _Key
    text: str
    mark: _Mark | None = None
    at_key: bool = False  # the key itself is wrong, not its value


class _Origin:
    """Where each value came from. Any two are equal: it is no part of what a scenario says."""

    def __init__(
        self,
        source: str = "",
        values: Mapping[_Key, tuple[int, int]] | None = None,
        keys: Mapping[_Key, tuple[int, int]] | None = None,
    ) -> None:
        self.source = source
        self.values: dict[_Key, _Mark] = dict(values or {})
        self.keys: dict[_Key, tuple[int, int]] = dict(keys or {})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Origin)

    __hash__ = None  # type: ignore[assignment]

    def override(self, key: _Key) -> None:
        """Note that a value now comes from `--set`, with all that it holds."""
        for marks in (self.values, self.keys):
            for known in [known for known in marks if known[: len(key)] == key]:
                del marks[known]
        self.values[key] = _join(key)

    def mark(self, key: _Key, *, at_key: bool = False) -> _Mark:
        """Return the mark of a value, of what `--set` put below it, or of its nearest parent."""
        if at_key and key in self.keys:
            return self.keys[key]
        if key not in self.values:
            for known, mark in self.values.items():
                if isinstance(mark, str) and known[: len(key)] == key:
                    return mark
        while key not in self.values and key:
            key = key[:-1]
        return self.values.get(key, (1, 1))

    def place(self, key: _Key, mark: _Mark | None = None) -> str:
        """Return source, line, column and key, as messages begin."""
        mark = self.mark(key) if mark is None else mark
        name = _join(key)
        if isinstance(mark, str):
            return f"--set {mark}" if name in ("", mark) else f"--set {mark}: {name}"
        if not self.values:
            return name
        where = f"{_plain(self.source)}:{mark[0]}:{mark[1]}"
        return f"{where}: {name}" if name else where

    def lines(self, mistakes: Sequence[_Mistake]) -> list[str]:
        """Return the messages: the file's by line, then those of the overrides."""
        marked = [(self.mark(m.key, at_key=m.at_key) if m.mark is None else m.mark, m) for m in mistakes]
        marked.sort(key=lambda pair: (2**31, 0) if isinstance(pair[0], str) else pair[0])
        return [f"{self.place(m.key, mark)}: {m.text}" for mark, m in marked]


# Values -----------------------------------------------------------------------------------------


def _rule(text: str) -> PydanticCustomError:
    """Return the error of a rule of ours; its text is the whole message."""
    return PydanticCustomError("rule", "{text}", {"text": text})


def _angle(value: object) -> object:
    """Turn `"60 deg"` or `"1 rad"` into radians; leave anything else for the number check."""
    if not isinstance(value, str):
        return value
    match = re.fullmatch(r"(\S+?)\s*(deg|rad)", value.strip())
    try:
        number = float(match[1]) if match else None
    except ValueError:
        number = None
    if match is None or number is None:
        if _spelled_as_number(value):
            return value
        example = 'must be a number (radians) or an angle such as "60 deg"'
        raise _rule(f"{example}, got the text {_show(value)}")
    return math.radians(number) if match[2] == "deg" else number


class _Count(NamedTuple):
    """Bounds on the number of items; checked after the items, so that their errors come alone."""

    low: int
    high: int | None = None

    def __get_pydantic_core_schema__(
        self, source: object, handler: Callable[[object], core_schema.CoreSchema]
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: Callable[[Any], dict[str, Any]]
    ) -> dict[str, Any]:
        bounds = {"minItems": self.low, "maxItems": self.high}
        return handler(schema) | {key: n for key, n in bounds.items() if n is not None}

    def _check(self, values: Sequence[object]) -> Sequence[object]:
        if self.low <= len(values) <= (math.inf if self.high is None else self.high):
            return values
        want = f"at least {self.low}" if self.high is None else f"{self.low}"
        if self.high is not None and self.high > self.low:
            want = f"{self.low} or {self.high}"
        raise _rule(f"must have {want} item{'s' * (want[-1] != '1')}, got {len(values)}")


def _distinct(values: tuple[str, ...]) -> tuple[str, ...]:
    for value in values:
        if values.count(value) > 1:
            raise _rule(f"must not repeat, got {_show(value)} {values.count(value)} times")
    return values


def _directed(values: tuple[float, ...]) -> tuple[float, ...]:
    if math.hypot(*values) < _SHORTEST:
        raise _rule(f"must not be zero, got {_show(list(values))}")
    return values


def _model_file(path: Path, info: ValidationInfo) -> Path:
    """Make the path absolute; where a scenario is read (context), the file must be there."""
    folder: Path = info.context["folder"] if info.context else Path()
    try:
        full = (folder / path).resolve()
        is_file = not info.context or stat.S_ISREG(full.stat().st_mode)
    except FileNotFoundError:
        raise _rule(f"no such file {_show(str(full))}{_nearby(full, ('.xml',))}") from None
    except (OSError, ValueError, RuntimeError) as error:  # not permitted; a NUL; a loop of links
        reason = getattr(error, "strerror", None) or str(error)
        raise _rule(f"cannot be read ({reason.lower()}), got {_show(str(path))}") from None
    if not is_file:
        raise _rule(f"is not a file: {_show(str(full))}")
    return full


def _text_or_list(value: object) -> str | None:
    return "<text>" if isinstance(value, str) else "<list>" if _is_list(value) else None


def _one_or_list(value: object) -> str:
    return "<list>" if _is_list(value) else "<one>"


def _is_list(value: object) -> bool:
    return isinstance(value, list | tuple)


_DECIMAL = r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?"
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Switch = Annotated[bool, Field(strict=True)]
Text = Annotated[str, Field(strict=True, min_length=1)]
Angle = Annotated[
    Number,
    BeforeValidator(_angle),
    WithJsonSchema(
        {
            "title": "angle",
            "anyOf": [
                {"type": "number"},
                {
                    "type": "string",
                    "pattern": rf"^\s*{_DECIMAL}\s*(deg|rad)\s*$",
                },
            ],
        }
    ),
]
Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
Vector = Annotated[tuple[Number, ...], _Count(2, 3)]
Direction = Annotated[
    Annotated[Literal["x", "y", "z"], Tag("<text>")]
    | Annotated[tuple[Number, ...], _Count(3, 3), AfterValidator(_directed), Tag("<list>")],
    Discriminator(
        _text_or_list,
        custom_error_type="direction",
        custom_error_message="see _WANTS",
    ),
]
_TAGS = {"<text>", "<list>", "<one>", "<line>", "<arc>", "<turn>", "<hold>"}


# Sections ---------------------------------------------------------------------------------------


def _key(meaning: str, unit: str | None = None, default: Any = ..., **more: Any) -> Any:
    extra: JsonDict | None = {"unit": unit} if unit else None
    return Field(default, description=meaning, json_schema_extra=extra, **more)


class Section(BaseModel):
    """One mapping of the file: frozen, and without any key that is not named here."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        validate_by_name=True,
        validate_by_alias=True,
        serialize_by_alias=True,
    )


class _Choice(Section):
    """A mapping in which some keys exclude others: those that are absent are not written."""

    @model_serializer(mode="wrap")
    def _present(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in handler(self).items() if value is not None}

    def _given(self, *names: str) -> list[str]:
        return [name for name in names if getattr(self, name) is not None]


class ArmSection(Section):
    """The arm: which model, which point of it, where it starts."""

    model: Annotated[Path, AfterValidator(_model_file)] = _key(
        "the MJCF file; a relative path starts at the scenario's folder"
    )
    site: Text = _key("the MuJoCo site that is controlled")
    start: Annotated[
        Annotated[Text, Tag("<text>")] | Annotated[tuple[Angle, ...], _Count(1), Tag("<list>")],
        Discriminator(
            _text_or_list,
            custom_error_type="name_or_positions",
            custom_error_message="see _WANTS",
        ),
    ] = _key("where the joints start: a keyframe's name, or a position a joint", "rad or m", "home")
    joints: Annotated[tuple[Text, ...], _Count(1), AfterValidator(_distinct)] | None = _key(
        "the joints that are driven; null: those between the base and the site", default=None
    )


class TaskSection(Section):
    """What of the site's motion counts, and how much."""

    axes: Annotated[tuple[Axis, ...], _Count(1), AfterValidator(_distinct)] = _key(
        "the rows of the twist that are controlled, along world axes", default=get_args(Axis)
    )
    length: Positive = _key(
        "characteristic length: linear rows are divided by it, so that they compare with angles",
        "m",
        1.0,
    )
    weights: Annotated[tuple[Positive, ...], _Count(1)] | None = _key(
        "task weights W_x, one an axis in the order of `axes`; null: all 1", "1", None
    )

    @field_validator("weights")
    @classmethod
    def _one_an_axis(
        cls, weights: tuple[float, ...] | None, info: ValidationInfo
    ) -> tuple[float, ...] | None:
        axes = info.data.get("axes")
        if weights is not None and axes is not None and len(weights) != len(axes):
            counts = f"got {len(weights)} for the {len(axes)} axes {', '.join(axes)}"
            raise _rule(f"must have one weight for each of task.axes, {counts}")
        return weights

    @model_validator(mode="after")
    def _in_row_order(self) -> TaskSection:
        """Sort axes as the rows of a twist, and their weights with them."""
        order = sorted(range(len(self.axes)), key=lambda i: get_args(Axis).index(self.axes[i]))
        # Frozen is a promise to users; the section is still being made.
        self.__dict__["axes"] = tuple(self.axes[i] for i in order)
        if self.weights is not None:
            self.__dict__["weights"] = tuple(self.weights[i] for i in order)
        return self


class DampingSection(Section):
    """How much damping λ the method `damped` uses, and when."""

    schedule: Literal["constant", "smallest_singular_value"] = _key(
        "how λ follows the arm: always `maximum`, or rising to it as σ_min falls below `below`",
        default="smallest_singular_value",
    )
    maximum: Positive = _key("λ_max, the largest damping (λ, not λ²)", "as σ", 0.1)
    below: Positive = _key("ε: damping starts when σ_min is below it", "as σ", 0.3)


class InverseSection(Section):
    """How the Jacobian is inverted."""

    method: Literal["inverse", "pseudoinverse", "damped"] = _key(
        "the filter g(σ) that stands for 1/σ", default="damped"
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = _key(
        "pseudoinverse: singular values up to this share of the largest are dropped", "1", 1e-6
    )
    damping: DampingSection = _key("damped: the damping λ", default=DampingSection())


class NullspaceSection(Section):
    """What the joints do that the task does not feel."""

    objective: Literal["none", "posture"] = _key(
        "what to aim for with the motion that is left over", default="none"
    )
    gain: NotNegative = _key("posture: rate for a given distance from the posture", "1/s", 1.0)
    posture: Annotated[tuple[Angle, ...], _Count(1)] | None = _key(
        "posture: the joint positions aimed for; null: those of the start", "rad or m", None
    )


class LimitsSection(Section):
    """The bounds on joint rates."""

    rate: (
        Annotated[
            Annotated[Positive, Tag("<one>")] | Annotated[tuple[Positive, ...], _Count(1), Tag("<list>")],
            Discriminator(_one_or_list),
        ]
        | None
    ) = _key("largest rate, of all joints or of each; null: the model's own", "rad/s or m/s", None)
    on_excess: Literal["scale", "clamp", "none"] = _key(
        "beyond the largest rate: scale all joints alike (keeps direction), clamp each, or none",
        default="scale",
    )


class ControlSection(Section):
    """The control law."""

    period: Positive = _key("time between two control ticks", "s", 0.001)
    inverse: InverseSection = _key("how the Jacobian is inverted", default=InverseSection())
    feedback: NotNegative = _key("K: twist for a given pose error", "1/s", 20.0)
    feedforward: Switch = _key("whether the reference twist is part of the command", default=True)
    joint_weights: Annotated[tuple[Positive, ...], _Count(1)] | None = _key(
        "joint weights W_q, one a joint: a heavier joint moves less; null: all 1", "1", None
    )
    nullspace: NullspaceSection = _key("the motion left over", default=NullspaceSection())
    limits: LimitsSection = _key("bounds on joint rates", default=LimitsSection())
    at_singularity: Literal["damp"] = _key("what happens near a singularity", default="damp")


class Turn(_Choice):
    """A rotation: by an angle about an axis, or to an orientation; world axes."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {"required": ["axis", "angle"], "maxProperties": 2},
                {"required": ["to"], "maxProperties": 1},
            ]
        }
    )
    axis: Direction | None = _key("the axis turned about, along world axes", "1", None)
    angle: Angle | None = _key("how far, counterclockwise about the axis", "rad", None)
    to: Annotated[tuple[Number, ...], _Count(4, 4), AfterValidator(_directed)] | None = _key(
        "the orientation turned to, as a quaternion w x y z", "1", None
    )

    @model_validator(mode="after")
    def _one_form(self) -> Turn:
        given = self._given("axis", "angle", "to")
        if given not in (["axis", "angle"], ["to"]):
            raise _rule(f"must have either axis and angle, or to, got {_and(given)}")
        return self


class Line(_Choice):
    """A straight line of the site's origin."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["to"]}, {"required": ["by"]}]})
    to: Vector | None = _key("where it ends: [x, y], which keeps z, or [x, y, z]", "m", None)
    by: Vector | None = _key("how far it goes: [dx, dy] or [dx, dy, dz]", "m", None)
    turn: Turn | None = _key("a rotation made on the way", default=None)

    @model_validator(mode="after")
    def _one_end(self) -> Line:
        given = self._given("to", "by")
        if len(given) != 1:
            raise _rule(f"must have exactly one of to, by, got {_and(given)}")
        return self


class Arc(_Choice):
    """A circular arc of the site's origin."""

    center: Vector = _key("the center: [x, y], which keeps z, or [x, y, z]", "m")
    axis: Direction = _key("the axis of the circle, along world axes", "1", "z")
    angle: Angle = _key("how far, counterclockwise about the axis; 360 deg: a full circle", "rad")
    turn: Turn | None = _key("a rotation made on the way", default=None)

    @field_validator("angle")
    @classmethod
    def _some(cls, angle: float) -> float:
        if angle == 0:
            raise _rule("must not be 0")
        return angle


class Hold(_Choice):
    """A pause."""

    duration: Positive = _key("how long", "s", alias="for")


class LineSegment(_Choice):
    """One piece of the path: `{line: ...}`."""

    line: Line = _key("go straight")


class ArcSegment(_Choice):
    """One piece of the path: `{arc: ...}`."""

    arc: Arc = _key("go around a center")


class TurnSegment(_Choice):
    """One piece of the path: `{turn: ...}`."""

    turn: Turn = _key("turn on the spot")


class HoldSegment(_Choice):
    """One piece of the path: `{hold: ...}`."""

    hold: Hold = _key("stay")


_KINDS = ("line", "arc", "turn", "hold")


def _segment_kind(value: object) -> str | None:
    names = list(type(value).model_fields) if isinstance(value, Section) else value
    if isinstance(names, list | dict) and len(names) == 1:
        (name,) = names
        return f"<{name}>" if name in _KINDS else None
    return None


Segment = Annotated[
    Annotated[LineSegment, Tag("<line>")]
    | Annotated[ArcSegment, Tag("<arc>")]
    | Annotated[TurnSegment, Tag("<turn>")]
    | Annotated[HoldSegment, Tag("<hold>")],
    Discriminator(
        _segment_kind,
        custom_error_type="segment",
        custom_error_message=f"must have exactly one of {', '.join(_KINDS)}",
    ),
]


class TargetLimitsSection(Section):
    """How fast the path is followed."""

    velocity: Positive = _key("largest speed", "m/s", 0.25)
    acceleration: Positive = _key("largest acceleration", "m/s²", 1.0)
    jerk: Positive = _key("largest jerk", "m/s³", 10.0)
    angular_velocity: Positive = _key("largest angular speed", "rad/s", 1.0)
    angular_acceleration: Positive = _key("largest angular acceleration", "rad/s²", 4.0)
    angular_jerk: Positive = _key("largest angular jerk", "rad/s³", 40.0)


class TargetSection(Section):
    """Where the site shall go."""

    path: Annotated[tuple[Segment, ...], _Count(1)] = _key("the pieces of the path, in order")
    limits: TargetLimitsSection = _key("how fast", default=TargetLimitsSection())


class PlantSection(Section):
    """What obeys the commanded rates."""

    kind: Literal["ideal", "servo", "torque"] = _key(
        "exact integration of the rates, joint-rate servos, or computed torques", default="servo"
    )
    kv: (
        Annotated[
            Annotated[Positive, Tag("<one>")] | Annotated[tuple[Positive, ...], _Count(1), Tag("<list>")],
            Discriminator(_one_or_list),
        ]
        | None
    ) = _key(
        "servo: torque or force for a given rate error, of all joints or of each; "
        "null: each joint's inertia at home over the timestep",
        "N·m·s/rad or N·s/m",
        None,
    )
    bandwidth: Positive = _key("torque: acceleration for a given rate error", "1/s", 500.0)
    timestep: Positive = _key(
        "servo, torque: MuJoCo's step; control.period is an integer multiple of it", "s", 0.001
    )
    gravity_compensation: Switch = _key("servo: whether gravity is balanced", default=True)
    wrench: Annotated[tuple[Number, ...], _Count(6, 6)] = _key(
        "external wrench [f; n] on the site, along world axes", "N, N·m", (0.0,) * 6
    )


class Check(_Choice):
    """What is expected of one figure of the scorecard."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [{"required": [key]} for key in ("below", "above", "equals")],
            "dependentRequired": {"equals": ["within"], "within": ["equals"]},
        }
    )
    below: Number | None = _key("the figure must be less than this", "as the figure", None)
    above: Number | None = _key("the figure must be more than this", "as the figure", None)
    equals: Number | None = _key("the figure must be this, give or take `within`", "as the figure", None)
    within: NotNegative | None = _key("how far from `equals` the figure may be", "as the figure", None)

    @model_validator(mode="after")
    def _something(self) -> Check:
        given = self._given("below", "above", "equals", "within")
        if "equals" in given and "within" not in given:
            raise _rule("equals needs within, how far from it the figure may be")
        if "within" in given and "equals" not in given:
            raise _rule("within needs equals")
        if not given:
            raise _rule("must have at least one of below, above, equals, got none of them")
        if self.below is not None and self.above is not None and self.above >= self.below:
            bounds = f"got above {_show(self.above)} and below {_show(self.below)}"
            raise _rule(f"above must be less than below, {bounds}")
        return self


class Scenario(Section):
    """Everything that one run depends on."""

    name: Annotated[Text, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)] = _key(
        "names the run and its files"
    )
    arm: ArmSection = _key("the arm")
    task: TaskSection = _key("what of the site's motion counts", default=TaskSection())
    control: ControlSection = _key("the control law", default=ControlSection())
    target: TargetSection = _key("where the site shall go")
    plant: PlantSection = _key("what obeys the commanded rates", default=PlantSection())
    expect: dict[str, Check] = _key("what is expected, by figure of the scorecard", default={})
    _origin: _Origin = PrivateAttr(default_factory=_Origin)

    @model_validator(mode="after")
    def _whole_steps(self) -> Scenario:
        problem = _uneven(self.plant.kind, self.control.period, self.plant.timestep)
        if problem:
            raise PydanticCustomError("period", "{text}", {"text": problem})
        return self

    def locate(self, key: str) -> str:
        """Return where a key was given, to begin a message with.

        Args:
            key: A dotted key, such as `control.inverse.damping.maximum` or `arm.start[1]`.

        Returns:
            `scenarios/x.yaml:7:13: control.inverse.damping.maximum`, where its value starts,
            counted from 1, or its nearest parent if it is absent; `--set KEY` if it was set so;
            the key alone if the scenario was made in Python.
        """
        return self._origin.place(_split(key))

    def to_yaml(self) -> str:
        """Return the complete scenario as it runs: all defaults, SI numbers, an absolute path.

        `loads` reads it back to an equal scenario.
        """
        data = self.model_dump(mode="json")
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None)


def _uneven(kind: str, period: float, timestep: float) -> str | None:
    """Return why a control period is not made of whole steps, if so; an ideal plant has none."""
    ratio = period / timestep
    # 1e-9: decimal fractions such as 0.003/0.001 are off by some 1e-16, real mistakes by far more.
    whole = 0.5 < ratio < math.inf and abs(ratio - round(ratio)) <= 1e-9 * ratio
    if kind == "ideal" or whole:
        return None
    values = f"got {_show(period)} and {_show(timestep)}"
    return f"must be an integer multiple of plant.timestep, {values}"


# Reading ----------------------------------------------------------------------------------------


def load(path: str | os.PathLike[str], overrides: Sequence[str] = ()) -> Scenario:
    """Read a scenario from a file.

    Args:
        path: The YAML file; messages show it as it is given.
        overrides: `KEY=VALUE` texts that replace values of the file, such as
            `control.inverse.method=inverse` or `arm.start[1]=10 deg`; VALUE is YAML.

    Returns:
        The checked scenario; `arm.model` is absolute.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    source = os.fspath(path)
    return _scenario(_read(source), source, Path(source).parent, overrides)


def loads(text: str, source: str = "<text>", overrides: Sequence[str] = ()) -> Scenario:
    """Read a scenario from a text; relative paths start at the working directory.

    Args:
        text: The YAML text.
        source: What messages call it.
        overrides: As in `load`.

    Returns:
        The checked scenario.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    size = len(text.encode(errors="surrogatepass"))
    if size > _MAX_BYTES:
        raise ScenarioError([_too_large(source, size)])
    return _scenario(text, source, Path(), overrides)


def _read(source: str) -> str:
    """Return the text of a file; refuse what is no small text file without reading it."""
    shown = _plain(source)
    if "\0" in source:
        raise ScenarioError([f"{shown}: cannot be read: a path must not hold a NUL"])
    try:
        status = os.stat(source)
        if stat.S_ISDIR(status.st_mode):
            raise ScenarioError([f"{shown}: is a directory, not a YAML file"])
        if not stat.S_ISREG(status.st_mode):  # reading a pipe or a device could wait forever
            raise ScenarioError([f"{shown}: is not a regular file"])
        if status.st_size > _MAX_BYTES:
            raise ScenarioError([_too_large(source, status.st_size)])
        with open(source, "rb") as file:
            return file.read(_MAX_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        near = _nearby(Path(source), (".yaml", ".yml"))
        raise ScenarioError([f"{shown}: no such file{near}"]) from None
    except UnicodeDecodeError as error:
        where = f"byte 0x{error.object[error.start]:02x} at offset {error.start}"
        raise ScenarioError([f"{shown}: is not UTF-8 text: {where}"]) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ScenarioError([f"{shown}: cannot be read: {reason}"]) from None


def _too_large(source: str, size: int) -> str:
    return f"{_plain(source)}: is {size / 1e6:.1f} MB, more than the 1 MiB a scenario may have"


def _nearby(path: Path, suffixes: tuple[str, ...]) -> str:
    """Suggest a file beside one that does not exist."""
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.suffix in suffixes]
    except OSError:
        return ""
    return did_you_mean(path.name, sorted(names))


def _scenario(text: str, source: str, folder: Path, overrides: Sequence[str]) -> Scenario:
    parsed = _parse(text, source)
    origin = _Origin(source, parsed.values, parsed.keys)
    data = parsed.value
    if not isinstance(data, dict):
        place = origin.place(())
        raise ScenarioError([f"{place}: must be a mapping of keys, got {_show(data)}"])
    mistakes, broken = parsed.mistakes, parsed.broken
    for override in overrides:
        mistakes += _override(data, origin, override, broken)
    try:
        context = {"folder": folder}
        scenario = Scenario.model_validate(data, context=context, by_alias=True, by_name=False)
    except ValidationError as error:
        mistakes += _mistakes(error, data, broken)
    if mistakes:
        raise ScenarioError(origin.lines(mistakes))
    scenario._origin = origin
    return scenario


# YAML -------------------------------------------------------------------------------------------


class _Refused(yaml.MarkedYAMLError):
    """A bound of ours is exceeded; the problem is the whole message."""


class _Loader(yaml.SafeLoader):
    """The safe loader, bounded while it composes nodes; it never constructs."""

    depth = 0
    count = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self.depth += 1
        self.count += 1
        event = self.peek_event()  # type: ignore[no-untyped-call]
        _bound(self.depth, self.count, event.start_mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _bound(depth: int, count: int, mark: yaml.Mark | None) -> None:
    # Both guard against files that are small but grow: brackets, aliases of aliases.
    if depth > _MAX_DEPTH:
        raise _Refused(problem=f"is nested more than {_MAX_DEPTH} deep", problem_mark=mark)
    if count > _MAX_VALUES:
        text = f"has more than {_MAX_VALUES} values, aliases counted as often as they are used"
        raise _Refused(problem=text, problem_mark=mark)


class _Parsed:
    """A YAML text as plain values, with the marks of all values and keys.

    Aliases are built anew wherever they are used, so that an override changes one place only.
    """

    def __init__(self, loader: _Loader, root: yaml.Node, prefix: _Key) -> None:
        self.loader = loader
        self.values: dict[_Key, tuple[int, int]] = {}
        self.keys: dict[_Key, tuple[int, int]] = {}
        self.mistakes: list[_Mistake] = []
        self.broken: set[_Key] = set()  # values that could not be built: further errors there mislead
        self.count = 0
        self.value = self._build(root, prefix, 1)

    def _build(self, node: yaml.Node, key: _Key, depth: int) -> Any:
        self.count += 1
        _bound(depth, self.count, node.start_mark)
        self.values[key] = _at(node)
        if isinstance(node, yaml.MappingNode) and node.tag == "tag:yaml.org,2002:map":
            return self._mapping(node, key, depth)
        if isinstance(node, yaml.SequenceNode) and node.tag == "tag:yaml.org,2002:seq":
            return [self._build(item, (*key, i), depth + 1) for i, item in enumerate(node.value)]
        return self._scalar(node, key)

    def _mapping(self, node: yaml.MappingNode, key: _Key, depth: int) -> dict[str, Any]:
        own: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        lines: dict[str, int] = {}
        # Merged keys first: an own key then replaces both the value and its marks.
        for name, value in sorted(node.value, key=lambda pair: pair[0].tag != _MERGE):
            if name.tag == _MERGE:
                merged = self._merged(value, key, depth) | merged
                continue
            if not _is_text(name):
                text = f"a key must be text, got {_written(name)}"
                self.mistakes.append(_Mistake(key, text, _at(name)))
                continue
            inner = (*key, name.value)
            if name.value in lines:
                text = f"is given twice, first in line {lines[name.value]}"
                self.mistakes.append(_Mistake(inner, text, _at(name)))
            if name.value in own or name.value in merged:
                self._forget(inner)
            lines.setdefault(name.value, _at(name)[0])
            own[name.value] = self._build(value, inner, depth + 1)
            self.keys[inner] = _at(name)
        return merged | own

    def _forget(self, key: _Key) -> None:
        for known in [known for known in self.values if known[: len(key)] == key]:
            del self.values[known]

    def _merged(self, node: yaml.Node, key: _Key, depth: int) -> dict[str, Any]:
        """Return what `<<` takes from one mapping or from several, of which the first wins."""
        sources = node.value if isinstance(node, yaml.SequenceNode) else [node]
        merged: dict[str, Any] = {}
        mark = self.values[key]
        for source in reversed(sources):
            value = self._build(source, key, depth + 1)
            if not isinstance(value, dict):
                text = f"<< must name a mapping, got {_show(value)}"
                self.mistakes.append(_Mistake(key, text, _at(source)))
                continue
            merged |= value
        self.values[key] = mark
        return merged

    def _scalar(self, node: yaml.Node, key: _Key) -> Any:
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        try:
            if isinstance(node, yaml.ScalarNode):
                if kind in ("str", "timestamp"):  # dates mean nothing here: text, as in YAML 1.2
                    node.value.encode()  # a lone surrogate is no text
                    return node.value
                if kind in ("null", "bool", "int", "float"):
                    return self.loader.construct_object(node)
            tag = node.tag if kind == node.tag else f"!!{kind}"
            text = f"the tag {_clip(_plain(tag))} is not supported"
        except (ValueError, KeyError, ArithmeticError):
            text = f"cannot be read as !!{kind}, got {_written(node)}"
        self.mistakes.append(_Mistake(key, text, _at(node)))
        self.broken.add(key)
        return None


_MERGE = "tag:yaml.org,2002:merge"


def _is_text(node: yaml.Node) -> bool:
    # A lone surrogate ("\ud800") is no text: nothing could print or store it.
    plain = isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:str"
    return plain and not re.search("[\ud800-\udfff]", node.value)


def _written(node: yaml.Node) -> str:
    """Return a scalar as the file has it, or what else it is."""
    if isinstance(node, yaml.ScalarNode):
        return _clip(_plain(node.value)) or "nothing"
    return "a mapping" if isinstance(node, yaml.MappingNode) else "a list"


def _at(node: yaml.Node) -> tuple[int, int]:
    return node.start_mark.line + 1, node.start_mark.column + 1


def _parse(text: str, source: str, prefix: _Key = ()) -> _Parsed:
    """Parse one YAML document; mistakes of single values are kept, those of the text raise."""
    shown = _plain(source)
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None:
            raise ScenarioError([f"{shown}: is empty"])
        return _Parsed(loader, root, prefix)
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        place = f"{before.count(chr(10)) + 1}:{error.position - before.rfind(chr(10))}"
        what = f"is not a text file: it holds the character U+{ord(text[error.position]):04X}"
        raise ScenarioError([f"{shown}:{place}: {what}"]) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{mark.line + 1}:{mark.column + 1}" if mark else "1:1"
        raise ScenarioError([f"{shown}:{place}: {_yaml_problem(error)}"]) from None


def _yaml_problem(error: yaml.MarkedYAMLError) -> str:
    problem = _plain(error.problem or error.context or "")
    if isinstance(error, _Refused):
        return problem
    if "but found another document" in problem:
        return "holds more than one YAML document"
    if r"character '\t'" in problem:
        return "is not valid YAML: a tab cannot stand here, use spaces"
    return f"is not valid YAML: {problem}"


# Overrides --------------------------------------------------------------------------------------


def _override(data: dict[str, Any], origin: _Origin, text: str, broken: set[_Key]) -> list[_Mistake]:
    """Apply one `KEY=VALUE` to the values of the file; return what is wrong with it."""
    name, equals, value_text = text.partition("=")
    try:
        key = _split(name.strip())
    except ValueError:
        key = ()
    if not equals or not key:
        wrong = "must be KEY=VALUE, for example control.feedback=10"
        return [_Mistake((), wrong, _clip(_plain(text)))]
    try:
        parsed = _parse(value_text if value_text.strip() else "null", "", key)
    except ScenarioError as error:
        broken.add(key)
        return [_Mistake(key, str(error).partition(": ")[2], _join(key))]
    problem = _put(data, key, parsed.value)
    if problem:
        return [_Mistake(key, problem, _join(key))]
    origin.override(key)
    broken |= parsed.broken
    return [mistake._replace(mark=_join(key)) for mistake in parsed.mistakes]


def _put(data: dict[str, Any], key: _Key, value: object) -> str | None:
    """Set one value deep in plain data, with the mappings that lead to it; return what hinders."""
    node: Any = data
    for depth, step in enumerate(key):
        above, rest = _join(key[:depth]), key[depth + 1 :]
        if isinstance(step, int):
            if not isinstance(node, list):
                return f"{above} is {_show(node)}, not a list"
            if step >= len(node):
                return f"{above} has {len(node)} item{'s' * (len(node) != 1)}, counted from 0"
        elif not isinstance(node, dict):
            return f"{above} is {_show(node)}, not a mapping"
        elif node.get(step) is None and not any(isinstance(inner, int) for inner in rest):
            for inner in reversed(rest):
                value = {inner: value}
            rest = ()
        if not rest:
            node[step] = value
            return None
        node = node[step] if isinstance(step, int) else node.get(step)
    return None


def _split(key: str) -> _Key:
    """Return the steps of a dotted key; figures of the scorecard have dots of their own."""
    steps: list[str | int] = []
    for part in key.split("."):
        match = re.fullmatch(r"([^.\[\]=\s]+)((?:\[[0-9]{1,6}\])*)", part)
        if match is None:
            raise ValueError(f"{key!r} is not a key such as control.feedback or arm.start[1]")
        steps += [match[1], *(int(i) for i in re.findall(r"[0-9]+", match[2]))]
    if steps[0] == "expect" and len(steps) > 2:
        tail = steps[-1:] if steps[-1] in Check.model_fields else []
        figure = ".".join(str(step) for step in steps[1 : len(steps) - len(tail)])
        return ("expect", figure, *tail)
    return tuple(steps)


def _join(key: _Key) -> str:
    parts = (f"[{step}]" if isinstance(step, int) else f".{_clip(_plain(step))}" for step in key)
    return "".join(parts).removeprefix(".")


# Messages ---------------------------------------------------------------------------------------


def _mistakes(error: ValidationError, data: dict[str, Any], broken: set[_Key]) -> list[_Mistake]:
    """Translate what pydantic found, but for what follows from mistakes already known."""
    found = []
    for detail in error.errors(include_url=False):
        *above, last = detail["loc"] or ("",)
        key = tuple(step for step in above if step not in _TAGS)
        if last not in _TAGS or detail["type"] == "extra_forbidden":
            key = (*key, last)
        if detail["type"] == "period":
            key = ("control", "period")
        if not any(key[:length] in broken for length in range(1, len(key) + 1)):
            at_key = detail["type"] == "extra_forbidden"
            found.append(_Mistake(key, _message(detail, key), at_key=at_key))
    # pydantic compares sections only when all of them are sound; a bad period is told all the same.
    names = (("plant", "kind"), ("control", "period"), ("plant", "timestep"))
    wrong = broken | {mistake.key for mistake in found}
    if not any(name[:length] in wrong for name in names for length in (1, 2)):
        defaults = {"plant": PlantSection(), "control": ControlSection()}
        values = [data.get(a, {}).get(b, getattr(defaults[a], b)) for a, b in names]
        problem = _uneven(*values)
        if problem:
            found.append(_Mistake(("control", "period"), problem))
    return found


def _message(detail: ErrorDetails, key: _Key) -> str:
    """Return one of pydantic's errors in our words."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind in _WHOLE:
        return _WHOLE[kind](detail, key)
    want = _WANTS.get(kind, "cannot be used").format(**context)
    quote = want == "must be text" and isinstance(value, bool | int | float)
    return f"{want}, got {_show(value)}{'; put it in quotes' * quote}"


def _required(_: ErrorDetails, key: _Key) -> str:
    sections = _sections_at(key[:-1])
    fields = [s.model_fields[f] for s in sections for f in s.model_fields if _name(s, f) == key[-1]]
    return f"is required: {fields[0].description}"


def _unknown(_: ErrorDetails, key: _Key) -> str:
    names = [_name(s, field) for s in _sections_at(key[:-1]) for field in s.model_fields]
    near = did_you_mean(str(key[-1]), names)
    return f"unknown key{near or '; the keys are ' + ', '.join(names)}"


def _name(section: type[Section], field: str) -> str:
    return section.model_fields[field].alias or field


def _sections_at(key: _Key) -> list[type[Section]]:
    """Return the sections that may stand at a key."""
    kind: Any = Scenario
    for step in key:
        options = [
            section.model_fields[field].annotation
            for section in _sections_in(kind)
            for field in section.model_fields
            if _name(section, field) == step
        ]
        if options and get_origin(kind) is not dict:
            (kind,) = options
        elif get_origin(kind) is dict:
            kind = get_args(kind)[1]
    return list(_sections_in(kind))


def _sections_in(kind: Any) -> Iterator[type[Section]]:
    if isinstance(kind, type) and issubclass(kind, Section):
        yield kind
    for inner in get_args(kind):
        yield from _sections_in(inner)


def _no_segment(detail: ErrorDetails, _: _Key) -> str:
    value = detail["input"]
    if not isinstance(value, dict):
        return f"{detail['msg']}, got {_show(value)}"
    names = list(value)
    near = did_you_mean(names[0], _KINDS) if len(names) == 1 else ""
    return f"{detail['msg']}, got {_and([_clip(_plain(name)) for name in names])}{near}"


def _no_choice(detail: ErrorDetails, _: _Key) -> str:
    value, options = detail["input"], re.findall(r"'([^']*)'", str(detail["ctx"]["expected"]))
    listed = ", ".join(f'"{option}"' for option in options)
    want = f"must be one of {listed}" if len(options) > 1 else f"must be {listed}"
    near = did_you_mean(value, options) if isinstance(value, str) else ""
    return f"{want}, got {_show(value)}{near}"


def _spelled_as_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _no_number(detail: ErrorDetails, _: _Key) -> str:
    """Show what is no number, and the way out when it looks like one."""
    value = detail["input"]
    if not isinstance(value, str):
        return f"must be a number, got {_show(value)}"
    shown = f"must be a number, got the text {_show(value)}"
    if not _spelled_as_number(value):
        return shown
    digits, exponent, power = value.strip().lower().partition("e")
    signed = power if power[:1] in ("+", "-") else f"+{power}"
    dotted = digits if "." in digits else f"{digits}.0"
    needs = ["a dot"] * (dotted != digits) + ["a sign in the exponent"] * (signed != power)
    if not exponent or not needs:
        return f"{shown}: remove the quotes"
    return f"{shown}: YAML 1.1 needs {_and(needs)}, write {dotted}e{signed}"


# How pydantic's errors read here: some need the value or the key, the others a want and a value.
_WHOLE: dict[str, Callable[[ErrorDetails, _Key], str]] = {
    "rule": lambda detail, _: str(detail["ctx"]["text"]),
    "period": lambda detail, _: str(detail["ctx"]["text"]),
    "missing": _required,
    "extra_forbidden": _unknown,
    "segment": _no_segment,
    "literal_error": _no_choice,
    "float_type": _no_number,
}
_WANTS = {
    "name_or_positions": "must be the name of a keyframe or a list of joint positions",
    "direction": 'must be one of "x", "y", "z" or a list of 3 numbers',
    "string_type": "must be text",
    "path_type": "must be text",
    "bool_type": "must be true or false",
    "tuple_type": "must be a list",
    "model_type": "must be a mapping",
    "dict_type": "must be a mapping",
    "finite_number": "must be finite",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": 'must be made of letters, digits, "_" and "-"',
    "greater_than": "must be > {gt:g}",
    "greater_than_equal": "must be >= {ge:g}",
    "less_than": "must be < {lt:g}",
}


def _show(value: object) -> str:
    """Return a value as a message shows it: on one line, as YAML would, and not too long."""
    if value is None:
        return "nothing"
    if isinstance(value, float):
        short = f"{value:.12g}"
        return short if float(short) == value or not math.isfinite(value) else repr(value)
    if isinstance(value, list):
        text = f"[{', '.join(_show(item) for item in value[:20])}]"
    elif isinstance(value, dict):
        items = [f"{_plain(str(k))}: {_show(v)}" for k, v in list(value.items())[:20]]
        text = f"{{{', '.join(items)}}}"
    elif isinstance(value, int) and abs(value) >= 10**80:  # Python writes 4300 digits at most
        text = "a huge integer"
    else:
        text = json.dumps(value, ensure_ascii=not str(value).isprintable())
    return _clip(text)


def _clip(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:77]}..."


def _plain(text: str) -> str:
    """Return a text that cannot break a line or a terminal."""
    return text if text.isprintable() else text.encode("unicode_escape").decode()


def _and(names: Sequence[str]) -> str:
    return " and ".join(names) if names else "none of them"


# Schema -----------------------------------------------------------------------------------------


class SchemaRow(NamedTuple):
    """One key of a scenario, as `rmrc schema` prints it."""

    key: str
    type: str
    unit: str
    default: str
    meaning: str


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a scenario, with units, for editors."""
    schema = Scenario.model_json_schema(by_alias=True, mode="validation")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_rows() -> list[SchemaRow]:
    """Return every key of a scenario, in the order of the file.

    `[]` in a key stands for an item of a list, `<figure>` for the name of a figure.
    """
    schema = json_schema()
    return list(_rows("", schema, schema["$defs"], required=True))


def _rows(key: str, schema: dict[str, Any], kinds: dict[str, Any], *, required: bool) -> Iterator[SchemaRow]:
    below = _resolve(schema, kinds)
    if "properties" in below:
        for name, inner in below["properties"].items():
            needed = name in below.get("required", ())
            yield from _rows(f"{key}.{name}".removeprefix("."), inner, kinds, required=needed)
    elif below.get("type") == "object":
        inner = below["additionalProperties"]
        yield from _rows(f"{key}.<figure>", inner, kinds, required=False)
    elif "oneOf" in below.get("items", {}):
        for inner in below["items"]["oneOf"]:
            if "$ref" in inner:
                yield from _rows(f"{key}[]", inner, kinds, required=False)
    else:
        default = "required" if required else _inline(schema.get("default"))
        unit = schema.get("unit", "")
        yield SchemaRow(key, _type(schema), unit, default, schema["description"])


def _resolve(schema: dict[str, Any], kinds: dict[str, Any]) -> dict[str, Any]:
    """Follow a reference, also through "or null"."""
    for option in (schema, *schema.get("anyOf", ())):
        if "$ref" in option:
            resolved: dict[str, Any] = kinds[option["$ref"].rpartition("/")[2]]
            return resolved
    return schema


def _inline(value: object) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, width=math.inf, allow_unicode=True)
    return text.strip().removesuffix("...").strip()


def _type(schema: dict[str, Any]) -> str:
    """Return the type of a value in words."""
    options = schema.get("anyOf", schema.get("oneOf"))
    if schema.get("title") == "angle":
        return "angle"
    if options:
        return " or ".join(_type(o) for o in options if o.get("type") != "null")
    if "enum" in schema or "const" in schema:
        return " | ".join(schema.get("enum", [schema.get("const")]))
    if schema["type"] == "array":
        low, high = schema.get("minItems", 0), schema.get("maxItems")
        count = "" if high is None else f"{low} " if low == high else f"{low} or {high} "
        item = re.sub("^(number|angle)", r"\1s", _type(schema["items"]))
        return f"list of {count}({item})" if "|" in item else f"list of {count}{item}"
    if schema["type"] == "number":
        signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<"}
        bounds = [f"{sign} {_show(schema[k])}" for k, sign in signs.items() if k in schema]
        return " ".join(["number", ", ".join(bounds)]).strip()
    words = {"string": "text", "boolean": "true | false"}
    return "path" if schema.get("format") == "path" else words[schema["type"]]
