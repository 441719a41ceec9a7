"""Findings of a check: errors, missing data and assumptions, each with a code, a line, and a remedy."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.check.motion import Motion
from rmrc.analysis.scaling import ASSUMED_RATE, Nearest, Scales
from rmrc.arm import Arm
from rmrc.arm.frames import code_of
from rmrc.arm.inventory import Actuator, Contact, OtherJoint
from rmrc.law.law import SINGULAR_BELOW
from rmrc.law.task import Array
from rmrc.results.verdict import SLIP_CURE
from rmrc.support.brief import brief
from rmrc.support.legible import listed

Level = Literal["error", "warning", "note"]

# Every code with its meaning; an error makes a run wrong, or prevents it.
CODES: dict[str, tuple[Level, str]] = {
    "home-outside-limits": ("error", "home is outside a joint's range: a run begins with the way back"),
    "home-contact": ("error", "bodies of the arm penetrate each other at home"),
    "diverged": ("error", "one second of motion diverged"),
    "plant-refused": ("warning", "a plant cannot run this arm"),
    "plant-differs": ("warning", "a plant errs a hundred times more than `ideal`, or leaves the rate limits"),
    "rank-deficient": ("warning", "the Jacobian is rank-deficient in every configuration"),
    "range-suspicious": ("warning", "angles seem to be in the other unit"),
    "range-reversed": ("warning", "a range of a URDF does not end above its beginning, and is not used"),
    "scale-suspicious": ("warning", "the arm is so long that its lengths seem to be in mm"),
    "home-singular": ("warning", "the arm is singular at home, or nearly so"),
    "home-touch": ("warning", "bodies of the arm touch each other at home"),
    "rate-limit-missing": ("warning", "a joint has no rate limit, which MJCF has only in servos"),
    "torque-limit-missing": ("warning", "a joint has no torque limit: its actuator is ideal"),
    "motion-contact": ("warning", "bodies touched during one second of motion"),
    "torque-saturated": ("warning", "an actuator saturated during one second of motion"),
    "spring-load": ("warning", "a plant does not compensate for the spring of a joint"),
    "follower-slip": ("warning", "a follower left its equality during one second of motion"),
    "mujoco-warning": ("warning", "MuJoCo issued a warning during one second of motion"),
    "frame-short": ("warning", "the controlled frame leaves out joints of a longer chain"),
    "range-missing": ("note", "a joint has no range"),
    "unused": ("note", "data of a URDF are not used"),
    "no-home": ("note", "there is no keyframe home; another configuration replaces it"),
    "frame": ("note", "other frames could be controlled instead"),
    "base-fixed": ("note", "the base has a free joint in the file, and is fixed"),
    "assumed": ("note", "another assumption was made where the file has no data or is unreadable"),
    "axes": ("note", "the arm has fewer than six degrees of freedom"),
    "actuator-other": ("note", "an actuator of the model acts on no joint of the arm"),
    "joint-idle": ("note", "a joint moves the site and is not actuated"),
    "joint-other": ("note", "the model has joints outside the arm"),
}
LEVELS: tuple[Level, ...] = ("error", "warning", "note")

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
        level: `error`, `warning` or `note`.
        code: One of `CODES`, which never changes.
        text: Description, in a line.
        way: The remedy; "" if none is needed.
    """

    level: Level
    code: str
    text: str
    way: str = ""

    def __str__(self) -> str:
        """Return text and remedy in a line."""
        return "; ".join(filter(None, (self.text, self.way)))


@brief
@dataclass(frozen=True, eq=False)
class Checked:
    """Result of a check.

    Attributes:
        arm: The arm.
        scales: Scales of the arm: task, length, distribution of σ_min.
        home: Joint positions of `home`, (n,) [rad or m].
        sigma: Singular values of A at home, descending, (k,).
        nearest: The nearest singularity that was found from home, within the limits.
        actuators: Actuators of the author's model.
        others: Joints that are not actuated.
        contacts: Contacts at home.
        motions: A second of motion on each plant.
        seed: Seed of that motion.
        findings: Errors, missing data and assumptions, errors first.
    """

    arm: Arm
    scales: Scales
    home: Array
    sigma: Array
    nearest: Nearest
    actuators: tuple[Actuator, ...]
    others: tuple[OtherJoint, ...]
    contacts: tuple[Contact, ...]
    motions: tuple[Motion, ...]
    seed: int
    findings: tuple[Finding, ...] = ()

    @property
    def is_ready(self) -> bool:
        """Whether the arm can be used without a correction."""
        return not any(finding.level == "error" for finding in self.findings)

    @property
    def condition(self) -> float:
        """κ = σ_1/σ_k at home, infinite where σ_k = 0."""
        return float(self.sigma[0] / self.sigma[-1]) if self.sigma[-1] > 0.0 else np.inf


