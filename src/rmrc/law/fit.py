"""Whether a law fits the joints of an arm: the checks that a section alone cannot make."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law.settings import rate_limit
from rmrc.law.task import Joints
from rmrc.scenario import ControlSection
from rmrc.scenario.choices import INVERSES, POLICIES
from rmrc.scenario.profile import load_profile
from rmrc.support.errors import Problem, ScenarioError, did_you_mean
from rmrc.support.text import listed

if TYPE_CHECKING:
    from rmrc.arm import Arm

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
