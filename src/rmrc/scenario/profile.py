"""Profiles: limits that a robot's vendor publishes for commands to its controller.

A profile is a YAML file, in `profiles/` beside this module or of a user. Every number in it has its source.
"""

import math
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Self, TypeVar

from pydantic import AfterValidator, Field, ValidationError, ValidationInfo, model_validator

from rmrc.scenario.keys import in_order
from rmrc.scenario.messages import translate
from rmrc.scenario.reading import TextError, parse, read
from rmrc.scenario.values import (
    Bounds,
    NotNegative,
    Positions,
    Positive,
    Section,
    Text,
    Weights,
    checked_file,
    count,
    key,
    rule,
)
from rmrc.scenario.wording import show
from rmrc.support.errors import ScenarioError, did_you_mean
from rmrc.support.problems import Origin, Problem

S = TypeVar("S", bound=Section)

SUFFIXES = (".yaml", ".yml")
SHIPPED = {file.stem: file for file in sorted(Path(__file__).with_name("profiles").glob("*.yaml"))}


class Sourced(Section):
    """A published fact."""

    source: Text = key("place of publication, or method of measurement")


class Value(Sourced):
    """One number."""

    value: Positive = key("the number, in SI units")


class Each(Sourced):
    """One number per joint."""

    value: Weights = key("one per joint, in SI units")


class Ends(Sourced):
    """Lower and upper position limit per joint."""

    lower: Positions = key("one per joint", unit="rad or m")
    upper: Positions = key("one per joint", unit="rad or m")


class Taper(Ends):
    """Rate limits near the ends: toward `upper` at most √(2 · deceleration · (upper − q)) − offset."""

    offset: Annotated[tuple[NotNegative, ...], count(1)] = key("one per joint", unit="rad/s or m/s")
    deceleration: Weights = key("one per joint", unit="rad/s² or m/s²")


class Span(Sourced):
    """Range of a number."""

    value: Bounds = key("smallest and largest value, in SI units")


class Loop(Section):
    """Known properties of the loop from a command to the motion; null: not published."""

    delay: Span | None = key("dead time from command to motion", None, "s")
    lag: Value | None = key("time constant of the motion", None, "s")
    encoder_resolution: Value | None = key("resolution of a measured position", None, "rad or m")


class Profile(Section):
    """Commands that a robot's controller accepts, as published by its vendor; null: not published.

    Every bound is strict: a command at the bound is refused.
    """

    name: str = key("name, equal to the file name", "")
    robot: Text = key("robot and version of its software")
    joints: Annotated[int, Field(strict=True, ge=1)] = key("number of joints")
    period: Value | None = key("time between two commands", None, "s")
    position: Ends | None = key("permitted commanded positions", None)
    rate: Each | None = key("largest rates", None, "rad/s or m/s")
    rate_near_ends: Taper | None = key("largest rates near the ends of the joint ranges", None)
    acceleration: Each | None = key("largest accelerations", None, "rad/s² or m/s²")
    jerk: Each | None = key("largest jerks", None, "rad/s³ or m/s³")
    margin: Positive = key(
        "margin that `control.limits.profile` keeps below these bounds of positions, rates, accelerations "
        "and jerks, each in its own unit",
        # as in libfranka's limiter: kLimitEps of include/franka/rate_limiting.h, 0.21.2
        1e-3,
    )
    loop: Loop = key("known properties of the loop", Loop())

    @model_validator(mode="after")
    def _one_a_joint(self) -> Self:
        for place in ("position", "rate", "rate_near_ends", "acceleration", "jerk"):
            part = getattr(self, place)
            for name, values in vars(part).items() if part else ():
                if isinstance(values, tuple) and len(values) != self.joints:
                    got = f"got {len(values)} for {self.joints} joints"
                    raise rule(f"must have one value per joint, {got}", (place, name))
            for j, low in enumerate(part.lower if isinstance(part, Ends) else ()):
                if not low < part.upper[j]:
                    wrong = f"must be below upper[{j}], which is {part.upper[j]:g}, got {low:g}"
                    raise rule(wrong, (place, "lower", j))
        for name, most in (("rate", self.rate), ("acceleration", self.acceleration), ("jerk", self.jerk)):
            if most and min(most.value) <= self.margin:
                raise rule(f"must be above margin {self.margin:g}, got {min(most.value):g}", (name, "value"))
        return self

    @cached_property
    def limits(self) -> dict[str, tuple[float, ...]]:
        """Values that it sets in `control.limits`, by key, one per joint."""
        found = {
            name: tuple(most - self.margin for most in part.value)
            for name in ("rate", "acceleration", "jerk")
            if (part := getattr(self, name)) is not None
        }
        if self.rate_near_ends:
            # by its discriminant, braking from `stops` on with half the taper's deceleration stays below it
            found["braking"] = tuple(0.5 * one for one in self.rate_near_ends.deceleration)
        return found

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
    found = checked_file(Path(name), info, *SUFFIXES)
    try:
        load_profile(str(found))
    except ScenarioError as error:
        raise rule("; ".join(map(str, error.problems))) from None
    return str(found)


ProfileName = Annotated[Text, AfterValidator(_of_name)]
"""The name of a shipped profile, or a profile file."""


def load_profile(name: str) -> Profile:
    """Return a profile.

    Args:
        name: Name of a shipped one, such as `franka_fr3`, or the path of a YAML file.

    Raises:
        ScenarioError: It cannot be read or is not a profile; lists all problems.
    """
    path = SHIPPED.get(name, Path(name))
    try:
        status = path.stat()
    except OSError as error:
        why = f"cannot be read: {(error.strerror or str(error)).lower()}"
        raise ScenarioError([Problem((), why, Origin(str(path)))]) from None
    return _loaded(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=64)
def _loaded(path: Path, mtime: int, size: int) -> Profile:  # noqa: ARG001 - read anew where they differ
    return read_section(Profile, path).model_copy(update={"name": path.stem})


def read_section(kind: type[S], path: Path) -> S:
    """Return the section in a YAML file.

    Args:
        kind: Class of the section.
        path: Path of the file.

    Raises:
        ScenarioError: It cannot be read, or is no such section; all problems.
    """
    try:
        document = parse(read(str(path)), str(path))
    except TextError as error:
        raise ScenarioError([error.problem(str(path))]) from None
    problems = list(document.problems)
    try:
        found = kind.model_validate(document.value)
    except ValidationError as error:
        problems += translate(error, document.sources, kind)
    if problems:
        raise ScenarioError(in_order(problems))
    return found
