"""Motions through the nearest singularity and back, and their faults on the ideal plant."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rmrc.analysis.scaling import CLEAR, Nearest, Scales, clear_of_singularities, nearest_singularity
from rmrc.analysis.trial import touching
from rmrc.arm.geometry import tidy
from rmrc.arm.inventory import Contact
from rmrc.law.task import Array
from rmrc.results.run import Run
from rmrc.support.spatial import exp_rotation, log_rotation, quat_conjugate, quat_multiply

# How far behind the singularity a motion through it turns back, as a share of the distance to it.
BEYOND = 0.5
# Distance at which the motion passes it [rad, or of the arm's size]: an exact crossing asks nothing of the
# lost direction, and hides the problem.
BESIDE = 0.02
# Shares of the way from the singularity to the start at which a motion begins; the next if one fails.
NEARER = (1.0, 0.5, 0.25)
# Length of a motion without a singularity [of the arm's size, or rad].
SHORT = 0.2
# Smaller values relative to the arm's size, or in radians, are rounding.
NOTHING = 1e-5
# Preferred motions: largest share of time at rate limits; largest error, relative to the length or in rad;
# and largest duration [s].
LIMITED, ASTRAY, LONG = 0.05, 0.1, 40.0
# Faults that a scenario expects not to be.
MET, WITHIN = "the arm touches something", "bodies penetrate each other at the start"


@dataclass(frozen=True, eq=False)
class Move:
    """The start, turning point and speed of a scenario's motion.

    Attributes:
        start: Joint positions, (n,).
        is_home: Whether they are those of `home`.
        how: `through`, `towards`, or `aside` without a singularity.
        by: Displacement of the site on the way out, (3,) [m].
        turn: Rotation vector on the way out, (3,) [rad].
        epsilon: σ_min below which the law damps.
        nearest: The singularity.
        rank: Whether each possible fault applies, the worst first: the least motion is the best.
        faults: Those that apply.
        contacts: Parts of the arm that touch each other or something else.
    """

    start: Array
    is_home: bool
    how: str
    by: Array
    turn: Array
    epsilon: float
    nearest: Nearest
    rank: tuple[bool, ...] = ()
    faults: tuple[str, ...] = ()
    contacts: tuple[Contact, ...] = ()


def moves(scales: Scales) -> Iterator[Move]:
    """Yield motions, the most instructive first."""
    task, arm, unit = scales.task, scales.task.arm, scales.size / scales.task.length
    start, is_home = begin(scales)
    nearest = nearest_singularity(scales, start)
    for share in NEARER:
        q = start if share == 1.0 else np.round(nearest.q + share * (start - nearest.q), 3)
        if scales.sigma_at(q) < scales.below / CLEAR:
            continue
        first, at = arm.pose(q), is_home and share == 1.0
        beyond = np.clip(nearest.q + BEYOND * (nearest.q - q), scales.lower, scales.upper)
        for how, end, off in (
            ("through", beyond, BESIDE * unit * nearest.twist),
            ("towards", nearest.q, np.zeros(6)),
        ):
            last = arm.pose(end)
            turned = quat_multiply(exp_rotation(off[3:]), last[3:])
            turn = log_rotation(quat_multiply(turned, quat_conjugate(first[3:])))
            yield _move(scales, nearest, q, at, how, last[:3] - first[:3] + off[:3], turn)
    best = np.zeros(6)  # the direction in which the arm moves best
    best[task.rows] = np.linalg.svd(task.matrix(arm.jacobian(start)))[0][:, 0] / task.row_scale
    for sign in (SHORT * unit, -SHORT * unit):
        yield _move(scales, nearest, start, is_home, "aside", sign * best[:3], sign * best[3:])


def begin(scales: Scales) -> tuple[Array, bool]:
    """Return the start of a scenario, and whether it is `home`; otherwise the nearest clear configuration."""
    arm = scales.task.arm
    home = arm.configuration("home")[arm.wiring.qpos]
    lower, upper = arm.position_limit.T
    if (home >= lower).all() and (home <= upper).all() and scales.sigma_at(home) >= scales.below:
        return home, True
    near = np.clip(home, scales.lower, scales.upper)
    clear = near if scales.sigma_at(near) >= scales.below else clear_of_singularities(scales, near)
    return np.round(clear, 3), False


def _move(
    scales: Scales, nearest: Nearest, start: Array, is_home: bool, how: str, by: Array, turn: Array
) -> Move:
    rows = set(scales.task.rows.tolist())
    # a single rotational row is turned about alone; two of them do not commute, and use all three
    rows |= {3, 4, 5} if len(rows & {3, 4, 5}) > 1 else set()
    way = np.concatenate([by, turn])
    counts = np.abs(way) > NOTHING * np.repeat([scales.size, 1.0], 3)
    way = np.array([tidy(x, 4) if row in rows and counts[row] else 0.0 for row, x in enumerate(way)])
    epsilon = tidy(min(scales.below, scales.sigma_at(start) / CLEAR))
    return Move(start, is_home, how, way[:3], way[3:], epsilon, nearest)


def judged(scales: Scales, move: Move, run: Run) -> Move:
    """Return a motion with its faults in a run on the ideal plant."""
    card, arm = run.scorecard, scales.task.arm
    at_start = touching(arm, arm.configuration(move.start)[None])
    known = {each.geoms for each in at_start}
    later = [each for each in touching(arm, run["qpos"]) if each.geoms not in known]

    def value(name: str) -> float:
        return float(card[name].value) if name in card else 0.0

    astray = max(value("position_error.max") / scales.size, value("orientation_error.max"))
    faults = {
        "a joint reaches its position limit": value("status_time.POSITION_LIMITED") > 0.0,
        MET: bool(later),
        "the arm stands still": value("status_time.STUCK") > 0.0,
        "the error is large": astray > ASTRAY,
        "rates are limited for a while": value("status_time.RATE_LIMITED") > LIMITED * value("duration"),
        "sigma_min stays above half of `below`": move.how != "aside"
        and value("sigma.min") >= 0.5 * move.epsilon,
        "it meets no singularity": move.how == "aside",
        "it takes long": value("duration") > LONG,
        WITHIN: bool(at_start),
    }
    names = tuple(name for name, applies in faults.items() if applies)
    return replace(move, rank=tuple(faults.values()), faults=names, contacts=(*at_start, *later))
