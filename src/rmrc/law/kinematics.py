"""Kinematics of the site: geometric Jacobian, pose, and the error to the reference."""

import math
from typing import TypeAlias

from rmrc.law.compiling import Array, Record, compiled

Quaternion: TypeAlias = tuple[float, float, float, float]

# The frames of the rows, as a scenario names them and as a record codes them.
FRAMES = ("world", "base", "site")
WORLD, BASE, SITE = range(3)

# An angle beyond half a turn by no more than this does not wrap: rounding must not choose its sign.
HALF_TURN = 1e-5


@compiled
def geometric_jacobian(world: Record) -> None:
    """Write J (6, n), rows [v; ω], along world axes, for the site at `state.pose`, from the axes found last.

    Where some joints follow others, the contributions of all axes are `chain.columns`.
    """
    chain, state = world.chain, world.state
    if chain.axes == world.n:
        write_columns(world, state.pose, state.J)
    else:
        write_columns(world, state.pose, chain.columns)
        gather(world, chain.columns, state.J)


@compiled
def second_jacobian(world: Record) -> None:
    """Write J_2 of the second task's site, after J; joints behind that site do not move it."""
    second = world.second
    write_columns(world, second.pose, second.columns)
    for a in range(world.chain.axes):
        if not second.moves[a]:
            for i in range(6):
                second.columns[i, a] = 0.0
    gather(world, second.columns, second.J)


@compiled
def write_columns(world: Record, point: Array, columns: Array) -> None:
    """Write the contribution of each axis to the twist of a point, (6, ℓ).

    A revolute joint with axis z through o contributes [z × (p − o); z], a prismatic one [z; 0]
    [Whitney72], and a helical one of pitch h [z × (p − o) + h z; z] [Selig92].
    """
    chain = world.chain
    for a in range(chain.axes):
        turns, advance = chain.turns[a], chain.advance[a]
        x, y, z = chain.axis[a, 0], chain.axis[a, 1], chain.axis[a, 2]
        rx, ry = point[0] - chain.anchor[a, 0], point[1] - chain.anchor[a, 1]
        rz = point[2] - chain.anchor[a, 2]
        columns[0, a] = turns * (y * rz - z * ry) + advance * x
        columns[1, a] = turns * (z * rx - x * rz) + advance * y
        columns[2, a] = turns * (x * ry - y * rx) + advance * z
        columns[3, a], columns[4, a], columns[5, a] = turns * x, turns * y, turns * z


@compiled
def gather(world: Record, columns: Array, J: Array) -> None:
    """Write J (6, n) from the columns of the axes, (6, ℓ): the followers of each joint move with it."""
    chain = world.chain
    for i in range(6):
        for j in range(world.n):
            J[i, j] = 0.0
        for a in range(chain.axes):
            J[i, chain.leader[a]] += chain.ratio[a] * columns[i, a]


