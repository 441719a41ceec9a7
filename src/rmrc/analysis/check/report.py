"""The result of a check of a model: tables, JSON, and whether the model is ready."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rmrc.analysis.check.check import Checked
from rmrc.analysis.check.findings import CODES, Finding
from rmrc.analysis.check.motion import BOUND, DURATION, Motion
from rmrc.analysis.new.text import listed_positions
from rmrc.arm.geometry import damping_maximum
from rmrc.results.expectations import Case
from rmrc.results.scorecard import Figure
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number

# Metrics of each motion that are shown.
FIGURES = ("joint_rate.peak", "position_error.max", "tau.share_of_limit")


def report(found: Checked) -> Report:
    """Return the report of a check; its condition is met if there is no error.

    Args:
        found: The result of `check`.

    Example:
        >>> from rmrc.analysis.check.check import check
        >>> report(check("planar_2link")).met
        True
    """
    sheets = [_what(found), _joints(found), _motions(found), _findings(found)]
    return Report(sheets, plain(_values(found)), met=found.is_ready, cases=_cases(found))


def _cases(found: Checked) -> list[Case]:
    """Return one case per code, which fails if there is an error with that code."""
    told = {code: [one for one in found.findings if one.code == code] for code in CODES}
    return [
        Case(code, all(one.level != "error" for one in found), "; ".join(map(_line, found)) or "none")
        for code, found in told.items()
    ]


def _line(one: Finding) -> str:
    """Return a finding in a line."""
    return f"{one.level}: {one.text}" + (f"; {one.way}" if one.way else "")


def _values(found: Checked) -> dict[str, Any]:
    arm, near = found.arm, found.nearest
    return {
        "model": arm.path.name, "site": arm.site, "sites": arm.sites, "ready": found.is_ready,
        "findings": [vars(finding) for finding in found.findings],
        "joints": [
            {
                "name": name, "kind": kind, "unit": unit, "home": at, "range": limits, "rate": rate,
                "torque": torque,
            }
            for name, kind, unit, at, limits, rate, torque in _rows(found)
        ],
        "axes": found.scales.task.axes, "length": found.scales.task.length, "sigma": found.sigma,
        "condition": found.condition, "lost": found.lost,
        "nearest": {"q": near.q, "sigma": near.sigma, "is_singular": near.is_singular},
        "actuators": [vars(one) for one in found.actuators], "others": [vars(one) for one in found.others],
        "contacts": [vars(one) for one in found.contacts], "routes": found.routes, "seed": found.seed,
        "motions": {one.plant: _motion_values(one) for one in found.motions},
    }  # fmt: skip


def _motion_values(one: Motion) -> dict[str, Any]:
    card: Mapping[str, Figure] = one.scorecard or {}
    return {
        "refused": one.refused or None, "diverged": one.diverged or None,
        "contacts": [vars(contact) for contact in one.contacts], "warnings": dict(one.warnings or {}),
        **{name: card[name].value for name in FIGURES if name in card},
    }  # fmt: skip


def _what(found: Checked) -> Sheet:
    arm, task, near, below = found.arm, found.scales.task, found.nearest, found.scales.below
    far = float(np.linalg.norm((near.q - np.clip(found.home, *arm.position_limit.T)) / task.joint_scale))
    where = f"{'' if near.is_singular else 'none; least sigma '}at {listed_positions(found.scales, near.q)}"
    routes = ", ".join(f"{name} {number(value)}" for name, value in found.routes.items())
    rows = [
        ("site", arm.site),
        ("task", f"{' '.join(task.axes)}, 1 rad counts as {number(task.length)} m"),
        (
            "damping by default",
            f"up to {number(damping_maximum(below))} where sigma_min is below {number(below)}",
        ),
        ("sigma at home", "  ".join(map(number, found.sigma))),
        ("sigma_min, kappa", f"{number(found.sigma[-1])}, {number(found.condition)}"),
        ("nearest singularity", f"{where}, {number(far)} rad away" if near.is_singular else where),
        ("J by other methods", f"off by {routes}"),
    ]
    return Sheet(f"{arm.path.name}: {arm.n} joints", ("", ""), rows, frozenset({0, 1}))


def _joints(found: Checked) -> Sheet:
    drives = {one.drives: f"{one.kind} {one.name}" for one in found.actuators}
    rows = [
        (
            name, kind, number(at) if abs(at) > 1e-12 else "0", *map(_limit, (*limits, rate, torque)),
            drives.get(f"joint {name}", UNDEFINED),
        )
        for name, kind, _, at, limits, rate, torque in _rows(found)
    ]  # fmt: skip
    heads = ("joint", "kind", "home", "from", "to", "rate", "torque", "actuator")
    return Sheet("Joints, in rad or m, per s, and N m or N", heads, rows, frozenset({0, 1, 7}))


def _rows(found: Checked) -> Iterator[tuple[Any, ...]]:
    """Return name, kind, unit, position at home, and limits of each joint."""
    arm = found.arm
    limits = arm.position_limit, arm.rate_limit, arm.torque_limit
    return zip(arm.joints, arm.kinds, arm.units, found.home, *limits, strict=True)


def _limit(value: float) -> str:
    return number(value) if np.isfinite(value) else UNDEFINED


def _motions(found: Checked) -> Sheet:
    rows = []
    for one in found.motions:
        card: Mapping[str, Figure] = one.scorecard or {}
        told = "refused" if one.refused else "diverged" if one.diverged else "ok"
        figures = (
            number(float(card[name].value)) if name in card else UNDEFINED
            for name in FIGURES
        )  # fmt: skip
        rows.append(
            (one.plant, told, *figures, str(len(one.contacts)), str(sum((one.warnings or {}).values())))
        )
    heads = ("plant", "", "peak rate", "error [m]", "tau share", "contacts", "warnings")
    title = f"{DURATION:g} s of motion, each joint within {BOUND:g} rad of home, seed {found.seed}"
    return Sheet(title, heads, rows, frozenset({0, 1}))


def _findings(found: Checked) -> Sheet:
    rows = [(one.level, one.code, f"{one.text}{f'; {one.way}' if one.way else ''}") for one in found.findings]
    count = sum(one.level == "error" for one in found.findings)
    title = f"Findings: {count} with errors" if count else "Findings: none with errors"
    return Sheet(title, ("", "code", "what"), rows, frozenset({0, 1, 2}))
