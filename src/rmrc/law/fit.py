"""Whether a law fits the joints of an arm: the checks that a section alone cannot make."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rmrc.law.law import rate_limit
from rmrc.law.task import Joints
from rmrc.scenario import ControlSection
from rmrc.scenario.choices import INVERSES, POLICIES
from rmrc.scenario.profile import load_profile
from rmrc.support.errors import did_you_mean
from rmrc.support.legible import listed

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
    method = control.inverse.method
    if INVERSES[method].needs_square and m != arm.n:
        yield (
            "control.inverse.method",
            (
                f'"{method}" needs as many task axes as joints, got {m} axes and {arm.n} joints; '
                'choose other task.axes, or "pseudoinverse" or "damped"'
            ),
        )
    if control.inverse.metric != "inertia":
        return
    if method == "selectively_damped":
        yield (
            "control.inverse.metric",
            f'"{method}" clamps joint by joint, so it needs the metric "joints", got "inertia"; choose '
            'another method, such as "damped"',
        )
    if control.limits.on_excess in ("optimal", "sns"):
        yield (
            "control.inverse.metric",
            f'on_excess "{control.limits.on_excess}" measures joint by joint, so it needs the metric '
            '"joints", got "inertia"; choose "scale" or "redistribute"',
        )


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
        yield (
            key,
            (
                f'must be a site that the arm moves, but none of its joints moves "{site}"; '
                f"its sites: {listed(name for name in arm.sites if arm.moves(name).any())}"
            ),
        )


def slow_misfits(control: ControlSection, arm: Joints, called: object) -> Misfits:
    """Yield the needs of a policy that slows the path: a feed-forward to scale, and limits to keep."""
    name = control.at_singularity
    if not POLICIES[name].slows:
        return
    if not control.feedforward:
        yield (
            "control.at_singularity",
            (f'"{name}" scales the feed-forward, so it needs control.feedforward: true, got false'),
        )
    rate = control.limits.rate
    if isinstance(rate, tuple) and len(rate) != arm.n:  # reported already
        return
    if not np.isfinite(rate_limit(arm, control.limits)).all():
        yield (
            "control.at_singularity",
            (
                f'"{name}" keeps rates within their limits, and {called} has none for every joint; '
                "give control.limits.rate"
            ),
        )
