"""Rotations, poses, twists and wrenches: the order of their rows lives here and nowhere else.

A quaternion is [w, x, y, z], a pose [p; quat], a twist [v; ω], a wrench [f; n]. Every function
broadcasts over leading axes.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

AXES = ("x", "y", "z", "rx", "ry", "rz")
"""The rows of a twist [v; ω] and of a pose error, along the axes of a frame."""

ORIGIN: Array = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
"""The pose of a frame in itself."""
ORIGIN.setflags(write=False)


def normalize(v: ArrayLike) -> Array:
    """Return v / |v|, also where |v|² would overflow or vanish.

    Args:
        v: Vectors or quaternions, (..., k).

    Returns:
        Of length 1, (..., k).

    Raises:
        ValueError: A vector is zero or not finite: it has no direction.

    >>> normalize([0.0, 3e-200, 4e-200])
    array([0. , 0.6, 0.8])
    """
    v = np.asarray(v, dtype=float)
    largest = np.max(np.abs(v), axis=-1, keepdims=True)
    if not np.all((largest > 0) & np.isfinite(largest)):
        raise ValueError("cannot normalize a vector that is zero or not finite")
    scaled = v / largest
    unit: Array = scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
    return unit


def skew(v: ArrayLike) -> Array:
    """Return the matrix S of the cross product, S w = v × w for every w.

    Args:
        v: (..., 3).

    Returns:
        (..., 3, 3).

    >>> skew([1.0, 2.0, 3.0]) @ [0.0, 0.0, 1.0]
    array([ 2., -1.,  0.])
    """
    x, y, z = np.moveaxis(np.asarray(v, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [(zero, -z, y), (z, zero, -x), (-y, x, zero)]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


# Rotations ---------------------------------------------------------------------------------------


def quat_multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """Return a ⊗ b: the rotation b, then the rotation a.

    Args:
        a: [w, x, y, z], (..., 4).
        b: [w, x, y, z], (..., 4).

    Returns:
        (..., 4).

    >>> quat_multiply([0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0])
    array([0., 0., 0., 1.])
    """
    aw, ax, ay, az = np.moveaxis(np.asarray(a, dtype=float), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, dtype=float), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def quat_conjugate(q: ArrayLike) -> Array:
    """Return the inverse of a unit quaternion.

    Args:
        q: [w, x, y, z], unit, (..., 4).

    Returns:
        [w, -x, -y, -z], (..., 4).

    >>> quat_conjugate([0.5, 0.5, -0.5, 0.5])
    array([ 0.5, -0.5,  0.5, -0.5])
    """
    return np.asarray(q, dtype=float) * [1.0, -1.0, -1.0, -1.0]


def quat_from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Return the rotation by an angle about an axis.

    It is continuous in the angle: one more full turn changes the sign.

    Args:
        axis: Axis of any length but 0, (..., 3).
        angle: (...) [rad].

    Returns:
        [w, x, y, z], unit, (..., 4).

    Raises:
        ValueError: The axis is zero or not finite.

    >>> quat_from_axis_angle([0.0, 0.0, 2.0], np.pi).round(12)
    array([0., 0., 0., 1.])
    """
    half = 0.5 * np.asarray(angle, dtype=float)[..., None]
    vector = np.sin(half) * normalize(axis)
    scalar = np.broadcast_to(np.cos(half), (*vector.shape[:-1], 1))
    return np.concatenate([scalar, vector], axis=-1)


def quat_from_rpy(angles: ArrayLike) -> Array:
    """Return the rotation by roll, pitch and yaw: about x, then y, then z, all fixed.

    Args:
        angles: (..., 3) [rad].

    Returns:
        [w, x, y, z], unit, (..., 4).

    >>> quat_from_rpy([0.0, 0.0, np.pi]).round(12)
    array([0., 0., 0., 1.])
    """
    roll, pitch, yaw = np.moveaxis(quat_from_axis_angle(np.eye(3), angles), -2, 0)
    return quat_multiply(yaw, quat_multiply(pitch, roll))


