"""A linter for models: frame, limits, start, size, and a second of motion on each plant.

It has findings: errors, missing data and assumptions, each with a code, a line, and a remedy.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rmrc.analysis.scaling import ASSUMED_RATE, Scales, scales
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.analysis.trial import Trial, identity, overlaps, touching, tried
from rmrc.arm import Arm
from rmrc.arm.inventory import Contact, other_joints
from rmrc.arm.tree import code_of
from rmrc.law.law import SINGULAR_BELOW
from rmrc.law.task import Array
from rmrc.results.expectations import Case
from rmrc.results.scorecard import SLIP_CURE, Figure
from rmrc.scenario import Scenario
from rmrc.scenario.choices import PLANTS
from rmrc.show.sheets import UNDEFINED, Report, Sheet, number, plain
from rmrc.simulation.prepare import Cache, prepare
from rmrc.support.text import brief

# The motions that are tried -----------------------------------------------------------------------
#
# A second of bounded motion of an arm on every plant, compared with the ideal one.

# Displacement of each joint from the start [rad, or of L], number of positions, and duration [s].
BOUND, PLACES, DURATION = 0.05, 2, 1.0
# A plant differs from the ideal one if its error is this many times as large, or a rate this share above its
# limit. Errors below the last, in m of the arm's size or rad, are rounding.
TIMES, ABOVE, ROUNDING = 100.0, 0.05, 1e-6


def motions(scales: Scales, start: Array) -> tuple[Trial, ...]:
    """Return the results of the motion on each plant, the ideal one first.

    The site visits its poses at random joint positions near the start, one after another, and returns, by
    the law and within the rate limits; the target motion is the same on all plants.

    Args:
        scales: Scales of the arm.
        start: Joint positions within the limits, (n,).
    """
    arm = scales.task.arm
    quiet = replace(arm, notes=())  # the findings contain them
    cache, written = Cache(*() if arm.stretch else (quiet,)), _scenario(scales, start)
    hurry = prepare(written, cache).reference.duration / DURATION
    powers = {"velocity": 1, "acceleration": 2, "jerk": 3}
    faster = {
        f"target.limits.{name}": value * hurry ** powers[name.removeprefix("angular_")]
        for name, value in written.target.limits.model_dump().items()
    }
    return tuple(tried(written.set(faster), plant, cache) for plant in PLANTS.names)


def difference(scales: Scales, card: Mapping[str, Figure], ideal: Mapping[str, Figure]) -> str:
    """Return how the metrics on a plant differ from those on the ideal one; "" if they hardly do."""
    texts = []
    for name, size in (("position_error.max", scales.size), ("orientation_error.max", 1.0)):
        if name in card:
            error = float(card[name].value)
            times = error / max(float(ideal[name].value), ROUNDING * size)
            if times >= TIMES:
                texts.append(
                    f"{name} {error:.3g} {card[name].unit} is {times:.0f} times that of the ideal plant"
                )
    for joint, limit in zip(scales.task.arm.joints, scales.rate, strict=True):
        rate, unit, *_ = card[f"joint_rate.{joint}.peak"]
        if float(rate) > (1.0 + ABOVE) * limit:
            texts.append(f"{joint} moves at {rate:.3g} {unit}, beyond its limit of {limit:.3g}")
    return "; ".join(texts)


def _scenario(scales: Scales, start: Array) -> Scenario:
    """Return the motion, timed by the defaults of a target."""
    task, arm = scales.task, scales.task.arm
    away = BOUND * task.joint_scale * np.random.default_rng(0).uniform(-1.0, 1.0, (PLACES, arm.n))
    places = [*np.clip(start + away, *arm.position_limit.T), start]
    return Scenario.model_validate({
        "name": "check",
        "arm": identity(arm, Path.resolve) | {"start": start.tolist()},
        "task": {"axes": list(task.axes), "length": task.length},
        "control": {"limits": {"rate": scales.rate.tolist()}},
        "target": {"path": [{"configurations": [q.tolist() for q in places]}]},
    })  # fmt: skip


# The findings -------------------------------------------------------------------------------------

Level = Literal["error", "warning", "note"]

# Codes by their level, the worst first; docs/my_robot.md says what each means. An error makes a run wrong, or
# prevents it.
LEVELS: dict[Level, tuple[str, ...]] = {
    "error": ("home-outside-limits", "home-contact", "diverged"),
    "warning": (
        "plant-refused", "plant-differs", "rank-deficient", "range-suspicious", "range-reversed",
        "scale-suspicious", "home-singular", "home-touch", "rate-limit-missing", "torque-limit-missing",
        "motion-contact", "torque-saturated", "spring-load", "follower-slip", "frame-short",
    ),
    "note": ("range-missing", "unused", "no-home", "frame", "base-fixed", "assumed", "joint-idle"),
}  # fmt: skip
CODES: dict[str, Level] = {code: level for level, codes in LEVELS.items() for code in codes}

# Bodies that overlap by more [m] push each other apart; smaller overlaps are margins or meshes.
DEEP = 1e-3
# If all hinges have ranges below the first, or one above the second [rad], the units are mixed up.
NARROW, WIDE = 0.12, 8.0 * np.pi
# Arms are shorter [m].
LONG = 50.0


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
        contacts: Contacts at home of parts that the joints move relative to each other.
        motions: A second of motion on each plant.
        findings: Errors, missing data and assumptions, errors first.
    """

    arm: Arm
    scales: Scales
    home: Array
    sigma: Array
    contacts: tuple[Contact, ...]
    motions: tuple[Trial, ...]
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
    findings = [
        Finding(CODES[code], code, text, way)
        for judge in (_home, _size, _limits, _moving)
        for code, text, way in judge(facts)
    ]
    return tuple(sorted(findings, key=lambda finding: [*CODES].index(finding.code)))


