"""Directions that an arm has lost or nearly lost, joint motions that do not move its task, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rmrc.law.law import SINGULAR_BELOW
from rmrc.law.task import RANK_TOLERANCE, Array, Task

# A singular value of this share of the largest is rounding: the direction is lost, not nearly lost.
LOST = RANK_TOLERANCE
# A direction whose singular value is this share of the largest is nearly lost: the law's SINGULAR.
SLOW = SINGULAR_BELOW
# Squares of cosines that differ by less, and components of a motion of norm 1 that are less, are rounding.
ROUNDING = 1e-9
# A direction is written with two decimals; parts and components that round to 0.00 are left out.
VISIBLE = 0.005


@dataclass(frozen=True, eq=False)
class Direction:
    """Singular vectors u and v of A = S_x J S_q with one singular value.

    Attributes:
        words: What they mean, in a sentence.
        sigma: The singular value; 0 for a lost direction and for a self-motion.
        twist: S_x⁻¹ u of a lost direction, [v; ω] along world axes, 0 in the rows that do not count; of the
            others the motion of the site by the joint motion, (6,) [m, rad].
        wrench: S_x u of a lost direction, the wrench with Jᵀ F = 0, likewise, (6,) [N, N·m]; else None.
        joint_motion: S_q v, of norm 1 with slides in units of L, (n,) [rad or m]; None if it is lost.
    """

    words: str
    sigma: float
    twist: Array
    wrench: Array | None = None
    joint_motion: Array | None = None


def rank_of(sigma: Array) -> int:
    """Return the number of singular values above rounding relative to the largest."""
    return int(np.count_nonzero(sigma > LOST * sigma[0])) if sigma[0] > 0.0 else 0


def examine(
    task: Task, J: Array, pose: Array, R_world_frame: Array | None = None
) -> tuple[Array, tuple[Direction, ...], tuple[Direction, ...], tuple[Direction, ...]]:
    """Return the singular values, lost and nearly lost directions, and motions that do not move the task.

    All come from one decomposition: LAPACK's values with and without vectors differ by rounding.

    Where several directions are lost, or several motions do not move the task, the ones with the fewest rows
    or joints are returned.

    Args:
        task: The rows that count.
        J: Rows [v; ω] of the site along world axes, (6, n).
        pose: Pose of the site, (7,).
        R_world_frame: Rotation of the frame of the words, (3, 3); None: the world.

    Returns:
        Singular values of A, descending, (k,), and the three lists.
    """
    u, sigma, vt = (np.asarray(part, np.float64) for part in np.linalg.svd(task.matrix(task.turned(J, pose))))
    rank = rank_of(sigma)

    def seen(vector: Array) -> Array:
        return vector if R_world_frame is None else (vector.reshape(2, 3) @ R_world_frame).ravel()

    def embedded(rows: Array) -> Array:
        whole = np.zeros(6)
        whole[task.rows] = rows
        return task.view.back(whole, pose)

    lost, slow, standing = list[Direction](), list[Direction](), list[Direction]()
    for direction in _simple(u[:, rank:]):
        wrench = embedded(direction * task.row_scale)
        lost.append(Direction(impossible(seen(wrench)), 0.0, embedded(direction / task.row_scale), wrench))
    for i in np.flatnonzero(sigma[:rank] <= SLOW * sigma[0]):
        twist = embedded(sigma[i] * u[:, i] / task.row_scale)
        sign = np.sign(twist[np.argmax(np.abs(twist))])
        twist, motion = sign * twist, sign * task.joint_scale * vt[i]
        slow.append(Direction(_costly(seen(twist), motion, task), sigma[i], twist, joint_motion=motion))
    for still in _simple(vt[rank:].T):
        motion = task.joint_scale * still * np.sign(still[np.abs(still) > VISIBLE][0])
        twist = J @ motion
        words = _unseen(seen(np.where(np.abs(twist) < ROUNDING, 0.0, twist)), motion, task)
        standing.append(Direction(words, 0.0, twist, joint_motion=motion))
    return sigma, tuple(lost), tuple(slow), tuple(standing)


def _simple(basis: Array) -> list[Array]:
    """Return unit vectors that span the same space as a basis, with as many zeros as possible.

    As many coordinates are chosen as there are vectors: in turn, the one whose axis is nearest to the rest of
    the space. Each vector has one of them, and the coordinates that were not chosen.
    """
    remainder, chosen = basis @ basis.T, []
    for _ in range(basis.shape[1]):
        nearness = np.diag(remainder)
        # The first of those that are equally near: rounding must not choose.
        chosen.append(int(np.argmax(nearness >= nearness.max() - ROUNDING)))
        vector = remainder[:, chosen[-1]] / np.sqrt(nearness[chosen[-1]])
        remainder = remainder - np.outer(vector, vector)
    vectors = basis @ np.linalg.inv(basis[sorted(chosen)])
    return list((vectors / np.linalg.norm(vectors, axis=0)).T)


# Words ------------------------------------------------------------------------------------------


def impossible(wrench: Array) -> str:
    """Return the impossible motion of an arm at a singularity, and the wrench that costs it nothing there.

    Every motion has f·v + n·ω = 0. Where both f and n count, it cannot turn about n while v = 0, nor move
    along f while ω = 0.

    Args:
        wrench: The wrench with Jᵀ F = 0, (6,) [N, N·m].

    >>> impossible(np.eye(6)[0])
    'cannot move along x; a force along x needs no torque'
    """
    force, moment = _halves(wrench)
    if not moment:
        return f"cannot move along {force}; a force along {force} needs no torque"
    if not force:
        return f"cannot turn about {moment}; a moment about {moment} needs no torque"
    line, axis = force.removeprefix("-"), moment.removeprefix("-")
    sizes = " N to ".join(_digits(np.linalg.norm(half)) for half in (wrench[:3], wrench[3:]))
    return (
        f"cannot turn about {axis} in place, nor move along {line} without turning; a force along {force} "
        f"with a moment about {moment}, {sizes} N m, needs no torque"
    )


def _costly(twist: Array, motion: Array, task: Task) -> str:
    """Return the joint rates that a nearly lost direction takes: 1 m/s along x takes -500 rad/s of elbow."""
    along, about = _halves(twist)
    size, turning = np.linalg.norm(twist[:3] if along else twist[3:]), np.linalg.norm(twist[3:])
    what = f"1 m/s along {along}" if along else f"1 rad/s about {about}"
    what += f" with {_digits(turning / size)} rad/s about {about}" if along and about else ""
    rates = [
        f"{_digits(motion[i] / size)} {task.arm.units[i]}/s of {task.arm.joints[i]}" for i in _main(motion)
    ]
    return f"{what} takes {listed(rates)}"


def _unseen(twist: Array, motion: Array, task: Task) -> str:
    """Return a joint motion that does not move the task, and the motion of the site in its other rows."""
    main, arm = _main(motion), task.arm
    units = [arm.units[i] for i in main]
    mixed = len(set(units)) > 1
    ratio = " : ".join(
        f"{motion[i] / motion[main[0]]:.3g}" + f" {arm.units[i]}" * mixed for i in main if len(main) > 1
    )
    how = (
        "alone"
        if not ratio
        else "against each other"
        if ratio.startswith("1 : -") and len(main) == 2
        else "together"
    )
    verb = ("turn" if set(units) == {"rad"} else "move") + "s" * (not ratio)
    also = [
        f"{word} {part}"
        for word, part in zip(("moves along", "turns about"), _halves(twist), strict=True)
        if part
    ]
    effect = f"and the site {listed(also)}" if also else "without moving the site"
    return ", ".join(filter(None, [f"{listed([arm.joints[i] for i in main])} {verb} {how}", ratio, effect]))


def _halves(vector: Array) -> tuple[str, str]:
    """Return the directions of both halves of a twist or a wrench in words; "" for one that is negligible."""
    least = VISIBLE * np.linalg.norm(vector)
    force, moment = (
        direction(half) if np.linalg.norm(half) > least else "" for half in (vector[:3], vector[3:])
    )
    return force, moment


def _main(motion: Array) -> list[int]:
    """Return the joints that contribute visibly to a motion."""
    return np.flatnonzero(np.abs(motion) > VISIBLE * np.abs(motion).max()).tolist()


def direction(vector: Array) -> str:
    """Return a direction in words.

    Args:
        vector: Vector of any length but 0, (3,).

    >>> direction(np.array([0.0, -2.0, 0.0])), direction(np.array([1.0, 1.0, 0.0]))
    ('-y', '(0.71, 0.71, 0)')
    """
    unit = np.round(vector / np.linalg.norm(vector), 2) + 0.0
    if np.count_nonzero(unit) == 1:
        return f"{'-' * bool(unit.min() < 0.0)}{'xyz'[np.argmax(np.abs(unit))]}"
    return f"({', '.join(f'{component:g}' for component in unit)})"


def listed(words: Sequence[str]) -> str:
    """Return words as in a sentence.

    >>> listed(["x"]), listed(["x", "y", "rz"])
    ('x', 'x, y and rz')
    """
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def _digits(value: Any) -> str:
    """Return two digits, to keep sentences short."""
    return f"{float(f'{value:.2g}'):g}"
