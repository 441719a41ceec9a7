"""The result of a search, in words and as rows of tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.results.facts import versions
from rmrc.study.margins.margins import Margin
from rmrc.tuning.bar import ALIKE
from rmrc.tuning.robot import GAIN_MARGIN
from rmrc.tuning.space import Setting, rounded
from rmrc.tuning.tables import Row
from rmrc.tuning.trials import CHATTER, SATURATED, TOLERANCE, Limits
from rmrc.tuning.tried import Tried
from rmrc.tuning.tune import Tuned, Tuning


def told(work: Tuning, found: Tuned) -> dict[str, Any]:
    """Return the results of a search beside its settings, as strict JSON, for its page."""
    limits = found.limits.rate / found.limits.scale
    return {
        "name": work.scenario.name, "title": title(work, found), "facts": facts(work, found),
        "front": front(found) if found.feasible else [], "named": named(found) if found.feasible else [],
        "margins": margins(found), "limits": sorted(set(limits[np.isfinite(limits)].tolist())),
        "lines": [as_written(found), *alike(found), *doubts(found)] if found.feasible else [nothing(found)],
        "block": found.block if found.feasible else "", "versions": versions(),
    }  # fmt: skip


def words(setting: Setting) -> str:
    """Return a structure in words: `damped, constant`, and choices other than `damp` and the scenario's."""
    structure = setting.structure
    policy = structure.at_singularity.replace("damp", "")
    parts = (structure.method, structure.schedule, policy, structure.on_excess)
    return ", ".join(filter(None, parts))


def numbers(setting: Setting) -> str:
    """Return the numbers in words: `maximum 0.1, below 0.3, feedback 20`."""
    pairs = zip(setting.structure.keys, setting.numbers, strict=True)
    return ", ".join(f"{_short(key)} {value:.6g}" for key, value in pairs)


def _short(key: str) -> str:
    return key.removeprefix("control.").removeprefix("inverse.").removeprefix("damping.")


def title(work: Tuning, found: Tuned) -> str:
    """Return the title of the tables."""
    kept = f"{len(found.feasible)} were tried on every perturbed scenario and keep the limits"
    return f"{work.scenario.name}: {len(found.tried)} settings in {found.runs} runs; {kept}"


def facts(work: Tuning, found: Tuned) -> list[tuple[str, str]]:
    """Return the limits and the trials."""
    limits, perturbed = found.limits, len(found.scenarios) - 1
    whose = "the setting as written"
    if found.own.worst.completed < 1.0:
        whose += ", or of the path if that does not complete it"
    off = f"and {perturbed} perturbed scenario{'s' * (perturbed != 1)}: {work.spread_in_words}"
    lines = [
        ("tried on", f"the scenario {off if perturbed else 'alone'}"),
        ("robot", _robot(work)),
        ("rates", _allowed(limits.rate, "rate", limits, "/s")),
        ("accelerations", _allowed(limits.acceleration, "acceleration", limits, "/s²")),
        ("time", f"at most {work.slower:g} times that of {whose}, for each perturbed scenario"),
        ("chatter", f"at most {CHATTER:g} sign changes of a joint's commanded acceleration per second"),
        ("torque", f"at its limit for at most {SATURATED:.0%} of the time"),
    ]
    if found.looks:
        late = 1e3 * sum(work.robot.slowest(work.scenario))
        coarse = f"dead time of {late:.4g} ms, in ticks of {1e3 * found.tick:.4g} ms"
        first = f"{found.looks} settings on an ideal plant with a {coarse}"
        lines.append(("first checks", first))
    if work.loops:
        every = f"on {len(work.loops)} more loops, evenly spaced from the fastest to the slowest"
        lines.append(("final checks", f"the recommended and the second best setting, {every}"))
    return lines + [("not possible", reason) for reason in work.left_out]


def _robot(work: Tuning) -> str:
    """Return on which robots it was tried, and how to give others, in a line."""
    robot, margin = work.robot, f", with a gain margin of {work.margin:g}" if work.margin > 1.0 else ""
    if robot.is_assumed:
        return f"assumed: {robot.words}{margin}; give yours by --delay, --lag and --noise"
    if robot.profile:
        return f"{robot.words}, as the profile {robot.profile} has it{margin}"
    if robot.words:
        return f"{robot.words}{margin}"
    return f"as the scenario has it{margin}: --delay, --lag and --noise give a range"


