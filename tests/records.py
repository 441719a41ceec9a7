"""Records of worlds without an arm, made by hand: a task that is all rows of a Jacobian, and a law of given numbers."""

import functools

import numpy as np

from codes import field
from rmrc.law import active_set, damping, inverses, jerk, limits, metric, nullspace, policies, svd
from rmrc.law.metric import INERTIA
from rmrc.law.record import new_worlds
from rmrc.law.settings import link, schedule_of
from rmrc.law.step import resolve_alone
from rmrc.scenario.choices import CHOICES, INVERSES, LIMITS, OBJECTIVES, POLICIES, PRIORITIES, SCHEDULES

# Fields that other groups have by the same names, as tests call them.
PLACES = {
    "rate_limit": "limits.rate", "acceleration_limit": "limits.acceleration", "change_limit": "limits.change",
    "position_limit": "limits.position", "position_range": "limits.range", "qdot_cmd_last": "memory.qdot_cmd",
    "change_last": "memory.change", "u": "first.u", "v": "first.v", "age": "first.age", "sigma": "first.sigma",
    "gain": "first.gain", "damping": "first.damping", "q": "state.q", "qdot": "state.qdot", "error": "scratch.error",
    "braking": "limits.braking", "row": "task.row", "row_scale": "task.row_scale", "lower": "bounds.lower",
    "upper": "bounds.upper", "qdot0": "scratch.qdot0",
}  # fmt: skip
OF_SECOND = ("m", "row", "row_scale", "moves", "J", "pose", "pose_ref", "feedback")
PLACES |= {f"{name}_2": f"second.{name}" for name in OF_SECOND}
OF_TICK = {name: PLACES[name] for name in ("sigma", "gain", "damping")}
GROUPS = "law", "task", "state", "scratch", "limits", "memory", "bounds", "links", "tick"


class Flat:
    """The records of worlds, (w,), or of one of them, whose fields have names of their own without groups."""

    def __init__(self, records, places=PLACES, groups=GROUPS):
        self.records, self._places, self._groups = records, places, groups

    def __getitem__(self, name):
        if isinstance(name, int):
            return Flat(self.records[name], self._places, self._groups)
        group, field_ = self._home(name)
        return self.records[group][field_] if group else self.records[field_]

    def __setitem__(self, name, value):
        group, field_ = self._home(name)
        (self.records[group] if group else self.records)[field_] = value

    def _home(self, name):
        records = self.records
        if name in self._places:
            return self._places[name].split(".")
        if name in records.dtype.names and records.dtype[name].names is None:
            return "", name
        return next(group for group in self._groups if name in records.dtype[group].names), name

    def copy(self):
        return Flat(copied(self.records), self._places, self._groups)

    @property
    def tick(self):
        """The columns of the same records."""
        return Flat(self.records, OF_TICK, ("tick",))


def blank(m, n):
    """Return the record of a world whose task has m rows and n joints, and that of its tick, as arrays of one."""
    world = Flat(copied(unscaled(m, n)))
    return world, world.tick


def copied(worlds):
    """Return a copy of records, (w,), as bytes: numpy copies them field by field, which takes fifty times as long."""
    return worlds.view(np.uint8).copy().view(worlds.dtype)


@functools.cache
def unscaled(m, n):
    """Return a record with unit scales, the full rank, and nothing that limits or wishes."""
    worlds = new_worlds(1, n)
    world, task, chain, limits_ = worlds[0], worlds[0]["task"], worlds[0]["chain"], worlds[0]["limits"]
    world["n"], world["m"], world["k"], world["rank"] = n, m, min(m, n), min(m, n)
    world["first"]["rows"] = m
    chain["axes"], chain["leader"][:n], chain["ratio"][:n] = n, np.arange(n), 1.0
    task["row"], task["row_scale"], task["joint_scale"] = np.arange(6), 1.0, 1.0
    limits_["position"], limits_["range"] = 2 * [[[-np.inf], [np.inf]]]
    limits_["rate"] = limits_["acceleration"] = np.inf
    world["law"][LIMITS.field] = LIMITS.code("none")
    return worlds


def put(world, **fields):
    """Write fields of a record, by names that `codes.field` knows; a vector fills as many entries as it has."""
    for name, value in fields.items():
        if np.ndim(value):
            world[field(name)][0][tuple(slice(size) for size in np.shape(value))] = value
        else:
            world[field(name)] = value


def resolve(world, tick=None):  # noqa: ARG001 - it is in the same record
    """Resolve `twist_cmd` of a world, by the methods that its codes choose."""
    records = world.records
    records["first"]["rows"] = records["m"]
    link(records, methods(records[0]), late=())
    resolve_alone.entry(records["limits"]["rate"].shape[-1])(records.ctypes.data)


def methods(world):
    """Return what is called for the codes of a record, as `TaskLaw.methods` does for a scenario."""
    names = {one.field: one.names[int(world["law"][one.field])] for one in CHOICES}
    method, objective, limit = (names[one.field] for one in (INVERSES, OBJECTIVES, LIMITS))
    policy, second = names[POLICIES.field], world["second"]["m"] > 0
    chosen = {
        "decompose": svd.decompose,
        "complete": svd.complete,
        "gains": getattr(inverses, method),
        "damping": getattr(damping, schedule_of(method, names[SCHEDULES.field])),
        "null_space": nullspace.move_in_null_space if objective != "none" else None,
        "objective": getattr(nullspace, objective) if objective != "none" else None,
        "priority": getattr(nullspace, names[PRIORITIES.field]) if second else None,
        "policy": getattr(policies, policy) if POLICIES[policy].acts else None,
        "hold_off": policies.hold_off if policy == "keep_out" else None,
        "weigh": metric.weigh if world["law"]["inverse_metric"] == INERTIA else None,
        "limit": getattr(limits, limit) if limit != "none" else None,
        "ease": limits.ease_rates if world["limits"]["is_eased"] else None,
        "stops": jerk.rest_bounds if world["limits"]["is_eased"] else None,
        "give_way": active_set.give_way if limit != "none" else None,
        "find_best": active_set.find_best if limit in ("optimal", "sns") else None,
    }
    world["methods"] = np.zeros((), world["methods"].dtype)
    return {name: one for name, one in chosen.items() if one is not None}
