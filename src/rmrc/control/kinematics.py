"""What is measured at the site: geometric Jacobian, pose, and the error to the reference."""

import math

from rmrc.control.compiled import Array, Record, compiled


@compiled
def geometric_jacobian(world: Record, point: Array, anchors: Array, axes: Array, J: Array) -> None:
    """Write J (6, n), rows [v; ω], along world axes, at a point fixed to the last link.

    A revolute joint with axis z through o contributes [z × (p − o); z], a prismatic one [z; 0]
    [Whitney72]. The axes come from MuJoCo's fresh kinematics, so nothing is differentiated.

    Args:
        world: Reads which joints of the model are the arm's, and their kind.
        point: The site's origin, (3,) [m].
        anchors: A point on each joint axis of the model, (njnt, 3) [m].
        axes: Unit vector of each joint axis, (njnt, 3).
        J: Written, (6, n).
    """
    for j in range(world.n):
        joint = world.joint[j]
        zx, zy, zz = axes[joint, 0], axes[joint, 1], axes[joint, 2]
        if world.is_slide[j]:
            J[0, j], J[1, j], J[2, j] = zx, zy, zz
            J[3, j] = J[4, j] = J[5, j] = 0.0
        else:
            rx, ry, rz = (
                point[0] - anchors[joint, 0],
                point[1] - anchors[joint, 1],
                point[2] - anchors[joint, 2],
            )
            J[0, j], J[1, j], J[2, j] = zy * rz - zz * ry, zz * rx - zx * rz, zx * ry - zy * rx
            J[3, j], J[4, j], J[5, j] = zx, zy, zz


@compiled
def scale_joints(world: Record, rates: Array) -> None:
    """Turn scaled rates into joint rates: multiply by S_q."""
    for j in range(world.n):
        rates[j] *= world.joint_scale[j]


@compiled
def pose_error(pose: Array, pose_ref: Array, error: Array) -> None:
    """Write [p_ref − p; log(R_ref Rᵀ)], (6,) [m, rad], along world axes.

    The rotation vector is taken from the quaternion's atan2 form, which keeps full precision for
    small errors, where acos of the trace loses half the digits.
    """
    for i in range(3):
        error[i] = pose_ref[i] - pose[i]
    aw, ax, ay, az = pose_ref[3], pose_ref[4], pose_ref[5], pose_ref[6]
    bw, bx, by, bz = pose[3], -pose[4], -pose[5], -pose[6]
    w = aw * bw - ax * bx - ay * by - az * bz
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    if w < 0.0:  # the shorter way round
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 if sine == 0.0 else 2.0 * math.atan2(sine, w) / sine
    error[3], error[4], error[5] = factor * x, factor * y, factor * z
