"""Resolved motion rate control, one tick of one world.

    twist_cmd = twist_ref + K · pose_error
    A         = S_x J S_q = Σ σ_i u_i v_iᵀ          (task rows only; S_x = W_x^½ / L, S_q = W_q^-½ · L)
    qdot_cmd  = S_q Σ g(σ_i) v_i (u_iᵀ S_x twist_cmd)  +  N qdot0

The characteristic length L divides linear rows and multiplies sliding joints, so that σ of any arm is
a number without unit and does not change when the model is drawn in millimeters.
"""

import math
from enum import IntEnum

import numpy as np

from rmrc.control.compiled import Array, Record, compiled, entry, inlined
from rmrc.control.inverse import damping, gains
from rmrc.control.kinematics import pose_error
from rmrc.control.limits import limit_rates
from rmrc.control.nullspace import NONE, add_projected, wished_rates
from rmrc.control.records import Method, OnExcess, Schedule, Status, tick_type, world_type
from rmrc.control.smallmat import dot, orthonormalize, set_identity, svd
from rmrc.errors import did_you_mean

# Flags become plain integers in compiled code.
DAMPED, RATE_LIMITED, SINGULAR = map(int, (Status.DAMPED, Status.RATE_LIMITED, Status.SINGULAR))

# κ ≥ 100 is called SINGULAR: the direction that dies takes a hundred times the joint rates of the best one.
SINGULAR_BELOW = 0.01

# Rotations accumulate rounding in the warm start; so often it is made orthonormal again. In 64 ticks of
# some 30 rotations it has lost 1e-13 at the worst.
REFRESH = 64


@inlined
def control(world: Record, tick: Record) -> None:
    """Turn the measured state and the reference of one tick into `tick.qdot_cmd`.

    Args:
        world: Parameters, measurement (q, pose, J) and memory; scratch is overwritten.
        tick: Reads pose_ref and twist_ref; writes every column from pose_error to status but tau.
    """
    pose_error(world.pose, tick.pose_ref, tick.pose_error)
    for i in range(6):
        world.twist_cmd[i] = world.feedforward * tick.twist_ref[i] + world.feedback * tick.pose_error[i]
    resolve(world, tick)


@entry
def resolve(world: Record, tick: Record) -> None:
    """Resolve `world.twist_cmd` into joint rates: decompose, filter, project, limit, and record."""
    scale_task(world)
    decompose(world, tick.sigma)
    tick.damping = damping(world, tick.sigma)
    gains(world, tick.sigma, tick.damping, tick.gain)
    resolved_rates(world, tick.gain, tick.qdot_cmd)
    if world.objective != NONE:
        wished_rates(world, world.qdot0)
        add_projected(world, tick.sigma, world.qdot0, tick.qdot_cmd)
    limited = limit_rates(world, tick.qdot_cmd)
    record_measures(world, tick)
    tick.status = (
        (DAMPED if tick.damping > 0.0 else 0)
        | (RATE_LIMITED if limited else 0)
        | (SINGULAR if tick.sigma[world.k - 1] <= SINGULAR_BELOW * tick.sigma[0] else 0)
    )


@compiled
def scale_task(world: Record) -> None:
    """A = S_x J S_q and S_x twist_cmd, of the rows that count."""
    for i in range(world.m):
        row, scale = world.row[i], world.row_scale[i]
        world.task[i] = scale * world.twist_cmd[row]
        for j in range(world.n):
            world.A[i, j] = scale * world.J[row, j] * world.joint_scale[j]


@inlined
def decompose(world: Record, sigma: Array) -> None:
    """A = Σ σ_i u_i v_iᵀ, warm-started from the vectors of the last tick."""
    basis = world.u if world.m <= world.n else world.v
    if world.age == 0:
        set_identity(basis, world.k)
    elif world.age % REFRESH == 0:
        orthonormalize(basis, world.k)
    world.age += 1
    svd(world.A, world.m, world.n, world.u, sigma, world.v)


