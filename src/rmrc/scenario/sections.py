"""All sections of a scenario: their fields are the keys of a file, with unit, default and meaning."""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, model_validator

from rmrc.scenario.arm import ArmSection
from rmrc.scenario.choices import PLANTS
from rmrc.scenario.control import ControlSection, TaskSection
from rmrc.scenario.plant import PlantSection
from rmrc.scenario.profile import ProfileName
from rmrc.scenario.reading import show, split
from rmrc.scenario.sweep import Baseline, SweepSection, TuneSection
from rmrc.scenario.target import TargetSection
from rmrc.scenario.values import Choice, Name, NotNegative, Number, Section, TextOr, key, rule
from rmrc.support.errors import Key

# The key in `expect` for a profile instead of a metric.
PROFILE = "profile"

_ACCEPTED = "vendor limits of the commands: a shipped profile's name, or a file"


class Check(Choice):
    """Expectation of one metric of the scorecard.

    Attributes:
        below: upper bound, exclusive
        above: lower bound, exclusive
        equals: expected value, to `within`
        within: tolerance of `equals`
    """

    counts = ((("below", "above", "equals"), 1, 3),)
    needs = (("equals", "within"), ("within", "equals"))
    below: Number | None = key(None, "as the metric")
    above: Number | None = key(None, "as the metric")
    equals: Number | None = key(None, "as the metric")
    within: NotNegative | None = key(None, "as the metric")


def _profile_apart(expect: Any) -> Any:
    """Refuse a text in place of a check, and a check in place of a profile."""
    for name, value in expect.items() if isinstance(expect, dict) else ():
        if (name == PROFILE) != isinstance(value, str):
            wanted = "the name of a profile or a file" if name == PROFILE else "a mapping, such as {below: 1}"
            raise rule(f"must be {wanted}, got {show(value)}", ("expect", name))
    return expect


Expectations = Annotated[dict[str, TextOr[ProfileName, Check]], BeforeValidator(_profile_apart)]
"""A check of each metric, by its name, and a profile."""


class LookSection(Section):
    """Point of interest of a run: its recording opens there and marks it.

    Attributes:
        quantity: plot to open; status: active limits; path: the end effector's, in the picture
        at: time of the mark; null: where the quantity is worst
    """

    quantity: Literal[
        "rates", "joints", "sigma", "error", "rotation", "torque", "pace", "belief", "status", "path"
    ]
    at: NotNegative | None = key(None, "s")


class Sections(Section):
    """All inputs of a run.

    Attributes:
        name: name of the run and of its files
        arm: the arm
        task: controlled components of the site's motion
        control: the control law
        target: target motion of the site
        plant: plant, which executes the commanded rates
        expect: expectations, by metric of the scorecard
        look: point of interest in its recording; null: the rates, singular values and error
        baseline: changes of keys for a baseline, which `rmrc run` also runs for comparison
        sweep: variants for `rmrc sweep`
        tune: uncertainty about the robot, for `rmrc tune`
    """

    model_config = ConfigDict(title="Scenario")
    name: Name
    arm: ArmSection
    task: TaskSection = TaskSection()
    control: ControlSection = ControlSection()
    target: TargetSection
    plant: PlantSection = PlantSection()
    expect: Expectations = key(
        {}, schema={"properties": {PROFILE: {"type": "string", "default": None, "description": _ACCEPTED}}}
    )
    look: LookSection | None = None
    baseline: Baseline = key({})
    sweep: SweepSection = SweepSection()
    tune: TuneSection = TuneSection()

    @model_validator(mode="after")
    def _whole_steps(self) -> Self:
        period, timestep = self.control.period, self.plant.timestep
        steps = period / timestep if timestep and PLANTS[self.plant.kind].physics else 1.0
        # 1e-9: decimal fractions such as 0.003/0.001 are off by some 1e-16, real mistakes by far more.
        if not (steps < math.inf and abs(steps - max(1, round(steps))) <= 1e-9 * steps):
            numbers = f"got {show(period)} and {show(timestep)}"
            text = f"must be an integer multiple of plant.timestep, {numbers}; write plant.timestep: null"
            raise rule(text, ("control", "period"))
        return self


def parse_key(text: str) -> Key:
    """Return the steps of a dotted key; the name of a metric is one step, including its dots.

    A key in a sweep or a baseline is also one step: `sweep.vary.arm.start[0]` is the key `arm.start[0]` of
    `sweep.vary`.

    Raises:
        ValueError: If the text is no key.
    """
    for section in ("baseline", "sweep.vary", "sweep.draw"):
        if text.startswith(f"{section}.") and text != f"{section}.":
            return (*section.split("."), text.removeprefix(f"{section}."))
    section, _, below = text.partition(".")
    if section != "expect" or "." not in text:
        return split(text)
    metric, _, last = below.rpartition(".")  # a metric may lack a name, and is then refused
    return (section, metric, last) if metric and last in Check.model_fields else (section, below)
