"""The record of a world: all that compiled code reads and writes, in named groups.

A record is one element of a numpy structured array. Arrays over joints have room for a capacity of 8, 16 or
more joints, and loops run to `n`: arms of the same capacity share all machine code. Runs, `Controller` and
`Law` use the same record, so that they share the law.
"""

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario.choices import record_fields

ROWS = 6  # a twist has six rows; a task, and so sigma, has at most as many
# Bits of `input.given` of a pose and a twist; more stand in `rmrc.law.step`.
POSE, TWIST = 1, 2
CAPACITY = 8  # joints of the smallest record; larger arms get the next power of two
# A joint with this step of jerk may change its rate without limit: quotients and cubes of rates over it are
# finite [rad/s or m/s].
UNLIMITED = 1e30
# With a smaller one it may not change its rate at all.
UNCHANGED = 1.0 / UNLIMITED

# Methods at addresses, 0 where a world has none: the choices of the law, its parts that few worlds need, the
# plant, and the stages between law and plant.
METHODS = (
    "decompose complete gains damping null_space objective priority policy hold_off limit stops ease "
    "remember give_way find_best metric weigh turn control move_joints by_joint believe "
    "readings obey transmission ticks"
)


def capacity(n: int) -> int:
    """Return the number of joints, or axes of a chain, that the records of an arm with n of them hold.

    >>> capacity(2), capacity(8), capacity(9)
    (8, 8, 16)
    """
    return max(CAPACITY, 1 << (n - 1).bit_length())


# Fields of MjData that compiled code reads or writes, by their names in MuJoCo; `known_` are those of the arm
# that a plant knows.
ENGINE_FIELDS = (
    "qpos qvel act ctrl xfrc_applied xpos xquat site_xpos site_xquat xanchor xaxis actuator_force "
    "qfrc_actuator qfrc_gravcomp qfrc_spring actuator_moment moment_rowadr moment_rownnz moment_colind "
    "known_qfrc_bias known_qfrc_passive known_qfrc_gravcomp known_M known_qpos known_qvel"
)

# The groups of the record. A word with a colon gives the type of the names behind it: f for numbers or i for
# integers, and the shape of an array, with J joints and R rows.

# A matrix Σ σ_i u_i v_iᵀ with its task t, the demand Uᵀ t, λ and the gains g(σ); ticks since it began, and
# the last v_k.
SPECTRUM = "i: rows age f: damping fRJ: matrix u v fR: task sigma asked gain fJ: v_last"

# Of the twist that count, and S_x; their frame, and the axis about which the site is free, or -1.
TASK_ROWS = "iR: row fR: row_scale i: frame free f: feedback "

# Axes outward: the joint that moves each and its ratio; 1 if it turns, its way along itself per radian, or 1
# if it slides; its direction and the step to it with all joints at 0; then their directions, points on them,
# and the pose behind them, which is the identity with all joints at 0.
AXES = "iJ: leader fJ: ratio turns advance fJ3: axis_0 step_0 axis anchor fJ7: frame "