def _home(facts: Checked) -> _Findings:
    """Yield what was assumed, and what is wrong at home."""
    arm = facts.arm
    for note in arm.notes:
        yield code_of(note), note, ""
    if "home" not in arm.keyframes:
        yield "no-home", "no keyframe home, so all joints start at the model's zero", "set arm.start"
    for name in arm.idle():
        yield "joint-idle", f"joint {name} moves the site and is not actuated", "list it in arm.joints"
    for name, at, (lower, upper) in zip(arm.joints, facts.home, arm.position_limit, strict=True):
        if not lower <= at <= upper:
            text = f"joint {name} is at {at:.4g} at home, outside its range [{lower:.4g}, {upper:.4g}]"
            yield "home-outside-limits", text, "set arm.start within it"
    if facts.sigma[-1] <= SINGULAR_BELOW * facts.sigma[0]:
        text = f"at home sigma_min is {facts.sigma[-1]:.2g}: the arm can hardly move in one direction"
        yield "home-singular", text, "set arm.start away from it; `rmrc inspect` names the direction"
    if facts.contacts:
        code = "home-contact" if facts.contacts[0].depth > DEEP else "home-touch"
        yield code, f"at home {overlaps(facts.contacts)}", "set arm.start, or exclude the pair"


def _size(facts: Checked) -> _Findings:
    """Yield an arm that loses a direction in every posture, or whose lengths are implausible."""
    arm, rank, model = facts.arm, facts.scales.task.rank, facts.arm.model
    if rank < min(arm.n, 6):
        text = f"{arm.n} joints move {rank} directions of the site in every posture: some axes coincide"
        yield "rank-deficient", text, "correct axes and places of joints; `rmrc inspect` names those"
    travel = np.diff(arm.position_limit[arm.is_slide])
    links = np.linalg.norm([*arm.chain.step[1:], arm.chain.tip_step], axis=1)
    shapes = model.geom_rbound[model.body_weldid[model.geom_bodyid] > 0]
    size = max(links.sum() + travel[np.isfinite(travel)].sum(), shapes.max(initial=0.0))
    if size > LONG:
        text = f"the arm, or a shape on it, is {size:.3g} m long, as if it were in mm"
        yield "scale-suspicious", text, 'write m and kg m^2, and scale="0.001 0.001 0.001" of meshes in mm'


