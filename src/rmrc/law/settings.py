"""The settings of a law: what the section `control` means for an arm, and whether it fits."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law import damping, inverses, jerk, law, limits, metric, nullspace, policies, svd
from rmrc.law.active_set import find_best, give_way
from rmrc.law.compiling import Array, Method
from rmrc.law.metric import find_metric, link_fields
from rmrc.law.record import UNCHANGED, UNLIMITED
from rmrc.law.task import BareJoints, Joints, SecondTask, Task
from rmrc.scenario import ControlSection, LimitsSection
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, POLICIES, write_choices
from rmrc.scenario.profile import load_profile
from rmrc.support.errors import Problem, ScenarioError, did_you_mean
from rmrc.support.text import listed

if TYPE_CHECKING:
    from rmrc.arm import Arm, Positions


class TaskLaw:
    """The law of a scenario for the joints of a task.

    Attributes:
        task: The task of the site.
        control: The control section; without an arm, numbers that come from one may be null.
        second: The second task, if any.
        rate_limit: Largest rates, from the model where the scenario has none, (n,); infinite for none.
        acceleration_limit: Largest accelerations, (n,); infinite for none.
        jerk_limit: Largest jerks, (n,); infinite for none.
        braking: Decelerations before position limits, (n,).
        position_limit: Lower and upper, (2, n); infinite where they are not enforced.
        posture: Posture of the objective with this name, (n,).
    """

    def __init__(
        self, task: Task, control: ControlSection, start: Array, seen: "Positions | None" = None
    ) -> None:
        """Bind parameters to joints.

        Args:
            task: The task of the site.
            control: The control section; its lists over joints fit the arm.
            start: Start configuration, (n,).
            seen: Where all joints are, if they are not at rest: see `Arm.pose`.
        """
        arm, section, nullspace_ = task.arm, control.limits, control.nullspace
        self.task, self.control = task, control
        self.rate_limit = rate_limit(arm, section)
        self.acceleration_limit = _each(arm, section.acceleration)
        self.jerk_limit = _each(arm, section.jerk)
        self.braking = np.minimum(section.braking, self.acceleration_limit)
        nowhere = np.array([arm.n * [-math.inf], arm.n * [math.inf]])
        self.position_limit = arm.position_limit.T if section.position else nowhere
        if section.profile and section.position:
            lower, upper = load_profile(section.profile).stops
            least, most = self.position_limit
            self.position_limit = np.array([np.maximum(least, lower), np.minimum(most, upper)])
        self.posture = start if nullspace_.posture is None else np.array(nullspace_.posture)
        has_second, has_inertia = nullspace_.objective == "secondary", control.inverse.metric == "inertia"
        seen = start if seen is None else seen
        self.second = SecondTask(task, nullspace_.secondary, seen) if has_second else None
        has_inertia &= not isinstance(arm, BareJoints)  # whose caller has it
        self._links = link_fields(arm, task.length) if has_inertia else {}

    @property
    def is_eased(self) -> bool:
        """Whether a jerk is limited."""
        return bool(np.isfinite(self.jerk_limit).any())

    @property
    def methods(self) -> dict[str, Method]:
        """The methods that it calls, by their fields in a world's record."""
        control = self.control
        inverse, objective = control.inverse, control.nullspace.objective
        names = {
            "gains": (inverses, inverse.method),
            "damping": (damping, schedule_of(inverse.method, inverse.damping.schedule)),
            "null_space": (nullspace, "move_in_null_space" if OBJECTIVES[objective].acts else ""),
            "objective": (nullspace, objective if OBJECTIVES[objective].acts else ""),
            "priority": (nullspace, control.nullspace.secondary.priority if self.second else ""),
            "policy": (policies, control.at_singularity if POLICIES[control.at_singularity].acts else ""),
            "hold_off": (policies, "hold_off" if control.at_singularity == "keep_out" else ""),
            "limit": (limits, control.limits.on_excess if LIMITS[control.limits.on_excess].acts else ""),
        }
        methods = {field: getattr(module, name) for field, (module, name) in names.items() if name}
        methods |= {"control": law.control, "decompose": svd.decompose, "complete": svd.complete}
        on_excess, has_range = control.limits.on_excess, np.isfinite(self.position_limit).any()
        parts = {
            "turn": (law.turn, self.task.frame != "world"),
            "weigh": (metric.weigh, inverse.metric == "inertia"),
            "metric": (find_metric, bool(self._links)),
            "ease": (limits.ease_rates, self.is_eased),
            "stops": (jerk.rest_bounds, self.is_eased),
            "remember": (jerk.remember, self.is_eased),
            "find_best": (find_best, on_excess in ("optimal", "sns")),
            "give_way": (give_way, has_range or on_excess not in ("scale", "clamp", "none")),
        }
        return methods | {field: method for field, (method, is_needed) in parts.items() if is_needed}

    def write(self, world: np.void) -> None:
        """Write parameters into a world's record."""
        control, n, bounds = self.control, self.task.arm.n, world["limits"]
        self.task.write(world)
        world["first"]["rows"], world["period"] = world["m"], control.period
        world["input"]["period"], bounds["stretch"] = control.period, 1.0
        world["task"]["feedback"], world["task"]["feedforward"] = control.feedback, control.feedforward
        ranges = self.task.arm.position_limit.T
        bounds["range"][:, :n] = ranges
        is_bounded = np.isfinite([ranges, self.position_limit]).any(axis=(0, 1))
        world["task"]["comes_round"][:n] = self.task.arm.comes_round & ~is_bounded
        bounds["rate"][:n], bounds["is_eased"] = self.rate_limit, self.is_eased
        # The limits on changes also keep them within the acceleration limit.
        bounds["acceleration"][:n] = math.inf if self.is_eased else self.acceleration_limit
        bounds["hardest"][:n], bounds["jerk"][:n] = self.acceleration_limit, self.jerk_limit
        bounds["change"][:n] = self.acceleration_limit * control.period
        if self.is_eased:
            bounds["jerk_step"][:n] = np.clip(self.jerk_limit * control.period**2, UNCHANGED, UNLIMITED)
        bounds["braking"][:n] = self.braking
        bounds["position"][:, :n] = world["input"]["range"][:, :n] = self.position_limit
        bounds["keep_direction"] = control.limits.keep_direction
        if self.second is not None:
            self.second.write(world)
        world["links"]["count"] = len(self._links.get("mass", ()))
        for name, values in self._links.items():
            world["links"][name][: len(values)] = values
        write_choices(world["law"], control)
        world["law"]["nullspace_posture"][:n] = self.posture