@compiled
def place_axis(tree: Record, a: int, b: int, q: Array) -> None:
    """Write an axis, a point on it, and the pose behind it, at joint positions q (n,).

    Args:
        tree: The chain, or the links of an inertia.
        a: The axis, which moves with its leader in a ratio.
        b: The axis before it, whose pose is known, or -1.
        q: Joint positions, (n,).
    """
    frame, turn, x, y, z = tree.frame[a], (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
    if b >= 0:
        turn, x, y, z = turn_of(tree.frame[b]), tree.frame[b, 0], tree.frame[b, 1], tree.frame[b, 2]
    dx, dy, dz = turned(turn, tree.step_0[a])
    x, y, z = x + dx, y + dy, z + dz
    ax, ay, az = turned(turn, tree.axis_0[a])
    tree.axis[a, 0], tree.axis[a, 1], tree.axis[a, 2] = ax, ay, az
    tree.anchor[a, 0], tree.anchor[a, 1], tree.anchor[a, 2] = x, y, z
    moved = tree.ratio[a] * q[tree.leader[a]]
    way = tree.advance[a] * moved
    frame[0], frame[1], frame[2] = x + way * ax, y + way * ay, z + way * az
    if tree.turns[a] != 0.0:
        c, s = math.cos(0.5 * moved), math.sin(0.5 * moved)
        turn = quat_product((c, s * ax, s * ay, s * az), turn)
    frame[3], frame[4], frame[5], frame[6] = turn


@compiled
def follow_chain(world: Record, q: Array) -> None:
    """Write the axes, their anchors and the site at joint positions q, by the product of exponentials.

    T(q) = exp(S_1 q_1) … exp(S_n q_n) T(0) [Brockett84], carried outward as a rotation and a point on the
    next axis. The axes of followers are among them, and move with their leaders. MuJoCo is not called.

    Args:
        world: Read: the arm's geometry at 0. Written: `chain` and `state.pose`.
        q: Joint positions, (n,).
    """
    chain = world.chain
    for a in range(chain.axes):
        place_axis(chain, a, a - 1, q)
    carry(chain.frame[chain.axes - 1], chain.tip, world.state.pose)


@compiled
def follow_second(world: Record) -> None:
    """Write pose and Jacobian of the second task's site, at the q of the last `follow_chain`."""
    second = world.second
    carry(world.chain.frame[second.last_axis], second.tip, second.pose)
    second_jacobian(world)


@compiled
def carry(frame: Array, pose: Array, carried: Array) -> None:
    """Write a pose of a frame, (7,), along world axes, (7,); any of them may be the same array."""
    turn = turn_of(frame)
    x, y, z = turned(turn, pose)
    carried[0], carried[1], carried[2] = frame[0] + x, frame[1] + y, frame[2] + z
    carried[3], carried[4], carried[5], carried[6] = quat_product(turn, turn_of(pose))


@compiled
def turn_of(pose: Array) -> Quaternion:
    """Return the orientation of a pose, (7,)."""
    return (pose[3], pose[4], pose[5], pose[6])


@compiled
def turn_back(pose: Array) -> Quaternion:
    """Return the rotation of world vectors into the axes of a pose, (7,): its orientation, conjugated."""
    return (pose[3], -pose[4], -pose[5], -pose[6])


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


@compiled
def pose_error(pose: Array, pose_ref: Array, error: Array) -> None:
    """Write [p_ref − p; log(R_ref Rᵀ)], (6,) [m, rad], along world axes.

    The rotation vector comes from the quaternion by the arc tangent, which keeps full precision for small
    errors, where acos of the trace loses half the digits.
    """
    for i in range(3):
        error[i] = pose_ref[i] - pose[i]
    w, x, y, z = quat_product(turn_of(pose_ref), turn_back(pose))
    sine, shorter = math.sqrt(x * x + y * y + z * z), -1.0 if w < 0.0 else 1.0  # the shorter way round
    factor = 2.0 * shorter if sine == 0.0 else 2.0 * shorter * math.atan2(sine, abs(w)) / sine
    error[3], error[4], error[5] = factor * x, factor * y, factor * z


@compiled
def way_to(world: Record, j: int, position: float) -> float:
    """Return the way of a joint to a position: the shorter way round where a whole turn changes nothing.

    Half a turn goes upwards, whatever the number of turns and their rounding.
    """
    way = position - world.state.q[j]
    if world.task.comes_round[j] != 0:
        way -= math.tau * math.ceil((way - math.pi - HALF_TURN) / math.tau)
    return float(way)


@compiled
def frame_turn(frame: int, base: Array, pose: Array) -> Quaternion:
    """Return the rotation of world vectors into the axes of a frame: the conjugate of its orientation.

    Args:
        frame: BASE or SITE.
        base: Pose of the base, (7,).
        pose: Pose of the site, (7,).
    """
    return turn_back(pose if frame == SITE else base)


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


@compiled
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
        base: Pose of the base, (7,).
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
    w, x, y, z = quat_product(turn_back(pose), turn_of(pose_ref))
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    first, second = (free + 1) % 3, (free + 2) % 3  # k is the third of three axes in cyclic order
    vector = (x, y, z)
    a, b, t = vector[first], vector[second], vector[free]
    c = math.sqrt(w * w + t * t)
    if c > 0.0:  # otherwise the axis points the other way, and every turn about it is equally good
        a, b = (w * a - t * b) / c, (w * b + t * a) / c
    sine = math.sqrt(a * a + b * b)
    factor = 2.0 if sine == 0.0 else 2.0 * math.atan2(sine, c) / sine
    error[3 + first], error[3 + second] = factor * a, factor * b
    error[3 + free] = 2.0 * math.atan2(t, w)