def quat_to_matrix(q: ArrayLike) -> Array:
    """Return the rotation matrix of a unit quaternion.

    Args:
        q: [w, x, y, z], unit, (..., 4).

    Returns:
        (..., 3, 3).

    >>> quat_to_matrix([0.0, 1.0, 0.0, 0.0])
    array([[ 1.,  0.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0., -1.]])
    """
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    rows = [
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_quat(R: ArrayLike) -> Array:
    """Return the quaternion of a rotation matrix, accurate for every angle.

    4 q qᵀ is linear in R; its row with the largest diagonal entry is q up to a factor that
    cannot vanish [Shepperd78].

    Args:
        R: Rotation matrices, (..., 3, 3).

    Returns:
        [w, x, y, z], unit, w >= 0; for w = 0 the largest component is positive, (..., 4).

    >>> matrix_to_quat(np.diag([1.0, -1.0, -1.0]))
    array([0., 1., 0., 0.])
    """
    R = np.asarray(R, dtype=float)
    # Python's floats are as exact as numpy's, and the entries of one matrix take a third of the time
    xx, xy, xz, yx, yy, yz, zx, zy, zz = R.ravel().tolist() if R.ndim == 2 else R.reshape(-1, 9).T
    rows = [
        (1 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx),
        (xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy),
        (yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz),
    ]
    products = np.array(rows).reshape(4, 4, -1)
    largest = np.argmax(np.diagonal(products), axis=-1)
    row = products[largest, :, np.arange(len(largest))]
    return normalize(np.where(row[:, :1] < 0, -row, row)).reshape(*R.shape[:-2], 4)


def exp_rotation(rotvec: ArrayLike) -> Array:
    """Return the rotation about rotvec by |rotvec|: the exponential map of SO(3).

    Args:
        rotvec: Axis times angle, (..., 3) [rad].

    Returns:
        [w, x, y, z], unit, (..., 4).

    >>> exp_rotation([0.0, 1e-12, 0.0])
    array([1.e+00, 0.e+00, 5.e-13, 0.e+00])
    """
    rotvec = np.asarray(rotvec, dtype=float)
    half = 0.5 * np.linalg.norm(rotvec, axis=-1, keepdims=True)
    # numpy's sinc(x) is sin(πx)/(πx), exact in the limit x = 0.
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * rotvec], axis=-1)


