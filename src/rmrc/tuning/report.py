"""What a search found, in words and as rows of its tables."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rmrc.output.tuning_table import Row
from rmrc.tuning.search import ALIKE, Tried
from rmrc.tuning.space import Setting
from rmrc.tuning.trials import TOLERANCE, Limits
from rmrc.tuning.tuning import Tuned, Tuning


def words(setting: Setting) -> str:
    """Return a structure in words: `damped, constant`, and `stop` or `slow` if it is not `damp`."""
    structure = setting.structure
    parts = [structure.method, structure.schedule, structure.at_singularity.replace("damp", "")]
    return ", ".join(filter(None, parts))


def numbers(setting: Setting) -> str:
    """Return the numbers in words: `maximum 0.1, below 0.3, feedback 20`."""
    pairs = zip(setting.structure.keys, setting.numbers, strict=True)
    return ", ".join(f"{_short(key)} {value:.6g}" for key, value in pairs)


def _short(key: str) -> str:
    return key.removeprefix("control.").removeprefix("inverse.").removeprefix("damping.")


def title(work: Tuning, found: Tuned) -> str:
    """Return what was done."""
    kept = f"{len(found.feasible)} were tried on every copy and keep what is allowed"
    return f"{work.scenario.name}: {len(found.tried)} settings in {found.runs} runs; {kept}"


def facts(work: Tuning, found: Tuned) -> list[tuple[str, str]]:
    """Return what was allowed and what was tried."""
    limits, copies = found.limits, len(found.copies) - 1
    lines = [
        (
            "tried on",
            f"the scenario and {copies} cop{'y' if copies == 1 else 'ies'} of it: {work.spread_in_words}",
        ),
        ("rates", _allowed(limits.rate, "rate", limits, "/s")),
        ("accelerations", _allowed(limits.acceleration, "acceleration", limits, "/s²")),
        ("time", f"at most {work.slower:g} times that of the setting as written, copy by copy"),
    ]
    return lines + [("not possible", reason) for reason in work.left_out]


def _allowed(values: NDArray[np.float64], what: str, limits: Limits, per: str) -> str:
    """Return a limit in words."""
    if not np.isfinite(values).any():
        return f"no limit; control.limits.{what} sets one"
    each = [f"{value:.4g} {unit}{per}" for value, unit in zip(values, limits.units, strict=True)]
    text = each[0] if len(set(each)) == 1 else ", ".join(each)
    return f"at most {text}, measured, and {TOLERANCE:.0%} for overshoot"


def _row(one: Tried, found: Tuned) -> Row:
    verdict, out = found.verdict, one.worst
    roles = (("recommended", verdict.recommended), ("second best", verdict.second), ("as written", found.own))
    name = ", ".join(name for name, other in roles if other is one)
    return Row(name, words(one.setting), numbers(one.setting), out.error, out.peak_rate, out.time)


def front(found: Tuned) -> list[Row]:
    """Return the rows of the front."""
    return [_row(one, found) for one in found.verdict.front]


def named(found: Tuned) -> list[Row]:
    """Return what is recommended, second best, as written, and what dominates that if it is another."""
    verdict = found.verdict
    chosen: Sequence[Tried | None] = (verdict.recommended, verdict.second, found.own, verdict.better)
    unique = {id(one): one for one in chosen if one is not None}
    rows = [_row(one, found) for one in unique.values()]
    return [row if row.name else row._replace(name="dominates as written") for row in rows]


def as_written(found: Tuned) -> str:
    """Return whether the setting as written is any good."""
    own, better = found.own, found.verdict.better
    if not own.keeps_limits:
        return f"As written it does not keep what is allowed: {own.worst.missed}."
    if better is None:
        return "As written it is on the front: nothing that was tried dominates it."
    error, rate = better.worst.error / own.worst.error, better.worst.peak_rate / own.worst.peak_rate
    which = "the recommended setting" if better is found.verdict.recommended else words(better.setting)
    cost = f"{error:.3g} times its error at {rate:.3g} times its peak rate"
    return f"As written it is dominated: {which} has {cost}."


def alike(found: Tuned) -> list[str]:
    """Return which other inverses are as good as the one recommended."""
    names = dict.fromkeys(words(one.setting) for one in found.verdict.alike)
    return [f"As good, within {ALIKE:.0%} of error: {'; '.join(names)}."] if names else []


def nothing(found: Tuned) -> str:
    """Return what the nearest setting misses."""
    nearest = found.verdict.nearest
    assert nearest is not None  # nothing is feasible
    which = f"{words(nearest.setting)} ({numbers(nearest.setting)})"
    return f"nothing that was tried keeps what is allowed; nearest is {which}: {nearest.worst.missed}"
