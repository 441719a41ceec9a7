"""Worlds made by hand for the tests of the law: records from matrices and from chains, and what they shall give."""

from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from codes import Method, Schedule
from oracle_inverse import damping, generalized_inverse
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
named = pytest.mark.parametrize("variant", VARIANTS, ids=NAMES)


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


def along(J, twist, **parameters):
    """Return what the law answers along a path, (steps, n), each tick starting from the last."""
    world, tick = make_world(J[0], twist, **parameters)
    m, n = J[0].shape
    answers = np.empty((len(J), n))
    for answer, jacobian in zip(answers, J, strict=True):
        world["J"][0, :m, :n] = jacobian
        resolve(world, tick)
        answer[:] = tick["qdot_cmd"][0, :n]
    return answers


def with_sigma(rng, m, n, sigma):
    """Return a random m x n matrix that has these singular values."""
    k = min(m, n)
    u, v = (np.linalg.qr(rng.normal(size=(size, k)))[0] for size in (m, n))
    return (u * sigma) @ v.T


def formula(variant, A, t, **parameters):
    """Return (y, g, λ) by the oracle: scaled rates, gains along LAPACK's singular vectors, and λ of the smallest σ."""
    p = {**DEFAULTS, **parameters}
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    method, lam = variant.method.name.lower(), 0.0
    if method in ("damped", "filtered"):
        schedule = variant.schedule.name.lower() if method == "damped" else "smallest_singular_value"
        lam = damping(
            schedule, p["damping_maximum"], p["damping_below"], sigma[-1], w=np.prod(sigma),
            w_below=p["manipulability_below"], error=p["error"], error_gain=p["error_gain"], A=A, t=t,
            bound=p["rate_bound"],
        )  # fmt: skip
    G = generalized_inverse(
        A, t, np.ones(len(A)), np.ones(len(A.T)), method, p["tolerance"], lam, cutoff=p["cutoff"], gamma=p["gamma"],
        bound=p["rate_bound"], maximum=p["damping_maximum"], below=p["damping_below"],
    )  # fmt: skip
    return G @ t, np.sum(vt.T * (G @ u), axis=0), lam
