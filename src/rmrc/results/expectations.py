"""The expectations of a scenario about the metrics of its run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rmrc.results.columns import no_ticks
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, json_value, nearest
from rmrc.scenario import Check, Scenario
from rmrc.scenario.sections import PROFILE
from rmrc.support.errors import ScenarioError
from rmrc.support.spatial import AXES


@dataclass(frozen=True)
class Case:
    """The outcome of a check.

    Attributes:
        name: It stays the same from one version to the next.
        ok: Whether the check passed.
        text: The result.
    """

    name: str
    ok: bool
    text: str

    def __str__(self) -> str:
        """Return one line: `joint_rate.peak: expected below 3 rad/s, got 3.21, 0.21 too high`."""
        return f"{self.name}: {self.text}"


@dataclass(frozen=True)
class Outcome(Case):
    """The outcome of one expectation; an undefined value is never ok.

    Attributes:
        value: Value of the metric.
        wanted: In words, with the unit: `below 3 rad/s`.
        missed_by: Distance to the nearest value allowed: positive if the value is too high,
            negative if too low, 0 if it is allowed or exactly at a strict bound, NaN if undefined.
    """

    value: float
    wanted: str
    missed_by: float

    def facts(self) -> dict[str, object]:
        """Return the attributes and the line as a dict for strict JSON, as in `Scorecard.nested`."""
        return {**{name: json_value(value) for name, value in vars(self).items()}, "text": str(self)}


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
        if name not in card and name != PROFILE:
            is_other = name in blank(tuple(joints), AXES)
            why = "needs other axes in task.axes" if is_other else f"no such metric{nearest(name, card)}"
            problems.append((name, why))
        elif name in card and isinstance(card[name].value, str):
            problems.append((name, "is the name of something; an expectation needs a number"))
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


def _accepted(card: Scorecard, profile: str) -> Outcome:
    """Return whether a profile accepts all commands, and the first violation."""
    parts = ("refused", "first_condition", "first_joint", "first_time")
    count, condition, joint, time = (card[f"profile.{part}"].value for part in parts)
    wanted = f"commands that {Path(profile).stem} accepts"
    text = f"expected {wanted}, got {count:g} of {card['ticks'].value} refused"
    if condition:
        text += f', the first for the {condition} of "{joint}" at {time:.6g} s'
    return Outcome(PROFILE, count == 0.0, text, float(count), wanted, float(count))


def _outcome(name: str, figure: Figure, check: Check) -> Outcome:
    value = float(figure.value)
    bounds = (("above", check.above), ("below", check.below))
    words, misses = [f"{word} {bound:.12g}" for word, bound in bounds if bound is not None], []
    # `not value < bound` instead of `value >= bound`: NaN must miss.
    if check.above is not None and not value > check.above:
        misses.append(value - check.above)
    if check.below is not None and not value < check.below:
        misses.append(value - check.below)
    if check.equals is not None and check.within is not None:
        words.append(f"{check.equals:.12g} within {check.within:.12g}")
        off = value - check.equals
        misses += [off - math.copysign(check.within, off)] * (not abs(off) <= check.within)
    miss, wanted = max(misses, key=abs, default=0.0), " and ".join(words)
    wanted += "" if figure.unit == "1" else f" {figure.unit}"
    text = f"expected {wanted}, got {value:.6g}"
    if math.isnan(value):
        text = f"expected {wanted}, but it is undefined for this run"
    elif misses:
        text += f", {abs(miss):.3g} too {'high' if miss > 0 else 'low'}" if miss else ", exactly the bound"
    return Outcome(name, not misses, text, value, wanted, miss)
