"""Actuator torques and link loads of an arm at rest under a wrench, and the wrenches that need no torque.

The wrench is the one that acts *on* the arm. Jᵀ F is equivalent to it, −Jᵀ F balances it, see
`rmrc.textbook.statics`. The forces from link to link, found inward from the site without any Jacobian, are
the second route to the same torques.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm import Arm
from rmrc.law.task import RANK_TOLERANCE, SAMPLES, Task, choose
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.spatial import AXES, quat_to_matrix, twist_transform, wrench_transform
from rmrc.textbook.propagation import actuator_torques, inward_wrenches
from rmrc.textbook.screws import exp_screw, joint_screw
from rmrc.textbook.statics import equilibrium_torques, joint_torques

Array = NDArray[np.float64]

# A result below this share of its summands is rounding.
ROUNDING = 1e-12
# A direction is nearly free if it costs less than a tenth of the most expensive one.
NEARLY = 0.1


@dataclass(frozen=True, eq=False)
class Balance:
    """An arm at rest under a wrench.

    Attributes:
        arm: The arm.
        q: Joint positions, (n,).
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        equivalent: Jᵀ F, (n,): with it the site presses on the world with F [N·m or N].
        equilibrium: −Jᵀ F, (n,): with it the arm holds still while F acts on it.
        bears_weight: Whether the actuators support the arm's weight; otherwise it is compensated.
        gravity: Actuator torques against gravity, (n,); 0 if gravity is compensated.
        springs: Actuator torques against springs of the joints, (n,).
        frames: T_0_i of the link behind each axis of the chain, (ℓ, 4, 4), as in `link_frames`.
        reaction: [f; n] of the wrench alone that each link receives from the one before, at the origin and
            along the axes of its frame, (ℓ, 6) [N, N·m].
        driven: Its component along each axis, (ℓ,): the actuator provides it, or the coupling of a follower.
        propagated: Torque of each actuator for all axes that it moves, (n,): `equilibrium` by the other
            route.
    """

    arm: Arm
    q: Array
    wrench: Array
    equivalent: Array
    equilibrium: Array
    bears_weight: bool
    gravity: Array
    springs: Array
    frames: Array
    reaction: Array
    driven: Array
    propagated: Array

    @property
    def torque(self) -> Array:
        """Total actuator torques, (n,) [N·m or N]: against the wrench, gravity and springs."""
        return self.equilibrium + self.gravity + self.springs

    @property
    def margin(self) -> Array:
        """Margin to each torque limit, (n,) [N·m or N]: negative where it is exceeded."""
        return np.asarray(self.arm.torque_limit - np.abs(self.torque))

    @property
    def exceeded(self) -> tuple[str, ...]:
        """Names of the joints whose torque limit is exceeded, by more than rounding."""
        over = self.margin < -ROUNDING * self.size
        return tuple(name for name, is_over in zip(self.arm.joints, over, strict=True) if is_over)

    @property
    def reaction_world(self) -> Array:
        """The reactions along world axes, at the same points, (ℓ, 6) [N, N·m]."""
        R = self.frames[:, :3, :3]
        halves = self.reaction.reshape(-1, 2, 3)
        return np.asarray(np.einsum("iab,ihb->iha", R, halves).reshape(-1, 6))

    @property
    def structure(self) -> Array:
        """The reactions without the actuators' part: the load of bearings and links, own frames, (ℓ, 6).

        It does no work in the joint's own motion: a screw's nut takes its share of a thrust as a moment.
        """
        taken = np.array(self.reaction)
        # An actuator pushes along a slide, and turns a hinge or the hinge of a screw.
        along = np.where(np.isinf(self.arm.chain.pitch), 2, 5)
        taken[np.arange(len(taken)), along] -= self.driven
        return taken

    @property
    def disagreement(self) -> float:
        """Largest difference between the two routes to the torques [N·m or N]."""
        return float(np.abs(self.equilibrium - self.propagated).max())

    @property
    def size(self) -> Array:
        """|J_v,j| |f| + |J_ω,j| |n| and the other parts, (n,) [N·m or N]: the torques if nothing canceled."""
        linear, angular = np.linalg.norm(self.arm.jacobian(self.q).reshape(2, 3, -1), axis=1)
        force, moment = np.linalg.norm(self.wrench.reshape(2, 3), axis=1)
        return np.asarray(linear * force + angular * moment + np.abs(self.gravity) + np.abs(self.springs))


def balance(arm: Arm, q: ArrayLike, wrench: ArrayLike, gravity: bool = False) -> Balance:
    """Return actuator torques and link loads of an arm at rest while a wrench acts on it.

    τ = −Jᵀ F by MuJoCo's Jacobian, and by forces from link to link [Craig05, §5.9, §5.10].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        gravity: Whether the actuators support the arm's weight; otherwise it is compensated.

    Raises:
        QuestionError: The wrench has not 6 values, or q not n.
    """
    q, wrench = np.asarray(q, dtype=np.float64), np.asarray(wrench, dtype=np.float64)
    if wrench.shape != (6,):
        raise QuestionError(f"a wrench must have 6 values [f; n], got shape {wrench.shape}")
    if q.shape != (arm.n,):
        raise QuestionError(f"q must have {arm.n} values, one for each joint, got shape {q.shape}")
    J = arm.jacobian(q)
    weight, springs = arm.rest_torques(q)
    frames, tip = link_frames(arm, q)
    links = np.linalg.inv(np.concatenate([np.eye(4)[None], frames[:-1]])) @ frames
    # The wrench on the arm is the negative of the wrench with which the arm presses.
    to_tip = tip[:3, :3].T
    pressed = -np.concatenate([to_tip @ wrench[:3], to_tip @ wrench[3:]])
    reaction = inward_wrenches(links, pressed, np.linalg.inv(frames[-1]) @ tip)
    driven = actuator_torques(reaction, arm.chain.pitch)
    return Balance(
        arm=arm, q=q, wrench=wrench,
        equivalent=joint_torques(J, wrench), equilibrium=equilibrium_torques(J, wrench),
        bears_weight=gravity, gravity=weight if gravity else np.zeros(arm.n), springs=springs,
        frames=frames, reaction=reaction, driven=driven,
        propagated=arm.chain.gathered(driven, arm.n),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Elsewhere:
    """The same wrench at another site {A} of the body that carries the controlled one {B}.

    Attributes:
        site: Name of {A}.
        velocity_transform: ᴬT_v,B: twist_a = ᴬT_v,B twist_b, (6, 6).
        force_transform: ᴬT_f,B = (ᴮT_v,A)ᵀ: wrench_a = ᴬT_f,B wrench_b, (6, 6).
        wrench: [f; n] at the origin and along the axes of {A}, (6,) [N, N·m].
    """

    site: str
    velocity_transform: Array
    force_transform: Array
    wrench: Array


def elsewhere(arm: Arm, q: ArrayLike, wrench: ArrayLike, site: str) -> Elsewhere:
    """Return a wrench as seen at another site of the same body: it does the same work [Craig05, §5.11].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] at the controlled site, along world axes, (6,) [N, N·m].
        site: Name of the other site.

    Raises:
        QuestionError: There is no such site, or another body carries it.
    """
    model = arm.model
    # Bodies that are welded together move as one.
    body = {name: int(model.body_weldid[model.site(name).bodyid[0]]) for name in arm.sites}
    alike = [name for name in arm.sites if body[name] == body[arm.site]]
    if site not in alike:
        what = (
            "is on another body"
            if site in body
            else f"is not a site of {arm.path}{did_you_mean(site, alike)}"
        )
        raise QuestionError(f'--at: "{site}" {what}; sites that move with "{arm.site}": {", ".join(alike)}')
    here, there = arm.pose(np.asarray(q, dtype=np.float64)), arm.pose(np.asarray(q, dtype=np.float64), site)
    R_b, R_a = quat_to_matrix(here[3:]), quat_to_matrix(there[3:])
    R_a_b, p_a_b = R_a.T @ R_b, R_a.T @ (here[:3] - there[:3])
    force_transform = wrench_transform(R_a_b, p_a_b)
    own = (np.asarray(wrench, dtype=np.float64).reshape(2, 3) @ R_b).ravel()
    return Elsewhere(site, twist_transform(R_a_b, p_a_b), force_transform, force_transform @ own)


def link_frames(arm: Arm, q: ArrayLike) -> tuple[Array, Array]:
    """Return the frame of each link, T_0_i (ℓ, 4, 4), and of the site, (4, 4), at joint positions.

    Each has its origin on an axis of the chain and z along it; with all joints at 0 its axes are the world's,
    turned the shortest way that brings z there. They come from the product of exponentials, which only uses
    the arm's geometry at 0 from MuJoCo [Lynch17, §4.1].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
    """
    chain = arm.chain
    points = np.cumsum(chain.step, axis=0)
    motions = exp_screw(joint_screw(chain.axis, points, chain.pitch), chain.positions(q))
    frames, so_far = np.empty((len(points), 4, 4)), np.eye(4)
    for i in range(len(points)):
        so_far = so_far @ motions[i]
        frames[i] = so_far @ _pose(_turn_to(chain.axis[i]), points[i])
    return frames, so_far @ _pose(quat_to_matrix(chain.tip_quat), points[-1] + chain.tip_step)


def _pose(R: Array, p: Array) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def _turn_to(axis: Array) -> Array:
    """Return the smallest rotation that brings z to a unit vector; half a turn about x for −z."""
    x, y, z = axis
    across = x * x + y * y
    # 1 + z, without cancellation near −z
    w = 1.0 + z if z > 0.0 else across / (1.0 - z)
    quat = np.array([w, -y, x, 0.0]) if w > 0.0 else np.array([0.0, 1.0, 0.0, 0.0])
    return quat_to_matrix(quat / np.linalg.norm(quat))


class Cost(StrEnum):
    """The cost of a wrench for the actuators, and whether it is the same at other configurations."""

    ALWAYS = "nothing, anywhere"
    OTHERS = "nothing; elsewhere another"
    SINGULAR = "nothing: singular"
    MIXED = "nothing; elsewhere fewer do"
    NEARLY = "nearly nothing"
    TORQUE = "torque"


@dataclass(frozen=True, eq=False)
class Direction:
    """A wrench of norm 1, with meters and radians made comparable by the length.

    Attributes:
        wrench: [f; n] at the site, along world axes, (6,).
        sigma: Norm of the torques that balance it.
        cost: In words.
    """

    wrench: Array
    sigma: float
    cost: Cost

    @property
    def amplification(self) -> float:
        """Force per unit torque: 1/σ, infinite where it costs nothing."""
        return 1.0 / self.sigma if self.sigma > 0.0 else np.inf


@dataclass(frozen=True, eq=False)
class Costs:
    """The costs of wrenches of one kind for the actuators at a configuration.

    Attributes:
        kind: `wrench`, `force` or `moment`.
        directions: Orthogonal to each other, the cheapest first.
        free_anywhere: Number that cost nothing at almost every configuration, perhaps in other directions.
    """

    kind: str
    directions: tuple[Direction, ...]
    free_anywhere: int

    @property
    def free(self) -> int:
        """Number that cost nothing here."""
        return sum(one.sigma == 0.0 for one in self.directions)

    @property
    def free_only_here(self) -> int:
        """Number that cost nothing here only; 0 where J has its full rank."""
        return self.free - self.free_anywhere


KINDS = {"wrench": range(6), "force": range(3), "moment": range(3, 6)}
"""Rows of a wrench: all of it, forces without a moment, moments without a force."""


def wrench_costs(arm: Arm, q: ArrayLike, length: float | None = None) -> tuple[Costs, ...]:
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
    """
    here = np.asarray(q, dtype=np.float64)
    jacobians = np.array([arm.jacobian(each) for each in (here, *arm.sampled(SAMPLES))])
    tasks = {kind: choose(arm, [AXES[row] for row in rows], length) for kind, rows in KINDS.items()}
    return tuple(_costs(task, kind, jacobians) for kind, task in tasks.items())


