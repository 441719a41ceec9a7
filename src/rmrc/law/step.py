"""One call of the law from Python: kinematics, a target in any frame, the law, and checks of the input.

    input         --receive--> q, pose, J; target pose and twist along world axes
                  --aim, resolve_twist--> qdot_cmd     or: a motion of the joints, or the way to rest
                  --send--> memory, q_cmd

It is the law of a run: with the same input, a loop outside a run gives the same rates to the bit.
"""

import math
from enum import IntFlag

from rmrc.law.jerk import remember
from rmrc.law.jit import Array, Record, compiled, entry
from rmrc.law.joint_motion import brake_blindly, come_back, follow_joints, is_outside
from rmrc.law.kinematics import (
    BASE,
    SITE,
    chain_jacobian,
    follow_chain,
    follow_second,
    geometric_jacobian,
    quat_product,
    second_jacobian,
    turn_twist,
    turned,
)
from rmrc.law.law import aim, decompose, record_measures, resolve_twist, scale_task, singular_status
from rmrc.law.metric import INERTIA, factor
from rmrc.scenario.choices import Status

INVALID, OVERDUE, STOPPED = int(Status.INVALID_INPUT), int(Status.OVERDUE), int(Status.STOPPED)

# The largest position, velocity or command; MuJoCo calls larger ones bad (its mjMAXVAL).
LARGEST = 1e10
# Tolerances: a shorter quaternion, or a matrix whose columns are less orthonormal, is no rotation.
SHORTEST, SKEWEST = 1e-3, 1e-3


class Given(IntFlag):
    """The kinds of input of one call; the frame of pose and twist is added, times FRAME."""

    TWIST = 1
    QUATERNION = 2
    MATRIX = 4
    ROTVEC = 8
    RATES = 16
    POSITION_TARGET = 32
    RATE_TARGET = 64
    REFUSED = 128


class Refused(IntFlag):
    """The unusable parts of an input: not finite, too large, or no rotation."""

    CALL = 1
    POSITIONS = 2
    RATES = 4
    KINEMATICS = 8
    POSE = 16
    TWIST = 32
    TARGET = 64
    METRIC = 128


FRAME = 1024
# Sources of the kinematics: MuJoCo's data of one or two sites, the chain, or a Jacobian alone.
CHAIN_ALONE, JACOBIAN_ALONE = 0, -1
# Flags become plain integers in compiled code.
TWIST, QUATERNION, MATRIX, ROTVEC, RATES = map(
    int, (Given.TWIST, Given.QUATERNION, Given.MATRIX, Given.ROTVEC, Given.RATES)
)
POSITION_TARGET, RATE_TARGET, REFUSED = int(Given.POSITION_TARGET), int(Given.RATE_TARGET), int(Given.REFUSED)
(
    BAD_CALL, BAD_POSITIONS, BAD_RATES, BAD_KINEMATICS, BAD_POSE, BAD_TWIST, BAD_TARGET, BAD_METRIC
) = map(int, Refused)  # fmt: skip


@entry
def step(
    worlds: Record, ticks: Record, site_xpos: Array, xquat: Array, xanchor: Array, xaxis: Array
) -> None:  # fmt: skip
    """Turn the input into `qdot_cmd`, world by world. Nothing is raised.

    Python takes ten times as long to pass a single record as an array of one.

    Args:
        worlds: The records of worlds, (w,).
        ticks: The records of their ticks, (w,).
        site_xpos: This and the others are the fields of MjData of the same names, up to date, read where the
            world has sites.
        xquat: Orientation of each body.
        xanchor: Joint anchors.
        xaxis: Joint axes.
    """
    for w in range(worlds.shape[0]):
        world, tick = worlds[w], ticks[w]
        late = brake_while_late(world, tick)
        world.refused = receive(world, tick, site_xpos, xquat, xanchor, xaxis)
        if world.refused == 0:
            if world.sites == JACOBIAN_ALONE:
                take_twist(world, tick)
            else:
                aim(world, tick)
            outside = is_outside(world)
            if outside or world.given & (POSITION_TARGET | RATE_TARGET) != 0:
                move_joints(world, tick, outside)
            else:
                resolve_twist(world, tick)
        if world.refused != 0 or not is_bounded(tick.qdot_cmd, world.n):
            forget(world, tick)
            brake_blindly(world, tick)
            tick.status = STOPPED | INVALID if world.refused != 0 else STOPPED
        tick.status |= late
        send(world, tick)


@compiled
def brake_while_late(world: Record, tick: Record) -> int:
    """Brake for the periods without a step, as the sender has done; return OVERDUE if there are any."""
    if world.late == 0:
        return 0
    tick.path_rate = 0.0
    for _ in range(world.late):
        brake_blindly(world, tick)
        send(world, tick)
        moves = 0.0
        for j in range(world.n):
            moves += abs(tick.qdot_cmd[j]) + abs(world.course[j])
        if moves == 0.0:
            break
    world.late = 0
    return OVERDUE