def _allowed(values: NDArray[np.float64], what: str, limits: Limits, per: str) -> str:
    """Return a limit in words."""
    if not np.isfinite(values).any():
        return f"no limit; control.limits.{what} sets one"
    each = [f"{value:.4g} {unit}{per}" for value, unit in zip(values, limits.units, strict=True)]
    text = each[0] if len(set(each)) == 1 else ", ".join(each)
    return f"at most {text}, measured, and {TOLERANCE:.0%} for overshoot"


def _row(one: Tried, found: Tuned) -> Row:
    out = one.worst
    return Row(found.role(one), words(one.setting), numbers(one.setting), out.error, out.peak_rate, out.time)


def front(found: Tuned) -> list[Row]:
    """Return the rows of the front."""
    return [_row(one, found) for one in found.verdict.front]


def named(found: Tuned) -> list[Row]:
    """Return the recommended and the second best setting, the one as written, and one that dominates it."""
    verdict = found.verdict
    chosen: Sequence[Tried | None] = (verdict.recommended, verdict.second, found.own, verdict.better)
    unique = {id(one): one for one in chosen if one is not None}
    rows = [_row(one, found) for one in unique.values()]
    return [row if row.name else row._replace(name="dominates as written") for row in rows]


def as_written(found: Tuned) -> str:
    """Return the judgment of the setting as written."""
    own, better = found.own, found.verdict.better
    if not own.keeps_limits:
        return f"The setting as written violates a limit: {own.worst.missed}."
    if better is None and not any(one is own for one in found.feasible):
        return "The setting as written is outside --only; no setting within --only dominates it."
    if better is None:
        return "The setting as written is on the Pareto front: no tried setting dominates it."
    which = "the recommended setting" if better is found.verdict.recommended else words(better.setting)
    if better.worst.point[:2] == own.worst.point[:2]:
        took = f"in {better.worst.time:.6g} s and not in {own.worst.time:.6g} s"
        return f"The setting as written is dominated: {which} has its error and its peak rate {took}."
    # a dominated setting has the larger error or peak rate; if one of them is 0, it is 0 in both
    error, rate = (_share(*pair) for pair in zip(better.worst[:2], own.worst[:2], strict=True))
    if error == rate == "1":
        return (
            f"The setting as written is dominated, but not significantly: {which} is better by less than "
            "0.1%."
        )
    return (
        f"The setting as written is dominated: {which} has {error} times its error at {rate} times its "
        "peak rate."
    )


def _share(its: float, own: float) -> str:
    return f"{its / own if own else 1.0:.3g}"


def alike(found: Tuned) -> list[str]:
    """Return which other inverses are equal to the recommended one."""
    names = dict.fromkeys(words(one.setting) for one in found.verdict.alike)
    return [f"As good, within {ALIKE:.0%} of error: {'; '.join(names)}."] if names else []


def margins(found: Tuned) -> list[tuple[str, ...]]:
    """Return the margins of each recommendation: gain, and additional delay and lag [ms]."""
    return [
        (name, _bears(one.gain, 1.0), _bears(one.delay, 1e3), _bears(one.lag, 1e3))
        for name, one in found.margins.items()
    ]


def _bears(margin: Margin | None, scale: float) -> str:
    if margin is None:
        return "none"
    value = f"{scale * margin.value:.3g}" if scale * margin.value < 1000 else f"{scale * margin.value:.0f}"
    return value if margin.edge.is_found else f"> {value}"


def doubts(found: Tuned) -> list[str]:
    """Return the warnings about a recommendation for a robot."""
    best, lines = found.verdict.recommended, []
    if best is None:
        return []
    margin = found.margins.get("recommended")
    if margin and margin.gain.edge.high <= GAIN_MARGIN:
        lines.append(
            f"Warning: its gain margin is {margin.gain.value:.3g}, below {GAIN_MARGIN:g}: if your robot "
            f"may be slower than assumed here, use less feedback, by --gain-margin {GAIN_MARGIN:g}."
        )
    pairs = zip(best.setting.structure.keys, best.setting.numbers, strict=True)
    for key, value in () if best.setting.is_written else pairs:
        if value in map(rounded, found.bounds.get(key, ())):
            lines.append(
                f"Warning: {key} is at its search bound, {value:.6g}: values beyond were not tried; --only "
                f"{key}=V1,V2 tries values of your choice."
            )
    return lines


def nothing(found: Tuned) -> str:
    """Return the limit that the nearest setting misses."""
    nearest = found.verdict.nearest
    assert nearest is not None  # nothing is feasible
    which = f"{words(nearest.setting)} ({numbers(nearest.setting)})"
    return f"no tried setting keeps the limits; the nearest is {which}: {nearest.worst.missed}"
