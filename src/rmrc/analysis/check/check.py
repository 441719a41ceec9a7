"""A linter for models: chain, limits, actuators, start, other parts, and a second of motion."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rmrc.analysis.check.findings import CODES, Checked, findings_of
from rmrc.analysis.check.motion import BOUND, DURATION, motions
from rmrc.analysis.scaling import nearest_singularity, scales
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.arm.geometry import damping_maximum
from rmrc.arm.inventory import actuators, contacts, other_joints
from rmrc.results.expectations import Case
from rmrc.results.scorecard import Figure
from rmrc.scenario import Scenario
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number

# Metrics of each motion that are shown.
METRICS = {
    "joint_rate.peak": "peak rate", "position_error.max": "error [m]", "orientation_error.max": "error [rad]",
    "tau.share_of_limit": "tau share",
}  # fmt: skip


def check(
    model: Model,
    *,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    joints: Sequence[str] | None = None,
    seed: int = 0,
) -> Checked:
    """Check whether a model is ready to be used, and report the necessary corrections.

    Args:
        model: An arm, an MJCF file, the name of a shipped one, or a scenario, whose arm is checked with its
            length.
        site: The site to control; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame to control, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        joints: The joints to actuate; None: those of the arm or scenario, or else all on the chain.
        seed: Seed of the second of motion.

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
    near = nearest_singularity(suits, np.clip(home, suits.lower, suits.upper))
    touching = contacts(arm, arm.configuration("home")[None])
    start = np.clip(home, *arm.position_limit.T)
    checked = Checked(
        arm, suits, home, np.array(np.linalg.svd(suits.task.matrix(arm.jacobian(home)))[1]), near,
        actuators(arm), other_joints(arm), touching,
        motions(suits, start, frozenset(contact.geoms for contact in touching), seed), seed,
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
    answer = values(checked)
    about = [
        (name, _cell(value))
        for name, value in answer.items()
        if name not in ("joints", "motions", "findings")
    ]
    count = sum(finding.level == "error" for finding in checked.findings)
    sheets = [
        Sheet(f"{answer['model']}: {checked.arm.n} joints", ("", ""), about, frozenset({0, 1})),
        _sheet("Joints, in rad or m, per s, and N m or N", answer["joints"], frozenset({0, 1, 7})),
        _sheet(f"{DURATION:g} s of motion, each joint within {BOUND:g} rad of home, seed {checked.seed}",
               answer["motions"], frozenset({0, 1})),
        _sheet(f"Findings: {count or 'none'} with errors",
               [{"level": each.level, "code": each.code, "what": str(each)} for each in checked.findings],
               frozenset({0, 1, 2})),
    ]  # fmt: skip
    cases = []
    for code in CODES:
        told = [finding for finding in checked.findings if finding.code == code]
        ok = all(finding.level != "error" for finding in told)
        cases.append(Case(code, ok, "; ".join(f"{each.level}: {each}" for each in told) or "none"))
    return Report(sheets, plain(answer), met=checked.is_ready, cases=cases)


def values(checked: Checked) -> dict[str, Any]:
    """Return the answer: what is said of the arm, and a list each of joints, motions and findings."""
    arm, task, near = checked.arm, checked.scales.task, checked.nearest
    drives = {each.drives: f"{each.kind} {each.name}" for each in checked.actuators}
    joints = zip(
        arm.joints, arm.kinds, checked.home, arm.position_limit, arm.rate_limit, arm.torque_limit, strict=True
    )
    far = np.linalg.norm((near.q - np.clip(checked.home, *arm.position_limit.T)) / task.joint_scale)
    motion_rows = []
    for motion in checked.motions:
        card: Mapping[str, Figure] = motion.scorecard or {}
        motion_rows.append({
            "plant": motion.plant, "result": motion.result,
            **{name: card[name].value if name in card else None for name in METRICS},
            "contacts": len(motion.contacts), "warnings": sum((motion.warnings or {}).values()),
        })  # fmt: skip
    return {
        "model": arm.path.name, "site": arm.site, "ready": checked.is_ready,
        "axes": " ".join(task.axes), "length": task.length, "damping below": checked.scales.below,
        "damping maximum": damping_maximum(checked.scales.below), "sigma": checked.sigma.tolist(),
        "condition": checked.condition, "nearest singularity": checked.scales.listed(near.q),
        "is singular": near.is_singular, "distance": float(far), "seed": checked.seed,
        "joints": [
            {"joint": name, "kind": kind, "home": float(home) if abs(home) > 1e-12 else 0.0,
             "from": float(lower), "to": float(upper), "rate": float(rate), "torque": float(torque),
             "actuator": drives.get(f"joint {name}")}
            for name, kind, home, (lower, upper), rate, torque in joints
        ],
        "motions": motion_rows,
        "findings": [vars(finding) for finding in checked.findings],
    }  # fmt: skip


def _sheet(title: str, rows: Sequence[Mapping[str, Any]], words: frozenset[int]) -> Sheet:
    headings = tuple(METRICS.get(name, name) for name in rows[0]) if rows else ("",)
    return Sheet(title, headings, [tuple(map(_cell, row.values())) for row in rows], words)


def _cell(value: Any) -> str:
    """Return a value in a table."""
    if isinstance(value, list):
        return "  ".join(map(_cell, value))
    if isinstance(value, str | bool | int):
        return str(value)
    return UNDEFINED if value is None or not np.isfinite(value) else number(value)
