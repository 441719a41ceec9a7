"""Findings of a check: errors, missing data and assumptions, each with a code, a line, and a remedy."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.check.facts import Facts
from rmrc.analysis.check.motion import BOUND
from rmrc.analysis.inspect.directions import SLOW
from rmrc.analysis.new.scaling import ASSUMED_RATE
from rmrc.arm.frames import code_of
from rmrc.arm.inventory import Contact
from rmrc.results.verdict import SLIP_CURE
from rmrc.support.legible import listed

Level = Literal["error", "warning", "note"]

# Every code with its meaning; an error makes a run wrong, or prevents it.
CODES: dict[str, tuple[Level, str]] = {
    "home-outside-limits": (
        "error",
        "home is outside a joint's range: a run begins with the way back",
    ),
    "home-contact": ("error", "bodies of the arm penetrate each other at home"),
    "jacobian-routes": ("error", "J by another method differs from MuJoCo's"),
    "plant-refused": ("warning", "a plant cannot run this arm"),
    "diverged": ("error", "one second of motion diverged"),
    "rank-deficient": ("warning", "the Jacobian is rank-deficient in every configuration"),
    "range-suspicious": ("warning", "a range seems to be in the other unit of angles"),
    "home-singular": ("warning", "the arm is singular at home, or nearly so"),
    "home-touch": ("warning", "bodies of the arm touch each other at home"),
    "rate-limit-missing": (
        "warning",
        "a joint has no rate limit; MJCF has rate limits only in servos",
    ),
    "torque-limit-missing": (
        "warning",
        "a joint has no torque limit: its actuator is ideal",
    ),
    "motion-contact": ("warning", "bodies touched during one second of motion"),
    "torque-saturated": ("warning", "an actuator saturated during one second of motion"),
    "spring-load": ("warning", "a plant does not compensate for the spring of a joint"),
    "follower-slip": ("warning", "a follower left its equality during one second of motion"),
    "mujoco-warning": ("warning", "MuJoCo issued a warning during one second of motion"),
    "frame-short": ("warning", "the controlled frame leaves out joints of a longer chain"),
    "range-missing": ("note", "a joint has no range"),
    "acceleration-limit": ("note", "MJCF cannot express acceleration limits"),
    "no-home": ("note", "there is no keyframe home; another configuration replaces it"),
    "frame": ("note", "other frames could be controlled instead"),
    "base-fixed": ("note", "the base has a free joint in the file, and is fixed"),
    "assumed": ("note", "another assumption was made where the file has no data or is unreadable"),
    "axes": ("note", "the arm has fewer than six degrees of freedom"),
    "actuator-replaced": ("note", "a plant replaces an actuator of the model by its own"),
    "actuator-other": ("note", "an actuator of the model acts on no joint of the arm"),
    "joint-idle": ("note", "a joint moves the site and is not actuated"),
    "joint-other": ("note", "the model has joints outside the arm"),
}
ORDER: tuple[Level, ...] = ("error", "warning", "note")

# Routes agree to the accuracy of central differences, 1e-10 for an arm of some meters.
DIFFERENT = 1e-6
# Bodies that overlap by more [m] push each other apart; smaller overlaps are margins or meshes.
DEEP = 1e-3
# If all hinges have ranges below the first, or one above the second [rad], the units are mixed up.
NARROW, WIDE = 0.12, 8.0 * np.pi


@dataclass(frozen=True)
class Finding:
    """One finding.

    Attributes:
        code: One of `CODES`, which never changes.
        level: `error`, `warning` or `note`.
        text: Description, in a line.
        way: The remedy; "" if none is needed.
    """

    code: str
    level: Level
    text: str
    way: str = ""


def found(facts: Facts) -> tuple[Finding, ...]:
    """Return all findings, errors first."""
    judged = (of(facts) for of in JUDGES)
    findings = [Finding(code, CODES[code][0], text, way) for each in judged for code, text, way in each]
    return tuple(sorted(findings, key=lambda finding: ORDER.index(finding.level)))


# Code, text and remedy of each finding.
_Findings = Iterator[tuple[str, str, str]]


def _start(facts: Facts) -> _Findings:
    arm = facts.arm
    for name, at, (lower, upper), unit in zip(
        arm.joints, facts.home, arm.position_limit, arm.units, strict=True
    ):
        if not lower <= at <= upper:
            yield (
                "home-outside-limits",
                f"joint {name} is at {at:.4g} {unit} at home, outside its range [{lower:.4g}, {upper:.4g}]",
                'add <key name="home" qpos="..."/> within it, or set arm.start',
            )
    if "home" not in arm.keyframes:
        known = f"; its keyframes: {listed(sorted(arm.keyframes))}" if arm.keyframes else ""
        yield "no-home", f"no keyframe home, so all joints start at the model's zero{known}", "set arm.start"
    for note in arm.notes:
        yield code_of(note), note, ""
    if facts.sigma[-1] <= SLOW * facts.sigma[0]:
        for words in facts.lost[:1]:
            yield "home-singular", f"at home the arm {words}", "set arm.start away from it"


def _geometry(facts: Facts) -> _Findings:
    arm, task = facts.arm, facts.scales.task
    for route, difference in facts.routes.items():
        if not difference <= DIFFERENT * max(1.0, task.length):
            yield (
                "jacobian-routes",
                f"J by {route} differs from MuJoCo's by {difference:.2g}",
                "this is a bug; report it with the model",
            )
    missing = min(arm.n, 6) - task.rank
    if missing > 0:
        yield (
            "rank-deficient",
            f"{arm.n} joints move {task.rank} directions of the site in every configuration: some axes "
            "coincide",
            "correct axis and pos of the joints that `rmrc inspect` reports as turning against each other",
        )
    if task.rank < 6:
        yield "axes", f"the arm moves {' '.join(task.axes)} of the site independently", "set task.axes"


def _limits(facts: Facts) -> _Findings:
    arm = facts.arm
    width = np.diff(arm.position_limit, axis=1)[:, 0]
    hinges, limited = ~arm.is_slide, np.isfinite(width)
    angles = width[hinges & limited]
    if angles.size and (angles < NARROW).all():
        text = f"the ranges of all hinges are below {NARROW:g} rad, as if radians had been read as degrees"
        yield "range-suspicious", text, 'set <compiler angle="radian"/>'
    for name in _named(facts, hinges & limited & (width > WIDE)):
        yield (
            "range-suspicious",
            f"joint {name} has a range of {width[arm.joints.index(name)] / (2.0 * np.pi):.3g} turns",
            'set <compiler angle="degree"/>, or write radians',
        )
    if missing := _named(facts, ~limited):
        yield (
            "range-missing",
            f"no range of {', '.join(missing)}",
            'set <joint range="..."/> where there are stops',
        )
    if missing := _named(facts, ~np.isfinite(arm.rate_limit)):
        yield (
            "rate-limit-missing",
            f"no rate limit of {', '.join(missing)}; `rmrc new` assumes {ASSUMED_RATE:g} rad/s",
            "set control.limits.rate, or control.limits.profile",
        )
    if missing := _named(facts, ~np.isfinite(arm.torque_limit)):
        way = 'set <joint actuatorfrcrange="..."/> or forcerange of its actuator'
        yield "torque-limit-missing", f"no torque limit of {', '.join(missing)}", way
    yield (
        "acceleration-limit",
        "no acceleration limits, which MJCF cannot express",
        "set control.limits.acceleration, or .profile",
    )


def _model(facts: Facts) -> _Findings:
    arm = facts.arm
    others = [name for name in arm.sites if name != arm.site]
    if others and not {"frame", "frame-short"} & {*map(code_of, arm.notes)}:
        yield (
            "frame",
            f"site {arm.site} is controlled; other sites: {listed(others)}",
            "choose by --site, or arm.site",
        )
    named = [(one.is_replaced, f"{one.name} ({one.kind}, {one.drives})") for one in facts.actuators]
    if replaced := [name for is_replaced, name in named if is_replaced]:
        yield (
            "actuator-replaced",
            f"plants replace the actuators {listed(replaced)} by their own actuators",
            "",
        )
    if kept := [name for is_replaced, name in named if not is_replaced]:
        yield "actuator-other", f"not actuators of the arm: {listed(kept)}", ""
    for one in (one for one in facts.others if one.moves_site):
        yield (
            "joint-idle",
            f"joint {one.name} ({one.kind}) moves the site and is not actuated",
            "list it in arm.joints",
        )
    if rest := [f"{one.name} ({one.kind}, body {one.body})" for one in facts.others if not one.moves_site]:
        yield "joint-other", f"joints outside the arm: {listed(rest)}", ""


def _touching(facts: Facts) -> _Findings:
    met = [contact for contact in facts.contacts if contact.is_moved]
    if met:
        code = "home-contact" if met[0].depth > DEEP else "home-touch"
        yield code, f"at home {_pairs(met)}", "set arm.start, or add <contact><exclude .../></contact>"


def _moving(facts: Facts) -> _Findings:
    for motion in facts.motions:
        how = (
            f"one second of motion on the {motion.plant} plant (seed {facts.seed}, {BOUND:g} rad about home)"
        )
        if motion.refused:
            yield (
                "plant-refused",
                f"the {motion.plant} plant refuses it: {motion.refused}",
                "choose another plant.kind",
            )
            continue
        if motion.diverged:
            way = "correct masses, armature or damping, or lower plant.timestep"
            yield "diverged", f"{how} diverged {motion.diverged}", way
        if motion.springs:
            way = "take the servo or torque plant, which compensate them, or drive these joints by motors"
            yield "spring-load", f"on the {motion.plant} plant {motion.springs}", way
        if motion.scorecard and motion.scorecard["status_time.SLIPPED"].value:
            off = f"{how}: a follower was {motion.scorecard['slip.max'].value:.3g} rad or m off its equality"
            yield "follower-slip", off, SLIP_CURE
        if motion.contacts:
            yield "motion-contact", f"{how}: {_pairs(motion.contacts)}", "set arm.start, or exclude the pair"
        share = float(motion.scorecard["tau.share_of_limit"].value) if motion.scorecard else 0.0
        if share >= 1.0 - 1e-9:
            yield (
                "torque-saturated",
                f"{how}: an actuator was at its limit",
                "lower plant.kv, or the speeds of a scenario",
            )
        for name, count in (motion.warnings or {}).items():
            yield "mujoco-warning", f"{how}: {name}, {count} times", ""


JUDGES: tuple[Callable[[Facts], _Findings], ...] = (_start, _touching, _geometry, _limits, _moving, _model)


def _named(facts: Facts, which: NDArray[np.bool_]) -> list[str]:
    return [name for name, is_one in zip(facts.arm.joints, which, strict=True) if is_one]


def _pairs(contacts: Sequence[Contact]) -> str:
    """Return the deepest of some contacts in words, and the number of the others."""
    (one, other), (first, second) = contacts[0].geoms, contacts[0].bodies
    more = f", and {len(contacts) - 1} more pairs" if len(contacts) > 1 else ""
    depth = f"{1e3 * contacts[0].depth:.2g} mm"
    return f"{one} of body {first} and {other} of body {second} penetrate by {depth}{more}"
