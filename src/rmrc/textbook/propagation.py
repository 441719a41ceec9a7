"""Propagation from link to link: velocities outward from the base, forces and moments inward from the tip.

The input is the link transforms T_i-1_i(q) of a chain for i = 1..n, at one configuration. Frame {i} is fixed
in link i, its origin lies on the axis of joint i, and its z is along that axis. The direction of x and the
position of the origin along the axis are free. Any serial arm has this form, and so has a modified DH chain.
Frame {0} is at rest. The tip is fixed in link n.

The `pitch` of joint i is in m/rad: 0 for revolute, inf for prismatic, else helical; see
`rmrc.textbook.screws`.

The notes use the frames of standard DH chains. Their {i} lies at the far end of link i and turns with it
about ẑ_i-1, so ᶦ⁺¹v_i+1 contains ω_i+1 in place of ω_i. Both forms transport a body's twist to another of its
points, and add the joint's own twist on its axis: the notes before the transport, these functions after it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError
from rmrc.support.spatial import twist_transform, wrench_transform
from rmrc.textbook.screws import joint_screw

Array = NDArray[np.float64]


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