GROUPS = {
    # S_q, the joints for which a whole turn changes nothing, and the pose of the base
    "task": TASK_ROWS + "fJ: joint_scale iJ: comes_round f7: base f: feedforward",
    # a second task: its site, the axes that move it, and its target, also in the base; where it is for the
    # law, and its true error
    "second": TASK_ROWS + "i: m last_axis iJ: moves f7: pose_ref in_base tip pose "
    "fRJ: J columns f6: error f: true_error",
    # the contributions of the axes to the twist of the site, and their rates
    "chain": AXES + "i: axes f7: tip fRJ: columns fJ: rate",
    # moving masses: the link before each, and its inertia about its joint; at their places: screws, and the
    # inertia that each carries; the scaled joint inertia and its Cholesky factor
    "links": AXES + "i: count iJ: parent fJ: mass armature scale fJ3: moment fJ33: inertia "
    "fJ6: screw twist momentum fJ66: body f33: half_turned f3: turned_moment fJJ: metric root",
    # the largest acceleration and jerk, and what they are in a tick; the length of the ticks ahead over that
    # of this one, 1 where all are alike
    "limits": "fJ: rate acceleration braking torque hardest jerk change jerk_step f: stretch "
    "f2J: position range i: is_eased keep_direction",
    # what the law takes the arm to do
    "state": "fJ: q qdot f7: pose fRJ: J",
    # from tick to tick: the last command, its change, and the course from which the next change starts; how
    # far the joint lags behind its wish, and the change of that; its position if it had obeyed since it
    # strayed; sums that give its lag
    "memory": "fJ: qdot_cmd change course lag slope q_sent f4J: behind "
    # ticks of the path, its pace, the fastest pace within the rate limits and its fall, the wait, the share
    # of the rates that is left, how long the site has stood still while it should move, and the longest tick
    # of the last seconds, 0 while all last one period
    "f: path_tick pace fastest falling waited share still longest",
    # the wanted twist along the axes of the task's frame, the commanded one; A; wished rates; parts of the
    # rates, linear in the pace or in the share of the task; a root of an inertia; held joints
    "scratch": "f6: twist_ref twist_cmd wrench f: error fRJ: A fJ: qdot0 work shape part_a part_b sway "
    "fJJ: root_b",
    # smallest and largest rates, those from position and rate limits alone, and the side at which a joint is
    # held; the share of its wish that a held joint gets; the null-space motion; the best rates so far
    "bounds": "fJ: lower upper stop_lower stop_upper held fade drift best i: acting eased "
    # the active set: whether it is that of the last search, λ, how often a joint was released, the task, and
    # the slopes
    "i: goes_on f: damping iJ: releases fR: task direction missing pull magnitude "
    # jerk: the wish, the course that can be kept, the joints that share a factor, and those that have strayed
    "fJ: wish kept coast iJ: group strayed",
    # singular values that must not fall faster: gradients, bounds, shortfalls, and multipliers
    "barrier": "fRJ: slope row fR: least need push acts fRR: gram root",
    # the columns of a run that stand nowhere else
    "tick": "f: time path_time path_rate manipulability condition secondary_error secondary_sigma slip "
    "fJ: q q_believed qdot qdot_cmd qdot_arrived qdot_plain v_min tau tau_gravity "
    "f7: pose pose_ref f6: twist_ref pose_error u_min i: status",
    # of a step outside a run: the source of kinematics, its parts, the periods without a step, the time since
    # the last one and the period, and refusals
    "input": "i: sites is_beside given refused late f27: site_place f: called dt period "
    # the positions that servos take, and the position limits of the joints without them; TORQUE_LIMITED where
    # an actuator is at its limit; gears, and the ranges of the forces of actuators and of torques; memory:
    # the integral of the commands, the joints on their way back, the change before
    "fJ: q_target qdot_target f2J: servo range i: has_servos saturated fJ: gear f2J: force torque "
    "fJ: q_cmd returning change_before",
    # actuators: gains, bandwidth, the external wrench and its lever, joints whose tau lacks gravity
    # compensation
    "plant": "f6: true_error wrench f3: lever fJ: qdot_sent kv gravity_apart qddot sent_before torque "
    "inertia f: bandwidth i: clamped "
    # resistance that they compensate: damping of q̇, q̇|q̇|, q̇³; dry friction up to a loss, its inertia and
    # decay
    "iJ: resists fJ3: damping fJ: friction_loss friction_inertia friction_decay i: carries_springs "
    # encoders
    "fJ: encoder_offset encoder_noise encoder_resolution q_read qdot_read q_last "
    "i: differentiates is_noisy integrates f: rate_decay encoder_delay "
    # transport of commands, in ticks; the command in effect and its number
    "i: is_late span arrived f: latency jitter loss fJ: in_effect "
    # lag, resonance, backlash
    "i: lags swings has_play fJ: lag_step lag_mean lagging half_play in_play f22: swing_step f2: swing_mean "
    "f2J: swinging",
    # of MuJoCo: addresses of its model and data, of functions, and of fields of the data; their sizes
    "engine": f"i: {ENGINE_FIELDS} model data begin advance step substeps known_model known_data "
    "nq nv nu nbody warning_info warning_count "
    # of the arm in it: ids of its joints and sites, addresses of its degrees of freedom, controls and forces
    "iJ: joint qpos_at dof ctrl_at force_at i: body base i2: site_at "
    "i: followers iJ: follows follower_qpos follower_dof fJ: follower_ratio follower_offset "
    # of the run: the next tick, the end of this piece and of the run, the path, rows of columns and of
    # positions, past ticks, the drives of the model, and a function that is called after the law
    "i: next last ticks path path_size path_ticks diverged diverged_joint reference record record_size "
    "columns sources width rows positions past past_rows chance drives drive_count freedoms masses "
    "mass_count mass_size free_count room watch",
}