# Code, text and remedy of each finding.
_Findings = Iterator[tuple[str, str, str]]


def findings_of(facts: Checked) -> tuple[Finding, ...]:
    """Return all findings, errors first."""
    judges = (_start, _geometry, _limits, _parts, _moving)
    findings = [
        Finding(CODES[code][0], code, text, way) for judge in judges for code, text, way in judge(facts)
    ]
    return tuple(sorted(findings, key=lambda finding: LEVELS.index(finding.level)))


def _start(facts: Checked) -> _Findings:
    arm = facts.arm
    for name, at, (lower, upper), unit in zip(
        arm.joints, facts.home, arm.position_limit, arm.units, strict=True
    ):
        if not lower <= at <= upper:
            text = f"joint {name} is at {at:.4g} {unit} at home, outside its range [{lower:.4g}, {upper:.4g}]"
            key = "" if arm.is_urdf else 'add <key name="home" qpos="..."/> within it, or '
            yield "home-outside-limits", text, f"{key}set arm.start"
    if "home" not in arm.keyframes:
        known = f"; its keyframes: {listed(sorted(arm.keyframes))}" if arm.keyframes else ""
        yield "no-home", f"no keyframe home, so all joints start at the model's zero{known}", "set arm.start"
    for note in arm.notes:
        yield code_of(note), note, ""
    if facts.sigma[-1] <= SINGULAR_BELOW * facts.sigma[0]:
        text = f"at home sigma_min is {facts.sigma[-1]:.2g}: the arm can hardly move in one direction"
        yield "home-singular", text, "set arm.start away from it; `rmrc inspect` names the direction"
    if met := [contact for contact in facts.contacts if contact.is_moved]:
        exclude = "" if arm.is_urdf else ", or add <contact><exclude .../></contact>"
        code = "home-contact" if met[0].depth > DEEP else "home-touch"
        yield code, f"at home {_pairs(met)}", f"set arm.start{exclude}"


def _geometry(facts: Checked) -> _Findings:
    arm, task = facts.arm, facts.scales.task
    if task.rank < min(arm.n, 6):
        text = f"{arm.n} joints move {task.rank} directions of the site in every posture: some axes coincide"
        yield "rank-deficient", text, "correct axes and places of joints; `rmrc inspect` names those"
    size = _size(arm)
    if size > LONG:
        text = f"the arm, or a shape on it, is {size:.3g} m long, as if it were in mm"
        yield "scale-suspicious", text, 'write m and kg m^2, and scale="0.001 0.001 0.001" of meshes in mm'
    if task.rank < 6:
        yield "axes", f"the arm moves {' '.join(task.axes)} of the site independently", "set task.axes"


def _size(arm: Arm) -> float:
    """Return the length of an arm from its first joint to its site, or of a larger shape on it [m]."""
    chain, model = arm.chain, arm.model
    travel = np.diff(arm.position_limit[arm.is_slide])
    links = np.linalg.norm([*chain.step[1:], chain.tip_step], axis=1)
    moved = model.body_weldid[model.geom_bodyid] > 0
    length = float(links.sum() + travel[np.isfinite(travel)].sum())
    return max(length, float(model.geom_rbound[moved].max(initial=0.0)))


def _limits(facts: Checked) -> _Findings:
    arm, is_urdf = facts.arm, facts.arm.is_urdf
    width = np.diff(arm.position_limit, axis=1)[:, 0]
    hinges, limited = ~arm.is_slide, np.isfinite(width)
    angles = width[hinges & limited]

    def named(which: NDArray[np.bool_]) -> str:
        return ", ".join(np.array(arm.joints)[which])

    if angles.size and (angles < NARROW).all():
        text = f"the ranges of all hinges are below {NARROW:g} rad, as if radians had been read as degrees"
        yield "range-suspicious", text, RADIANS if is_urdf else 'set <compiler angle="radian"/>'
    if (wide := hinges & limited & (width > WIDE)).any():
        text = f"ranges of more than {WIDE / (2.0 * np.pi):g} turns, as if degrees were rad: {named(wide)}"
        yield (
            "range-suspicious",
            text,
            RADIANS if is_urdf else 'set <compiler angle="degree"/>, or write radians',
        )
    if not limited.all():
        way = 'set <joint range="..."/>'
        urdf = 'set <limit lower="..." upper="..."/> in rad or m, and no type="continuous",'
        yield (
            "range-missing",
            f"no range of {named(~limited)}",
            f"{urdf if is_urdf else way} where there are stops",
        )
    if (missing := ~np.isfinite(arm.rate_limit)).any():
        text = f"no rate limit of {named(missing)}; `rmrc new` assumes {ASSUMED_RATE:g} rad/s"
        way = 'set velocity="..." of <limit>, ' if is_urdf else "set "
        yield "rate-limit-missing", text, f"{way}control.limits.rate, or .profile"
    if (missing := ~np.isfinite(arm.torque_limit)).any():
        way = 'set <joint actuatorfrcrange="..."/> or forcerange of its actuator'
        urdf = 'set <limit effort="..."/> in N m or N'
        yield "torque-limit-missing", f"no torque limit of {named(missing)}", urdf if is_urdf else way


