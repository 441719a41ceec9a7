"""Actuator torques and link loads of an arm at rest under a wrench, and the wrenches that need no torque.

The wrench is the one that acts *on* the arm. Jᵀ F is equivalent to it, −Jᵀ F balances it, see
`rmrc.textbook.statics`. The load on a link is what acts on all bodies that its joint moves: the wrench, and
their weight if the actuators bear it. Found without any Jacobian, the loads are the second route to the same
torques.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm import Arm
from rmrc.arm.adapting import is_behind
from rmrc.arm.wiring import SLIDE
from rmrc.law.task import RANK_TOLERANCE, SAMPLES, Task, choose
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.spatial import AXES, quat_from_axis_angle, quat_to_matrix, twist_transform, wrench_transform
from rmrc.textbook.screws import joint_screw, product_of_exponentials
from rmrc.textbook.statics import joint_torques

Array = NDArray[np.float64]

# A result below this share of its summands is rounding, and becomes 0.
ROUNDING = 1e-12
# A direction is nearly free if it costs less than a tenth of the most expensive one.
NEARLY = 0.1
# Rows of a wrench: all of it, forces without a moment, moments without a force.
KINDS = {"wrench": range(6), "force": range(3), "moment": range(3, 6)}


@dataclass(frozen=True, eq=False)
class Balance:
    """An arm at rest under a wrench, and under its weight if the actuators bear that.

    Attributes:
        arm: The arm.
        q: Joint positions, (n,).
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        bears_weight: Whether the actuators support the arm's weight; otherwise it is compensated.
        equivalent: Jᵀ F, (n,): with it the site presses on the world with F [N·m or N].
        equilibrium: −Jᵀ F, (n,): with it the arm holds still while F acts on it.
        gravity: Actuator torques against gravity, (n,); 0 if gravity is compensated.
        springs: Actuator torques against springs of the joints, (n,).
        torque: Actuator torques against all of them, (n,).
        size: The largest torque if nothing canceled.
        margin: Margin to each torque limit, (n,): negative where it is exceeded by more than rounding.
        exceeded: Names of those joints.
        frames: T_0_i of the link behind each axis of the chain, (ℓ, 4, 4), as in `link_frames`.
        reaction: [f; n] that each link receives from the one before, at the origin and along the axes of its
            frame, (ℓ, 6) [N, N·m]: of the wrench, and of the weight if the actuators bear it.
        reaction_world: The same along world axes, at the same points.
        driven: Its component along each axis, (ℓ,): the actuator provides it, with the joint's spring, or the
            coupling of a follower. It pushes along a slide, and turns a hinge or the hinge of a screw.
        structure: The reactions without it: the load of bearings and links, (ℓ, 6). The nut of a screw takes
            its share of a thrust as a moment.
        disagreement: Largest difference between the two routes to the torques against wrench and weight.
    """

    arm: Arm
    q: Array
    wrench: Array
    bears_weight: bool
    equivalent: Array
    equilibrium: Array
    gravity: Array
    springs: Array
    torque: Array
    size: float
    margin: Array
    exceeded: tuple[str, ...]
    frames: Array
    reaction: Array
    reaction_world: Array
    driven: Array
    structure: Array
    disagreement: float


def without_rounding(values: Array, size: float) -> Array:
    """Return sums of terms of some size, 0 where they are rounding."""
    return np.where(np.abs(values) <= ROUNDING * size, 0.0, values)


def balance(arm: Arm, q: ArrayLike, wrench: ArrayLike, gravity: bool = False) -> Balance:
    """Return actuator torques and link loads of an arm at rest while a wrench acts on it.

    τ = −Jᵀ F by MuJoCo's Jacobian, and by forces from link to link [Craig05, §5.9, §5.10].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        gravity: Whether the actuators support the arm's weight; otherwise it is compensated.
    """
    q, wrench = np.asarray(q, dtype=np.float64), np.asarray(wrench, dtype=np.float64)
    J, frames, (weight, springs) = arm.jacobian(q), link_frames(arm, q), arm.rest_torques(q)
    equivalent, weight = joint_torques(J, wrench), weight * gravity
    levers, acts = (np.linalg.norm(each.reshape(2, 3, -1), axis=1) for each in (J, wrench))
    size = float(((levers * acts).sum(axis=0) + np.abs(weight) + np.abs(springs)).max())
    torque = without_rounding(weight + springs - equivalent, size)
    margin = without_rounding(arm.torque_limit - np.abs(torque), size)
    loads, driven, propagated = _loads(arm, q, wrench, arm.weights * gravity, frames[:, :3, 3])
    largest, reaction = np.abs(loads).max(), (loads @ frames[:, :3, :3]).reshape(-1, 6)
    structure = reaction.copy()
    structure[np.arange(len(driven)), np.where(np.isinf(arm.chain.pitch), 2, 5)] -= driven
    return Balance(
        arm=arm, q=q, wrench=wrench, bears_weight=gravity, size=size, frames=frames,
        equivalent=without_rounding(equivalent, size), equilibrium=without_rounding(-equivalent, size),
        gravity=without_rounding(weight, size), springs=without_rounding(springs, size),
        torque=torque, margin=margin, exceeded=tuple(np.array(arm.joints)[margin < 0.0].tolist()),
        reaction=without_rounding(reaction, largest), structure=without_rounding(structure, largest),
        reaction_world=without_rounding(loads.reshape(-1, 6), largest),
        driven=without_rounding(driven, largest),
        disagreement=float(np.abs(weight - equivalent - propagated).max()),
    )  # fmt: skip


def _loads(arm: Arm, q: Array, wrench: Array, weights: Array, origins: Array) -> tuple[Array, Array, Array]:
    """Return the loads on links at origins, (ℓ, 2, 3), along axes, (ℓ,), and of actuators, (n,).

    Both halves of a screw have one axis, and bodies may hang on the first half alone: the link is all that
    the first moves, and each half gives its own component.
    """
    model, wiring, data = arm.model, arm.wiring, arm.data_at(arm.configuration(q))
    site, acts = data.site_xpos[wiring.site], wrench.reshape(2, 3)
    force, moment = np.zeros((2, model.njnt, 3))  # about the world's origin
    for joint in arm.others.own:
        behind = is_behind(model, int(model.jnt_bodyid[joint]))
        weight, borne = weights[joint] * behind[:, None], acts * behind[wiring.body]
        force[joint] = -borne[0] - weight.sum(axis=0)
        moment[joint] = -borne[1] - np.cross(site, borne[0]) - np.cross(data.xipos, weight).sum(axis=0)
    turning = moment - np.cross(data.xanchor, force)
    along = (data.xaxis * np.where(model.jnt_type[:, None] == SLIDE, force, turning)).sum(axis=1)
    first, driven, axes = wiring.axis.copy(), along[wiring.axis], wiring.axis.tolist()
    for follower, joint in zip(arm.followers, wiring.follower_joint, strict=True):
        if follower.pitch:
            axis = axes.index(wiring.joint[follower.leader])
            first[axis], driven[axis] = min(first[axis], joint), driven[axis] + follower.ratio * along[joint]
    loads = np.stack([force[first], moment[first] - np.cross(origins, force[first])], axis=1)
    return loads, driven, along[model.dof_jntid] @ arm.motion


def link_frames(arm: Arm, q: ArrayLike) -> Array:
    """Return the frame of each link, T_0_i (ℓ, 4, 4), at joint positions.

    Each has its origin on an axis of the chain and z along it; with all joints at 0 its axes are the world's,
    turned the shortest way that brings z there. They come from the product of exponentials, which only uses
    the arm's geometry at 0 from MuJoCo [Lynch17, §4.1].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
    """
    chain = arm.chain
    x, y, z = chain.axis.T
    across = np.hypot(x, y)
    normal = np.where(across > 0.0, [-y, x, np.zeros_like(z)], [[1.0], [0.0], [0.0]]).T
    at_zero = np.tile(np.eye(4), (len(z), 1, 1))
    at_zero[:, :3, :3] = quat_to_matrix(quat_from_axis_angle(normal, np.arctan2(across, z)))
    at_zero[:, :3, 3] = np.cumsum(chain.step, axis=0)
    screws, moved = joint_screw(chain.axis, at_zero[:, :3, 3], chain.pitch), chain.positions(q)
    frames = (product_of_exponentials(screws[: i + 1], moved[: i + 1], T) for i, T in enumerate(at_zero))
    return np.array(list(frames))


def elsewhere(arm: Arm, q: ArrayLike, wrench: ArrayLike, site: str) -> dict[str, Any]:
    """Return a wrench as seen at another site of the same body: it does the same work [Craig05, §5.11].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] at the controlled site {B}, along world axes, (6,) [N, N·m].
        site: Name of the other site {A}.

    Returns:
        site: Name of {A}.
        wrench: [f; n] at the origin and along the axes of {A}, (6,) [N, N·m].
        force_transform: ᴬT_f,B = (ᴮT_v,A)ᵀ: wrench_a = ᴬT_f,B wrench_b, (6, 6).
        velocity_transform: ᴬT_v,B: twist_a = ᴬT_v,B twist_b, (6, 6).

    Raises:
        QuestionError: There is no such site, or another body carries it.
    """
    model, q = arm.model, np.asarray(q, dtype=np.float64)
    # Bodies that are welded together move as one.
    body = {name: int(model.body_weldid[model.site(name).bodyid[0]]) for name in arm.sites}
    alike = [name for name in arm.sites if body[name] == body[arm.site]]
    if site not in alike:
        unknown = f"is not a site of {arm.path}{did_you_mean(site, alike)}"
        what = "is on another body" if site in body else unknown
        raise QuestionError(f'--at: "{site}" {what}; sites that move with "{arm.site}": {", ".join(alike)}')
    here, there = arm.pose(q), arm.pose(q, site)
    R_b, R_a = quat_to_matrix(here[3:]), quat_to_matrix(there[3:])
    R_a_b, p_a_b = R_a.T @ R_b, R_a.T @ (here[:3] - there[:3])
    force_transform, velocity_transform = (
        without_rounding(transform(R_a_b, p_a_b), 1.0) for transform in (wrench_transform, twist_transform)
    )
    at_a = force_transform @ (np.reshape(wrench, (2, 3)) @ R_b).ravel()
    return {
        "site": site, "wrench": without_rounding(at_a, np.abs(at_a).max()),
        "force_transform": force_transform, "velocity_transform": velocity_transform,
    }  # fmt: skip


# Wrenches that need no torque --------------------------------------------------------------------


def wrench_costs(arm: Arm, q: ArrayLike, length: float | None = None) -> dict[str, dict[str, Any]]:
    """Return the costs of wrenches, forces alone and moments alone for the actuators, and the free ones.

    |S_q Jᵀ F| = σ_i for S_x⁻¹ F = u_i, the left singular vectors of A = S_x J S_q. The links alone carry a
    force along a lost direction, and a force along a nearly lost one can be 1/σ times as large per unit of
    torque [Khatib08] [Yoshikawa85].

    The rank of J almost everywhere separates directions that are free at almost every configuration, because
    the arm has too few joints, from those that are free here alone.

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        length: Characteristic length L [m]: a force of 1/L N is as large as a moment of 1 N·m; None: that of
            the arm.

    Returns:
        For `wrench`, `force` and `moment`:

        directions: Orthogonal wrenches of norm 1, with meters and radians made comparable by the length, the
            cheapest first. Each has `wrench`, [f; n] at the site along world axes, (6,); `words`; `sigma`,
            the norm of the torques that balance it; `amplification`, 1/σ, infinite where it costs nothing;
            and `costs`, in words.
        free: Number of them that cost nothing here.
        free_anywhere: Number that cost nothing at almost every configuration, perhaps in other directions.
        free_only_here: Number that cost nothing here only; 0 where J has its full rank.
    """
    here = np.asarray(q, dtype=np.float64)
    jacobians = np.array([arm.jacobian(each) for each in (here, *arm.sampled(SAMPLES))])
    return {
        name: _costs(choose(arm, [AXES[row] for row in rows], length), jacobians)
        for name, rows in KINDS.items()
    }


def _costs(task: Task, jacobians: Array) -> dict[str, Any]:
    """Return the costs at the first of many configurations, whose Jacobians are (N, 6, n)."""
    scaled = task.matrix(jacobians)
    floor = RANK_TOLERANCE * float(np.linalg.norm(scaled, 2, axis=(1, 2)).max())
    u, sigma, _ = np.linalg.svd(scaled[0])
    sigma = np.pad(sigma, (0, len(u) - len(sigma)))
    # A direction that is free at all configurations is free for all of their columns.
    v, sizes, _ = np.linalg.svd(np.concatenate(list(scaled), axis=1), full_matrices=False)
    constant, free = v[:, sizes <= floor], u[:, sigma <= floor]
    free_here, free_anywhere = free.shape[1], len(u) - task.rank
    word = "nothing; elsewhere another" if free_here == free_anywhere else "nothing: singular"
    always = constant @ constant.T
    directions = [_direction(task, each, 0.0, "nothing, anywhere") for each in _readable(always)]
    directions += [_direction(task, each, 0.0, word) for each in _readable(free @ free.T - always)]
    for each, value in zip(u.T[::-1], sigma[::-1], strict=True):
        if value > floor:
            word = "nearly nothing" if value < NEARLY * sigma[0] else "torque"
            directions.append(_direction(task, each, float(value), word))
    return {
        "free": free_here, "free_anywhere": free_anywhere, "free_only_here": free_here - free_anywhere,
        "directions": directions,
    }  # fmt: skip


def _direction(task: Task, scaled: Array, sigma: float, costs: str) -> dict[str, Any]:
    """Return a direction with F = S_x u as all six rows, its largest component positive, without rounding."""
    wrench = np.zeros(6)
    wrench[task.rows] = task.row_scale * np.where(np.abs(scaled) < RANK_TOLERANCE, 0.0, scaled)
    wrench = wrench * np.sign(wrench[np.argmax(np.round(np.abs(wrench), 9))]) + 0.0
    return {
        "wrench": wrench, "words": _in_words(*wrench.reshape(2, 3)), "sigma": sigma,
        "amplification": 1.0 / sigma if sigma > 0.0 else np.inf, "costs": costs,
    }  # fmt: skip


def _readable(projector: Array) -> list[Array]:
    """Return an orthonormal basis, (m,) each, of a space that is given by its projector, (m, m).

    It is along axes where possible: the axis nearest to the space is projected into it, and that direction is
    removed, until none remains.
    """
    basis: list[Array] = []
    for _ in range(round(np.trace(projector))):
        # Rounding must not choose between axes that are equally near.
        nearest = int(np.argmax(np.round(np.diag(projector), 9)))
        basis.append(projector[:, nearest] / np.linalg.norm(projector[:, nearest]))
        projector = projector - np.outer(basis[-1], basis[-1] @ projector)
    return basis


def _in_words(force: Array, moment: Array) -> str:
    """Return a wrench of size 1 in words, such as `a force along x`."""
    if force.any() and moment.any():
        f, n = (", ".join(f"{x:g}" for x in np.round(half, 2) + 0.0) for half in (force, moment))
        return f"force ({f}) and moment ({n})"
    vector = force if force.any() else moment
    unit = vector / np.linalg.norm(vector)
    axis = f"({', '.join(f'{x:.3g}' for x in np.round(unit, 6) + 0.0)})"  # nearly along an axis: not named
    if np.count_nonzero(vector) == 1:
        axis = "xyz"[int(np.flatnonzero(vector)[0])]
    return f"a force along {axis}" if force.any() else f"a moment about {axis}"