def _fields(text: str, joints: int) -> list[tuple[str, str, tuple[int, ...]]]:
    """Return the fields of a group."""
    fields, declared, sizes = [], "", {"J": joints, "R": ROWS}
    for word in text.split():
        if word.endswith(":"):
            declared = word
        else:
            shape = tuple(sizes[size] if size in sizes else int(size) for size in declared[1:-1])
            fields.append((word, f"{declared[0]}8", shape))
    return fields


# Cached, so that equal types are one object, which numba compares fast.
@cache
def spectrum_type(joints: int) -> np.dtype[np.void]:
    """Return the type of a spectrum with room for a number of joints."""
    return np.dtype(_fields(SPECTRUM, joints))


@cache
def world_type(joints: int) -> np.dtype[np.void]:
    """Return the type of a world's record with room for a number of joints."""
    groups = {name: np.dtype(_fields(text, joints)) for name, text in GROUPS.items()}
    groups["law"] = np.dtype(
        [(name, kind, (joints,) if is_each else ()) for name, kind, is_each in record_fields()]
    )
    groups["methods"] = np.dtype([(name, np.int64) for name in METHODS.split()])
    groups |= dict.fromkeys(("first", "rest"), spectrum_type(joints))
    return np.dtype([*_fields("i: n m k rank f: period", joints), *groups.items()])


def field_offset(record: np.dtype[np.void], group: str, field: str) -> int:
    """Return where a field of a group begins in the record of a world [bytes]."""
    fields: Any = record.fields
    inner, first = fields[group]
    return int(first + inner.fields[field][1])


def new_worlds(count: int, n: int, axes: int = 0) -> NDArray[np.void]:
    """Return the records of worlds of an arm before anything is written into them, (count,).

    Args:
        count: Number of worlds.
        n: Number of joints.
        axes: Number of axes of the chain, if more than n.
    """
    worlds = np.zeros(count, world_type(capacity(max(n, axes))))
    worlds["n"] = n
    reset(worlds)
    worlds["limits"]["change"] = worlds["limits"]["torque"] = math.inf
    worlds["limits"]["jerk_step"] = UNLIMITED
    worlds["limits"]["stretch"] = 1.0
    worlds["task"]["free"] = worlds["second"]["free"] = -1
    worlds["input"]["q_cmd"] = worlds["input"]["called"] = math.nan
    worlds["input"]["servo"] = np.array([[-math.inf], [math.inf]])
    worlds["engine"]["diverged"] = -1
    worlds["tick"]["slip"] = math.nan
    return worlds


def reset(worlds: Any) -> None:
    """Forget all ticks."""
    memory = worlds["memory"]
    memory[...] = np.zeros((), memory.dtype)
    worlds["first"]["age"] = 0
    memory["q_sent"] = math.nan
    memory["pace"] = memory["share"] = 1.0


def copied(worlds: NDArray[np.void]) -> NDArray[np.void]:
    """Return a copy of worlds' records, as bytes: numpy would copy field by field, ten times as slow."""
    return worlds.view(np.uint8).copy().view(worlds.dtype)
