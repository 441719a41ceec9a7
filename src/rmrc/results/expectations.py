"""The expectations of a scenario about the metrics of its run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rmrc.results.columns import no_ticks
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, json_value
from rmrc.scenario import Check, Scenario
from rmrc.scenario.sections import PROFILE
from rmrc.support.errors import ScenarioError, did_you_mean
from rmrc.support.spatial import AXES


@dataclass(frozen=True)
class Outcome:
    """The outcome of one expectation.

    Attributes:
        name: Name of the metric.
        value: Value of the metric.
        wanted: In words, with the unit: `below 3 rad/s`.
        missed_by: Distance to the nearest value allowed: positive if the value is too high,
            negative if too low, 0 if it is allowed or exactly at a strict bound, NaN if undefined.
        ok: Whether the value is allowed; an undefined one never is.
        got: Description of an outcome that has no value; "": the value describes it.
    """

    name: str
    value: float
    wanted: str
    missed_by: float
    ok: bool
    got: str = ""

    def __str__(self) -> str:
        """Return one line: `joint_rate.peak: expected below 3 rad/s, got 3.21, 0.21 too high`."""
        text = f"{self.name}: expected {self.wanted}"
        if math.isnan(self.value):
            return f"{text}, but it is undefined for this run"
        text += f", got {self.got or f'{self.value:.6g}'}"
        if self.ok or self.got:
            return text
        if self.missed_by == 0.0:
            return f"{text}, exactly the bound"
        return f"{text}, {abs(self.missed_by):.3g} too {'high' if self.missed_by > 0 else 'low'}"

    def facts(self) -> dict[str, object]:
        """Return the attributes and the line as a dict for strict JSON, as in `Scorecard.nested`."""
        values = {name: json_value(value) for name, value in vars(self).items() if name != "got"}
        return {**values, "text": str(self)}


@lru_cache(maxsize=16)  # used again for each of thousands of variants
def blank(joints: tuple[str, ...], axes: tuple[str, ...]) -> Scorecard:
    """Return the scorecard of a run without ticks: all its metrics, without values.

    Args:
        joints: Names of the joints.
        axes: Task axes that count.
    """
    n = len(joints)
    run = Run(
        name="", joints=joints, is_slide=(False,) * n, axes=axes, length=1.0, period=1.0, planned=1,
        columns=no_ticks(n, 1, n),
    )  # fmt: skip
    return run.scorecard


def refuse_unknown(scenario: Scenario, joints: Sequence[str]) -> None:
    """Refuse a scenario that expects metrics that its run will not have, or that are not numbers.

    Args:
        scenario: Its `expect` and task are read.
        joints: Names of the joints.

    Raises:
        ScenarioError: All names that are refused, each with its place in the scenario.
    """
    card, problems = blank(tuple(joints), scenario.task.axes), []
    for name in scenario.expect:
        if name in card and isinstance(card[name].value, str):
            problems.append((name, "is the name of something; an expectation needs a number"))
        elif name not in card and name != PROFILE:
            problems.append((name, _unknown(name, card)))
    if problems:
        raise ScenarioError(scenario.problem(f"expect.{name}", why) for name, why in problems)


def check(card: Scorecard, expect: Mapping[str, Check | str]) -> list[Outcome]:
    """Compare metrics with their expectations.

    `below` and `above` are strict: the bound itself is a miss. `equals` allows `within` on both
    sides, the ends included. An undefined metric (NaN) never passes.

    Args:
        card: The scorecard.
        expect: Checks by name of metric; for `profile` the profile that the run was checked against.

    Returns:
        One outcome per check, in the order of `expect`.
    """
    return [
        _accepted(card, wanted) if isinstance(wanted, str) else _outcome(name, card[name], wanted)
        for name, wanted in expect.items()
    ]


def _unknown(name: str, card: Scorecard) -> str:
    """Return why there is no such metric, and the remedy."""
    for error, rows in (("position_error", AXES[:3]), ("orientation_error", AXES[3:])):
        if name.startswith(error) and f"{error}.max" not in card:
            return f"needs one of {', '.join(rows)} in task.axes"
    groups = ", ".join(dict.fromkeys(known.partition(".")[0] for known in card))
    return "no such metric" + (did_you_mean(name, card) or f"; metrics begin with {groups}")


def _accepted(card: Scorecard, profile: str) -> Outcome:
    """Return whether a profile accepts all commands, and the first violation."""
    count, ticks, profile = float(card["profile.refused"].value), card["ticks"].value, Path(profile).stem
    got = f"{count:g} of {ticks} refused"
    if count > 0.0:
        names = ("condition", "joint", "time")
        condition, joint, time = (card[f"profile.first_{name}"].value for name in names)
        got += f', the first for the {condition} of "{joint}" at {time:.6g} s'
    return Outcome(PROFILE, count, f"commands that {profile} accepts", count, count == 0.0, got)


def _outcome(name: str, figure: Figure, wanted: Check) -> Outcome:
    value = float(figure.value)
    words, misses = [], []
    # `not value < bound` instead of `value >= bound`: NaN must miss.
    if wanted.above is not None:
        words.append(f"above {wanted.above:.12g}")
        misses += [value - wanted.above] * (not value > wanted.above)
    if wanted.below is not None:
        words.append(f"below {wanted.below:.12g}")
        misses += [value - wanted.below] * (not value < wanted.below)
    if wanted.equals is not None and wanted.within is not None:
        words.append(f"{wanted.equals:.12g} within {wanted.within:.12g}")
        off = value - wanted.equals
        misses += [off - math.copysign(wanted.within, off)] * (not abs(off) <= wanted.within)
    text = " and ".join(words) + ("" if figure.unit == "1" else f" {figure.unit}")
    return Outcome(name, value, text, max(misses, key=abs, default=0.0), not misses)
