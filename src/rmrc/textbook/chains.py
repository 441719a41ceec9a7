"""Chains of joints: Denavit-Hartenberg tables, screws, propagation from link to link, and static forces.

Denavit-Hartenberg tables give link transforms, forward kinematics and the geometric Jacobian. The sources
use two conventions: [Craig05] and [Khatib08] put frame i on the axis of joint i ("modified"), [Denavit55]
and [Paul81] on the axis of joint i+1 ("standard").

Screws give a column for each kind of joint, and the arm as a product of screw motions. A screw is [ω; v]
with v the velocity of the body's point at the *origin*, the order of the notes; a twist elsewhere in this
program is [v; ω] with v at the tip. `geometric_from_screws` goes from one to the other.

The pitch h is in m/rad: the advance of a joint per radian. The notes' p is the
advance of a full turn, h = p/2π. h = 0 is a revolute joint, and h = inf a prismatic one, whose position is in
m. Any other h is a helical joint, whose position is in rad.

Propagation carries velocities outward from the base, forces and moments inward from the tip. The input is
the link transforms T_i-1_i(q) of a chain for i = 1..n, at one configuration. Frame {i} is fixed in link i,
its origin lies on the axis of joint i, and its z is along that axis. The direction of x and the position of
the origin along the axis are free. Any serial arm has this form, and so has a modified DH chain. Frame {0}
is at rest. The tip is fixed in link n.

The notes use the frames of standard DH chains. Their {i} lies at the far end of link i and turns with it
about ẑ_i-1, so ᶦ⁺¹v_i+1 contains ω_i+1 in place of ω_i. Both forms transport a body's twist to another of its
points, and add the joint's own twist on its axis: the notes before the transport, these functions after it.

Joint torques for a wrench at the tip follow by virtual work. The sign depends on the question. τ = Jᵀ F is
*equivalent* to the wrench F: with these torques the tip presses on the world with F. −Jᵀ F *balances* it:
with these torques the arm holds still while F acts on the tip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError
from rmrc.support.spatial import (
    exp_rotation,
    matrix_of,
    normalize,
    quat_to_matrix,
    shift_twist,
    times,
    twist_transform,
    wrench_transform,
)

JointKind = Literal["revolute", "prismatic"]
Convention = Literal["standard", "modified"]


def dh_transform(alpha: ArrayLike, a: ArrayLike, d: ArrayLike, theta: ArrayLike) -> NDArray[np.float64]:
    """Return the standard link transform.

    T_i-1_i = Rot(z, θ_i) Trans(z, d_i) Trans(x, a_i) Rot(x, α_i) [Denavit55] [Paul81].

    Args:
        alpha: Twist α_i, (...) [rad].
        a: Link length a_i, (...) [m].
        d: Joint offset d_i, (...) [m].
        theta: Joint angle θ_i, (...) [rad].

    Returns:
        Pose of frame i in frame i-1, (..., 4, 4).

    Example:
        A link of 2 m along x, its next axis tipped back by 90° about x:

        >>> dh_transform(np.pi / 2, 2.0, 0.0, 0.0).round(3) + 0.0
        array([[ 1.,  0.,  0.,  2.],
               [ 0.,  0., -1.,  0.],
               [ 0.,  1.,  0.,  0.],
               [ 0.,  0.,  0.,  1.]])
    """
    ca, sa, ct, st, a, d, zero, one = _trigonometry(alpha, a, d, theta)
    return matrix_of(
        [ct, -st * ca, st * sa, a * ct],
        [st, ct * ca, -ct * sa, a * st],
        [zero, sa, ca, d],
        [zero, zero, zero, one],
    )


def modified_dh_transform(
    alpha: ArrayLike, a: ArrayLike, d: ArrayLike, theta: ArrayLike
) -> NDArray[np.float64]:
    """Return the modified link transform.

    T_i-1_i = Rot(x, α_i-1) Trans(x, a_i-1) Rot(z, θ_i) Trans(z, d_i) [Craig05, eq. 3.6].

    Args:
        alpha: Twist α_i-1, (...) [rad].
        a: Link length a_i-1, (...) [m].
        d: Joint offset d_i, (...) [m].
        theta: Joint angle θ_i, (...) [rad].

    Returns:
        Pose of frame i in frame i-1, (..., 4, 4).

    Example:
        The second row of the Stanford arm's table: the offset lies along the tipped axis.

        >>> modified_dh_transform(-np.pi / 2, 0.0, 0.154, 0.0).round(3) + 0.0
        array([[ 1.   ,  0.   ,  0.   ,  0.   ],
               [ 0.   ,  0.   ,  1.   ,  0.154],
               [ 0.   , -1.   ,  0.   ,  0.   ],
               [ 0.   ,  0.   ,  0.   ,  1.   ]])
    """
    ca, sa, ct, st, a, d, zero, one = _trigonometry(alpha, a, d, theta)
    return matrix_of(
        [ct, -st, zero, a],
        [st * ca, ct * ca, -sa, -sa * d],
        [st * sa, ct * sa, ca, ca * d],
        [zero, zero, zero, one],
    )


@dataclass(frozen=True)
class DHChain:
    """A serial arm as its Denavit-Hartenberg table.

    The joint position is added to θ of a revolute joint and to d of a prismatic one. The entry of the table
    is therefore the offset of the joint's zero.

    Attributes:
        table: One row (α, a, d, θ) a joint, n rows [rad, m, m, rad].
        kinds: "revolute" or "prismatic", n of them.
        convention: "modified" (rows α_i-1, a_i-1, d_i, θ_i) or "standard" (α_i, a_i, d_i, θ_i).

    Raises:
        ModelError: Table and kinds differ in length, or a word is not one of the above.

    Example:
        Two links of 1 m, the first at 90°, the second bent back by 90°. The tool at the end of the second is
        at (1, 1):

        >>> arm = DHChain(((0, 0, 0, 0), (0, 1, 0, 0)), ("revolute", "revolute"))
        >>> q = np.array([np.pi / 2, -np.pi / 2])
        >>> (arm.frames(q)[-1] @ [1, 0, 0, 1]).round(3)
        array([1., 1., 0., 1.])
        >>> arm.jacobian(q, point=(1, 0, 0)).round(3)[[0, 1, 5]] + 0.0
        array([[-1.,  0.],
               [ 1.,  1.],
               [ 1.,  1.]])
    """

    table: tuple[tuple[float, float, float, float], ...]
    kinds: tuple[JointKind, ...]
    convention: Convention = "modified"

    def __post_init__(self) -> None:
        """Check the table once, for all later calls."""
        if len(self.table) != len(self.kinds):
            raise ModelError(
                f"DH chain: {len(self.table)} rows in the table but {len(self.kinds)} joint kinds; "
                "give one kind a row"
            )
        for kind in self.kinds:
            if kind not in get_args(JointKind):
                raise ModelError(f'DH chain: joint kind "{kind}" is neither revolute nor prismatic')
        if self.convention not in get_args(Convention):
            raise ModelError(f'DH chain: convention "{self.convention}" is neither standard nor modified')

    def link_transforms(self, q: ArrayLike) -> NDArray[np.float64]:
        """Return the pose of every frame in the frame before it.

        Args:
            q: Joint positions, (..., n) [rad or m].

        Returns:
            T_i-1_i for i = 1..n, (..., n, 4, 4).

        Raises:
            ModelError: If q does not hold one value per joint.
        """
        q = np.asarray(q, dtype=np.float64)
        n = len(self.table)
        if q.shape[-1:] != (n,):
            raise ModelError(f"DH chain: expected {n} joint positions, got shape {q.shape}")
        alpha, a, d, theta = np.array(self.table, dtype=np.float64).T
        revolute = self._revolute()
        transform = modified_dh_transform if self.convention == "modified" else dh_transform
        return transform(alpha, a, d + np.where(revolute, 0.0, q), theta + np.where(revolute, q, 0.0))

    def frames(self, q: ArrayLike) -> NDArray[np.float64]:
        """Return the pose of every frame in frame {0}: T_0_i = T_0_1 T_1_2 ... T_i-1_i.

        Args:
            q: Joint positions, (..., n) [rad or m].

        Returns:
            T_0_i for i = 0..n, the first being the identity, (..., n + 1, 4, 4).

        Raises:
            ModelError: If q does not hold one value per joint.
        """
        links = self.link_transforms(q)
        frames = [np.broadcast_to(np.eye(4), (*links.shape[:-3], 4, 4))]
        for i in range(links.shape[-3]):
            frames.append(frames[-1] @ links[..., i, :, :])
        return np.stack(frames, axis=-3)

    def jacobian(
        self, q: ArrayLike, frame: int | None = None, point: ArrayLike = (0.0, 0.0, 0.0)
    ) -> NDArray[np.float64]:
        """Return the geometric Jacobian of a point fixed in a frame, along the axes of frame {0}.

        Column i is [z × (p − o); z] for a revolute joint and [z; 0] for a prismatic one, with the
        joint's axis z and a point o on it [Craig05, §5.7]; z and o are those of frame i in the
        modified and of frame i-1 in the standard convention. A joint beyond the frame does not move
        it: 0.

        Args:
            q: Joint positions, (..., n) [rad or m].
            frame: The frame that carries the point, 0..n; None: the last.
            point: The point in that frame, (3,) [m].

        Returns:
            Rows [v; ω], (..., 6, n) [m/s and rad/s per unit of joint rate].

        Raises:
            ModelError: If q does not hold one value per joint, or there is no such frame.
        """
        n = len(self.table)
        frame = n if frame is None else frame
        if not 0 <= frame <= n:
            raise ModelError(f"DH chain: frame {frame} does not exist; frames are 0 to {n}")
        frames = self.frames(q)
        first = 1 if self.convention == "modified" else 0
        axes = frames[..., first : first + n, :3, 2]
        origins = frames[..., first : first + n, :3, 3]
        pose = frames[..., frame, :3, :]
        tip = pose[..., :3] @ np.asarray(point, dtype=np.float64) + pose[..., 3]

        revolute = self._revolute()[:, None]
        moves = (np.arange(n) < frame)[:, None]
        v = np.where(revolute, np.cross(axes, tip[..., None, :] - origins), axes)
        omega = np.where(revolute, axes, 0.0)
        return np.swapaxes(np.concatenate([v, omega], axis=-1) * moves, -1, -2)

    def _revolute(self) -> NDArray[np.bool_]:
        return np.array([kind == "revolute" for kind in self.kinds], dtype=np.bool_)


def _trigonometry(
    alpha: ArrayLike, a: ArrayLike, d: ArrayLike, theta: ArrayLike
) -> tuple[NDArray[np.float64], ...]:
    alpha, a, d, theta = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (alpha, a, d, theta)))
    zero, one = np.zeros_like(a), np.ones_like(a)
    return np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta), a, d, zero, one


Array = NDArray[np.float64]


def joint_screw(axis: ArrayLike, point: ArrayLike, pitch: ArrayLike = 0.0) -> Array:
    """Return the screw of a joint per unit of its rate: (ẑ; u × ẑ + h ẑ), or (0; ẑ) if it slides.

    ẑ is its axis and u any point on it; h = p/2π [Selig92, §6.6]. For an infinite pitch the unit of position
    is the advance instead of the angle, which gives (0; ẑ).

    Args:
        axis: Along the joint, of any length but 0, (..., 3).
        point: u, (..., 3) [m].
        pitch: h: 0 revolute, inf prismatic, else helical, (...) [m/rad].

    Returns:
        [ω; v at the origin], (..., 6) [rad and m per unit of joint position].

    Raises:
        ModelError: If a pitch is nan or −inf.
        ValueError: If an axis is zero or not finite.

    Example:
        A spindle along z through (2, 0, 0) that advances 0.5 m per turn, and a slide along x:

        >>> joint_screw([0, 0, 1], [2, 0, 0], pitch=0.5 / (2 * np.pi)).round(3) + 0.0
        array([ 0.  ,  0.  ,  1.  ,  0.  , -2.  ,  0.08])
        >>> joint_screw([1, 0, 0], [2, 0, 0], pitch=np.inf)
        array([0., 0., 0., 1., 0., 0.])
    """
    axis, point, pitch = normalize(axis), np.asarray(point, dtype=np.float64), np.asarray(pitch, dtype=float)
    if np.any(np.isnan(pitch) | np.isneginf(pitch)):
        raise ModelError("joint pitch: nan or -inf; give 0 if revolute, inf if prismatic, else m/rad")
    slides = np.isinf(pitch)[..., None]
    advance = np.where(slides, 0.0, pitch[..., None])
    v = np.where(slides, axis, np.cross(point, axis) + advance * axis)
    return np.concatenate([np.broadcast_to(np.where(slides, 0.0, axis), v.shape), v], axis=-1)


def transform_screw(screw: ArrayLike, R: ArrayLike, t: ArrayLike) -> Array:
    """Return the screw of a joint after the joint was turned by R and then moved by t.

    [ω'; v'] = [[R, 0], [T R, R]] [ω; v] with T = skew(t) [Selig92, exercise 6.6]. As a screw is
    written [line; moment], this is the matrix that a wrench [f; n] has,
    `rmrc.support.spatial.wrench_transform`.

    Args:
        screw: [ω; v at the origin], (..., 6).
        R: (..., 3, 3).
        t: (..., 3) [m].

    Returns:
        [ω'; v' at the origin], (..., 6).

    Example:
        >>> transform_screw(joint_screw([0, 0, 1], [0, 0, 0]), np.eye(3), [2, 0, 0])
        array([ 0.,  0.,  1.,  0., -2.,  0.])
    """
    return times(wrench_transform(R, t), np.asarray(screw, dtype=np.float64))


def exp_screw(screw: ArrayLike, q: ArrayLike) -> Array:
    """Return the motion along a screw: exp([ω]× q, v q; 0, 0).

    R = exp([φ]×) and t = (sin θ/θ) ρ + ((1 − cos θ)/θ²) φ × ρ + ((1 − sin θ/θ)/θ²) φ (φ·ρ), with
    φ = ω q, ρ = v q, θ = |φ| [Lynch17, §3.3.3]. For a joint screw of the axis ẑ through u this is the
    notes' t = h q ẑ + (I − R) u [Selig92, §6.6], and t = q ẑ if it slides.

    Args:
        screw: [ω; v at the origin], of any size, (..., 6).
        q: Joint position, (...) [rad; m for a slide].

    Returns:
        Pose, (..., 4, 4).

    Example:
        Half a turn about an axis at (1, 0, 0), which advances 0.2 m per radian:

        >>> exp_screw(joint_screw([0, 0, 1], [1, 0, 0], pitch=0.2), np.pi).round(3) + 0.0
        array([[-1.   ,  0.   ,  0.   ,  2.   ],
               [ 0.   , -1.   ,  0.   ,  0.   ],
               [ 0.   ,  0.   ,  1.   ,  0.628],
               [ 0.   ,  0.   ,  0.   ,  1.   ]])
    """
    motion = np.asarray(screw, dtype=np.float64) * np.asarray(q, dtype=np.float64)[..., None]
    phi, rho = motion[..., :3], motion[..., 3:]
    theta = np.linalg.norm(phi, axis=-1, keepdims=True)
    # numpy's sinc(x) is sin(πx)/(πx). The last ratio only appears times θ², so that neither its
    # rounding near 0 nor the limit 1/6 matters.
    sinc, half = np.sinc(theta / np.pi), np.sinc(theta / (2 * np.pi))
    last = np.divide(1.0 - sinc, theta**2, out=np.full_like(theta, 1 / 6), where=theta**2 > 0)
    along = last * np.sum(phi * rho, axis=-1, keepdims=True) * phi
    T = np.zeros((*motion.shape[:-1], 4, 4))
    T[..., :3, :3] = quat_to_matrix(exp_rotation(phi))
    T[..., :3, 3] = sinc * rho + 0.5 * half**2 * np.cross(phi, rho) + along
    T[..., 3, 3] = 1.0
    return T


def product_of_exponentials(screws: ArrayLike, q: ArrayLike, home: ArrayLike) -> Array:
    """Return the pose of the tip: T(q) = exp(S₁ q₁) exp(S₂ q₂) … exp(S_n q_n) M [Lynch17, §4.1].

    Args:
        screws: S_i of each joint at q = 0, in frame {0}, (..., n, 6).
        q: Joint positions, (..., n) [rad; m for a slide].
        home: M, pose of the tip at q = 0, (..., 4, 4).

    Returns:
        T_0_tip, (..., 4, 4).

    Raises:
        ModelError: If there is not one position for each screw.

    Example:
        Two links of 1 m at (90°, −90°):

        >>> screws = joint_screw([0, 0, 1], [[0, 0, 0], [1, 0, 0]])
        >>> home = np.eye(4)
        >>> home[0, 3] = 2.0
        >>> product_of_exponentials(screws, [np.pi / 2, -np.pi / 2], home)[:3, 3].round(3) + 0.0
        array([1., 1., 0.])
    """
    T = np.asarray(home, dtype=np.float64)
    for motion in reversed(_motions(screws, q)):
        T = motion @ T
    return T


def space_jacobian(screws: ArrayLike, q: ArrayLike) -> Array:
    """Return the screws of all joints at q: the Jacobian of the notes.

    Column i is S_i, transformed by the motion exp(S₁ q₁) … exp(S_i-1 q_i-1) of the joints before it
    [Selig92, §6.6] [Lynch17, §5.1.1].

    Args:
        screws: S_i of each joint at q = 0, in frame {0}, (..., n, 6).
        q: Joint positions, (..., n) [rad; m for a slide].

    Returns:
        Rows [ω; v at the origin of {0}], (..., 6, n).

    Raises:
        ModelError: If there is not one position for each screw.

    Example:
        >>> screws = joint_screw([0, 0, 1], [[0, 0, 0], [1, 0, 0]])
        >>> space_jacobian(screws, [np.pi / 2, 0.0]).round(3)[[2, 3, 4]] + 0.0
        array([[1., 1.],
               [0., 1.],
               [0., 0.]])
    """
    screws, motions = np.asarray(screws, dtype=np.float64), _motions(screws, q)
    so_far, columns = np.eye(4), []
    for i, motion in enumerate(motions):
        column = transform_screw(screws[..., i, :], so_far[..., :3, :3], so_far[..., :3, 3])
        columns.append(np.broadcast_to(column, (*motion.shape[:-2], 6)))
        so_far = so_far @ motion
    return np.stack(columns, axis=-1)


def geometric_from_screws(jacobian: ArrayLike, tip: ArrayLike) -> Array:
    """Return the geometric Jacobian of a Jacobian of screws: rows exchanged, reference point moved.

    [ω; s] becomes [s + ω × p; ω] for a tip at p [Selig92, §6.6].

    Args:
        jacobian: Rows [ω; v at the origin of {0}], (..., 6, n).
        tip: p in {0}, (..., 3) [m].

    Returns:
        Rows [v at the tip; ω] along the axes of {0}, (..., 6, n).

    Example:
        Two links of 1 m, stretched out along x:

        >>> screws = joint_screw([0, 0, 1], [[0, 0, 0], [1, 0, 0]])
        >>> geometric_from_screws(screws.T, [2, 0, 0])[[0, 1, 5]]
        array([[0., 0.],
               [2., 1.],
               [1., 1.]])
    """
    screws = np.swapaxes(np.asarray(jacobian, dtype=np.float64), -1, -2)
    to_origin = -np.asarray(tip, dtype=np.float64)[..., None, :]
    return np.swapaxes(shift_twist(np.roll(screws, 3, axis=-1), to_origin), -1, -2)


def _motions(screws: ArrayLike, q: ArrayLike) -> list[Array]:
    screws, q = np.asarray(screws, dtype=np.float64), np.asarray(q, dtype=np.float64)
    if screws.shape[-2] != q.shape[-1]:
        raise ModelError(f"screws: {screws.shape[-2]} joints but {q.shape[-1]} positions; give one per joint")
    return list(np.moveaxis(exp_screw(screws, q), -3, 0))


def outward_velocities(
    links: ArrayLike, pitch: ArrayLike, qdot: ArrayLike, tip: ArrayLike | None = None
) -> Array:
    """Return the twist of every link and of the tip, each along the axes of its own frame.

    ᶦ⁺¹ω_i+1 = ᶦ⁺¹R_i ᶦω_i + θ̇_i+1 Ẑ, ᶦ⁺¹v_i+1 = ᶦ⁺¹R_i (ᶦv_i + ᶦω_i × ᶦP_i+1) + ḋ_i+1 Ẑ, with
    Ẑ = (0, 0, 1); θ̇ = q̇, ḋ = 0 of a revolute, θ̇ = 0, ḋ = q̇ of a prismatic, and θ̇ = q̇, ḋ = h q̇
    of a helical joint [Craig05, §5.6].

    Args:
        links: T_i-1_i, (..., n, 4, 4).
        pitch: h of each joint: 0 revolute, inf prismatic, else helical, (n,) [m/rad].
        qdot: Joint rates, (..., n) [rad/s; m/s for a prismatic joint].
        tip: T_n_tip, (..., 4, 4); None: frame {n} itself.

    Returns:
        [v; ω] of links 1..n and of the tip, at the origin and along the axes of the frame of each,
        (..., n + 1, 6) [m/s, rad/s].

    Raises:
        ModelError: If links, pitch and qdot differ in n, or a pitch is nan or −inf.

    Example:
        Example 5.3 of the notes, in frame {2} and in {0}:

        >>> (l1, l2), (q1, q2), (w1, w2) = (1.0, 0.8), (0.4, 0.9), (2.0, -3.0)
        >>> turn = lambda q, x: np.array(
        ...     [[np.cos(q), -np.sin(q), 0, x], [np.sin(q), np.cos(q), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        ... )
        >>> twists = outward_velocities([turn(q1, 0), turn(q2, l1)], [0, 0], [w1, w2], tip=turn(0, l2))
        >>> v = twists[-1, :3]
        >>> bool(np.allclose(v, [l1 * w1 * np.sin(q2), l1 * w1 * np.cos(q2) + l2 * (w1 + w2), 0]))
        True
        >>> x = -l1 * w1 * np.sin(q1) - l2 * (w1 + w2) * np.sin(q1 + q2)
        >>> y = l1 * w1 * np.cos(q1) + l2 * (w1 + w2) * np.cos(q1 + q2)
        >>> bool(np.allclose(turn(q1 + q2, 0)[:3, :3] @ v, [x, y, 0]))
        True
    """
    links, qdot = np.asarray(links, dtype=np.float64), np.asarray(qdot, dtype=np.float64)
    n = links.shape[-3]
    own = _unit_twists(pitch, n)
    if qdot.shape[-1:] != (n,):
        raise ModelError(f"chain: {n} joints but rates of shape {qdot.shape}; give one per joint")
    twist = np.zeros((*np.broadcast_shapes(links.shape[:-3], qdot.shape[:-1]), 6))
    twists = []
    for i in range(n):
        twist = _carried(twist, links[..., i, :, :]) + own[i] * qdot[..., i, None]
        twists.append(twist)
    twists.append(twist if tip is None else _carried(twist, np.asarray(tip, dtype=np.float64)))
    shape = twists[-1].shape
    return np.stack([np.broadcast_to(each, shape) for each in twists], axis=-2)


def jacobian_by_propagation(links: ArrayLike, pitch: ArrayLike, tip: ArrayLike | None = None) -> Array:
    """Return the geometric Jacobian of the tip: `outward_velocities` with one joint at a time at rate 1.

    The last twist, along the axes of {0}, is column i for q̇ = e_i [Craig05, §5.7].

    Args:
        links: T_i-1_i, (..., n, 4, 4).
        pitch: h of each joint: 0 revolute, inf prismatic, else helical, (n,) [m/rad].
        tip: T_n_tip, (..., 4, 4); None: frame {n} itself.

    Returns:
        Rows [v; ω] at the tip, along the axes of {0}, (..., 6, n).

    Raises:
        ModelError: If links and pitch differ in n, or a pitch is nan or −inf.

    Example:
        A slide along x whose joint axis z is turned there from frame {0}:

        >>> slide = np.array([[0, 0, 1, 0.3], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
        >>> jacobian_by_propagation([slide], [np.inf]).T
        array([[1., 0., 0., 0., 0., 0.]])
    """
    links = np.asarray(links, dtype=np.float64)
    n = links.shape[-3]
    tip = np.eye(4) if tip is None else np.asarray(tip, dtype=np.float64)
    # The rates have an axis of their own, in front of the links.
    twists = outward_velocities(links[..., None, :, :, :], pitch, np.eye(n), tip[..., None, :, :])
    R = tip[..., :3, :3]
    for i in reversed(range(n)):
        R = links[..., i, :3, :3] @ R
    last = np.swapaxes(twists[..., -1, :], -1, -2)
    return np.concatenate([R @ last[..., :3, :], R @ last[..., 3:, :]], axis=-2)


def inward_wrenches(links: ArrayLike, wrench: ArrayLike, tip: ArrayLike | None = None) -> Array:
    """Return the force and moment on each link from the previous link.

    ᶦf_i = ᶦR_i+1 ᶦ⁺¹f_i+1, ᶦn_i = ᶦR_i+1 ᶦ⁺¹n_i+1 + ᶦP_i+1 × ᶦf_i [Craig05, §5.9] [Khatib08]: the whole
    reaction. The actuator provides one component of it, `actuator_torques`, and the bearings the rest.

    Args:
        links: T_i-1_i, (..., n, 4, 4).
        wrench: [f; n] of the tip on the world, at the tip and along its axes,
            (..., 6) [N, N·m]. For a wrench on the arm, give its negative.
        tip: T_n_tip, (..., 4, 4); None: frame {n} itself.

    Returns:
        [f_i; n_i] exerted on link i by link i-1, for i = 1..n, at the origin and along the axes of
        {i}, (..., n, 6) [N, N·m].

    Example:
        The notes' two links of 1 m at (0, 60°) press down with 1 N. The first joint's bearing
        carries that force along −y, the second's along its own axes:

        >>> T1, T2, tip = np.eye(4), np.eye(4), np.eye(4)
        >>> T2[:2, :2] = [[0.5, -np.sqrt(0.75)], [np.sqrt(0.75), 0.5]]
        >>> T2[0, 3] = tip[0, 3] = 1.0
        >>> down = [*(T2[:3, :3].T @ [0, -1, 0]), 0, 0, 0]
        >>> reactions = inward_wrenches([T1, T2], down, tip)
        >>> reactions.round(3) + 0.0
        array([[ 0.   , -1.   ,  0.   ,  0.   ,  0.   , -1.5  ],
               [-0.866, -0.5  ,  0.   ,  0.   ,  0.   , -0.5  ]])
        >>> actuator_torques(reactions, [0, 0]).round(12)
        array([-1.5, -0.5])

        Stretched out upward, at (90°, 0), even 1000 N need no torque:

        >>> T1[:2, :2], T2[:2, :2] = [[0, -1], [1, 0]], np.eye(2)
        >>> actuator_torques(inward_wrenches([T1, T2], [-1000, 0, 0, 0, 0, 0], tip), [0, 0]) + 0.0
        array([0., 0.])
    """
    links, wrench = np.asarray(links, dtype=np.float64), np.asarray(wrench, dtype=np.float64)
    if tip is not None:
        wrench = _brought(wrench, np.asarray(tip, dtype=np.float64))
    wrenches = [wrench]
    for i in reversed(range(1, links.shape[-3])):
        wrenches.append(_brought(wrenches[-1], links[..., i, :, :]))
    shape = np.broadcast_shapes(wrenches[-1].shape, (*links.shape[:-3], 6))
    return np.stack([np.broadcast_to(each, shape) for each in reversed(wrenches)], axis=-2)


def actuator_torques(wrenches: ArrayLike, pitch: ArrayLike) -> Array:
    """Return each actuator's component of its link's reaction; the bearings provide the rest.

    τ_i = ᶦn_i · Ẑ of a revolute, ᶦf_i · Ẑ of a prismatic joint [Craig05, §5.9] [Khatib08], and
    ᶦn_i · Ẑ + h ᶦf_i · Ẑ of a helical one: the reaction's power in the joint's own motion, because the
    bearings do no work.

    Args:
        wrenches: [f_i; n_i] of every link, as `inward_wrenches` returns them, (..., n, 6) [N, N·m].
        pitch: h of each joint: 0 revolute, inf prismatic, else helical, (n,) [m/rad].

    Returns:
        τ, equivalent to the wrench at the tip, (..., n) [N·m; N for a prismatic joint].

    Raises:
        ModelError: If wrenches and pitch differ in n, or a pitch is nan or −inf.

    Example:
        A spindle that advances 10 mm per radian presses with 100 N along its axis:

        >>> actuator_torques([[0, 0, 100, 0, 0, 0]], [0.01])
        array([1.])
    """
    wrenches = np.asarray(wrenches, dtype=np.float64)
    return np.asarray(np.sum(wrenches * _unit_twists(pitch, wrenches.shape[-2]), axis=-1))


def _unit_twists(pitch: ArrayLike, n: int) -> Array:
    """Return [v; ω] of each joint per unit rate, in its own frame: (0, 0, h, 0, 0, 1), (0, 0, 1, 0, 0, 0)."""
    pitch = np.asarray(pitch, dtype=np.float64)
    if pitch.shape != (n,):
        raise ModelError(f"chain: {n} joints but pitches of shape {pitch.shape}; give one per joint")
    return np.roll(joint_screw((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), pitch), 3, axis=-1)


def _carried(twist: Array, T: Array) -> Array:
    """Return the twist of a body at the next of its frames, along that: v + ω × P, turned."""
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    back = -np.einsum("...ij,...j->...i", R, T[..., :3, 3])
    return np.asarray((twist_transform(R, back) @ twist[..., None])[..., 0])


def _brought(wrench: Array, T: Array) -> Array:
    """Return a wrench at the frame before: turned, n + P × f."""
    return np.asarray((wrench_transform(T[..., :3, :3], T[..., :3, 3]) @ wrench[..., None])[..., 0])


def joint_torques(jacobian: ArrayLike, wrench: ArrayLike) -> NDArray[np.float64]:
    """Return the joint torques that are equivalent to a wrench: τ = Jᵀ F.

    They do the same work in any small motion: τ·δq = F·δx for δx = J δq
    [Craig05, §5.10] [Khatib08].

    Args:
        jacobian: J, (..., m, n).
        wrench: F at the point and along the axes of J, in the order of its rows, (..., m) [N, N·m].

    Returns:
        τ, (..., n) [N·m, N for a prismatic joint].

    Example:
        The notes' two links of 1 m at (0, 60°) press down with 1 N:

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> joint_torques(two_link_jacobian([1, 1], np.radians([0, 60])), [0, -1]).round(12)
        array([-1.5, -0.5])

        Stretched out upward, at (90°, 0), even 1000 N need no torque: the arm is singular, and the force is
        along the lost direction.

        >>> joint_torques(two_link_jacobian([1, 1], np.radians([90, 0])), [0, -1000]).round(9) + 0.0
        array([0., 0.])
    """
    jacobian = np.asarray(jacobian, dtype=np.float64)
    wrench = np.asarray(wrench, dtype=np.float64)
    return np.asarray(np.einsum("...mn,...m->...n", jacobian, wrench))


def equilibrium_torques(jacobian: ArrayLike, wrench: ArrayLike) -> NDArray[np.float64]:
    """Return the joint torques that balance a wrench which acts on the arm: τ = −Jᵀ F.

    The virtual work τ·δq + F·δx is zero for every δq [Craig05, §5.10] [Khatib08].

    Args:
        jacobian: J, (..., m, n).
        wrench: F at the point and along the axes of J, in the order of its rows, (..., m) [N, N·m].

    Returns:
        τ, (..., n) [N·m, N for a prismatic joint].

    Example:
        A weight of 1 N hangs at the tip of two links of 1 m at (0, 60°):

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> equilibrium_torques(two_link_jacobian([1, 1], np.radians([0, 60])), [0, -1]).round(12)
        array([1.5, 0.5])
    """
    return -joint_torques(jacobian, wrench)
