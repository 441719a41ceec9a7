"""Actuator torques and link loads of an arm at rest under a wrench.

The wrench is the one that acts *on* the arm. Jᵀ F is equivalent to it, −Jᵀ F balances it, see
`rmrc.textbook.statics`. The load on a link is what acts on all bodies that its joint moves: the wrench, and
their weight if the actuators bear it. The loads need no Jacobian, and are the second route to the same
torques.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm import Arm
from rmrc.arm.adapting import is_behind
from rmrc.arm.wiring import SLIDE
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.spatial import quat_to_matrix, twist_transform, wrench_transform
from rmrc.textbook.statics import joint_torques

Array = NDArray[np.float64]

# A result below this share of its summands is rounding, and becomes 0.
ROUNDING = 1e-12


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
        axis: Each axis of the chain along the axes of its body, (ℓ, 3).
        reaction: [f; n] that the link behind each axis receives from the one before, along the axes of the
            link's body and at the joint's anchor, a point of that body, (ℓ, 6) [N, N·m]: of the wrench, and
            of the weight if the actuators bear it.
        driven: Its component along each axis, (ℓ,): the actuator provides it, with the joint's spring, or the
            coupling of a follower. It pushes along a slide, and turns a hinge or the hinge of a screw.
            Bearings and links carry the rest; the nut of a screw takes its share of a thrust as a moment.
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
    axis: Array
    reaction: Array
    driven: Array
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
    J, (weight, springs) = arm.jacobian(q), arm.rest_torques(q)
    equivalent, weight = joint_torques(J, wrench), weight * gravity
    levers, acts = (np.linalg.norm(each.reshape(2, 3, -1), axis=1) for each in (J, wrench))
    size = float(((levers * acts).sum(axis=0) + np.abs(weight) + np.abs(springs)).max())
    torque = without_rounding(weight + springs - equivalent, size)
    margin = without_rounding(arm.torque_limit - np.abs(torque), size)
    reaction, driven, propagated = _loads(arm, q, wrench, arm.weights * gravity)
    largest = np.abs(reaction).max()
    return Balance(
        arm=arm, q=q, wrench=wrench, bears_weight=gravity, size=size,
        equivalent=without_rounding(equivalent, size), equilibrium=without_rounding(-equivalent, size),
        gravity=without_rounding(weight, size), springs=without_rounding(springs, size),
        torque=torque, margin=margin, exceeded=tuple(np.array(arm.joints)[margin < 0.0].tolist()),
        axis=arm.model.jnt_axis[arm.wiring.axis], reaction=without_rounding(reaction, largest),
        driven=without_rounding(driven, largest),
        disagreement=float(np.abs(weight - equivalent - propagated).max()),
    )  # fmt: skip


def _loads(arm: Arm, q: Array, wrench: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Return the loads on links, (ℓ, 6), their components along the axes, (ℓ,), and of actuators, (n,).

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
    link, driven, axes = wiring.axis.copy(), along[wiring.axis], wiring.axis.tolist()
    for follower, joint in zip(arm.followers, wiring.follower_joint, strict=True):
        if follower.pitch:
            axis = axes.index(wiring.joint[follower.leader])
            link[axis], driven[axis] = min(link[axis], joint), driven[axis] + follower.ratio * along[joint]
    body = model.jnt_bodyid[wiring.axis]
    R = data.xmat[body].reshape(-1, 3, 3)
    anchor = data.xpos[body] + (R @ model.jnt_pos[wiring.axis, :, None])[..., 0]
    loads = np.stack([force[link], moment[link] - np.cross(anchor, force[link])], axis=1)
    return (loads @ R).reshape(-1, 6), driven, along[model.dof_jntid] @ arm.motion


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
