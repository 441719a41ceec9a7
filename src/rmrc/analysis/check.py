"""A linter for models: frame, limits, start, size, and a second of motion on each plant."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rmrc.analysis.findings import BOUND, CODES, DURATION, Checked, findings_of, motions
from rmrc.analysis.scaling import scales
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.analysis.trial import touching
from rmrc.results.expectations import Case
from rmrc.scenario import Scenario
from rmrc.show.sheets import UNDEFINED, Report, Sheet, number, plain

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
            `rmrc.arm.frames`.
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
