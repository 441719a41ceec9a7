"""The singularities of an arm: directions that it has lost, and the determinant of J as a product.

Directions and joint motions that do not move the task are told in words. The determinant has a factor for
each family of singularities. Each known structure of arms proposes a product. It is kept if it is the
determinant at a few random configurations: what the geometry of an arm makes so at these holds at all
others.

The Jacobian comes by four routes, so that each checks the others. MuJoCo's own comes from the poses of the
bodies at q. Screws and propagation only know the axes at q = 0: one moves screws by a product of
exponentials, the other propagates velocities along frames from link to link. Differences use only poses.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.task import RANK_TOLERANCE, Array, Task
from rmrc.support.spatial import normalize, pose_error, quat_to_matrix
from rmrc.textbook.chains import (
    geometric_from_screws,
    jacobian_by_propagation,
    joint_screw,
    modified_dh_transform,
    product_of_exponentials,
    space_jacobian,
)

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


Place: TypeAlias = Callable[[Array], Array]
"""Returns J of some point of the last link for J of the site."""

# Number of configurations at which a product is compared with the determinant.
SAMPLES = 6
# Shares of the largest value below this are rounding.


@dataclass(frozen=True)
class Rule:
    """One factor of det J as a function of J, and with it a family of singularities.

    Attributes:
        name: shoulder, elbow, boom, pivot, wrist, or arm: the first three joints without a known structure.
        where: Condition under which it vanishes, in words.
        of: The function of J (..., 6, n), rows [v; ω] of the site along world axes; its values are (...).
        power: Its power in the product, 1 or 2.
    """

    name: str
    where: str
    of: Callable[[Array], Any]
    power: int = 1

    @property
    def family(self) -> str:
        """Whether the singularities are at the boundary or in the interior of the workspace, if known."""
        return {"elbow": "boundary", "arm": ""}.get(self.name, "interior")


@dataclass(frozen=True)
class Product:
    """The determinant of an arm's J as a product of factors.

    Attributes:
        rules: The factors; the product contains each to its power.
        largest: The largest magnitude of each at random configurations, (k,).
        sign: Sign of the first, by the order of the rows.
    """

    rules: tuple[Rule, ...]
    largest: Array
    sign: float

    def values(self, J: Array) -> Array:
        """Return the factors, (..., k), at J (..., 6, n)."""
        first, *others = (rule.of(J) for rule in self.rules)
        return np.stack([self.sign * first, *others], axis=-1)


def product(task: Task, columns: Sequence[int] | None = None) -> Product | None:
    """Return det J of the task's rows as a product; None where they are not square or no structure is known.

    Args:
        task: The arm and the rows that count.
        columns: The joints that count; None for all. The others must not move these rows.
    """
    arm = task.arm
    chosen = np.arange(arm.n) if columns is None else np.asarray(columns)
    if len(task.rows) != len(chosen):
        return None
    q = arm.sampled(SAMPLES)
    J = np.stack([arm.jacobian(each)[:, chosen] for each in q])
    dets = np.linalg.det(task.turned(J, np.stack([arm.pose(each) for each in q]))[:, task.rows])
    for rules in _proposals(J, [arm.joints[i] for i in chosen], arm.is_slide[chosen], task.axes):
        values = np.stack([rule.of(J) for rule in rules], axis=-1)
        products = np.prod(values ** [rule.power for rule in rules], axis=1)
        sign = float(np.sign(dets @ products))
        if sign and np.abs(sign * products - dets).max() <= ROUNDING * np.abs(dets).max():
            return Product(rules, np.abs(values).max(axis=0), sign)
    return None


def factors(task: Task, J: Array) -> list[dict[str, Any]]:
    """Return the factors of det J at a configuration; none where `product` has none.

    Args:
        task: The arm and the rows that count.
        J: J at the configuration, rows [v; ω] along world axes, (6, n).

    Returns:
        Name, family, where and power of each, as in `Rule`; the term, which is the name with the power; its
        value [m, m², m³ or 1]; and whether it vanishes. The product of the values, each to its power, is the
        determinant.
    """
    known = product(task)
    if known is None:
        return []
    values = known.values(J)
    vanish = np.abs(values) <= ROUNDING * known.largest
    return [
        {"name": rule.name, "term": rule.name + "²" * (rule.power == 2), "family": rule.family,
         "where": rule.where, "power": rule.power, "value": float(value), "vanishes": bool(zero)}
        for rule, value, zero in zip(known.rules, values, vanish, strict=True)
    ]  # fmt: skip


def _proposals(
    J: Array, joints: Sequence[str], slides: NDArray[np.bool_], axes: Sequence[str]
) -> Iterator[tuple[Rule, ...]]:
    """Yield the factors of the known structures of arms with these rows."""
    turns, n = len({"rx", "ry", "rz"} & set(axes)), len(joints)
    in_plane = f"the axes of {listed(joints[-3:])} lie in one plane"
    wrist = Rule("wrist", in_plane, lambda J: np.linalg.det(J[..., 3:, -3:]))
    if n == 6:
        # A wrist whose axes meet: det J = det J_v(wrist point) · z₄·(z₅ × z₆) [Khatib08].
        at_wrist = partial(_at_meeting, 3)
        for arm in _arm(J, joints, slides, "the wrist point", at_wrist):
            yield (*arm, wrist)
        where = f"{listed(joints[:3])} cannot move the wrist point at will"
        yield Rule("arm", where, lambda J: np.linalg.det(at_wrist(J)[..., :3, :3])), wrist
        # Parallel axes 2 to 4, as of a UR: joint 1 alone moves along them the point where axes 5 and 6 meet.
        meet = f"the axes of {joints[4]} and {joints[5]} meet along the axis of {joints[1]}"
        across = partial(_across, partial(_at_meeting, 4), 1, 0)
        shoulder = Rule("shoulder", f"{joints[0]} cannot move where {meet}", across)
        in_line = f"{listed(joints[1:4])} are in line"
        yield shoulder, Rule("elbow", in_line, partial(_area, partial(_at_axis, 1, 3), 1, 1, 2)), wrist
    elif n == 3 and turns == 3:
        yield (wrist,)
    elif n == 3 and not turns:
        yield from _arm(J, joints, slides, "the site", _at_site)
    elif n == 2 and slides[1]:
        where = f"{joints[1]} has the site beside the axis of {joints[0]}"
        yield (Rule("pivot", where, partial(_area, _at_site, 0, 0, 1)),)
    elif n == 2 or (n == 3 and not slides.any()):
        place = _at_site if n == 2 else partial(_at_axis, 0, 2)
        yield (Rule("elbow", f"the links beside {joints[1]} are in line", partial(_area, place, 0, 0, 1)),)


def _arm(
    J: Array, joints: Sequence[str], slides: NDArray[np.bool_], point: str, place: Place
) -> Iterator[tuple[Rule, ...]]:
    """Yield factors of three joints that move a point.

    Where two of three columns stay normal to an axis a, det [c₁ c₂ c₃] = ±(a·c₁) a·(c₂ × c₃): shoulder and
    elbow, or shoulder and boom. Where the third is along a, the second factor is alone.

    Args:
        J: J of the site at some configurations, (N, 6, n).
        joints: Their names.
        slides: Whether each slides.
        point: The point in words.
        place: Returns J of the point.
    """
    for hinge in (joint for joint in range(3) if not slides[joint]):
        for single in range(3):
            i, j = sorted({0, 1, 2} - {single}, key=lambda joint: not slides[joint])
            if any(np.abs(_across(place, hinge, joint, J)).max() > ROUNDING for joint in (i, j)):
                continue
            where = f"{joints[single]} cannot move {point} out of the arm's plane"
            shoulder = Rule("shoulder", where, partial(_across, place, hinge, single))
            area = partial(_area, place, hinge, i, j)
            if slides[i]:
                where = f"{joints[i]} has drawn {point} beside the axis of {joints[j]}"
                inner = Rule("boom", where, area)
                where = f"{joints[i]} is parallel to the axis of {joints[single]}"
                tilted = Rule("shoulder", where, partial(_tilt, hinge, single, i))
                yield tilted, Rule("boom", inner.where, area, 2)
            else:
                inner = Rule("elbow", f"{point}, {joints[i]} and {joints[j]} are in line", area)
            yield (inner,)
            yield shoulder, inner


def _across(place: Place, hinge: int, joint: int, J: Array) -> Any:
    """Return a·v, the velocity of a place by a joint, along the axis a of a hinge."""
    return (J[..., 3:, hinge] * place(J)[..., :3, joint]).sum(axis=-1)


def _area(place: Place, hinge: int, i: int, j: int, J: Array) -> Any:
    """Return a·(v₁ × v₂), the velocities of a place by two joints, a the axis of a hinge."""
    v = place(J)[..., :3, :]
    return (J[..., 3:, hinge] * np.cross(v[..., i], v[..., j])).sum(axis=-1)


def _tilt(hinge: int, joint: int, slide: int, J: Array) -> Any:
    """Return a·(z × v), a and z the axes of two hinges, v the direction of a slide."""
    return (J[..., 3:, hinge] * np.cross(J[..., 3:, joint], J[..., :3, slide])).sum(axis=-1)


def _at_site(J: Array) -> Array:
    return J


def _at_axis(hinge: int, joint: int, J: Array) -> Array:
    """Return J on the axis of a joint, which is parallel to that of a hinge."""
    return _moved(J, np.cross(J[..., 3:, hinge], J[..., :3, joint]))


def _at_meeting(first: int, J: Array) -> Array:
    """Return J where the axes of the joints from `first` on meet, or are nearest to it."""
    axes, v = np.swapaxes(J[..., 3:, first:], -1, -2), np.swapaxes(J[..., :3, first:], -1, -2)
    # The velocity of that point is zero: v + ω × p = 0.
    rows = np.cross(axes[..., None, :], np.eye(3)).swapaxes(-1, -2).reshape(*J.shape[:-2], -1, 3)
    return _moved(J, -(np.linalg.pinv(rows) @ v.reshape(*J.shape[:-2], -1, 1))[..., 0])


def _moved(J: Array, point: Array) -> Array:
    """Return J of a point of the last link, (..., 3) from the site."""
    v = J[..., :3, :] + np.cross(J[..., 3:, :], point[..., None], axis=-2)
    return np.concatenate([v, J[..., 3:, :]], axis=-2)


# Truncation, step²/6 times a third derivative, and rounding over the step are both about 1e-11 for an arm of
# meters: below 1e-8, the tolerance for a correct Jacobian.
DIFFERENCE_STEP = 1e-5


def jacobians(arm: Arm, q: Sequence[float] | Array) -> dict[str, Array]:
    """Return J by each route, rows [v; ω] of the site along world axes, (6, n) each.

    By screws: the product of exponentials of the joint screws at q = 0 [Selig92, §6.6] [Lynch17, §5.1.1]. By
    differences: central differences of the pose, to about 1e-10 of the arm's size.

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
    """
    q = np.asarray(q, dtype=np.float64)
    points, at_zero = _at_zero(arm)
    screws, moved = joint_screw(arm.chain.axis, points, arm.chain.pitch), arm.chain.positions(q)
    tip = product_of_exponentials(screws, moved, at_zero)[:3, 3]
    steps = DIFFERENCE_STEP * np.eye(arm.n)
    columns = [pose_error(arm.pose(q + step), arm.pose(q - step)) for step in steps]
    return {
        "mujoco": arm.jacobian(q),
        "screws": arm.chain.gathered(geometric_from_screws(space_jacobian(screws, moved), tip), arm.n),
        "propagation": arm.chain.gathered(jacobian_by_propagation(*link_transforms(arm, q)), arm.n),
        "differences": np.array(columns).T / (2.0 * DIFFERENCE_STEP),
    }


def link_transforms(arm: Arm, q: Sequence[float] | Array) -> tuple[Array, Array, Array]:
    """Return the link transforms of the arm, for `rmrc.textbook.chains`.

    Frame {i} is fixed in link i, its z along axis i of the chain; at q = 0 its origin is MuJoCo's anchor. It
    moves as a modified DH link of no length and twist: q turns about z, or slides along it.

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].

    Returns:
        T_i-1_i, (ℓ, 4, 4); the pitch of each axis, (ℓ,) [m/rad]; and T_n_site, (4, 4).
    """
    q, z, pitch = arm.chain.positions(q), arm.chain.axis, arm.chain.pitch
    still = np.tile(np.eye(4), (len(q) + 2, 1, 1))
    x = normalize(np.cross(np.eye(3)[np.argmin(np.abs(z), axis=-1)], z))
    still[1:-1, :3, :3] = np.stack([x, np.cross(z, x), z], axis=-1)
    still[1:-1, :3, 3], still[-1] = _at_zero(arm)
    steps = np.linalg.inv(still[:-1]) @ still[1:]
    slides, none = np.isinf(pitch), np.zeros(len(q))
    advance = np.where(slides, 1.0, np.where(slides, 0.0, pitch)) * q
    return steps[:-1] @ modified_dh_transform(none, none, advance, np.where(slides, 0.0, q)), pitch, steps[-1]


def _at_zero(arm: Arm) -> tuple[Array, Array]:
    """Return a point on each axis at q = 0, (ℓ, 3) [m], and the site's transform there, (4, 4)."""
    points, tip = np.cumsum(arm.chain.step, axis=0), np.eye(4)
    tip[:3, :3], tip[:3, 3] = quat_to_matrix(arm.chain.tip_quat), points[-1] + arm.chain.tip_step
    return points, tip
