"""Worlds made by hand for the tests of the law: records from matrices and from chains, and what they shall give.

`formula` is the law's filters once more, from docs/theory.md: LAPACK's decomposition, numpy, no records.
"""

from operator import attrgetter
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from codes import Method, Schedule
from oracle_inverse import damping
from records import blank, put, resolve
from rmrc.scenario import ControlSection
from rmrc.scenario.choices import INVERSES, PARAMETERS

matrices = arrays(
    np.float64, st.tuples(st.integers(1, 6), st.integers(1, 8)), elements=st.floats(-2, 2, width=16)
)
seeds = st.integers(0, 2**32 - 1)

# One shape of each kind, and those of the arms that there are.
SHAPES = [(1, 1), (2, 2), (2, 4), (3, 7), (4, 2), (6, 3), (6, 6), (6, 7)]

# What inverses and schedules read, as `resolve_rates` calls it: its defaults, without an arm, and some error.
SHORT = {"damping_manipulability_below": "manipulability_below", "damping_error_gain": "error_gain"}
DEFAULTS = {
    SHORT.get(name, name): one.null if (value := attrgetter(one.key)(ControlSection())) is None else value
    for one in PARAMETERS
    if one.field.startswith("inverse_")
    for name in [one.field.removeprefix("inverse_")]
} | {"error": 0.1}

ROUNDING = 1e-14  # of σ_1: at or below it a σ is rounding, whatever the method


class Variant(NamedTuple):
    """A method, with a schedule if it has one: what a user can choose."""

    method: Method
    schedule: Schedule = Schedule.CONSTANT

    def __str__(self):
        return self.method.name.lower() + (
            f"-{self.schedule.name.lower()}" if INVERSES.options[self.method].is_scheduled else ""
        )


# Made from the declarations, so that a method or schedule that is added runs in every test here.
VARIANTS = [Variant(method) for method in Method if not INVERSES.options[method].is_scheduled]
VARIANTS += [
    Variant(method, schedule)
    for method in Method
    if INVERSES.options[method].is_scheduled
    for schedule in Schedule
]
NAMES = [str(variant) for variant in VARIANTS]
VARIANT = dict(zip(NAMES, VARIANTS, strict=True))


def fits(variant, shape):
    """Return whether a variant is for matrices of that shape."""
    return not INVERSES.options[variant.method].needs_square or shape[0] == shape[1]


def make_world(J, twist, row_scale=1.0, joint_scale=1.0, **parameters):
    """Return the record of a world whose task is all rows of J, and its tick, as arrays of one."""
    m, n = J.shape
    world, tick = blank(m, n)
    put(world, **DEFAULTS, J=J, twist_cmd=twist, row_scale=row_scale, joint_scale=joint_scale)
    put(world, **parameters)
    return world, tick


def one_world(J, twist, wx=1.0, wq=1.0, variant=None, **parameters):
    """Return the record of a world with weights W_x and W_q, and its tick after one call of the law."""
    if variant is not None:
        parameters = {"method": variant.method, "schedule": variant.schedule, **parameters}
    world, tick = make_world(J, twist, np.sqrt(wx), 1 / np.sqrt(wq), **parameters)
    resolve(world, tick)
    return world[0], tick[0]


def rates_of(J, twist, variant, **parameters):
    """Return the joint rates of a world without weights."""
    return one_world(J, twist, variant=variant, **parameters)[1]["qdot_cmd"][: J.shape[1]].copy()


def along(J, twist, cold=False, **parameters):
    """Return what the law answers along a path, (steps, n): warm, each tick starting from the last, or cold."""
    world, tick = make_world(J[0], twist, **parameters)
    # bytes, because numpy copies a record field by field
    start, state = world.records.tobytes(), memoryview(world.records.view(np.uint8))
    m, n = J[0].shape
    measured, rates = world["J"][0, :m, :n], tick["qdot_cmd"][0, :n]
    answers = np.empty((len(J), n))
    for answer, jacobian in zip(answers, J, strict=True):
        if cold:
            state[:] = start
        measured[:] = jacobian
        resolve(world, tick)
        answer[:] = rates
    return answers


def with_sigma(rng, m, n, sigma):
    """Return a random m x n matrix that has these singular values."""
    k = min(m, n)
    u, v = (np.linalg.qr(rng.normal(size=(size, k)))[0] for size in (m, n))
    return (u * sigma) @ v.T


