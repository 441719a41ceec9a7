"""Findings of a check: errors, missing data and assumptions, each with a code, a line, and a remedy."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.check.facts import Facts
from rmrc.analysis.check.motion import BOUND
from rmrc.analysis.directions import SLOW
from rmrc.analysis.new.scaling import ASSUMED_RATE
from rmrc.arm import Arm
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
    "range-suspicious": ("warning", "angles seem to be in the other unit"),
    "range-reversed": ("warning", "a range of a URDF does not end above its beginning, and is not used"),
    "scale-suspicious": ("warning", "the arm is so long that its lengths seem to be in mm"),
    "home-singular": ("warning", "the arm is singular at home, or nearly so"),
    "home-touch": ("warning", "bodies of the arm touch each other at home"),
    "rate-limit-missing": (
        "warning",
        "a joint has no rate limit, which MJCF has only in servos",
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
    "acceleration-limit": ("note", "no acceleration limits are read from a model"),
    "unused": ("note", "data of a URDF are not used"),
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
# Arms are shorter [m].
LONG = 50.0
RADIANS = "write lower and upper of <limit> in rad, and velocity in rad/s"


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
                _way(arm, 'add <key name="home" qpos="..."/> within it, or set arm.start', "set arm.start"),
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
            "correct axes and places of the joints that `rmrc inspect` reports as turning against each other",
        )
    size = _size(arm)
    if size > LONG:
        text = f"the arm, or a shape on it, is {size:.3g} m long, as if it were in mm"
        yield "scale-suspicious", text, 'write m and kg m^2, and scale="0.001 0.001 0.001" of meshes in mm'
    if task.rank < 6:
        yield "axes", f"the arm moves {' '.join(task.axes)} of the site independently", "set task.axes"


def _limits(facts: Facts) -> _Findings:
    arm = facts.arm
    width = np.diff(arm.position_limit, axis=1)[:, 0]
    hinges, limited = ~arm.is_slide, np.isfinite(width)
    angles = width[hinges & limited]
    if angles.size and (angles < NARROW).all():
        text = f"the ranges of all hinges are below {NARROW:g} rad, as if radians had been read as degrees"
        yield "range-suspicious", text, _way(arm, 'set <compiler angle="radian"/>', RADIANS)
    wide = hinges & limited & (width > WIDE)
    if wide.any():
        sizes = map("{} {:.0f} rad".format, _named(facts, wide), width[wide])
        text = f"ranges of more than {WIDE / (2.0 * np.pi):g} turns, as if degrees were rad: {listed(sizes)}"
        way = _way(arm, 'set <compiler angle="degree"/>, or write radians', RADIANS)
        yield "range-suspicious", text, way
    if missing := _named(facts, ~limited):
        urdf = 'set <limit lower="..." upper="..."/> in rad or m, and no type="continuous",'
        way = _way(arm, 'set <joint range="..."/>', urdf)
        yield "range-missing", f"no range of {', '.join(missing)}", f"{way} where there are stops"
    if missing := _named(facts, ~np.isfinite(arm.rate_limit)):
        yield (
            "rate-limit-missing",
            f"no rate limit of {', '.join(missing)}; `rmrc new` assumes {ASSUMED_RATE:g} rad/s",
            _way(arm, "set ", 'set velocity="..." of <limit>, ') + "control.limits.rate, or .profile",
        )
    if missing := _named(facts, ~np.isfinite(arm.torque_limit)):
        way = 'set <joint actuatorfrcrange="..."/> or forcerange of its actuator'
        way = _way(arm, way, 'set <limit effort="..."/> in N m or N')
        yield "torque-limit-missing", f"no torque limit of {', '.join(missing)}", way
    yield (
        "acceleration-limit",
        "no acceleration limits, which are not read from a model",
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
        way = "set arm.start" + _way(facts.arm, ", or add <contact><exclude .../></contact>", "")
        yield code, f"at home {_pairs(met)}", way


def _moving(facts: Facts) -> _Findings:
    for motion in facts.motions:
        how = (
            f"one second of motion on the {motion.plant} plant (seed {facts.seed}, {BOUND:g} rad about home)"
        )
        if motion.refused:
            refusal = f"the {motion.plant} plant refuses it: {motion.refused}"
            if not (facts.arm.is_urdf and motion.plant == "model"):  # a URDF cannot have actuators
                yield "plant-refused", refusal, "choose another plant.kind"
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


def _way(arm: Arm, mjcf: str, urdf: str) -> str:
    """Return the remedy in the language of the arm's file."""
    return urdf if arm.is_urdf else mjcf


def _size(arm: Arm) -> float:
    """Return the length of an arm from its first joint to its site, or of a larger shape on it [m]."""
    chain, model = arm.chain, arm.model
    travel = np.diff(arm.position_limit[arm.is_slide])
    links = np.linalg.norm([*chain.step[1:], chain.tip_step], axis=1)
    moved = model.body_weldid[model.geom_bodyid] > 0
    length = float(links.sum() + travel[np.isfinite(travel)].sum())
    return max(length, float(model.geom_rbound[moved].max(initial=0.0)))


def _named(facts: Facts, which: NDArray[np.bool_]) -> list[str]:
    return [name for name, is_one in zip(facts.arm.joints, which, strict=True) if is_one]


def _pairs(contacts: Sequence[Contact]) -> str:
    """Return the deepest of some contacts in words, and the number of the others."""
    (one, other), (first, second) = contacts[0].geoms, contacts[0].bodies
    more = f", and {len(contacts) - 1} more pairs" if len(contacts) > 1 else ""
    depth = f"{1e3 * contacts[0].depth:.2g} mm"
    return f"{one} of body {first} and {other} of body {second} penetrate by {depth}{more}"
