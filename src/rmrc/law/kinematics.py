"""Kinematics of the site: geometric Jacobian, pose, and the error to the reference."""

import math
from typing import TypeAlias

from rmrc.law.jit import Array, Record, compiled, inlined
from rmrc.law.outward import GROUP, HERE, LANES, contribute, follow_first, follow_on, follow_short

Quaternion: TypeAlias = tuple[float, float, float, float]

# The frames of the rows, as a scenario names them and as a record codes them.
FRAMES = ("world", "base", "site")
WORLD, BASE, SITE = range(3)

# Squared tangents below which six terms of the series of the arc tangent are exact: the next is 2⁻⁶⁰/13.
SERIES_BELOW = 2.0**-10


@compiled
def geometric_jacobian(world: Record, anchors: Array, axes: Array) -> None:
    """Write J (6, n), rows [v; ω], along world axes, for the site at `world.pose`.

    The axes come from MuJoCo's up-to-date kinematics, so nothing is differentiated.

    Args:
        world: Read: ids, kinds, pitches and ratios of the axes, and the site's pose. Written: `outward`, J,
            and the columns of the axes where some joints follow others.
        anchors: A point on each of MuJoCo's joint axes, (njnt, 3) [m].
        axes: Unit vector of each joint axis, (njnt, 3).
    """
    for a in range(world.axes):
        joint = world.joint[a]
        for i in range(3):
            world.outward[i, a], world.outward[3 + i, a] = axes[joint, i], anchors[joint, i]
    chain_jacobian(world)


@compiled
def chain_jacobian(world: Record) -> None:
    """Write J like `geometric_jacobian`, with the axes that were found last."""
    if world.axes == world.n:
        write_columns(world, world.pose, world.J)
    else:
        write_columns(world, world.pose, world.columns)
        gather(world, world.columns, world.J)


@compiled
def second_jacobian(world: Record) -> None:
    """Write J_2 of the second task's site, after J; joints behind that site do not move it."""
    if world.axes == world.n:
        write_moving(world, world.J_2)
    else:
        write_moving(world, world.columns_2)
        gather(world, world.columns_2, world.J_2)


@compiled
def write_moving(world: Record, columns: Array) -> None:
    """Write the contribution of each axis to the twist of the second task's site, (6, ℓ)."""
    write_columns(world, world.pose_2, columns)
    for a in range(world.axes):
        if not world.moves_2[a]:
            for i in range(6):
                columns[i, a] = 0.0


@compiled
def write_columns(world: Record, point: Array, columns: Array) -> None:
    """Write the contribution of each axis to the twist of a point, (6, ℓ).

    A revolute joint with axis z through o contributes [z × (p − o); z], a prismatic one [z; 0]
    [Whitney72], and a helical one of pitch h [z × (p − o) + h z; z] [Selig92].
    """
    for first in range(0, world.axes, LANES):
        contribute(world.chain, world.outward, point, columns, first)


@compiled
def gather(world: Record, columns: Array, J: Array) -> None:
    """Write J (6, n) from the columns of the axes, (6, ℓ): the followers of each joint move with it."""
    for i in range(6):
        for j in range(world.n):
            J[i, j] = 0.0
        for a in range(world.axes):
            J[i, world.leader[a]] += world.ratio[a] * columns[i, a]


@compiled
def follow_chain(world: Record, q: Array) -> None:
    """Write the axes, their anchors and the site at joint positions q, by the product of exponentials.

    T(q) = exp(S_1 q_1) … exp(S_n q_n) T(0) [Brockett84], carried outward as a rotation and a point on the
    next axis. It serves where there are too many configurations for MuJoCo's own kinematics. The axes of
    followers are among them, and move with their leaders.

    Args:
        world: Read: the arm's geometry at 0. Written: `outward` and `pose`.
        q: Joint positions, (n,).
    """
    if world.axes <= GROUP:
        place = follow_short(world.chain, world.leader, q, world.outward)
    else:
        place = follow_first(world.chain, world.leader, q, world.outward, 0, world.axes, HERE)
    for first in range(LANES, world.axes, LANES):
        place = follow_on(world.chain, world.leader, q, world.outward, first, world.axes - first, place)
    turn, tip = (place[0], place[1], place[2], place[3]), world.tip_quat
    dx, dy, dz = turned(turn, world.tip_step)
    world.pose[0], world.pose[1], world.pose[2] = place[4] + dx, place[5] + dy, place[6] + dz
    world.pose[3], world.pose[4], world.pose[5], world.pose[6] = quat_product(
        turn, (tip[0], tip[1], tip[2], tip[3])
    )


@compiled
def follow_second(world: Record, q: Array) -> None:
    """Write pose and Jacobian of the second task's site, at the same q as the last `follow_chain`."""
    turn, last = (1.0, 0.0, 0.0, 0.0), world.last_2
    for a in range(last + 1):
        if not world.is_slide[a]:
            moved = 0.5 * world.ratio[a] * q[world.leader[a]]
            c, s, axis = math.cos(moved), math.sin(moved), world.outward[:3]
            turn = quat_product((c, s * axis[0, a], s * axis[1, a], s * axis[2, a]), turn)
    moved = world.ratio[last] * q[world.leader[last]]
    way = moved if world.is_slide[last] else world.pitch[last] * moved
    step, tip = turned(turn, world.tip_step_2), world.tip_quat_2
    for i in range(3):
        world.pose_2[i] = world.outward[3 + i, last] + way * world.outward[i, last] + step[i]
    world.pose_2[3], world.pose_2[4], world.pose_2[5], world.pose_2[6] = quat_product(
        turn, (tip[0], tip[1], tip[2], tip[3])
    )
    second_jacobian(world)