def rate_limit(arm: Joints, section: LimitsSection) -> Array:
    """Return the largest rates of an arm's joints, (n,), from the model where the limits give none."""
    return arm.rate_limit if section.rate is None else np.full(arm.n, section.rate)


def _each(arm: Joints, limit: float | tuple[float, ...] | None) -> Array:
    """Return a limit of each joint, (n,), infinite without one."""
    return np.full(arm.n, math.inf if limit is None else limit)


def schedule_of(method: str, schedule: str) -> str:
    """Return the name of the function that gives the λ of an inverse."""
    if INVERSES[method].is_scheduled:
        return schedule
    return "smallest_singular_value" if method == "filtered" else "undamped"


# Methods that most worlds never call: they are compiled when one does.
LATE = "give_way", "find_best", "complete"


def link(worlds: Any, methods: Mapping[str, Method], late: Sequence[str] = LATE) -> None:
    """Write the addresses of methods into worlds' records; they are compiled or loaded now, unless late.

    Args:
        worlds: The records.
        methods: Methods by their fields.
        late: Fields of those that are compiled when they are called.
    """
    capacity = worlds["limits"]["rate"].shape[-1]
    for field, method in methods.items():
        address = method.address_at_need if field in late else method.address
        worlds["methods"][field] = address(capacity)


Misfits: TypeAlias = Iterator[tuple[str, str]]
"""Dotted keys, and the problem with each."""

# Scales between this number and its inverse keep the squares of S_x J S_q finite.
LARGEST_SCALE = 1e30


def misfits(control: ControlSection, m: int, arm: Joints) -> Misfits:
    """Yield all misfits of a law and a task of m rows, except those that need a model."""
    yield from profile_misfits("control.limits.profile", control.limits.profile, arm)
    yield from length_misfits(control, arm)
    yield from scale_misfits("control.joint_weights", control.joint_weights or ())
    yield from method_misfits(control, m, arm)
    yield from slow_misfits(control, arm, "the arm")


def refuse(misfits: Iterable[tuple[str, str]]) -> None:
    """Raise a ScenarioError with all misfits, if there are any."""
    problems = [Problem(tuple(key.split(".")), text) for key, text in misfits]
    if problems:
        raise ScenarioError(problems)


def profile_misfits(key: str, name: str | None, arm: Joints) -> Misfits:
    """Yield a misfit if a profile is of another robot."""
    profile = load_profile(name) if name else None
    if profile and profile.joints != arm.n:
        has = f"the arm has {arm.n} ({', '.join(arm.joints)})"
        yield key, f"{profile.name} is of a robot with {profile.joints} joints, and {has}"


