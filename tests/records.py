"""Records of worlds without an arm, made by hand: a task that is all rows of a Jacobian, and a law of given numbers."""

import functools

import numpy as np

from codes import field
from rmrc.law.law import TaskLaw
from rmrc.law.record import records, tick_type
from rmrc.law.sight import Sight
from rmrc.law.task import Task
from rmrc.scenario.choices import LIMITS


class Unscaled:
    """A Writer for a task and a law: unit scales, the full rank, and nothing that limits or wishes."""

    fields = (*Task.fields, *TaskLaw.fields, *Sight.fields)  # the type of `resolve_rates`, compiled once

    def __init__(self, m, n):
        self.m, self.n = m, n

    def write(self, world):
        m, n = self.m, self.n
        world["n"], world["m"], world["k"], world["rank"] = n, m, min(m, n), min(m, n)
        world["axes"], world["leader"][:n], world["ratio"][:n] = n, np.arange(n), 1.0
        world["row"], world["row_scale"], world["joint_scale"] = np.arange(6), 1.0, 1.0
        world["position_limit"], world["position_range"] = 2 * [[[-np.inf], [np.inf]]]
        world["rate_limit"] = world["acceleration_limit"] = np.inf
        world[LIMITS.field] = LIMITS.code("none")


def blank(m, n):
    """Return the record of a world whose task has m rows and n joints, and that of its tick, as arrays of one."""
    return copied(unscaled(m, n)), np.zeros(1, tick_type(n))


def copied(worlds):
    """Return a copy of records, (w,), as bytes: numpy copies them field by field, which takes fifty times as long."""
    return worlds.view(np.uint8).copy().view(worlds.dtype)


@functools.cache
def unscaled(m, n):
    return records(n, [Unscaled(m, n)])


def put(world, **fields):
    """Write fields of a record, by names that `codes.field` knows; a vector fills as many entries as it has."""
    for name, value in fields.items():
        if np.ndim(value):
            world[field(name)][0][tuple(slice(size) for size in np.shape(value))] = value
        else:
            world[field(name)] = value
