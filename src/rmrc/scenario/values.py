"""Building blocks of sections: the mapping, its keys, and the constrained types of their values."""

import inspect
import math
import os
import re
import stat
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    SerializerFunctionWrapHandler,
    Tag,
    ValidationInfo,
    WithJsonSchema,
    model_serializer,
)
from pydantic.config import JsonDict
from pydantic_core import PydanticCustomError, core_schema

from rmrc.scenario.units import UNSIGNED, instead
from rmrc.scenario.wording import nearby, show
from rmrc.support.legible import visible
from rmrc.support.problems import Key

# A direction is normalized by its user; below this length its squares would vanish or be noise.
_SHORTEST = 1e-9

# Formats of a recorded motion.
MOTIONS = (".csv", ".parquet", ".npz")

_DECIMAL = rf"[-+]?{UNSIGNED}"
_RATE = rf"\s*(?:({UNSIGNED})\s*Hz|1\s*/\s*({UNSIGNED})\s*s?)\s*"


class Section(BaseModel):
    """One mapping of the file: frozen, and without any key that is not named here.

    The meaning of each key stands in the docstring of its class, under `Attributes`.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_by_name=True, validate_by_alias=True, serialize_by_alias=True
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Take the meanings from the docstring."""
        attributes = inspect.cleandoc(cls.__doc__ or "").partition("Attributes:\n")[2]
        for name, text in re.findall(r"^    (\w+): (.+(?:\n {6}.+)*)", attributes, re.M):
            cls.model_fields[name].description = " ".join(text.split())

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON Schema, with the meanings."""
        schema = handler(core)
        section = handler.resolve_ref_schema(schema)
        section["description"] = inspect.cleandoc(cls.__doc__ or "").partition("\n\nAttributes:")[0]
        for name, field in cls.model_fields.items():
            if field.description:
                section["properties"][field.alias or name]["description"] = field.description
        return schema


class Choice(Section):
    """A mapping in which some keys exclude others: those that are absent are not written."""

    @model_serializer(mode="wrap")
    def _present(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in handler(self).items() if value is not None}

    def given(self, *names: str) -> list[str]:
        """Return the keys that have a value."""
        return [name for name in names if getattr(self, name) is not None]


def key(default: Any = ..., unit: str | None = None, **more: Any) -> Any:
    """Return a key of a section with its unit; required without a default."""
    extra: JsonDict = {"unit": unit} if unit else {}
    extra |= more.pop("schema", {})
    return Field(default, json_schema_extra=extra or None, **more)


def rule(text: str, key: Key = ()) -> PydanticCustomError:
    """Return the error of one of this package's rules: its whole message, and its key if not the value's."""
    return PydanticCustomError("rule", "{text}", {"text": text, "key": key})


def choice(tag_of: Callable[[Any], str | None], want: str) -> Discriminator:
    """Distinguish the options of a union by their tags, so that only the matching one reports errors."""
    return Discriminator(tag_of, custom_error_type="choice", custom_error_message=want)


def is_spelled_as_number(text: str) -> bool:
    """Return whether Python would read a text as a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


class Count(NamedTuple):
    """Bounds on the number of items; checked after the items, so that their errors come alone."""

    low: int
    high: int | None = None

    def __get_pydantic_core_schema__(
        self, source: object, handler: Callable[[object], core_schema.CoreSchema]
    ) -> core_schema.CoreSchema:
        """Return the schema of the list, and the check after it."""
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: Callable[[Any], dict[str, Any]]
    ) -> dict[str, Any]:
        """Return the JSON Schema of the list with the bounds."""
        return handler(schema) | {"minItems": self.low} | ({"maxItems": self.high} if self.high else {})

    def _check(self, values: Sequence[object]) -> Sequence[object]:
        if self.low <= len(values) <= (self.high or math.inf):
            return values
        options = dict.fromkeys((f"{self.low}", f"{self.high}"))
        want = " or ".join(options) if self.high else f"at least {self.low}"
        raise rule(f"must have {want} item{'s' * (want[-1] != '1')}, got {len(values)}")


def _radians(value: object) -> object:
    """Turn `"60 deg"` or `"1 rad"` into radians; leave anything else for the number check."""
    if not isinstance(value, str) or is_spelled_as_number(value):
        return value
    match = re.fullmatch(rf"\s*({_DECIMAL}|nan|[-+]?inf)\s*(deg|rad)\s*", value)
    if match is None:
        example = 'must be a number (radians) or an angle such as "60 deg"'
        raise rule(f"{example}, got the text {show(value)}{instead(value, 'rad or m')}")
    number = float(match[1])
    return math.radians(number) if match[2] == "deg" else number


