"""Resolved motion rate control, one tick of one world.

    twist_cmd = Rᵀ twist_ref + K · pose_error
    A         = S_x Rᵀ J S_q = Σ σ_i u_i v_iᵀ       (task rows only; S_x = W_x^½ / L, S_q = W_q^-½ · L)
    qdot_cmd  = S_q Σ g(σ_i) v_i (u_iᵀ S_x twist_cmd)  +  N qdot0

The columns of R are the axes of the task's frame: the world, the base or the site. The error and J in the
record are along them. The characteristic length L divides linear rows and multiplies sliding joints, so that
σ of any arm is a number without unit and does not change when the model is drawn in millimeters.
"""

import math

from rmrc.law.compiling import Method, Record, call, compiled
from rmrc.law.inverses import invert_above, push_fading
from rmrc.law.kinematics import frame_error, frame_turn, pose_error, turn_columns, turn_twist
from rmrc.law.limits import limit
from rmrc.law.measurement import is_held
from rmrc.law.metric import INERTIA, backward, scale_joints
from rmrc.law.record import POSE
from rmrc.law.svd import RANK_FLOOR, clear, combine, copy, dot, product, project
from rmrc.scenario.choices import Status

# Flags become plain integers in compiled code.
DAMPED, SINGULAR, STUCK = int(Status.DAMPED), int(Status.SINGULAR), int(Status.STUCK)
WAITS = int(Status.STOPPED | Status.KEPT_OUT)

# κ ≥ 100 is called SINGULAR: the worst direction needs a hundred times the joint rates of the best one.
SINGULAR_BELOW = 0.01

# A direction counts as damped when it gets less than its demand by more than rounding explains.
GETS_ALL = 1.0 - 1e-9

# The site stands still below this share of the speed that it should have, in scaled rows. A limit or damping
# that slows an arm down leaves it more, except in moments in which a rate changes its sign.
SHARE = 0.02
# Below this speed the reference is at rest, and asks for nothing [1/s]: 1 mm/s for a length of 1 m.
SLOWEST = 1e-3
# Below this speed the site stands still in any case.
CREEPS = 0.1 * SLOWEST
# The site may stand still for this long before it is called stuck [s]: longer than a turn of direction or the
# start of a lagging feedback takes, shorter than the times that matter on a path.
PATIENCE = 0.2


@Method
def control(world: Record) -> None:
    """Turn the measured state and the reference of one tick into `tick.qdot_cmd`.

    Args:
        world: Read: parameters, memory, `state` (q, pose, J), and `tick.pose_ref` and `tick.twist_ref` at
            full pace. Written: the columns of the law. J is turned into the frame of the task.
    """
    aim(world)
    resolve(world)


@compiled
def aim(world: Record) -> None:
    """Write the commanded twist along the axes of the task's frame; turn J into that frame."""
    task, state, scratch, tick = world.task, world.state, world.scratch, world.tick
    pose_error(state.pose, tick.pose_ref, tick.pose_error)
    copy(tick.twist_ref, scratch.twist_ref, 6)
    if world.methods.turn != 0:
        call(world.methods.turn, world)
    feedforward, squares = task.feedforward * world.memory.pace, 0.0
    for i in range(6):
        scratch.twist_cmd[i] = feedforward * scratch.twist_ref[i] + task.feedback * tick.pose_error[i]
    for i in range(world.m):
        scaled = task.row_scale[i] * tick.pose_error[task.row[i]]
        squares += scaled * scaled
    scratch.error = math.sqrt(squares)
    if world.methods.metric != 0:
        call(world.methods.metric, world)


@Method
def turn(world: Record) -> None:
    """Turn the error, the wanted twist and J from world axes into the frame of the task."""
    task, state, tick = world.task, world.state, world.tick
    frame_error(task.frame, task.base, task.free, state.pose, tick.pose_ref, tick.pose_error)
    rotation = frame_turn(task.frame, task.base, state.pose)
    turn_twist(rotation, world.scratch.twist_ref)
    turn_columns(rotation, state.J, world.n)
    if world.chain.axes > world.n:  # the slopes are those of its axes
        turn_columns(rotation, world.chain.columns, world.chain.axes)


