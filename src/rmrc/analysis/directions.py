"""Directions that an arm has lost, and joint motions that do not move its task, in words."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rmrc.law.task import RANK_TOLERANCE, Array, Task

# A singular value of this share of the largest is rounding: the direction is lost.
LOST = RANK_TOLERANCE
# Squares of cosines that differ by less, and components of a motion of norm 1 that are less, are rounding.
ROUNDING = 1e-9
# A direction is written with two decimals; parts and components that round to 0.00 are left out.
VISIBLE = 0.005


@dataclass(frozen=True, eq=False)
class Direction:
    """A singular vector, u or v, of A = S_x J S_q without a singular value.

    Attributes:
        words: What it means, in a sentence.
        twist: S_x⁻¹ u of a lost direction, [v; ω] along world axes, 0 in the rows that do not count; else the
            motion of the site by the joint motion, (6,) [m, rad].
        wrench: S_x u of a lost direction, the wrench with Jᵀ F = 0, likewise, (6,) [N, N·m]; else None.
        joint_motion: S_q v, of norm 1 with slides in units of L, (n,) [rad or m]; None if u is lost.
    """

    words: str
    twist: Array
    wrench: Array | None = None
    joint_motion: Array | None = None


def examine(
    task: Task, J: Array, pose: Array, R_world_frame: Array | None = None
) -> tuple[Array, int, tuple[Direction, ...], tuple[Direction, ...]]:
    """Return the singular values, the rank, lost directions, and motions that do not move the task.

    Where several directions are lost, or several motions do not move the task, the ones with the fewest rows
    or joints are returned.

    Args:
        task: The rows that count.
        J: Rows [v; ω] of the site along world axes, (6, n).
        pose: Pose of the site, (7,).
        R_world_frame: Rotation of the frame of the words, (3, 3); None: the world.

    Returns:
        Singular values of A, descending, (k,); the number of those above rounding; and both lists.
    """
    u, sigma, vt = np.linalg.svd(task.matrix(task.turned(J, pose)))
    rank = int(np.count_nonzero(sigma > LOST * sigma[0]))
    R = np.eye(3) if R_world_frame is None else R_world_frame

    def along_world(rows: Array) -> Array:
        whole = np.zeros(6)
        whole[task.rows] = rows
        return task.view.back(whole, pose)

    lost, motions = list[Direction](), list[Direction]()
    for vector in _simple(u[:, rank:]):
        wrench = along_world(vector * task.row_scale)
        words = impossible((wrench.reshape(2, 3) @ R).ravel())
        lost.append(Direction(words, along_world(vector / task.row_scale), wrench))
    for vector in _simple(vt[rank:].T):
        motion = task.joint_scale * vector * np.sign(vector[np.abs(vector) > VISIBLE][0])
        twist = J @ motion
        seen = np.where(np.abs(twist) < ROUNDING, 0.0, twist).reshape(2, 3) @ R
        motions.append(Direction(_still(motion, seen.ravel(), task), twist, joint_motion=motion))
    return sigma, rank, tuple(lost), tuple(motions)


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
    sizes = np.linalg.norm(wrench.reshape(2, 3), axis=1)
    newtons, moments = (f"{float(f'{size:.2g}'):g}" for size in sizes)
    return (
        f"cannot turn about {axis} in place, nor move along {line} without turning; a force along {force} "
        f"with a moment about {moment}, {newtons} N to {moments} N m, needs no torque"
    )


def _still(motion: Array, twist: Array, task: Task) -> str:
    """Return a joint motion that does not move the task, and the motion of the site in its other rows."""
    arm, size = task.arm, np.abs(motion)
    main = np.flatnonzero(size > VISIBLE * size.max())
    shares = motion[main] / motion[main[0]]
    units = [arm.units[i] for i in main]
    verb = "turn" if set(units) == {"rad"} else "move"
    how = f"{verb} {'against each other' if len(main) == 2 and shares[1] < 0.0 else 'together'}"
    mixed = len(set(units)) > 1
    cells = (f"{share:.3g}" + f" {unit}" * mixed for share, unit in zip(shares, units, strict=True))
    ratio = f", {' : '.join(cells)}"
    if len(main) == 1:
        how, ratio = f"{verb}s alone", ""
    along, about = _halves(twist)
    effects = [f"moves along {along}"] * bool(along) + [f"turns about {about}"] * bool(about)
    effect = f"and the site {listed(effects)}" if effects else "without moving the site"
    return f"{listed([arm.joints[i] for i in main])} {how}{ratio}, {effect}"


def _halves(vector: Array) -> tuple[str, str]:
    """Return the directions of both halves of a twist or a wrench in words; "" for one that is negligible."""
    least = VISIBLE * np.linalg.norm(vector)
    first, second = (direction(half) if np.linalg.norm(half) > least else "" for half in vector.reshape(2, 3))
    return first, second


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
