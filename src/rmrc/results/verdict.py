"""The verdict on a run, in one sentence, derived from its columns."""

import math
import textwrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Recorded
from rmrc.scenario.choices import Status
from rmrc.support.legible import visible

if TYPE_CHECKING:
    from rmrc.results.scorecard import Scorecard

# Lines of a terminal, and characters of a line and of the name of a joint.
LINES, WIDTH, LONGEST_NAME = 2, 100, 24
# κ from which an arm counts as near a singularity: MoveIt Servo begins to slow down there. From 100 on it is
# SINGULAR.
NEAR = 17.0
# Share of the largest distance from the shoulder from which an arm counts as stretched out; and share of the
# lost direction that must point away from the shoulder for that to be the cause.
STRETCHED, AWAY = 0.995, 0.9
# A run that is damped for a larger share of its time, at κ below this, is damped without need.
USUAL, HARMLESS = 0.5, 20.0
# Rates that differ by less count as the same.
MORE = 1.05

# The cause of a reduced rate, by the status at the tick; the filter of an inverse without λ is named apart.
_KEEPERS = {
    Status.DAMPED: "damping",
    Status.SLOWED: "slowing down",
    Status.STOPPED: "stopping",
    Status.KEPT_OUT: "keeping out",
    Status.RATE_LIMITED: "the rate limit",
    Status.ACCELERATION_LIMITED: "the acceleration limit",
    Status.JERK_LIMITED: "the jerk limit",
    Status.POSITION_LIMITED: "a joint limit",
}
# Other events of a run that are reported, the most serious first.
_TIMES = {
    Status.STUCK: "stuck",
    Status.CONTACT: "in contact",
    Status.STOPPED: "stopping or stopped",
    Status.SLOWED: "slowed",
    Status.POSITION_LIMITED: "held back by joint limits",
    Status.TORQUE_LIMITED: "with an actuator at its torque limit",
    Status.SLIPPED: "with a follower off its equality",
}


def told(run: Recorded, card: "Scorecard", beside: "tuple[Recorded, Scorecard] | None" = None) -> str:
    """Return the verdict on a run: its end, its rates, its error, and the commands of others.

    Args:
        run: The run so far.
        card: Its metrics.
        beside: Its baseline and the metrics of that, if it has one.

    Returns:
        A sentence of at most LINES lines; joints are called by their names.
    """
    if not len(run):
        end = f"{run.divergence} before" if run.divergence else "Ended before"
        return f"{end[:1].upper()}{end[1:]} the first tick was recorded."
    place, rates, error, times = _place(run), _needless(run) + _rates(run), _error(card), _times(card)
    other = _plainly(run, card) if beside is None else _other(*beside)
    details = [[rates, error, *times[:count]] for count in range(len(times), -1, -1)]
    sentences = [f"{place}: {', '.join(told)}{other}." for told in [*details, [rates]]]
    short = f"{place}: {rates}."
    return next((one for one in sentences if len(textwrap.wrap(one, WIDTH)) <= LINES), short)


def _place(run: Recorded) -> str:
    """Return how near to a singularity it came, and whether it is complete."""
    status, condition = run.columns["status"].astype(np.int64), float(np.max(run["condition"]))
    singular = (status & Status.SINGULAR) != 0
    if singular.any():
        where = "full reach" if _stretched(run)[singular].all() else "a singularity"
        place = f"Stayed at {where}" if singular.all() else f"Came to {where} (κ {_amount(condition)})"
    elif condition >= NEAR:
        place = f"Came near a singularity (κ {_amount(condition)})"
    else:
        place = f"Met no singularity (κ at most {_amount(condition)})"
    if run.divergence:
        joint = f" at {_name(run.divergence.joint)}" if run.divergence.joint else ""
        return f"{place} and diverged at {_amount(run.divergence.time)} s{joint}"
    return place if run.is_complete else f"{place} and went {math.floor(100.0 * run.completed)}% of its path"


def _stretched(run: Recorded) -> NDArray[np.bool_]:
    """Return the ticks at which the arm is fully stretched out from its shoulder, (T,)."""
    if run.reach <= 0.0:
        return np.zeros(len(run), dtype=bool)
    outward = run["pose"][:, :3] - run.shoulder
    distance = np.linalg.norm(outward, axis=1)
    lost = run.view.back(run["u_min"], run["pose"])
    away = np.abs((lost[:, :3] * outward).sum(axis=1)) >= AWAY * distance * np.linalg.norm(lost, axis=1)
    return np.asarray((distance >= STRETCHED * run.reach) & away)


def _needless(run: Recorded) -> str:
    """Return for which share of its time a run was damped far from any singularity, if for the most of it."""
    share = float(np.mean((run["damping"] > 0.0) & (run["condition"] < HARMLESS)))
    way = " (lower damping.below)" if run.damping_below > 0.0 else ""
    return f"damped {100.0 * share:.0f}% of the time at κ below {HARMLESS:g}{way}, " if share > USUAL else ""