@compiled
def resolve(world: Record) -> None:
    """Resolve `scratch.twist_cmd`: decompose, filter, project, slow or stop, limit, judge, and record."""
    scratch, tick, first, methods = world.scratch, world.tick, world.first, world.methods
    scale_task(world)
    call(methods.decompose, world, first)
    project(first.u, first.task, world.k, world.m, first.asked)
    ask_plainly(world)
    push_fading(world, first.u, first.task, first.sigma, first.asked)
    call(methods.damping, world, first)
    call(methods.gains, world, first)
    combine(first.gain, first.asked, first.v, world.k, world.n, tick.qdot_cmd)
    scale_joints(world, tick.qdot_cmd)
    tick.secondary_error = tick.secondary_sigma = math.nan
    clear(scratch.qdot0, world.n)
    if methods.null_space != 0:
        call(methods.null_space, world)
    tick.path_rate = 1.0
    tick.status = singular_status(world)
    if methods.policy != 0:
        call(methods.policy, world)
    limit(world)
    if methods.hold_off != 0:
        call(methods.hold_off, world)
    watch_standstill(world)
    record_measures(world)


@compiled
def scale_task(world: Record) -> None:
    """Write A = S_x J S_q and S_x twist_cmd over the rows that count."""
    task, scratch, first = world.task, world.scratch, world.first
    for i in range(world.m):
        row, scale = task.row[i], task.row_scale[i]
        first.task[i] = scale * scratch.twist_cmd[row]
        for j in range(world.n):
            scratch.A[i, j] = first.matrix[i, j] = scale * world.state.J[row, j] * task.joint_scale[j]
    if world.methods.weigh != 0:
        call(world.methods.weigh, world)


@compiled
def ask_plainly(world: Record) -> None:
    """Write the command of the plain inverse or pseudoinverse: 1/σ of every σ above rounding.

    Nothing is damped, weighted, limited or added. The gains are overwritten.
    """
    tick, first = world.tick, world.first
    invert_above(world, first, RANK_FLOOR * first.sigma[0])
    combine(first.gain, first.asked, first.v, world.k, world.n, tick.qdot_plain)
    scale_joints(world, tick.qdot_plain)


@compiled
def singular_status(world: Record) -> int:
    """Return DAMPED if any direction gets less than its demand, and SINGULAR if one is nearly lost."""
    first = world.first
    status, floor = DAMPED if first.damping > 0.0 else 0, RANK_FLOOR * first.sigma[0]
    for i in range(world.k):
        if first.sigma[i] > floor and first.sigma[i] * first.gain[i] < GETS_ALL:
            status |= DAMPED
    if first.sigma[world.k - 1] <= SINGULAR_BELOW * first.sigma[0]:
        status |= SINGULAR
    return status


@compiled
def record_measures(world: Record) -> None:
    """Record w = ∏σ, κ = σ_1/σ_k, the lost task direction u_min and its joint motion v_min."""
    tick, first = world.tick, world.first
    last = world.k - 1
    tick.manipulability = product(first.sigma, world.k)
    tick.condition = first.sigma[0] / first.sigma[last] if first.sigma[last] > 0.0 else math.inf
    clear(tick.u_min, 6)
    for i in range(world.m):
        tick.u_min[world.task.row[i]] = first.u[last, i]
    copy(first.v[last], tick.v_min, world.n)
    if world.law.inverse_metric == INERTIA:  # in coordinates of the joints, with length 1
        backward(world.links.root, tick.v_min, world.n)
        size = math.sqrt(dot(tick.v_min, tick.v_min, world.n))
        for j in range(world.n):
            tick.v_min[j] /= size


@compiled
def watch_standstill(world: Record) -> None:
    """Add STUCK to the status once the site has stood still for a while although its reference was moving.

    It lasts until the site moves, the reference rests, or the arm waits by command. A pose that is given to
    `Controller` asks for motion until the site is there.
    """
    tick, first = world.tick, world.first
    task, memory, scratch, status = world.task, world.memory, world.scratch, tick.status
    status |= world.input.saturated
    if (status == 0 and world.m <= world.n) or status & WAITS:  # it obeys fully, or waits
        memory.still = 0.0
        return
    wanted, asked, done = 0.0, 0.0, 0.0
    for i in range(world.m):
        row, scale, moved = task.row[i], task.row_scale[i], 0.0
        for j in range(world.n):
            rate = tick.qdot_cmd[j]
            moved += world.state.J[row, j] * (world.state.qdot[j] if is_held(world, j, rate) else rate)
        wants, moved = scale * scratch.twist_ref[row], scale * moved
        wanted += wants * wants
        asked += first.task[i] * first.task[i]
        done += moved * moved
    moves = wanted > SLOWEST * SLOWEST
    wished, share = (wanted if moves else asked), SHARE
    if not moves and world.input.given & POSE:  # a set-point, whose speed depends on the distance alone
        moves, share = True, 0.0
    if wished <= SLOWEST * SLOWEST or done > max(share * share * wished, CREEPS * CREEPS):
        memory.still = 0.0
    elif moves:
        memory.still += world.period
    if memory.still > PATIENCE:
        tick.status |= STUCK