def formula(variant, A, t, **parameters):
    """Return (y, g, λ) by docs/theory.md: scaled rates, gains, and the damping of the smallest σ."""
    p = {**DEFAULTS, **parameters}
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    c = u.T @ t
    alive = sigma > ROUNDING * sigma[0]
    safe = np.where(alive, sigma, 1.0)
    lam, gain = 0.0, alive / safe
    method = variant.method
    if method == Method.PSEUDOINVERSE:
        gain = gain * (sigma > p["tolerance"] * sigma[0])
    elif method == Method.TRUNCATED:
        gain = gain * (sigma > p["cutoff"])
    elif method == Method.TRANSPOSE:
        below = np.sum(sigma**4 * c**2)
        gain = sigma * (np.sum(sigma**2 * c**2) / below if below > 0 else 0.0)
    elif method == Method.JPARSE:
        least = p["gamma"] * sigma[0]
        gain = np.where(sigma >= least, gain, sigma / (least or 1.0) ** 2)
    elif method == Method.FILTERED:
        lam2 = fading(sigma, p["damping_below"], p["damping_maximum"])
        gain, lam = sigma / np.where(alive, sigma**2 + lam2, 1.0), np.sqrt(lam2[-1])
    elif method == Method.SELECTIVELY_DAMPED:
        gain = gain * selective_shares(A, sigma, c, vt, alive, p["rate_bound"])
    elif method == Method.DAMPED:
        lam = scheduled(variant.schedule, sigma, c, p)
        gain = sigma / np.where(alive, sigma**2 + lam**2, 1.0)
    else:
        assert method == Method.INVERSE, f"no formula for {variant}: write it here, from docs/theory.md"
    gain = np.where(alive, gain, 0.0)
    return vt.T @ (gain * c), gain, lam


def fading(sigma, below, maximum):
    """Return λ² that rises from 0 at σ = ε to λ_max² at σ = 0."""
    return np.where(sigma < below, (1 - (sigma / below) ** 2) * maximum**2, 0.0)


def scheduled(schedule, sigma, c, p):
    """Return λ of (12)."""
    return damping(
        schedule.name.lower(), p["damping_maximum"], p["damping_below"], sigma[-1],
        w=np.prod(sigma), w_below=p["manipulability_below"], error=p["error"], error_gain=p["error_gain"],
        A=np.diag(sigma), t=c, bound=p["rate_bound"],
    )  # fmt: skip


def selective_shares(A, sigma, c, vt, alive, bound):
    """Return h of (9)."""
    rho = np.linalg.norm(A, axis=0)
    h = np.zeros(len(sigma))
    for i in np.flatnonzero(alive):
        largest = np.abs(vt[i]).max()
        most = bound * min(1.0, sigma[i] / (np.abs(vt[i]) @ rho))
        h[i] = min(1.0, most * sigma[i] / (abs(c[i]) * largest)) if c[i] else 1.0
    y = vt.T @ (h * c * alive / np.where(alive, sigma, 1.0))
    return h * min(1.0, bound / np.abs(y).max()) if np.any(y) else h


def chain_text(seed, n, scale=1.0):
    """Return the MJCF of a serial chain of hinges and slides, whose lengths are multiplied by `scale`."""
    rng = np.random.default_rng(seed)
    text = lambda values: " ".join(f"{value:.17g}" for value in values)  # noqa: E731
    bodies = ""
    for j in range(n):
        slides = rng.random() < 0.3
        low, high = rng.uniform(-2.0, -0.5), rng.uniform(0.5, 2.0)
        span = np.array([low, high]) * (scale if slides else 1.0)
        bodies += (
            f'<body name="b{j}" pos="{text(scale * rng.uniform(-0.4, 0.4, 3))}" quat="{text(rng.normal(size=4))}">'
            f'<joint name="j{j}" type="{"slide" if slides else "hinge"}" axis="{text(rng.normal(size=3))}" '
            f'pos="{text(scale * rng.uniform(-0.1, 0.1, 3))}" range="{text(span)}" armature="0.1"/>'
            f'<geom type="sphere" size="{0.03 * scale:.17g}" mass="1"/>'
        )
    site = f'<site name="tip" pos="{text(scale * rng.uniform(-0.3, 0.3, 3))}" quat="{text(rng.normal(size=4))}"/>'
    return f'<mujoco><compiler angle="radian"/><worldbody>{bodies}{site}{"</body>" * n}</worldbody></mujoco>'