def _parts(facts: Checked) -> _Findings:
    arm = facts.arm
    others = [name for name in arm.sites if name != arm.site]
    if others and not {"frame", "frame-short"} & {*map(code_of, arm.notes)}:
        text = f"site {arm.site} is controlled; other sites: {listed(others)}"
        yield "frame", text, "choose by --site, or arm.site"
    if other := [
        f"{each.name} ({each.kind}, {each.drives})" for each in facts.actuators if not each.is_replaced
    ]:
        yield "actuator-other", f"not actuators of the arm: {listed(other)}", ""
    for each in facts.others:
        if each.moves_site:
            text = f"joint {each.name} ({each.kind}) moves the site and is not actuated"
            yield "joint-idle", text, "list it in arm.joints"
    if other := [
        f"{each.name} ({each.kind}, body {each.body})" for each in facts.others if not each.moves_site
    ]:
        yield "joint-other", f"joints outside the arm: {listed(other)}", ""


def _moving(facts: Checked) -> _Findings:
    for motion in facts.motions:
        if motion.refused:
            text = f"the {motion.plant} plant refuses it: {motion.refused}"
            if not (facts.arm.is_urdf and motion.plant == "model"):  # a URDF cannot have actuators
                yield "plant-refused", text, "choose another plant.kind"
            continue
        causes = list(_causes(motion))
        for code, text, way in causes:
            yield code, f"on the {motion.plant} plant {text}", way
        if motion.differs:
            why = ", ".join(code for code, *_ in causes) or _suspects(facts, motion)
            way = "mend the cause, or take another plant.kind"
            yield "plant-differs", f"on the {motion.plant} plant {motion.differs}; cause: {why}", way


def _causes(motion: Motion) -> _Findings:
    """Yield what kept an arm from its motion on a plant."""
    if motion.diverged:
        way = "correct masses, armature or damping, or lower plant.timestep"
        yield "diverged", f"it {motion.diverged}", way
    if motion.springs:
        way = "take the servo or torque plant, which compensate them, or drive these joints by motors"
        yield "spring-load", motion.springs, way
    if motion.scorecard and motion.scorecard["status_time.SLIPPED"].value:
        off = f"a follower was {motion.scorecard['slip.max'].value:.3g} rad or m off its equality"
        yield "follower-slip", off, SLIP_CURE
    if motion.contacts:
        yield "motion-contact", _pairs(motion.contacts), "set arm.start, or exclude the pair"
    if motion.scorecard and motion.scorecard["torque_limited.time"].value:
        joint = motion.scorecard["torque_limited.first_joint"].value
        way = "lower plant.kv, or the speeds of a scenario"
        yield "torque-saturated", f"the actuator of {joint} was at its limit", way
    for name, count in (motion.warnings or {}).items():
        yield "mujoco-warning", f"MuJoCo warns: {name}, {count} times", ""


def _suspects(facts: Checked, motion: Motion) -> str:
    """Return the possible causes of a difference that the motion itself does not show."""
    if motion.plant == "model":
        return "the model's own drives, which lag or give way to the weight"
    touching = "contact at home" if any(contact.is_moved for contact in facts.contacts) else ""
    idle = "joints that are not driven" if facts.others else ""
    return ", ".join(filter(None, (touching, idle))) or "masses, friction or plant.timestep"


def _pairs(contacts: Sequence[Contact]) -> str:
    """Return the deepest of some contacts in words, and the number of the others."""
    (geom, other), (first, second) = contacts[0].geoms, contacts[0].bodies
    more = f", and {len(contacts) - 1} more pairs" if len(contacts) > 1 else ""
    depth = f"{1e3 * contacts[0].depth:.2g} mm"
    return f"{geom} of body {first} and {other} of body {second} penetrate by {depth}{more}"
