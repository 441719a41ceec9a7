"""Building blocks of sections: the mapping, its keys, and the constrained types of their values."""

import inspect
import math
import os
import re
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import pydantic
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic.config import JsonDict
from pydantic_core import PydanticCustomError

from rmrc.scenario.reading import nearby, show
from rmrc.support.errors import Key
from rmrc.support.shipped import shipped

T = TypeVar("T")
U = TypeVar("U")

# Formats of a recorded motion.
MOTIONS = (".csv", ".parquet", ".npz")

# Each digit matches in one way only; otherwise a long invalid text would take time quadratic in its length.
_UNSIGNED = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_DECIMAL = rf"[-+]?{_UNSIGNED}"
_ANGLE = rf"\s*({_DECIMAL})\s*(deg|rad)\s*"
_ANGULAR = rf"\s*(\+?{_UNSIGNED})\s*(deg|rad)"
_PER = (rf"{_ANGULAR}/s\s*", rf"{_ANGULAR}/s(?:²|\^?2)\s*", rf"{_ANGULAR}/s(?:³|\^?3)\s*")
_RATE = rf"\s*(?:({_UNSIGNED})\s*Hz|1\s*/\s*({_UNSIGNED})\s*s?)\s*"


# Factor to the unit of scenarios, and that unit.
_DEGREE = math.radians(1.0)
_UNITS = {
    "ms": (1e-3, "s"), "us": (1e-6, "s"), "mm": (1e-3, "m"), "cm": (1e-2, "m"), "g": (1e-3, "kg"),
    "deg": (_DEGREE, "rad"), "%": (1e-2, "1"),
}  # fmt: skip