@compiled
def turned(turn: Quaternion, v: Array) -> tuple[float, float, float]:
    """Return v + 2 w (u × v) + 2 u × (u × v) of the quaternion (w, u)."""
    w, x, y, z = turn
    cx, cy, cz = y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]
    return (
        v[0] + 2.0 * (w * cx + y * cz - z * cy),
        v[1] + 2.0 * (w * cy + z * cx - x * cz),
        v[2] + 2.0 * (w * cz + x * cy - y * cx),
    )


@compiled
def quat_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return a b, with the same bits as MuJoCo's product."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@inlined
def pose_error(pose: Array, pose_ref: Array, error: Array) -> None:
    """Write [p_ref − p; log(R_ref Rᵀ)], (6,) [m, rad], along world axes.

    The rotation vector comes from the quaternion by the arc tangent, which keeps full precision for small
    errors, where acos of the trace loses half the digits. Its series serves for small errors.
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
    sine2 = x * x + y * y + z * z
    if sine2 < SERIES_BELOW * w * w:
        t = sine2 / (w * w)
        t2 = t * t
        factor = (2.0 / w) * ((1.0 - t / 3.0) + t2 * ((1.0 / 5.0 - t / 7.0) + t2 * (1.0 / 9.0 - t / 11.0)))
    else:
        sine = math.sqrt(sine2)
        factor = 2.0 if sine == 0.0 else 2.0 * math.atan2(sine, w) / sine
    error[3], error[4], error[5] = factor * x, factor * y, factor * z


@compiled
def frame_turn(frame: int, base: Array, pose: Array) -> Quaternion:
    """Return the rotation of world vectors into the axes of a frame: the conjugate of its orientation.

    Args:
        frame: BASE or SITE.
        base: Orientation of the base, (4,).
        pose: Pose of the site, (7,).
    """
    if frame == SITE:
        return (pose[3], -pose[4], -pose[5], -pose[6])
    return (base[0], -base[1], -base[2], -base[3])


@compiled
def turn_twist(turn: Quaternion, twist: Array) -> None:
    """Turn both halves of [v; ω], (6,), in place."""
    twist[0], twist[1], twist[2] = turned(turn, twist[:3])
    twist[3], twist[4], twist[5] = turned(turn, twist[3:])


@compiled
def turn_columns(turn: Quaternion, J: Array, n: int) -> None:
    """Turn both halves of the first n columns of J (6, n) in place."""
    for j in range(n):
        for half in range(0, 6, 3):
            x, y, z = turned(turn, J[half : half + 3, j])
            J[half, j], J[half + 1, j], J[half + 2, j] = x, y, z


@inlined
def framed_error(frame: int, base: Array, free: int, pose: Array, pose_ref: Array, error: Array) -> None:
    """Write `pose_error` along the axes of a frame; the arguments are those of `frame_error`."""
    pose_error(pose, pose_ref, error)
    if frame != WORLD:
        frame_error(frame, base, free, pose, pose_ref, error)


@compiled
def frame_error(frame: int, base: Array, free: int, pose: Array, pose_ref: Array, error: Array) -> None:
    """Turn a `pose_error` into a frame.

    Where the rotation about one axis of the site is free, the reference is first turned about it. The other
    two errors are then those of the axis itself, however far the site has turned about it.

    Args:
        frame: BASE or SITE.
        base: Orientation of the base, (4,).
        free: The free axis of the site, 0 to 2, or -1.
        pose: Pose of the site, (7,).
        pose_ref: Wanted pose, (7,).
        error: The error along world axes, (6,) [m, rad]; replaced.
    """
    turn_twist(frame_turn(frame, base, pose), error)
    if free >= 0:
        _free_axis(free, pose, pose_ref, error)


@compiled
def _free_axis(free: int, pose: Array, pose_ref: Array, error: Array) -> None:
    """Replace the rotations of an error along the site's axes: q = Rᵀ R_ref is a tilt after a free turn.

    With q = (w, u + t k), u normal to the axis k, the turn is (w, t k)/c and the tilt (c, (w u − t u × k)/c).
    """
    w, x, y, z = quat_product(
        (pose[3], -pose[4], -pose[5], -pose[6]), (pose_ref[3], pose_ref[4], pose_ref[5], pose_ref[6])
    )
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    # k is the third of three axes in cyclic order
    if free == 2:
        a, b, t = x, y, z
    elif free == 0:
        a, b, t = y, z, x
    else:
        a, b, t = z, x, y
    c = math.sqrt(w * w + t * t)
    if c > 0.0:  # otherwise the axis points the other way, and every turn about it is equally good
        a, b = (w * a - t * b) / c, (w * b + t * a) / c
    sine = math.sqrt(a * a + b * b)
    factor = 2.0 if sine == 0.0 else 2.0 * math.atan2(sine, c) / sine
    first = (free + 1) % 3
    error[3 + first], error[3 + (first + 1) % 3] = factor * a, factor * b
    error[3 + free] = 2.0 * math.atan2(t, w)
