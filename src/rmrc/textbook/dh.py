"""Denavit-Hartenberg chains: link transforms, forward kinematics, geometric Jacobian.

The sources use two conventions: [Craig05] and [Khatib08] put frame i on the
axis of joint i ("modified"), [Denavit55] and [Paul81] on the axis of joint i+1 ("standard").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError

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
    return _matrix(
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
    return _matrix(
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


def _matrix(*rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