@compiled
def send(world: Record, tick: Record) -> None:
    """Remember the command; for joints that take positions, integrate it within their range."""
    for j in range(world.n):
        world.change_before[j] = world.change_last[j]
        at, rate = world.q_cmd[j], tick.qdot_cmd[j]
        at = world.q[j] if math.isnan(at) else at
        goal = at + world.period * rate
        if rate > 0.0:
            goal = max(at, min(goal, world.position_limit[1, j]))
        elif rate < 0.0:
            goal = min(at, max(goal, world.position_limit[0, j]))
        world.q_cmd[j] = goal
    remember(world, tick.qdot_cmd)
    world.path_tick += tick.path_rate


@compiled
def receive(world: Record, tick: Record, xpos: Array, xquat: Array, anchors: Array, axes: Array) -> int:
    """Read kinematics, and turn pose and twist to world axes; return the bits of `Refused`."""
    given = world.given & (FRAME - 1)
    if given & REFUSED:
        return BAD_CALL
    if not is_bounded(world.q, world.n):
        return BAD_POSITIONS
    refused = BAD_RATES if given & RATES and not is_bounded(world.qdot, world.n) else 0
    look(world, xpos, xquat, anchors, axes)
    known = is_bounded(world.pose, 7)
    for i in range(6):
        known = known and is_bounded(world.J[i], world.n)
    if not known:
        return refused | BAD_KINEMATICS
    for i in range(7):
        tick.pose[i] = world.pose[i]
    return refused | read_target(world, given) | read_wanted(world, tick, given)


@compiled
def read_wanted(world: Record, tick: Record, given: int) -> int:
    """Write target pose and twist along world axes; return the unusable parts."""
    refused = 0
    for i in range(6 if given & TWIST == 0 else 0):
        tick.twist_ref[i] = 0.0
    if not is_bounded(tick.twist_ref, 6):
        refused = BAD_TWIST
    if world.sites == JACOBIAN_ALONE:
        return refused if world.inverse_metric != INERTIA or takes_metric(world) else refused | BAD_METRIC
    if not read_pose(world, tick, given):
        return refused | BAD_POSE
    frame = world.given // FRAME
    if frame == BASE:
        to_world(world.base, tick, given)
    elif frame == SITE:
        to_world(world.pose, tick, given)
    return refused


@compiled
def look(world: Record, xpos: Array, xquat: Array, anchors: Array, axes: Array) -> None:
    """Write poses and Jacobians, from the arm's own chain or from MuJoCo's data."""
    if world.sites == CHAIN_ALONE:
        follow_chain(world, world.q)
        chain_jacobian(world)
        if world.m_2 > 0:
            follow_second(world, world.q)
    elif world.sites > 0:
        see(world, 0, xpos, xquat, world.pose)
        geometric_jacobian(world, anchors, axes)
        if world.sites == 2:
            see(world, 1, xpos, xquat, world.pose_2)
            second_jacobian(world)


@compiled
def see(world: Record, i: int, xpos: Array, xquat: Array, pose: Array) -> None:
    """Write the pose of a site, with its body's orientation times its own, to the bit as in a run."""
    body, own = xquat[world.body[i]], world.site_quat[i]
    turn = (body[0], body[1], body[2], body[3])
    for c in range(3):
        pose[c] = xpos[world.site[i], c]
    if world.is_beside:
        x, y, z = turned(turn, world.site_step[i])
        pose[0], pose[1], pose[2] = pose[0] + x, pose[1] + y, pose[2] + z
    pose[3], pose[4], pose[5], pose[6] = quat_product(turn, (own[0], own[1], own[2], own[3]))


@compiled
def read_target(world: Record, given: int) -> int:
    """Return BAD_TARGET if the targets of the joints are not finite."""
    is_known = given & POSITION_TARGET == 0 or is_bounded(world.q_target, world.n)
    return (
        0 if is_known and (given & RATE_TARGET == 0 or is_bounded(world.qdot_target, world.n)) else BAD_TARGET
    )


@compiled
def read_pose(world: Record, tick: Record, given: int) -> bool:
    """Write the given pose with a quaternion; without one, the pose of the site, which has no error.

    Return whether it is a pose.
    """
    pose = tick.pose_ref
    if given & MATRIX:
        return read_matrix(world.given_matrix, pose)
    if given & ROTVEC:
        v = world.given_vector
        half = 0.5 * math.sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5])
        part = 0.5 * math.sin(half) / half if half > 0.0 else 0.5
        pose[0], pose[1], pose[2], pose[3] = v[0], v[1], v[2], math.cos(half)
        pose[4], pose[5], pose[6] = part * v[3], part * v[4], part * v[5]
        return is_bounded(v, 6)
    if given & QUATERNION:
        norm2 = pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6]
        return is_bounded(pose, 7) and norm2 >= SHORTEST * SHORTEST
    for i in range(7):  # relative to its position, also in the frame of the site or of the base
        pose[i] = world.pose[i]
    return True


