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
    "decompose", "complete", "gains", "damping", "null_space", "objective", "priority", "policy", "hold_off",
    "limit", "stops", "ease", "remember", "give_way", "find_best", "metric", "weigh", "turn", "control",
    "second", "move_joints", "by_joint",
    "sense", "believe", "readings", "obey", "transmission", "ticks",
)  # fmt: skip


def capacity(n: int) -> int:
    """Return the number of joints, or axes of a chain, that the records of an arm with n of them hold.

    >>> capacity(2), capacity(8), capacity(9)
    (8, 8, 16)
    """
    return max(CAPACITY, 1 << (n - 1).bit_length())


@cache
def spectrum_type(joints: int) -> np.dtype[np.void]:
    """Return the type of a matrix Σ σ_i u_i v_iᵀ with its task t, the demand Uᵀ t, λ and the gains g(σ)."""
    f = np.float64
    return np.dtype(
        [
            ("rows", np.int64), ("matrix", f, (ROWS, joints)), ("task", f, (ROWS,)),
            ("sigma", f, (ROWS,)), ("asked", f, (ROWS,)), ("gain", f, (ROWS,)), ("damping", f),
            ("u", f, (ROWS, joints)), ("v", f, (ROWS, joints)),
            # ticks since it began, and the last v_k
            ("age", np.int64), ("v_last", f, (joints,)),
        ]
    )  # fmt: skip