def _limits(facts: Checked) -> _Findings:
    """Yield ranges in another unit, and limits that the file lacks."""
    arm, names = facts.arm, np.array(facts.arm.joints)
    width = np.diff(arm.position_limit, axis=1)[:, 0]
    angles = ~arm.is_slide & np.isfinite(width)
    narrow, wide = angles & (width < NARROW), angles & (width > WIDE)
    strange = narrow if (narrow == angles).all() else wide
    if strange.any():
        text = f"ranges of {', '.join(names[strange])} look as if radians and degrees were mixed up"
        urdf = "write lower and upper of <limit> in rad, and velocity in rad/s"
        mjcf = 'set <compiler angle="radian"/> or "degree", as the file is written'
        yield "range-suspicious", text, urdf if arm.is_urdf else mjcf
    for code, values, what, mjcf, urdf in (
        ("range-missing", width, "no range", '<joint range="..."/>',
         '<limit lower="..." upper="..."/> in rad or m, and no type="continuous"'),
        ("rate-limit-missing", arm.rate_limit, f"no rate limit (`rmrc new` assumes {ASSUMED_RATE:g} rad/s)",
         "control.limits.rate, or .profile", 'velocity="..." of <limit>, or control.limits.rate'),
        ("torque-limit-missing", arm.torque_limit, "no torque limit",
         '<joint actuatorfrcrange="..."/> or forcerange of its actuator', '<limit effort="..."/> in N m'),
    ):  # fmt: skip
        if (missing := ~np.isfinite(values)).any():
            yield code, f"{what} of {', '.join(names[missing])}", f"set {urdf if arm.is_urdf else mjcf}"


def _moving(facts: Checked) -> _Findings:
    """Yield what went wrong in the motion on each plant, and how it differs from that on the ideal one."""
    for motion in facts.motions:
        on = f"on the {motion.plant} plant"
        if motion.refused:
            if not (facts.arm.is_urdf and motion.plant == "model"):  # a URDF cannot have actuators
                yield "plant-refused", f"{on} it cannot run: {motion.refused}", "choose another plant.kind"
            continue
        causes = list(_causes(facts, motion))
        for code, text, way in causes:
            yield code, f"{on} {text}", way
        differs = difference(facts.scales, motion.scorecard, facts.motions[0].scorecard)
        if differs and not motion.diverged:
            why = ", ".join(code for code, *_ in causes) or _suspects(facts, motion)
            way = "mend the cause, or take another plant.kind"
            yield "plant-differs", f"{on} {differs}; cause: {why}", way


def _causes(facts: Checked, motion: Trial) -> _Findings:
    """Yield what kept an arm from its motion on a plant."""
    card, run, at_home = motion.scorecard, motion.run, {contact.geoms for contact in facts.contacts}
    assert run is not None
    if motion.diverged:
        way = "correct masses, armature or damping, or lower plant.timestep"
        yield "diverged", f"it {motion.diverged}", way
    if motion.springs:
        way = "take the servo or torque plant, which compensate them, or drive these joints by motors"
        yield "spring-load", motion.springs, way
    if card["status_time.SLIPPED"].value:
        off = f"a follower was {card['slip.max'].value:.3g} rad or m off its equality"
        yield "follower-slip", off, SLIP_CURE
    if met := [each for each in touching(facts.arm, run["qpos"]) if each.geoms not in at_home]:
        yield "motion-contact", overlaps(met), "set arm.start, or exclude the pair"
    if card["torque_limited.time"].value:
        text = f"the actuator of {card['torque_limited.first_joint'].value} was at its limit"
        yield "torque-saturated", text, "lower plant.kv, or the speeds of a scenario"


def _suspects(facts: Checked, motion: Trial) -> str:
    """Return the possible causes of a difference that the motion itself does not show."""
    if motion.plant == "model":
        return "the model's own drives, which lag or give way to the weight"
    met = "contact at home" if facts.contacts else ""
    idle = "joints that are not driven" if other_joints(facts.arm) else ""
    return ", ".join(filter(None, (met, idle))) or "masses, friction or plant.timestep"


# Metrics of each motion that are shown.
METRICS = ("joint_rate.peak", "position_error.max", "orientation_error.max", "tau.share_of_limit")