def log_rotation(quat: ArrayLike) -> Array:
    """Return the shortest rotation vector of a quaternion: the inverse of `exp_rotation`.

    The angle comes from atan2, which is accurate from the smallest angles up to π, where the arc cosine of
    the trace is not. q and −q give the same, except a half turn (w = 0), whose two vectors are equally short.

    Args:
        quat: [w, x, y, z], unit, (..., 4).

    Returns:
        Axis times angle, the angle in [0, π], (..., 3) [rad].

    >>> log_rotation([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]) / np.pi
    array([0. , 0. , 0.5])
    """
    quat = np.asarray(quat, dtype=float)
    quat = np.where(quat[..., :1] < 0, -quat, quat)
    sine = np.linalg.norm(quat[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quat[..., :1])
    # Where the sine vanishes, angle/sine has the limit 2.
    ratio = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
    rotvec: Array = ratio * quat[..., 1:]
    return rotvec


def rotate(quat: ArrayLike, v: ArrayLike) -> Array:
    """Return R(quat) v.

    Args:
        quat: [w, x, y, z], unit, (..., 4).
        v: (..., 3).

    Returns:
        (..., 3).

    >>> rotate([0.5, 0.5, 0.5, 0.5], [1.0, 2.0, 3.0])
    array([3., 1., 2.])
    """
    quat, v = np.asarray(quat, dtype=float), np.asarray(v, dtype=float)
    vector = quat[..., 1:]
    once = 2.0 * np.cross(vector, v)
    rotated: Array = v + quat[..., :1] * once + np.cross(vector, once)
    return rotated


# Poses, twists, wrenches -------------------------------------------------------------------------


def pose_error(pose_ref: ArrayLike, pose: ArrayLike) -> Array:
    """Return [p_ref − p; log(R_ref Rᵀ)]: the twist that closes the gap in one second.

    Both poses are in the world; the rotation is the shortest, along world axes [Lynch17, §11.3].

    Args:
        pose_ref: [p, quat w x y z], (..., 7) [m, 1].
        pose: [p, quat w x y z], (..., 7) [m, 1].

    Returns:
        (..., 6) [m, rad].

    >>> pose_error([1.0, 2, 3, 1, 0, 0, 0], [1.0, 2, 2, 0, 1, 0, 0]) / [1, 1, 1, np.pi, 1, 1]
    array([ 0.,  0.,  1., -1.,  0.,  0.])
    """
    pose_ref, pose = np.asarray(pose_ref, dtype=float), np.asarray(pose, dtype=float)
    turn = log_rotation(quat_multiply(pose_ref[..., 3:], quat_conjugate(pose[..., 3:])))
    return np.concatenate([pose_ref[..., :3] - pose[..., :3], turn], axis=-1)


def tilt_error(turn: ArrayLike, free: int) -> Array:
    """Return the rotation errors of a body along its own axes, about one of which it may turn freely.

    The rotation is tilt · turn about the free axis; the tilt has the rotation vector of the other two axes.

    Args:
        turn: Rᵀ R_ref as a unit quaternion, (..., 4).
        free: The free axis, 0 to 2.

    Returns:
        (..., 3) [rad]: the tilt's rotation vector, and the angle about the free axis.

    >>> half = np.sqrt(0.5)
    >>> quarter, about = [half, half, 0, 0], [0, 0, 0, 1]
    >>> tilt_error(quat_multiply(quarter, about), 2) / np.pi
    array([0.5, 0. , 1. ])
    """
    turn = np.asarray(turn, dtype=float)
    turn = np.where(turn[..., :1] < 0, -turn, turn)
    about = np.zeros_like(turn)
    about[..., 0], about[..., 1 + free] = turn[..., 0], turn[..., 1 + free]
    size = np.linalg.norm(about, axis=-1, keepdims=True)
    about = np.where(size > 0, about / np.where(size > 0, size, 1.0), [1.0, 0.0, 0.0, 0.0])
    error = log_rotation(quat_multiply(turn, quat_conjugate(about)))
    error[..., free] = 2.0 * np.arctan2(about[..., 1 + free], about[..., 0])
    return error


def pose_product(a_b: ArrayLike, b_c: ArrayLike) -> Array:
    """Return the pose of c in a, (..., 7), from that of b in a and that of c in b.

    >>> pose_product([1.0, 0, 0, 0, 0, 0, 1], [1.0, 0, 0, 0, 0, 0, 1])
    array([ 0.,  0.,  0., -1.,  0.,  0.,  0.])
    """
    a_b, b_c = np.asarray(a_b, dtype=float), np.asarray(b_c, dtype=float)
    point = a_b[..., :3] + (quat_to_matrix(a_b[..., 3:]) @ b_c[..., :3, None])[..., 0]
    return np.concatenate([point, quat_multiply(a_b[..., 3:], b_c[..., 3:])], axis=-1)


def pose_inverse(a_b: ArrayLike) -> Array:
    """Return the pose of a in b, (..., 7), from that of b in a.

    >>> pose_inverse([1.0, 2, 3, 0, 0, 0, 1])
    array([ 1.,  2., -3.,  0., -0., -0., -1.])
    """
    a_b = np.asarray(a_b, dtype=float)
    back = quat_conjugate(a_b[..., 3:])
    return np.concatenate([-(quat_to_matrix(back) @ a_b[..., :3, None])[..., 0], back], axis=-1)


def twist_transform(R_a_b: ArrayLike, p_a_b: ArrayLike) -> Array:
    """Return the matrix that takes the twist of a body from frame b to frame a.

    a and b are fixed to the body; each twist is that of its frame's origin, along its frame's
    axes: [[R, skew(p) R], [0, R]] [Craig05, §5.11].

    Args:
        R_a_b: Rotation of b in a, (..., 3, 3).
        p_a_b: Origin of b in a, (..., 3) [m].

    Returns:
        (..., 6, 6).

    >>> twist_transform(np.eye(3), [0.0, 1.0, 0.0]) @ [0.0, 0, 0, 0, 0, 1]
    array([1., 0., 0., 0., 0., 1.])
    """
    R = np.asarray(R_a_b, dtype=float)
    lever = skew(p_a_b) @ R
    return _blocks(np.broadcast_to(R, lever.shape), lever, np.zeros_like(lever))


def wrench_transform(R_a_b: ArrayLike, p_a_b: ArrayLike) -> Array:
    """Return the matrix that takes a wrench on a body from frame b to frame a.

    [[R, 0], [skew(p) R, R]], the inverse transpose of `twist_transform`, which preserves power
    [Craig05, §5.11].

    Args:
        R_a_b: Rotation of b in a, (..., 3, 3).
        p_a_b: Origin of b in a, (..., 3) [m].

    Returns:
        (..., 6, 6).

    >>> wrench_transform(np.eye(3), [0.0, 1.0, 0.0]) @ [1.0, 0, 0, 0, 0, 0]
    array([ 1.,  0.,  0.,  0.,  0., -1.])
    """
    R = np.asarray(R_a_b, dtype=float)
    lever = skew(p_a_b) @ R
    return _blocks(np.broadcast_to(R, lever.shape), np.zeros_like(lever), lever)


def _blocks(R: Array, upper: Array, lower: Array) -> Array:
    top, bottom = np.concatenate([R, upper], axis=-1), np.concatenate([lower, R], axis=-1)
    return np.concatenate([top, bottom], axis=-2)


def shift_twist(twist: ArrayLike, r: ArrayLike) -> Array:
    """Return the twist of the same body at another point, along the same axes.

    v' = v + r × ω [Craig05, §5.11].

    Args:
        twist: [v; ω] at the first point, (..., 6) [m/s, rad/s].
        r: From the new point to the first, (..., 3) [m].

    Returns:
        [v'; ω] at the new point, (..., 6) [m/s, rad/s].

    >>> shift_twist([0.0, 0, 0, 0, 0, 1], [-1.0, 0, 0])
    array([0., 1., 0., 0., 0., 1.])
    """
    twist, r = np.asarray(twist, dtype=float), np.asarray(r, dtype=float)
    linear = twist[..., :3] + np.cross(r, twist[..., 3:])
    angular = np.broadcast_to(twist[..., 3:], linear.shape)
    return np.concatenate([linear, angular], axis=-1)


def each_of(values: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Return the numbers of rows, (..., k), one array of each."""
    return tuple(np.moveaxis(np.asarray(values, dtype=np.float64), -1, 0))


def matrix_of(*rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return a matrix of its entries, (..., m, n)."""
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def times(matrix: Array, vector: Array) -> Array:
    """Return the products of matrices and vectors, (..., m)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])
