"""A linter for models: chain, limits, actuators, start, other parts, and a second of motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rmrc.analysis.check.facts import Facts
from rmrc.analysis.check.findings import Finding, found
from rmrc.analysis.check.motion import motions
from rmrc.analysis.directions import examine
from rmrc.analysis.new.nearest import nearest_singularity
from rmrc.analysis.new.scaling import scales
from rmrc.analysis.routes import disagreement
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.arm.inventory import actuators, contacts, other_joints
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted


@brief
@dataclass(frozen=True, eq=False)
class Checked(Facts):
    """Result of a check.

    Attributes:
        findings: Errors, missing data and assumptions, errors first.
    """

    findings: tuple[Finding, ...]

    @property
    def is_ready(self) -> bool:
        """Whether the arm can be used without a correction."""
        return not any(finding.level == "error" for finding in self.findings)


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
        model: An arm, an MJCF file, the name of a shipped one, or a scenario, whose arm is checked.
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
    suits = scales(arm)
    if not suits.below > 0.0:
        raise QuestionError(
            f"{arm.path}: its joints do not move {quoted(arm.site)}; choose another with --site or --body"
        )
    home = arm.configuration("home")[arm.wiring.qpos]
    start = np.clip(home, *arm.position_limit.T)
    sigma, lost, slow, _ = examine(suits.task, arm.jacobian(home), arm.pose(home))
    words = [one.words for one in lost] + [one.words for one in slow]
    near = nearest_singularity(suits, np.clip(home, suits.lower, suits.upper))
    touching = contacts(arm, arm.configuration("home")[None])
    facts = Facts(
        arm, suits, home, sigma, tuple(words), near, actuators(arm), other_joints(arm), touching,
        disagreement(arm, home),
        motions(suits, start, frozenset(contact.geoms for contact in touching), seed), seed,
    )  # fmt: skip
    return Checked(**vars(facts), findings=found(facts))