@compiled
def resolved_rates(world: Record, gain: Array, rates: Array) -> None:
    """S_q Σ g(σ_i) v_i (u_iᵀ S_x twist_cmd)."""
    for j in range(world.n):
        rates[j] = 0.0
    for i in range(world.k):
        along = gain[i] * dot(world.u[i], world.task, world.m)
        for j in range(world.n):
            rates[j] += along * world.v[i, j]
    for j in range(world.n):
        rates[j] *= world.joint_scale[j]


@compiled
def record_measures(world: Record, tick: Record) -> None:
    """Record w = ∏σ, κ = σ_1/σ_k, the dying task direction u_min and the joint motion v_min that it takes."""
    last = world.k - 1
    product = 1.0
    for i in range(world.k):
        product *= tick.sigma[i]
    tick.manipulability = product
    tick.condition = tick.sigma[0] / tick.sigma[last] if tick.sigma[last] > 0.0 else math.inf
    for i in range(6):
        tick.u_min[i] = 0.0
    for i in range(world.m):
        tick.u_min[world.row[i]] = world.u[last, i]
    for j in range(world.n):
        tick.v_min[j] = world.v[last, j]


def resolve_rates(
    J: Array,
    twist: Array,
    method: str = "damped",
    *,
    schedule: str = "constant",
    damping_maximum: float = 0.1,
    damping_below: float = 0.3,
    tolerance: float = 1e-6,
) -> Array:
    """Return the joint rates that one inverse answers to one twist: the law for a notebook.

    Args:
        J: Jacobian of the task, (m, n), m <= 6.
        twist: Commanded task velocity, (m,).
        method: `inverse` (square J), `pseudoinverse` or `damped`.
        schedule: `constant` or `smallest_singular_value`, of the damping.
        damping_maximum: λ_max, in the units of σ.
        damping_below: ε, where the schedule starts to damp.
        tolerance: The pseudoinverse drops σ_i <= tolerance · σ_1.

    Returns:
        Joint rates, (n,).

    Raises:
        ValueError: A shape or a name that the law does not have.

    >>> resolve_rates(np.diag([1.0, 0.1]), np.array([1.0, 1.0]), damping_maximum=0.1).round(3)
    array([0.99, 5.  ])
    """
    J, twist = np.atleast_2d(np.asarray(J, np.float64)), np.asarray(twist, np.float64)
    m, n = J.shape
    if m > 6 or twist.shape != (m,):
        raise ValueError(f"J must be (m, n) with m <= 6 and twist (m,), got {J.shape}, {twist.shape}")
    if method == "inverse" and m != n:
        raise ValueError(f"method 'inverse' needs a square J, got {J.shape}")
    if not (np.isfinite(J).all() and np.isfinite(twist).all()):
        raise ValueError("J and twist must be finite")
    world, tick = np.zeros(1, world_type(n)), np.zeros(1, tick_type(n))
    world["n"], world["m"], world["k"] = n, m, min(m, n)
    world["row"], world["row_scale"], world["joint_scale"] = np.arange(6), 1.0, 1.0
    world["J"][0, :m, :n], world["twist_cmd"][0, :m] = J, twist
    world["method"] = _choice("method", method, Method)
    world["schedule"] = _choice("schedule", schedule, Schedule)
    world["damping_maximum"], world["damping_below"] = damping_maximum, damping_below
    world["tolerance"], world["on_excess"] = tolerance, OnExcess.NONE
    resolve(world[0], tick[0])
    return np.array(tick["qdot_cmd"][0, :n])


def _choice(key: str, name: str, kinds: type[IntEnum]) -> IntEnum:
    names = {kind.name.lower(): kind for kind in kinds}
    if name not in names:
        known, hint = ", ".join(names), did_you_mean(name, names)
        raise ValueError(f'{key} must be one of {known}, got "{name}"{hint}')
    return names[name]