def seconds(value: Any) -> Any:
    """Turn `"30 Hz"` or `"1/30"` into a period [s]; leave anything else for the number check."""
    match = re.fullmatch(_RATE, value) if isinstance(value, str) else None
    rate = float(match[1] or match[2]) if match else 0.0
    return 1.0 / rate if rate > 0.0 else value


def angle(text: str) -> float:
    """Return the number that a text spells: `0.5`, or an angle such as `60 deg` or `1 rad`, in radians.

    Raises:
        ValueError: The text is neither, or not finite.
    """
    match = re.fullmatch(rf"\s*({_DECIMAL})\s*(deg|rad|)\s*", text)
    if match is None or not math.isfinite(float(match[1])):
        raise ValueError(f'must be a number or an angle such as "60 deg", got {show(text)}')
    return math.radians(float(match[1])) if match[2] == "deg" else float(match[1])


def _distinct(values: tuple[str, ...]) -> tuple[str, ...]:
    for value in values:
        if values.count(value) > 1:
            raise rule(f"must not repeat, got {show(value)} {values.count(value)} times")
    return values


def _directed(values: tuple[float, ...]) -> tuple[float, ...]:
    if math.hypot(*values) < _SHORTEST:
        raise rule(f"must not be zero, got {show(list(values))}")
    return values


def _rising(bounds: tuple[float, ...]) -> tuple[float, ...]:
    low, high = bounds
    if not low < high:
        raise rule(f"must have the lower bound first, got {show(list(bounds))}")
    return bounds


def _ordered(bounds: tuple[float, ...]) -> tuple[float, ...]:
    if bounds[0] > bounds[1]:
        raise rule(f"must have the least value first, got {show(list(bounds))}")
    return bounds


def _model_file(path: Path, info: ValidationInfo) -> Path:
    return checked_file(path, info, _model_near)


def _motion_file(path: Path, info: ValidationInfo) -> Path:
    if path.suffix not in MOTIONS:
        raise rule(f"must end in one of {', '.join(MOTIONS)}, got {show(str(path))}")
    return checked_file(path, info, lambda folder, path: nearby(folder / path, path.suffix))


def checked_file(path: Path, info: ValidationInfo, near: Callable[[Path, Path], str]) -> Path:
    """Make the path absolute; where a scenario is read (context), the file must be there."""
    try:
        full = _located(path, info).resolve()
        is_file = not info.context or stat.S_ISREG(full.stat().st_mode)
    except FileNotFoundError:
        folder = info.context["folder"] if info.context else Path()
        raise rule(f'no such file "{visible(str(full))}"{near(folder, path)}') from None
    except (OSError, ValueError, RuntimeError) as error:  # not permitted; a NUL; a loop of links
        reason = getattr(error, "strerror", None) or str(error)
        raise rule(f"cannot be read ({reason.lower()}), got {show(str(path))}") from None
    if not is_file:
        raise rule(f'is not a file: "{visible(str(full))}"')
    return full


def _located(path: Path, info: ValidationInfo) -> Path:
    """Return a path from the scenario's folder; below its root where all its files were moved there."""
    context = info.context or {"folder": Path(), "root": None}
    full: Path = context["folder"] / path
    if context["root"] is None:
        return full
    return Path(context["root"], *Path(os.path.abspath(full)).parts[1:])


def _folder(path: Path, info: ValidationInfo) -> Path:
    """Make the path absolute; where a scenario is read (context), the folder must be there."""
    full = Path(os.path.abspath(_located(path, info)))
    if info.context and not full.is_dir():
        raise rule(f'no such folder "{visible(str(full))}"')
    return full


def _model_near(folder: Path, path: Path) -> str:
    """Suggest a model for a path that does not exist: a file next to it, or in the folder of models."""
    if near := nearby(folder / path, ".xml", ".urdf"):
        return near
    for models in (folder / "models", folder.parent / "models"):
        if (models / path.name).with_suffix(".xml").is_file():
            return f'; did you mean "{os.path.relpath((models / path.name).with_suffix(".xml"), folder)}"?'
    return "" if path.suffix else "; give the path of an MJCF file, from the scenario's folder"


def _one_or_list(value: object) -> str:
    return "<list>" if isinstance(value, list | tuple) else "<one>"