# Cached, so that equal types are one object, which numba compares fast.
@cache
def world_type(joints: int) -> np.dtype[np.void]:
    """Return the type of a world's record with room for a number of joints."""
    f, i = np.float64, np.int64
    J, R = (joints,), (ROWS,)
    rows = [
        # of the twist that count, and S_x; their frame, and the axis about which the site is free, or -1
        ("row", i, R), ("row_scale", f, R), ("frame", i), ("free", i), ("feedback", f),
    ]  # fmt: skip
    task = [
        # S_q, the joints for which a whole turn changes nothing, and the pose of the base
        *rows, ("joint_scale", f, J), ("comes_round", i, J), ("base", f, (7,)), ("feedforward", f),
    ]  # fmt: skip
    second = [  # a second task: its rows, its site, the axes that move it, and its target, also in the base
        *rows, ("m", i), ("site", i), ("moves", i, J), ("pose_ref", f, (7,)), ("in_base", f, (7,)),
        ("last_axis", i), ("tip_step", f, (3,)), ("tip_quat", f, (4,)),
        # where it is for the law, and its true error
        ("pose", f, (7,)), ("J", f, (ROWS, joints)), ("columns", f, (ROWS, joints)), ("error", f, (6,)),
        ("true_error", f),
    ]  # fmt: skip
    V, Q = (joints, 3), (joints, 4)
    axes = [
        # axes outward: the joint that moves each and its ratio; 1 if it turns, its way along itself per
        # radian, or 1 if it slides; its direction and the step to it with all joints at 0
        ("leader", i, J), ("ratio", f, J), ("turns", f, J), ("advance", f, J),
        ("axis_0", f, V), ("step_0", f, V),
        # their directions, points on them, and the turn and the point behind them
        ("axis", f, V), ("anchor", f, V), ("turn", f, Q), ("point", f, V),
    ]  # fmt: skip
    chain = [
        *axes, ("axes", i), ("tip_step", f, (3,)), ("tip_quat", f, (4,)),
        # their contributions to the twist of the site, and their rates
        ("columns", f, (ROWS, joints)), ("rate", f, J),
    ]  # fmt: skip
    links = [
        # moving masses: the link before each, and its inertia about its joint
        *axes, ("count", i), ("parent", i, J), ("mass", f, J), ("moment", f, V),
        ("inertia", f, (joints, 3, 3)), ("armature", f, J), ("scale", f, J),
        # at their places: screws, and the inertia that each carries
        ("screw", f, (joints, 6)), ("body", f, (joints, 6, 6)), ("half_turned", f, (3, 3)),
        ("turned_moment", f, (3,)), ("twist", f, (joints, 6)), ("momentum", f, (joints, 6)),
        # the scaled joint inertia and its Cholesky factor
        ("metric", f, (joints, joints)), ("root", f, (joints, joints)),
    ]  # fmt: skip
    law = [
        (name, i if kind is int else f, J if is_each else ()) for name, kind, is_each in record_fields()
    ]  # fmt: skip
    limits = [
        ("rate", f, J), ("acceleration", f, J), ("change", f, J), ("jerk_step", f, J), ("is_eased", i),
        ("braking", f, J), ("position", f, (2, joints)), ("range", f, (2, joints)), ("keep_direction", i),
        ("torque", f, J),
        # the limits of which `change` and `jerk_step` are those of a tick; the length of the ticks ahead over
        # that of this one, 1 where all are alike
        ("hardest", f, J), ("jerk", f, J), ("stretch", f),
    ]  # fmt: skip
    state = [  # what the law takes the arm to do
        ("q", f, J), ("qdot", f, J), ("pose", f, (7,)), ("J", f, (ROWS, joints)),
    ]  # fmt: skip
    memory = [
        # from tick to tick: the last command, its change, and the course from which the next change starts
        ("qdot_cmd", f, J), ("change", f, J), ("course", f, J),
        # how far the joint lags behind its wish, and the change of that; its position if it had obeyed since
        # it strayed; sums that give its lag
        ("lag", f, J), ("slope", f, J), ("q_sent", f, J), ("behind", f, (4, joints)),
        # ticks of the path, its pace, the fastest pace within the rate limits and its fall, the wait, the
        # share of the rates that is left, and how long the site has stood still while it should move
        ("path_tick", f), ("pace", f), ("fastest", f), ("falling", f), ("waited", f),
        ("share", f), ("still", f),
        # the longest tick of the last seconds, 0 while all last one period
        ("longest", f),
    ]  # fmt: skip
    scratch = [
        # the wanted twist along the axes of the task's frame, the commanded one; A; wished rates
        ("twist_ref", f, (6,)), ("twist_cmd", f, (6,)), ("error", f),
        ("A", f, (ROWS, joints)), ("qdot0", f, J), ("work", f, J), ("shape", f, J),
        ("wrench", f, (6,)),
        # parts of the rates, linear in the pace or in the share of the task; a root of an inertia; held
        # joints
        ("part_a", f, J), ("part_b", f, J), ("root_b", f, (joints, joints)), ("sway", f, J),
    ]  # fmt: skip
    bounds = [
        # smallest and largest rates, those from position and rate limits alone, and the side at which a
        # joint is held; the share of its wish that a held joint gets; the null-space motion; the best rates
        # so far
        ("lower", f, J), ("upper", f, J), ("stop_lower", f, J), ("stop_upper", f, J), ("held", f, J),
        ("fade", f, J), ("drift", f, J), ("best", f, J), ("acting", i), ("eased", i),
        # the active set: whether it is that of the last search, λ, how often a joint was released, the task,
        # and the slopes
        ("goes_on", i), ("damping", f), ("releases", i, J),
        ("task", f, R), ("direction", f, R), ("missing", f, R), ("pull", f, R), ("magnitude", f, R),
        # jerk: the wish, the course that can be kept, the joints that share a factor, and those that have
        # strayed
        ("wish", f, J), ("kept", f, J), ("group", i, J), ("strayed", i, J), ("coast", f, J),
    ]  # fmt: skip
    barrier = [  # singular values that must not fall faster: gradients, bounds, shortfalls, and multipliers
        ("slope", f, (ROWS, joints)), ("row", f, (ROWS, joints)), ("least", f, R), ("need", f, R),
        ("push", f, R), ("acts", f, R), ("gram", f, (ROWS, ROWS)), ("root", f, (ROWS, ROWS)),
    ]  # fmt: skip
    tick = [  # the columns of a run that stand nowhere else
        ("time", f), ("q", f, J), ("q_believed", f, J), ("qdot", f, J), ("qdot_cmd", f, J),
        ("qdot_arrived", f, J), ("qdot_plain", f, J), ("pose", f, (7,)), ("pose_ref", f, (7,)),
        ("twist_ref", f, (6,)), ("pose_error", f, (6,)), ("manipulability", f), ("condition", f),
        ("u_min", f, (6,)), ("v_min", f, J), ("tau", f, J), ("tau_gravity", f, J),
        ("path_time", f), ("path_rate", f), ("secondary_error", f), ("secondary_sigma", f), ("slip", f),
        ("status", i),
    ]  # fmt: skip
    input_ = [
        # of a step outside a run: the source of kinematics, its parts, the periods without a step, the time
        # since the last one and the period, and refusals
        ("sites", i), ("site_quat", f, (2, 4)), ("is_beside", i), ("site_step", f, (2, 3)),
        ("given", i), ("called", f), ("refused", i), ("late", i), ("dt", f), ("period", f),
        ("q_target", f, J), ("qdot_target", f, J),
        # the positions that servos take, and the position limits of the joints meanwhile; TORQUE_LIMITED
        # where an actuator is at its limit
        ("servo", f, (2, joints)), ("has_servos", i), ("range", f, (2, joints)), ("saturated", i),
        # memory: the integral of the commands, the joints on their way back, the change before
        ("q_cmd", f, J), ("returning", f, J), ("change_before", f, J),
    ]  # fmt: skip
    plant = [
        ("qdot_sent", f, J), ("true_error", f, (6,)),
        # actuators: gains, bandwidth, the external wrench and its lever, joints whose tau lacks gravity
        # compensation
        ("kv", f, J), ("bandwidth", f), ("wrench", f, (6,)), ("lever", f, (3,)), ("gravity_apart", f, J),
        ("substeps", i), ("qddot", f, J), ("sent_before", f, J), ("clamped", i),
        # resistance that they compensate: damping of q̇, q̇|q̇|, q̇³; dry friction up to a loss, its inertia
        # and decay
        ("resists", i, J), ("damping", f, (joints, 3)), ("friction_loss", f, J), ("friction_inertia", f, J),
        ("friction_decay", f, J), ("carries_springs", i),
        # encoders
        ("encoder_offset", f, J), ("differentiates", i), ("rate_decay", f),
        ("encoder_delay", f), ("is_noisy", i), ("encoder_noise", f, J),
        ("encoder_resolution", f, J), ("q_read", f, J), ("qdot_read", f, J),
        ("integrates", i), ("q_last", f, J),
        # transport of commands, in ticks; the command in effect and its number
        ("is_late", i), ("latency", f), ("jitter", f), ("loss", f), ("span", i),
        ("in_effect", f, J), ("arrived", i),
        # lag, resonance, backlash
        ("lags", i), ("lag_step", f, J), ("lag_mean", f, J), ("lagging", f, J),
        ("swings", i), ("swing_step", f, (2, 2)), ("swing_mean", f, (2,)), ("swinging", f, (2, joints)),
        ("has_play", i), ("half_play", f, J), ("in_play", f, J),
    ]  # fmt: skip
    engine = [
        # of MuJoCo: addresses of its model and data, of functions, and of fields of the data; their sizes
        ("model", i), ("data", i), ("begin", i), ("advance", i), ("step", i), ("substeps", i),
        ("known_model", i), ("known_data", i),
        *((name, i) for name in ENGINE_FIELDS), ("nq", i), ("nv", i), ("nu", i), ("nbody", i), ("njnt", i),
        ("nsite", i),
        # of the arm in it: ids of its joints and site, addresses of its degrees of freedom, controls and
        # forces
        ("joint", i, J), ("qpos_at", i, J), ("dof", i, J), ("ctrl_at", i, J), ("force_at", i, J),
        ("site_id", i), ("body", i, (2,)), ("base", i), ("site_at", i, (2,)),
        ("followers", i), ("follows", i, J), ("follower_ratio", f, J), ("follower_offset", f, J),
        ("follower_qpos", i, J), ("follower_dof", i, J),
        # of the run: the next tick, the end of this piece and of the run, the path, rows of columns and of
        # positions, past ticks, the drives of the model, and a function that is called after the law
        ("next", i), ("last", i), ("ticks", i), ("path_ticks", i), ("diverged", i), ("diverged_joint", i),
        ("reference", i), ("record", i), ("record_size", i),
        ("columns", i), ("sources", i), ("width", i), ("rows", i), ("positions", i), ("past", i),
        ("past_rows", i), ("chance", i), ("drives", i), ("drive_count", i), ("freedoms", i),
        ("masses", i), ("mass_count", i), ("mass_size", i), ("mass_factors", i), ("free", i),
        ("free_count", i), ("free_damping", i), ("room", i), ("watch", i),
    ]  # fmt: skip
    spectrum = spectrum_type(joints)
    groups: dict[str, list[Any]] = {
        "task": task, "second": second, "chain": chain, "links": links, "law": law, "limits": limits,
        "methods": [(name, i) for name in METHODS], "state": state, "memory": memory, "scratch": scratch,
        "bounds": bounds, "barrier": barrier, "tick": tick, "input": input_, "plant": plant, "engine": engine,
    }  # fmt: skip
    return np.dtype(
        [
            ("n", i), ("m", i), ("k", i), ("rank", i), ("period", f),
            *((name, np.dtype(fields)) for name, fields in groups.items()),
            ("first", spectrum), ("rest", spectrum),
        ]
    )  # fmt: skip


# Fields of MjData that compiled code reads or writes, by their names in MuJoCo.
ENGINE_FIELDS = (
    "qpos", "qvel", "act", "ctrl", "xfrc_applied", "xpos", "xquat", "site_xpos", "site_xquat",
    "xanchor", "xaxis", "actuator_force", "qfrc_actuator", "qfrc_gravcomp", "qfrc_spring",
    "actuator_moment", "moment_rowadr", "moment_rownnz", "moment_colind",
    "warning_info", "warning_count", "known_bias", "known_passive", "known_gravcomp", "known_M",
    "known_qpos", "known_qvel",
)  # fmt: skip


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