def _costs(task: Task, kind: str, jacobians: Array) -> Costs:
    """Return the costs at the first of many configurations, whose Jacobians are (N, 6, n)."""
    scaled = task.matrix(jacobians)
    floor = RANK_TOLERANCE * float(np.linalg.norm(scaled, 2, axis=(1, 2)).max())
    u, sigma, _ = np.linalg.svd(scaled[0])
    sigma = np.pad(sigma, (0, len(u) - len(sigma)))
    dear = sigma > floor
    # A direction that is free at all of them is free for all of their columns.
    columns = np.concatenate(list(scaled), axis=1)
    v, sizes, _ = np.linalg.svd(columns)
    constant, free = v[:, np.count_nonzero(sizes > floor) :], u[:, ~dear]
    other = free - constant @ (constant.T @ free)
    rank = task.rank
    more, extra = free.shape[1] - constant.shape[1], free.shape[1] - (len(u) - rank)
    word = Cost.OTHERS if extra == 0 else Cost.SINGULAR if extra == more else Cost.MIXED
    always = [(one, 0.0, Cost.ALWAYS) for one in _readable(constant, constant.shape[1])]
    here = [(one, 0.0, word) for one in _readable(other, more)]
    rest = [
        (one, float(value), Cost.NEARLY if value < NEARLY * sigma[0] else Cost.TORQUE)
        for one, value in zip(u.T[dear][::-1], sigma[dear][::-1], strict=True)
    ]
    directions = tuple(
        Direction(_as_wrench(task, one), value, cost) for one, value, cost in always + here + rest
    )
    return Costs(kind, directions, len(u) - rank)


def _as_wrench(task: Task, scaled: Array) -> Array:
    """Return F = S_x u as all six rows, its largest component positive, without rounding."""
    wrench = np.zeros(6)
    wrench[task.rows] = task.row_scale * np.where(np.abs(scaled) < RANK_TOLERANCE, 0.0, scaled)
    largest = np.argmax(np.round(np.abs(wrench), 9))
    return np.asarray(wrench * np.sign(wrench[largest]) + 0.0)


def _readable(spanning: Array, count: int) -> list[Array]:
    """Return an orthonormal basis of a column space, (m,) each, along axes where possible.

    `count` times, the axis nearest to the space is projected into it, and that direction is removed.
    """
    u = np.linalg.svd(spanning, full_matrices=False)[0][:, :count]
    projector = u @ u.T
    basis = []
    for _ in range(count):
        # Rounding must not choose between axes that are equally near.
        nearest = int(np.argmax(np.round(np.diag(projector), 9)))
        one = projector[:, nearest] / np.linalg.norm(projector[:, nearest])
        basis.append(one)
        projector = projector - np.outer(one, one @ projector)
    return basis