def _text_or_list(value: object) -> str | None:
    return "<text>" if isinstance(value, str) else "<list>" if isinstance(value, list | tuple) else None


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Seed = Annotated[int, Field(strict=True, ge=0)]
Share = Annotated[Number, Field(ge=0, lt=1)]
Switch = Annotated[bool, Field(strict=True)]
Text = Annotated[str, Field(strict=True, min_length=1)]
Name = Annotated[Text, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]
ModelFile = Annotated[Path, AfterValidator(_model_file)]
Folder = Annotated[Path, AfterValidator(_folder)]
Angle = Annotated[
    Number,
    BeforeValidator(_radians),
    WithJsonSchema(
        {
            "title": "angle",
            "anyOf": [{"type": "number"}, {"type": "string", "pattern": rf"^\s*{_DECIMAL}\s*(deg|rad)\s*$"}],
        }
    ),
]
Period = Annotated[
    Positive,
    BeforeValidator(seconds),
    WithJsonSchema(
        {
            "title": "number > 0 or rate",
            "anyOf": [
                {"type": "number", "exclusiveMinimum": 0},
                {"type": "string", "pattern": f"^{_RATE}$"},
            ],
        }
    ),
]
NotNegativeAngle = Annotated[
    NotNegative,
    BeforeValidator(_radians),
    WithJsonSchema(
        {
            "title": "angle >= 0",
            "anyOf": [
                {"type": "number", "minimum": 0},
                {"type": "string", "pattern": rf"^\s*\+?{UNSIGNED}\s*(deg|rad)\s*$"},
            ],
        }
    ),
]
Range = Annotated[
    Annotated[NotNegative, Tag("<one>")]
    | Annotated[tuple[NotNegative, ...], Count(2, 2), AfterValidator(_ordered), Tag("<list>")],
    Discriminator(_one_or_list),
]
AngleRange = Annotated[
    Annotated[NotNegativeAngle, Tag("<one>")]
    | Annotated[tuple[NotNegativeAngle, ...], Count(2, 2), AfterValidator(_ordered), Tag("<list>")],
    Discriminator(_one_or_list),
]
MotionFile = Annotated[Path, AfterValidator(_motion_file)]
Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
Frame = Literal["world", "base", "site"]
Axes = Annotated[tuple[Axis, ...], Count(1), AfterValidator(_distinct)]
Names = Annotated[tuple[Text, ...], Count(1), AfterValidator(_distinct)]
Positions = Annotated[tuple[Angle, ...], Count(1)]
Weights = Annotated[tuple[Positive, ...], Count(1)]
Rates = Annotated[tuple[Number, ...], Count(1)]
Vector = Annotated[tuple[Number, ...], Count(2, 3)]
Bounds = Annotated[
    tuple[Angle, ...],
    Count(2, 2),
    AfterValidator(_rising),
    Field(description="lower and upper bound of the key", json_schema_extra={"unit": "as the key"}),
]
Values = Annotated[tuple[Any, ...], Count(1), Field(description="values of the key")]
Quaternion = Annotated[tuple[Number, ...], Count(4, 4), AfterValidator(_directed)]
Wrench = Annotated[tuple[Number, ...], Count(6, 6)]
Point = Annotated[tuple[Number, ...], Count(3, 3)]
Angles = Annotated[tuple[Angle, ...], Count(3, 3)]
Moments = Annotated[tuple[Positive, ...], Count(3, 3)]
Gravity = Annotated[tuple[Number, ...], Count(3, 3)]
Direction = Annotated[
    Annotated[Literal["x", "y", "z"], Tag("<text>")]
    | Annotated[tuple[Number, ...], Count(3, 3), AfterValidator(_directed), Tag("<list>")],
    choice(_text_or_list, 'must be one of "x", "y", "z" or a list of 3 numbers'),
]
NameOrPositions = Annotated[
    Annotated[Text, Tag("<text>")] | Annotated[Positions, Tag("<list>")],
    choice(_text_or_list, "must be the name of a keyframe or a list of joint positions"),
]
PositiveOrAuto = Annotated[
    Annotated[Positive, Tag("<one>")] | Annotated[Literal["auto"], Tag("<text>")],
    Discriminator(lambda value: "<text>" if isinstance(value, str) else "<one>"),
]
OneOrEach = Annotated[
    Annotated[Positive, Tag("<one>")] | Annotated[Weights, Tag("<list>")], Discriminator(_one_or_list)
]
NotNegativeOrEach = Annotated[
    Annotated[NotNegative, Tag("<one>")] | Annotated[tuple[NotNegative, ...], Count(1), Tag("<list>")],
    Discriminator(_one_or_list),
]
AngleOrEach = Annotated[
    Annotated[Angle, Tag("<one>")] | Annotated[Positions, Tag("<list>")], Discriminator(_one_or_list)
]
NotNegativeAngleOrEach = Annotated[
    Annotated[NotNegativeAngle, Tag("<one>")]
    | Annotated[tuple[NotNegativeAngle, ...], Count(1), Tag("<list>")],
    Discriminator(_one_or_list),
]