def check(
    model: Model,
    *,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    joints: Sequence[str] | None = None,
) -> Checked:
    """Check whether a model is ready to be used, and report the necessary corrections.

    Args:
        model: An arm, an MJCF file, the name of a shipped one, or a scenario, whose arm is checked with its
            length.
        site: The site to control; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.tree`.
        body: The body whose frame to control, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        joints: The joints to actuate; None: those of the arm or scenario, or else all on the chain.

    Raises:
        ModelError: The file cannot be read, or lacks the site or a joint.
        QuestionError: An arm is given with another site, or its joints do not move the site.

    Example:
        >>> one = check("planar_2link")
        >>> one.is_ready, [finding.code for finding in one.findings if finding.level == "warning"]
        (True, [])
    """
    arm = read_arm(model, site, body, packages, joints)
    arm.require_open()
    suits = scales(arm, model.task.length if isinstance(model, Scenario) else None)
    home = arm.configuration("home")[arm.wiring.qpos]
    checked = Checked(
        arm, suits, home, np.array(np.linalg.svd(suits.task.matrix(arm.jacobian(home)))[1]),
        touching(arm, arm.configuration("home")[None]), motions(suits, np.clip(home, *arm.position_limit.T)),
    )  # fmt: skip
    return replace(checked, findings=findings_of(checked))


def report(checked: Checked) -> Report:
    """Return the report of a check; its condition is met if there is no error.

    Args:
        checked: The result of `check`.

    Example:
        >>> report(check("planar_2link")).met
        True
    """
    arm, task, findings = checked.arm, checked.scales.task, checked.findings
    about = {
        "model": arm.path.name, "site": arm.site, "ready": checked.is_ready, "axes": " ".join(task.axes),
        "length": task.length, "damping below": checked.scales.below, "sigma": checked.sigma,
        "condition": checked.condition,
    }  # fmt: skip
    home = np.round(checked.home, 12) + 0.0
    limits = zip(arm.joints, arm.kinds, home, *arm.position_limit.T, arm.rate_limit,
                 arm.torque_limit, strict=True)  # fmt: skip
    joints = [
        dict(zip(("joint", "kind", "home", "from", "to", "rate", "torque"), row, strict=True))
        for row in limits
    ]
    trials = []
    for trial in checked.motions:
        result = "refused" if trial.refused else "diverged" if trial.diverged else "ok"
        card = trial.scorecard
        figures = {name: card[name].value if name in card else None for name in METRICS}
        trials.append({"plant": trial.plant, "result": result, **figures})
    answer = plain({
        **about, "joints": joints, "motions": trials, "findings": [vars(finding) for finding in findings],
    })  # fmt: skip
    count = sum(finding.level == "error" for finding in findings)
    sheets = [
        _sheet(f"{arm.path.name}: {arm.n} joints", [{"": name, " ": answer[name]} for name in about]),
        _sheet("Joints, in rad or m, per s, and N m or N", answer["joints"]),
        _sheet(f"{DURATION:g} s of motion, each joint within {BOUND:g} rad of home", answer["motions"]),
        _sheet(f"Findings: {count or 'none'} with errors",
               [{"level": each.level, "code": each.code, "what": str(each)} for each in findings]),
    ]  # fmt: skip
    cases = []
    for code, level in CODES.items():
        lines = [f"{level}: {finding}" for finding in findings if finding.code == code]
        cases.append(Case(code, not lines or level != "error", "; ".join(lines) or "none"))
    return Report(sheets, answer, met=checked.is_ready, cases=cases)


def _sheet(title: str, rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return a table of the same values as the JSON."""
    cells = [tuple(map(_cell, row.values())) for row in rows]
    words = {i for row in rows for i, value in enumerate(row.values()) if isinstance(value, str)}
    return Sheet(title, tuple(rows[0]) if rows else ("",), cells, frozenset({0} | words))


def _cell(value: Any) -> str:
    """Return a value in a table."""
    if isinstance(value, list):
        return "  ".join(map(_cell, value))
    if isinstance(value, float):
        return number(value)
    return UNDEFINED if value is None else str(value)
