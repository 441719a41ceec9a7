"""The expectations of a scenario about the metrics of its run."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rmrc.results.columns import Recorded, no_ticks
from rmrc.results.events import CONDITIONS
from rmrc.results.scorecard import Figure, Scorecard, json_value, scorecard
from rmrc.scenario import Check, Scenario
from rmrc.scenario.sections import PROFILE
from rmrc.support.errors import ScenarioError, did_you_mean
from rmrc.support.problems import Problem
from rmrc.support.spatial import AXES

# Units of what a profile bounds, per unit of the joint.
_PER = dict(zip(CONDITIONS, ("", "/s", "/s²", "/s³"), strict=True))

# What a metric names that is no number, by the end of its own name; and the number to expect instead.
_NAMED = {"_joint": "a joint", "_condition": "a condition", "_bodies": "bodies"}
_NUMBERS = {
    "profile.first_joint": "profile.refused",
    "profile.first_condition": "profile.refused",
    "return.change_joint": "return.joint_change",
    "contact.first_bodies": "contact.time",
    "torque_limited.first_joint": "torque_limited.time",
}


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
        if self.got:
            return f"{text}, got {self.got}"
        text += f", got {self.value:.6g}"
        if self.ok:
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
    return scorecard(Recorded("", joints, (False,) * n, axes, 1.0, 1.0, no_ticks(n, 1, n), 0))


def refuse_unknown(scenario: Scenario, joints: Sequence[str]) -> None:
    """Refuse a scenario that expects metrics that its run will not have.

    Args:
        scenario: Its `expect` and task are read.
        joints: Names of the joints.

    Raises:
        ScenarioError: All names that are refused, each with its place in the scenario.
    """
    problems = refused(scenario.expect, blank(tuple(joints), scenario.task.axes))
    if problems:
        raise ScenarioError(scenario.problem(f"expect.{name}", why) for name, why in problems.items())


def check(card: Scorecard, expect: Mapping[str, Check | str]) -> list[Outcome]:
    """Compare metrics with their expectations.

    `below` and `above` are strict: the bound itself is a miss. `equals` allows `within` on both
    sides, the ends included. An undefined metric (NaN) never passes.

    Args:
        card: The scorecard.
        expect: Checks by name of metric; for `profile` the profile that the run was checked against.

    Returns:
        One outcome per check, in the order of `expect`.

    Raises:
        ScenarioError: Names that are no metrics of this run, or not numbers; all of them.
    """
    problems = refused(expect, card)
    if problems:
        raise ScenarioError(Problem(("expect", name), why) for name, why in problems.items())
    return [
        _accepted(card, wanted) if isinstance(wanted, str) else _outcome(name, card[name], wanted)
        for name, wanted in expect.items()
    ]


def refused(names: Iterable[str], card: Scorecard) -> dict[str, str]:
    """Return why some metrics cannot be expected.

    Args:
        names: Names of metrics, as a scenario's `expect` has them.
        card: A scorecard of such a run, with values or without.

    Returns:
        For each name that is refused, in order, the reason; it follows the key in a message.
    """
    reasons = {}
    for name in names:
        if name == PROFILE:
            continue
        if name not in card:
            reasons[name] = _unknown(name, card)
        elif isinstance(card[name].value, str):
            number = _NUMBERS.get(name, name.removesuffix("_joint"))
            what = next(words for end, words in _NAMED.items() if name.endswith(end))
            reasons[name] = f"names {what}; an expectation needs a number, such as {number}"
    return reasons


def _unknown(name: str, card: Scorecard) -> str:
    """Return why there is no such metric, and the remedy."""
    rows = {"position_error": AXES[:3], "orientation_error": AXES[3:]}
    for error, other in (("position_error", "orientation_error"), ("orientation_error", "position_error")):
        if name.startswith(error) and name.replace(error, other) in card:
            return f"needs one of {', '.join(rows[error])} in task.axes"
    groups = ", ".join(dict.fromkeys(known.partition(".")[0] for known in card))
    return "no such metric" + (did_you_mean(name, card) or f"; metrics begin with {groups}")


def _accepted(card: Scorecard, profile: str) -> Outcome:
    """Return whether a profile accepts all commands, and the first violation."""
    count, all_of_them = float(card["profile.refused"].value), card["ticks"].value
    got = f"{all_of_them} that it accepts"
    if count > 0.0:
        joint, condition, time, value, bound = (
            card[f"profile.first_{name}"].value for name in ("joint", "condition", "time", "value", "bound")
        )
        unit = card[f"joint_rate.{joint}.peak"].unit.removesuffix("/s") + _PER[str(condition)]
        got = (
            f'{condition} {value:.6g} {unit} of "{joint}" at {time:.6g} s, which must stay within '
            f"{bound:.6g}; {count:g} of {all_of_them} commands are refused"
        )
    return Outcome(PROFILE, count, f"commands that {Path(profile).stem} accepts", count, count == 0.0, got)


def _outcome(name: str, figure: Figure, wanted: Check) -> Outcome:
    value = float(figure.value)
    words, misses = [], []
    # `not value < bound` instead of `value >= bound`: NaN must miss.
    if wanted.above is not None:
        words.append(f"above {wanted.above:.12g}")
        if not value > wanted.above:
            misses.append(value - wanted.above)
    if wanted.below is not None:
        words.append(f"below {wanted.below:.12g}")
        if not value < wanted.below:
            misses.append(value - wanted.below)
    if wanted.equals is not None and wanted.within is not None:
        words.append(f"{wanted.equals:.12g} within {wanted.within:.12g}")
        off = value - wanted.equals
        if not abs(off) <= wanted.within:
            misses.append(off - math.copysign(wanted.within, off))
    text = " and ".join(words) + ("" if figure.unit == "1" else f" {figure.unit}")
    return Outcome(name, value, text, max(misses, key=abs, default=0.0), not misses)
