"""Profiles: limits that a robot's vendor publishes for commands to its controller.

A profile is a YAML file, in `profiles/` beside this module or of a user. Every number in it has its source.
"""

import math
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Generic, Self, TypeVar

from pydantic import AfterValidator, Field, ValidationInfo, model_validator

from rmrc.scenario import values as types
from rmrc.scenario.messages import checked
from rmrc.scenario.reading import Document, show
from rmrc.scenario.values import Section, checked_file, key, rule
from rmrc.support.errors import ScenarioError, did_you_mean

V = TypeVar("V")

SUFFIXES = (".yaml", ".yml")
SHIPPED = {file.stem: file for file in sorted(Path(__file__).with_name("profiles").glob("*.yaml"))}


class Sourced(Section):
    """A published fact.

    Attributes:
        source: Place of publication, or method of measurement.
    """

    source: types.Text


class Value(Sourced, Generic[V]):
    """A number, a range, or one number per joint, in SI units."""

    value: V


class Ends(Sourced):
    """Lower and upper position limit per joint [rad or m]."""

    lower: types.Positions
    upper: types.Positions


class Taper(Ends):
    """Rate limits near the ends: toward `upper` at most √(2 · deceleration · (upper − q)) − offset.

    Attributes:
        offset: One per joint [rad/s or m/s].
        deceleration: One per joint [rad/s² or m/s²].
    """

    offset: Annotated[tuple[types.NotNegative, ...], types.count(1)]
    deceleration: types.Weights


class Loop(Section):
    """Known properties of the loop from a command to the motion; null: not published.

    Attributes:
        delay: Dead time from command to motion [s].
        lag: Time constant of the motion [s].
        encoder_resolution: Resolution of a measured position [rad or m].
    """

    delay: Value[types.Bounds] | None = None
    lag: Value[types.Positive] | None = None
    encoder_resolution: Value[types.Positive] | None = None


class Profile(Section):
    """Commands that a robot's controller accepts, as published by its vendor; null: not published.

    Every bound is strict: a command at the bound is refused.

    Attributes:
        name: Name, equal to the file name.
        robot: Robot and version of its software.
        joints: Number of joints.
        period: Time between two commands [s].
        position: Permitted commanded positions.
        rate: Largest rates [rad/s or m/s].
        rate_near_ends: Largest rates near the ends of the joint ranges.
        acceleration: Largest accelerations [rad/s² or m/s²].
        jerk: Largest jerks [rad/s³ or m/s³].
        margin: Margin that `control.limits.profile` keeps below these bounds of positions, rates,
            accelerations and jerks, each in its own unit.
        loop: Known properties of the loop.
    """

    name: str = ""
    robot: types.Text
    joints: Annotated[int, Field(strict=True, ge=1)]
    period: Value[types.Positive] | None = None
    position: Ends | None = None
    rate: Value[types.Weights] | None = None
    rate_near_ends: Taper | None = None
    acceleration: Value[types.Weights] | None = None
    jerk: Value[types.Weights] | None = None
    # as in libfranka's limiter: kLimitEps of include/franka/rate_limiting.h, 0.21.2
    margin: types.Positive = key(1e-3)
    loop: Loop = Loop()

    @model_validator(mode="after")
    def _one_a_joint(self) -> Self:
        for place in ("position", "rate", "rate_near_ends", "acceleration", "jerk"):
            part = getattr(self, place)
            for name, values in vars(part).items() if part else ():
                if isinstance(values, tuple) and len(values) != self.joints:
                    text = f"must have one value per joint, got {len(values)} for {self.joints} joints"
                    raise rule(text, (place, name))
                if name == "value" and min(values) <= self.margin:
                    raise rule(f"must be above margin {self.margin:g}, got {min(values):g}", (place, name))
            for j, low in enumerate(part.lower if isinstance(part, Ends) else ()):
                if not low < part.upper[j]:
                    raise rule(
                        f"must be below upper[{j}], {part.upper[j]:g}, got {low:g}", (place, "lower", j)
                    )
        return self

    @cached_property
    def limits(self) -> dict[str, tuple[float, ...]]:
        """Values that it sets in `control.limits`, by key, one per joint."""
        parts = {name: getattr(self, name) for name in ("rate", "acceleration", "jerk")}
        limits = {
            name: tuple(most - self.margin for most in part.value) for name, part in parts.items() if part
        }
        if self.rate_near_ends:
            # by its discriminant, braking from `stops` on with half the taper's deceleration stays below it
            limits["braking"] = tuple(0.5 * each for each in self.rate_near_ends.deceleration)
        return limits

    @cached_property
    def stops(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Positions, lower and upper, before which joints brake so that no bound is met; infinite for none.

        Braking by b toward a stop at d₀ from the end of the taper, √(2 b (d − d₀)) ≤ √(2 a d) − o for all d,
        with b = a/2: d₀ = o²/a.
        """
        lower, upper = [-math.inf] * self.joints, [math.inf] * self.joints
        for part in filter(None, (self.position, self.rate_near_ends)):
            for j in range(self.joints):
                room = self.margin
                if isinstance(part, Taper):
                    room += part.offset[j] ** 2 / part.deceleration[j]
                lower[j], upper[j] = max(lower[j], part.lower[j] + room), min(upper[j], part.upper[j] - room)
        return tuple(lower), tuple(upper)


def _of_name(name: str, info: ValidationInfo) -> str:
    """Return the name of a shipped profile, or the absolute path of a file."""
    if name in SHIPPED:
        return name
    if Path(name).suffix not in SUFFIXES:
        near = did_you_mean(name, SHIPPED) or f"; the profiles are {', '.join(SHIPPED)}"
        raise rule(f"must be a profile or a file that ends in .yaml, got {show(name)}{near}")
    file = checked_file(Path(name), info, *SUFFIXES)
    try:
        load_profile(str(file))
    except ScenarioError as error:
        raise rule("; ".join(map(str, error.problems))) from None
    return str(file)


ProfileName = Annotated[types.Text, AfterValidator(_of_name)]
"""The name of a shipped profile, or a profile file."""


def load_profile(name: str) -> Profile:
    """Return a profile.

    Args:
        name: Name of a shipped one, such as `franka_fr3`, or the path of a YAML file.

    Raises:
        ScenarioError: It cannot be read or is not a profile; lists all problems.
    """
    path = SHIPPED.get(name, Path(name))
    return _loaded(path, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=64)
def _loaded(path: Path, mtime: int) -> Profile:  # noqa: ARG001 - read anew where it differs
    return checked(Profile, Document.read(str(path))).model_copy(update={"name": path.stem})