class Section(BaseModel):
    """One mapping of the file: frozen, and without any key that is not named here.

    The meaning of each key stands in the docstring of its class, under `Attributes`.
    """

    # its schema waits for the meanings
    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_by_name=True, serialize_by_alias=True, defer_build=True
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Take the meanings from the docstring."""
        title, *attributes = inspect.cleandoc(cls.__doc__ or "").split("\n\nAttributes:\n")
        cls.model_config["json_schema_extra"] = {"description": title}
        for name, text in re.findall(r"^    (\w+): (.+(?:\n {6}.+)*)", "".join(attributes), re.M):
            cls.model_fields[name].description = " ".join(text.split())

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        """Return a copy that shares its values, which are frozen: pydantic copies each default."""
        return self.__copy__()


class Exclusive(Section):
    """A mapping in which some keys exclude or need others."""

    # Least and most number of the keys that have a value, and the key that another needs.
    counts: ClassVar[tuple[tuple[tuple[str, ...], int, int], ...]] = ()
    needs: ClassVar[tuple[tuple[str, str], ...]] = ()

    @pydantic.model_validator(mode="after")
    def _fitting(self) -> Self:
        values = self.__dict__
        for names, least, most in self.counts:
            present = [name for name in names if values[name] is not None]
            if not least <= len(present) <= most:
                number = "exactly one" if least == most else "at least one" if least else "at most one"
                listed = " and ".join(present) or "none"
                raise rule(f"must have {number} of {', '.join(names)}, got {listed}")
        for name, other in self.needs:
            if values[name] is not None and values[other] is None:
                raise rule(f"{name} needs {other}")
        return self


class Choice(Exclusive):
    """A mapping in which keys exclude others: those that are absent are not written."""

    @pydantic.model_serializer(mode="wrap")
    def _present(self, handler: pydantic.SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in handler(self).items() if value is not None}


def key(default: Any = ..., unit: str | None = None, **more: Any) -> Any:
    """Return a key of a section with its unit; required without a default."""
    extra: JsonDict = {"unit": unit} if unit else {}
    extra |= more.pop("schema", {})
    return Field(default, json_schema_extra=extra or None, **more)


def count(least: int, most: int | None = None) -> Any:
    """Return bounds on the number of items of a list."""
    return Field(min_length=least, max_length=most)


def rule(text: str, key: Key = ()) -> PydanticCustomError:
    """Return the error of one of this package's rules: its whole message, and its key if not the value's."""
    return PydanticCustomError("rule", "{text}", {"text": text, "key": key})


# Readers and checks of values --------------------------------------------------------------------


def quantity(text: str, unit: str) -> tuple[float, bool]:
    """Return the value of a text in a unit, such as "m" or "m/s", and whether the text has one itself.

    Raises:
        ValueError: It is no number with that unit, or one that converts to it, or with none.

    >>> quantity("6 ms", "s"), quantity("0.5", "rad")
    ((0.006, True), (0.5, False))
    """
    match = re.fullmatch(rf"\s*({_DECIMAL})\s*([a-z%]*)(/\S+)?\s*", text)
    factor, base = _UNITS.get(match[2], (1.0, match[2])) if match else (1.0, "")
    value = float(match[1]) * factor if match else math.nan
    if match is None or f"{base}{match[3] or ''}" not in ("", unit) or not math.isfinite(value):
        raise ValueError(f"is not a number in {unit}" if unit != "1" else "is not a number")
    return value, bool(match[2])


def angle(text: str) -> float:
    """Return the number that a text spells: `0.5`, or an angle such as `60 deg` or `1 rad`, in radians.

    Raises:
        ValueError: The text is neither, or not finite.
    """
    try:
        return quantity(text, "rad")[0]
    except ValueError:
        raise ValueError(f'must be a number or an angle such as "60 deg", got {show(text)}') from None


def _radians(pattern: str) -> BeforeValidator:
    """Turn a text such as `"60 deg"` into radians; leave anything else for the number check."""

    def radians(value: object) -> object:
        match = re.fullmatch(pattern, value) if isinstance(value, str) else None
        return float(match[1]) * (_DEGREE if match[2] == "deg" else 1.0) if match else value

    return BeforeValidator(radians)


def _seconds(value: object) -> object:
    """Turn `"30 Hz"` or `"1/30"` into a period [s]; leave anything else for the number check."""
    match = re.fullmatch(_RATE, value) if isinstance(value, str) else None
    rate = float(match[1] or match[2]) if match else 0.0
    return 1.0 / rate if rate > 0.0 else value


def _distinct(values: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(values)) < len(values):
        raise rule(f"must not repeat, got {show(list(values))}")
    return values


def directed(values: tuple[float, ...]) -> tuple[float, ...]:
    """Refuse a vector of zeros."""
    if math.hypot(*values) < 1e-9:  # its squares would vanish or be noise
        raise rule(f"must not be zero, got {show(list(values))}")
    return values


def _ordered(bounds: tuple[float, ...]) -> tuple[float, ...]:
    if bounds[0] > bounds[1]:
        raise rule(f"must have the lower bound first, got {show(list(bounds))}")
    return bounds


def checked_file(path: Path, info: pydantic.ValidationInfo, *suffixes: str, is_folder: bool = False) -> Path:
    """Make a path absolute; where a scenario is read (context), the file must be there.

    Args:
        path: Relative ones start at the context's `folder`; with a `root`, absolute ones start there.
        info: With the context.
        suffixes: Of files to suggest if there is none.
        is_folder: Whether it is the path of a folder.
    """
    context: dict[str, Any] = info.context or {}
    full = os.path.abspath(os.path.join(context.get("folder", ""), path))
    full = f"{context.get('root') or ''}{full}"
    if context and not (os.path.isdir(full) if is_folder else os.path.isfile(full)):
        near = nearby(Path(full), *suffixes)
        raise rule(f'no such {"folder" if is_folder else "file"} "{full}"{near}')
    return Path(full if is_folder else os.path.realpath(full))


def _model(path: Path, info: pydantic.ValidationInfo) -> Path:
    """Return the file of a model; a bare name without a file beside the scenario is that of a shipped one."""
    is_there = os.path.lexists(os.path.join((info.context or {}).get("folder", ""), path))
    named = None if is_there else shipped("models").get(str(path))
    return named or checked_file(path, info, ".xml", ".urdf")


def _motion(path: Path, info: pydantic.ValidationInfo) -> Path:
    if path.suffix not in MOTIONS:
        raise rule(f"must end in one of {', '.join(MOTIONS)}, got {show(str(path))}")
    return checked_file(path, info, path.suffix)


def _or_text(title: str, pattern: str, **bounds: int) -> pydantic.WithJsonSchema:
    """Return the JSON Schema of a number that may be written as a text."""
    options = [{"type": "number", **bounds}, {"type": "string", "pattern": f"^{pattern}$"}]
    return pydantic.WithJsonSchema({"title": title, "anyOf": options})


def _rate(unit: str, pattern: str) -> pydantic.WithJsonSchema:
    return _or_text(f"number > 0 or {unit}", pattern, exclusiveMinimum=0)


def _one_or_list(value: object) -> str:
    return "<list>" if isinstance(value, list | tuple) else "<one>"


def _text_or_other(value: object) -> str:
    return "<text>" if isinstance(value, str) else "<other>"


# Types -------------------------------------------------------------------------------------------

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Share = Annotated[Number, Field(ge=0, lt=1)]
Seed = Annotated[int, Field(strict=True, ge=0)]
Switch = Annotated[bool, Field(strict=True)]
Text = Annotated[str, Field(strict=True, min_length=1)]
Name = Annotated[Text, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]
ModelFile = Annotated[Path, AfterValidator(_model)]
MotionFile = Annotated[Path, AfterValidator(_motion)]
Folder = Annotated[Path, AfterValidator(lambda path, info: checked_file(path, info, is_folder=True))]
Angle = Annotated[Number, _radians(_ANGLE), _or_text("angle", _ANGLE)]
NotNegativeAngle = Annotated[
    NotNegative, _radians(_ANGLE), _or_text("angle >= 0", rf"{_ANGULAR}\s*", minimum=0)
]
AngularVelocity = Annotated[Positive, _radians(_PER[0]), _rate("deg/s", _PER[0])]
AngularAcceleration = Annotated[Positive, _radians(_PER[1]), _rate("deg/s²", _PER[1])]
AngularJerk = Annotated[Positive, _radians(_PER[2]), _rate("deg/s³", _PER[2])]
Period = Annotated[Positive, BeforeValidator(_seconds), _rate("rate", _RATE)]

_Items = Annotated[tuple[T, ...], count(1)]
_Two = Annotated[tuple[T, ...], count(2, 2), AfterValidator(_ordered)]
_Three = Annotated[tuple[T, ...], count(3, 3)]
# Only the option that fits reports errors.
_OneOr = Annotated[
    Annotated[T, Tag("<one>")] | Annotated[U, Tag("<list>")],
    Discriminator(_one_or_list),
]
TextOr = Annotated[
    Annotated[T, Tag("<text>")] | Annotated[U, Tag("<other>")],
    Discriminator(_text_or_other),
]

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
Frame = Literal["world", "base", "site"]
Axes = Annotated[_Items[Axis], AfterValidator(_distinct)]
Names = Annotated[_Items[Text], AfterValidator(_distinct)]
Positions = _Items[Angle]
Weights = _Items[Positive]
Rates = _Items[Number]
Vector = Annotated[tuple[Number, ...], count(2, 3)]
Point = _Three[Number]
Moments = _Three[Positive]
Wrench = Annotated[tuple[Number, ...], count(6, 6)]
Quaternion = Annotated[tuple[Number, ...], count(4, 4), AfterValidator(directed)]
OneOrEach = _OneOr[Positive, _Items[Positive]]
VelocityOrEach = _OneOr[AngularVelocity, _Items[AngularVelocity]]
AccelerationOrEach = _OneOr[AngularAcceleration, _Items[AngularAcceleration]]
JerkOrEach = _OneOr[AngularJerk, _Items[AngularJerk]]
NotNegativeOrEach = _OneOr[NotNegative, _Items[NotNegative]]
AngleOrEach = _OneOr[Angle, _Items[Angle]]
NotNegativeAngleOrEach = _OneOr[NotNegativeAngle, _Items[NotNegativeAngle]]
Range = _OneOr[NotNegative, _Two[NotNegative]]
AngleRange = _OneOr[NotNegativeAngle, _Two[NotNegativeAngle]]
NameOrPositions = TextOr[Text, Positions]
Direction = TextOr[Literal["x", "y", "z"], Annotated[_Three[Number], AfterValidator(directed)]]
PositiveOrAuto = TextOr[Literal["auto"], Positive]
Bounds = Annotated[
    _Two[Angle],
    Field(description="lower and upper bound of the key", json_schema_extra={"unit": "as the key"}),
]
Values = Annotated[_Items[Any], Field(description="values of the key")]