@compiled
def read_matrix(T: Array, pose: Array) -> bool:
    """Write the pose of a homogeneous matrix, (4, 4); return whether it is a pose.

    4 q qᵀ is linear in R; its row with the largest diagonal entry is q times a factor that cannot vanish
    [Shepperd78].
    """
    worst = abs(T[3, 3] - 1.0) + abs(T[3, 0]) + abs(T[3, 1]) + abs(T[3, 2])
    for i in range(3):
        for j in range(3):
            along = T[0, i] * T[0, j] + T[1, i] * T[1, j] + T[2, i] * T[2, j] - (1.0 if i == j else 0.0)
            worst = math.inf if math.isnan(along) else max(worst, abs(along))
    det = (
        T[0, 0] * (T[1, 1] * T[2, 2] - T[1, 2] * T[2, 1])
        - T[0, 1] * (T[1, 0] * T[2, 2] - T[1, 2] * T[2, 0])
        + T[0, 2] * (T[1, 0] * T[2, 1] - T[1, 1] * T[2, 0])
    )
    pose[0], pose[1], pose[2] = T[0, 3], T[1, 3], T[2, 3]
    if not (worst <= SKEWEST and det > 0.0 and is_bounded(pose, 3)):
        return False
    x, y, z = T[2, 1] - T[1, 2], T[0, 2] - T[2, 0], T[1, 0] - T[0, 1]
    xy, xz, yz = T[0, 1] + T[1, 0], T[0, 2] + T[2, 0], T[1, 2] + T[2, 1]
    a, b, c = T[0, 0], T[1, 1], T[2, 2]
    squares = (1.0 + a + b + c, 1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c)
    if squares[0] >= max(squares[1], squares[2], squares[3]):
        row = (squares[0], x, y, z)
    elif squares[1] >= max(squares[2], squares[3]):
        row = (x, squares[1], xy, xz)
    elif squares[2] >= squares[3]:
        row = (y, xy, squares[2], yz)
    else:
        row = (z, xz, yz, squares[3])
    norm = math.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] + row[3] * row[3])
    pose[3], pose[4], pose[5], pose[6] = row[0] / norm, row[1] / norm, row[2] / norm, row[3] / norm
    return True


@compiled
def to_world(frame: Array, tick: Record, given: int) -> None:
    """Turn pose and twist from a frame, whose pose is (7,), to world axes."""
    turn = (frame[3], frame[4], frame[5], frame[6])
    if given & (QUATERNION | MATRIX | ROTVEC):
        pose = tick.pose_ref
        x, y, z = turned(turn, pose)
        pose[0], pose[1], pose[2] = frame[0] + x, frame[1] + y, frame[2] + z
        pose[3], pose[4], pose[5], pose[6] = quat_product(turn, (pose[3], pose[4], pose[5], pose[6]))
    if given & TWIST:
        turn_twist(turn, tick.twist_ref)


@compiled
def take_twist(world: Record, tick: Record) -> None:
    """Take the rows of a twist as given; its caller has included the feedback.

    The caller gives `error` as well.
    """
    for i in range(6):
        world.twist_task[i] = tick.twist_ref[i]
        world.twist_cmd[i] = world.pace * tick.twist_ref[i]
        tick.pose_error[i] = math.nan


@compiled
def takes_metric(world: Record) -> bool:
    """Factor the given inertia, of which only the lower triangle is read; return whether it is positive."""
    n, is_positive = world.n, True
    for i in range(n):
        for j in range(i + 1):
            world.metric[j, i] = world.root[i, j] = world.metric[i, j]
    factor(world.root, n)
    for i in range(n):
        is_positive = is_positive and 0.0 < world.root[i, i] <= LARGEST
    return is_positive


@compiled
def move_joints(world: Record, tick: Record, outside: bool) -> None:
    """Write the rates of a motion of the joints: back into their range, or to their targets."""
    scale_task(world)
    decompose(world, tick.sigma)
    for i in range(world.k):
        tick.gain[i] = math.nan
    for j in range(world.n):
        tick.qdot_plain[j] = math.nan
    tick.damping = tick.secondary_error = tick.secondary_sigma = math.nan
    status = singular_status(world, tick)
    if outside:
        status |= come_back(world, tick)
    else:
        to_positions, to_rates = world.given & POSITION_TARGET != 0, world.given & RATE_TARGET != 0
        status |= follow_joints(world, tick, to_positions, to_rates)
    tick.status = status
    record_measures(world, tick)


@compiled
def is_bounded(values: Array, count: int) -> bool:
    """Return whether the first values are finite and within the largest possible magnitude."""
    bounded = True
    for i in range(count):
        bounded = bounded and abs(values[i]) <= LARGEST
    return bounded


@compiled
def forget(world: Record, tick: Record) -> None:
    """Mark this tick as one without measures; no decomposition starts from it."""
    for i in range(world.k):
        tick.sigma[i] = tick.gain[i] = math.nan
    for i in range(6):
        tick.pose_error[i] = tick.u_min[i] = math.nan
    for j in range(world.n):
        tick.v_min[j] = tick.qdot_plain[j] = math.nan
    tick.damping = tick.manipulability = tick.condition = math.nan
    tick.path_rate, world.age = 0.0, 0