def length_misfits(control: ControlSection, arm: Joints) -> Misfits:
    """Yield each list with one value per joint that has a wrong number of values."""
    by_profile = load_profile(control.limits.profile).limits if control.limits.profile else {}
    for key, values in (
        ("control.joint_weights", control.joint_weights),
        ("control.nullspace.posture", control.nullspace.posture),
        ("control.nullspace.rates", control.nullspace.rates),
        *(  # values of a profile are not checked again
            (f"control.limits.{name}", values)
            for name in ("rate", "acceleration", "jerk", "braking")
            if (values := getattr(control.limits, name)) != by_profile.get(name)
        ),
    ):
        if isinstance(values, tuple) and len(values) != arm.n:
            yield key, wrong_length(len(values), arm)


def wrong_length(got: int, arm: Joints) -> str:
    """Return the misfit of this number of values."""
    return f"must have {arm.n} values, one for each joint ({', '.join(arm.joints)}), got {got}"


def scale_misfits(key: str, values: tuple[float, ...], is_list: bool = True) -> Misfits:
    """Yield weights or lengths whose squares are not finite."""
    for i, value in enumerate(values):
        if not 1.0 / LARGEST_SCALE <= value <= LARGEST_SCALE:
            text = f"must be between {1.0 / LARGEST_SCALE:g} and {LARGEST_SCALE:g}, got {value:g}"
            yield f"{key}[{i}]" if is_list else key, text


def method_misfits(control: ControlSection, m: int, arm: Joints) -> Misfits:
    """Yield a misfit if an inverse needs a square Jacobian, or the metric of the joints."""
    method, on_excess, key = control.inverse.method, control.limits.on_excess, "control.inverse.metric"
    if INVERSES[method].needs_square and m != arm.n:
        text = (
            f'"{method}" needs as many task axes as joints, got {m} axes and {arm.n} joints; '
            'choose other task.axes, or "pseudoinverse" or "damped"'
        )
        yield "control.inverse.method", text
    needs = 'so it needs the metric "joints", got "inertia"; choose'
    if control.inverse.metric == "inertia" and method == "selectively_damped":
        yield key, f'"{method}" clamps joint by joint, {needs} another method, such as "damped"'
    if control.inverse.metric == "inertia" and on_excess in ("optimal", "sns"):
        yield key, f'on_excess "{on_excess}" measures joint by joint, {needs} "scale" or "redistribute"'


def second_task_misfits(control: ControlSection, arm: "Arm") -> Misfits:
    """Yield a misfit if the site of a second task is missing, or no joint moves it."""
    site = control.nullspace.secondary.site
    if control.nullspace.objective != "secondary" or site is None:
        return
    key = "control.nullspace.secondary.site"
    if site not in arm.sites:
        known, hint = listed(arm.sites), did_you_mean(site, arm.sites)
        yield key, f'{arm.path}: has no site "{site}"{hint}; its sites: {known}'
    elif not arm.moves(site).any():
        moved = listed(name for name in arm.sites if arm.moves(name).any())
        text = f'must be a site that the arm moves, but none of its joints moves "{site}"; its sites: {moved}'
        yield key, text


def slow_servos(limit: NDArray[np.float64], arm: "Arm") -> str:
    """Return which rate servos of a model take less than some rate limits, (n,), in a line; or ""."""
    most = arm.servo_limits[1]
    slow = np.flatnonzero(most < limit)
    if not len(slow):
        return ""
    each = listed(f"{arm.joints[j]} {most[j]:.4g} of {limit[j]:.4g} {arm.units[j]}/s" for j in slow.tolist())
    values = np.minimum(most, limit)
    is_limit = (np.isfinite(values) & (values > 0.0)).all()
    key = (
        f"write control.limits.rate: [{', '.join(f'{rate:.4g}' for rate in values)}], or " if is_limit else ""
    )
    return (
        f"by their ctrlrange, rate servos take less than the limits of the law: {each}; {key}widen the ranges"
    )


def slow_misfits(control: ControlSection, arm: Joints, called: object) -> Misfits:
    """Yield the needs of a policy that slows the path: a feed-forward to scale, and limits to keep."""
    name, key, rate = control.at_singularity, "control.at_singularity", control.limits.rate
    if not POLICIES[name].slows:
        return
    if not control.feedforward:
        yield key, f'"{name}" scales the feed-forward, so it needs control.feedforward: true, got false'
    if isinstance(rate, tuple) and len(rate) != arm.n:  # reported already
        return
    if not np.isfinite(rate_limit(arm, control.limits)).all():
        text = f'"{name}" keeps rates within their limits, and {called} has none for every joint'
        yield key, f"{text}; give control.limits.rate"