def _rates(run: Recorded) -> str:
    """Return the limit on the joint with the largest plain rate, or the largest rate."""
    n = len(run.joints)
    limit = np.array(run.rate_limit or (math.inf,) * n)
    scale = np.where(np.isfinite(limit), limit, 1.0) if np.isfinite(limit).any() else np.ones(n)
    plain, sent = np.abs(run["qdot_plain"]), np.abs(run["qdot_cmd"]).max(axis=0)
    with np.errstate(over="ignore"):  # beyond the least limits, all rates are infinitely hard
        hardest, share = plain / scale, sent / scale
    if not np.isnan(hardest).any():
        tick, j = map(int, np.unravel_index(hardest.argmax(), hardest.shape))
        keepers = _keepers(run, tick, int(np.abs(run["qdot_cmd"][:, j]).argmax()))
        if plain[tick, j] > MORE * sent[j] and keepers:
            return f"{keepers} kept {_name(run.joints[j])}'s commands at {_of_limit(run, j, sent[j])}"
    j = int(share.argmax())
    return f"{_name(run.joints[j])}'s commands peaked at {_of_limit(run, j, sent[j])}"


def _keepers(run: Recorded, *ticks: int) -> str:
    """Return the causes that acted at any of some ticks, in words."""
    status = Status(int(np.bitwise_or.reduce(run.columns["status"][list(ticks)].astype(np.int64))))
    is_damped = any(run["damping"][tick] > 0.0 for tick in ticks)
    words = {**_KEEPERS, Status.DAMPED: "damping" if is_damped else "the inverse's filter"}
    found = [word for one, word in words.items() if one in status]
    return " and ".join(found[:2]) if len(found) < 3 else f"{found[0]}, {found[1]} and others"


def _of_limit(run: Recorded, j: int, rate: float) -> str:
    limit = run.rate_limit[j] if run.rate_limit else math.inf
    of = f" of {_amount(limit)}" if math.isfinite(limit) else ""
    return f"{_amount(rate)}{of} {run.joint_unit(j)}/s"


def _error(card: "Scorecard") -> str:
    parts = [
        f"{_amount(factor * float(card[name].value))} {unit}"
        for name, factor, unit in (
            ("position_error.max", 1e3, "mm"), ("orientation_error.max", math.degrees(1.0), "deg"),
        )
        if name in card
    ]  # fmt: skip
    return f"with at most {' and '.join(parts)} of error"


def _times(card: "Scorecard") -> list[str]:
    """Return the notable events, and how long they lasted, the most serious first."""
    times = {one: float(card[f"status_time.{one.name}"].value) for one in _TIMES}
    return [f"{_TIMES[one]} for {_amount(seconds)} s" for one, seconds in times.items() if seconds > 0.0]


def _plainly(run: Recorded, card: "Scorecard") -> str:
    """Return the largest rate of the plain inverse, if that is more than was commanded."""
    plain, sent = (float(card[f"joint_rate_{kind}.peak"].value) for kind in ("plain", "cmd"))
    return f"; the plain inverse would ask for {_peak(run, card, 'plain')}" if plain > MORE * sent else ""


def _other(run: Recorded, card: "Scorecard") -> str:
    """Return the largest rate that a baseline commanded."""
    is_plain = len(run) and np.allclose(run["qdot_cmd"], run["qdot_plain"], rtol=1e-9, atol=1e-12)
    who = "the plain inverse" if is_plain else "the baseline"
    commanded = f"commanded {_peak(run, card, 'cmd') if len(run) else 'nothing'}"
    if run.divergence:
        return f"; {who} {commanded} and diverged at {_amount(run.divergence.time)} s"
    return f"; {who} {commanded}"


def _peak(run: Recorded, card: "Scorecard", kind: str) -> str:
    """Return the largest rate of a kind, over all joints and ticks, with the unit of its joint."""
    peak, joint = (card[f"joint_rate_{kind}.{name}"].value for name in ("peak", "peak_joint"))
    unit = run.joint_unit(run.joints.index(str(joint))) if joint else "?"
    return f"{_amount(float(peak))} {unit}/s"


def _name(joint: str) -> str:
    name = visible(joint)
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


def _amount(value: float) -> str:
    """Return three digits, or a whole number up to a million with commas; never 0 for a nonzero value."""
    if not math.isfinite(value):
        return "infinite" if value > 0.0 else "unknown"
    if value >= 999.5:
        return f"{value:,.0f}" if value < 1e6 else f"{value:.3g}"
    return f"{value:.3g}" if value >= 1e-3 or value == 0.0 else "less than 0.001"
