"""Actuator torques, link loads, free wrenches, and the result of the physics: JSON, and tables of it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.statics.statics import WRENCH, Statics
from rmrc.show.report import Report, plain
from rmrc.show.sheets import Sheet, number

TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
# Headings of columns of words.
WORDS = {"", "costs"}
PLURALS = {"wrench": "wrenches", "force": "forces alone", "moment": "moments alone"}

Values: TypeAlias = Mapping[str, Any]


def report(found: Statics) -> Report:
    """Return the report of an arm under a wrench; its condition fails if holding it did not agree.

    The tables show the values of the JSON, at most 100 columns wide. Its keys, in SI units:

        model, site, joints     the file, the end effector, the names of the actuated joints
        q, wrench_on_arm        joint positions; [f; n] at the site, along world axes
        bears_weight            whether the actuators bear the weight, so that links and bearings carry it
        at                      the wrench at another site, or null: see `balance.elsewhere`
        torque                  of each actuator: unit; equivalent, equilibrium, gravity, springs, and in_all;
                                limit and margin; exceeded, the joints beyond it: see `balance.Balance`
        links                   of each axis: joint, unit, frame; reaction, reaction_world; drive, the
                                component along the axis, and structure, the rest: see `balance.Balance`
        disagreement            largest difference between the torques by −Jᵀ F and link by link
        length, costs           characteristic length; wrenches by their torques: see `balance.wrench_costs`
        held                    how it was held in the physics, or null: see `statics.hold_wrench`

    Args:
        found: The result of `statics`.

    Example:
        >>> from rmrc.analysis.statics.statics import statics
        >>> shown = report(statics("models/planar_2link.xml", [0, -1, 0], [0.0, np.pi / 3]))
        >>> shown.sheets[1].title, shown.sheets[1].rows[0][:3], shown.json["torque"]["exceeded"]
        ('Actuators', ('shoulder [N·m]', '-1.500', '1.500'), [])
    """
    balance, held = found.balance, found.held
    arm = balance.arm
    values = {
        "model": str(arm.path), "site": arm.site, "joints": arm.joints, "q": balance.q,
        "wrench_on_arm": balance.wrench, "bears_weight": balance.bears_weight, "at": found.elsewhere,
        "torque": {
            "unit": ["N" if slides else "N·m" for slides in arm.is_slide],
            "equivalent": balance.equivalent, "equilibrium": balance.equilibrium, "gravity": balance.gravity,
            "springs": balance.springs, "in_all": balance.torque, "limit": arm.torque_limit,
            "margin": balance.margin, "exceeded": balance.exceeded,
        },
        "links": [
            {"joint": joint, "unit": "N" if np.isinf(arm.chain.pitch[j]) else "N·m",
             "frame": balance.frames[j], "reaction": balance.reaction[j],
             "reaction_world": balance.reaction_world[j], "drive": balance.driven[j],
             "structure": balance.structure[j]}
            for j, joint in enumerate(arm.axis_names)
        ],
        "disagreement": balance.disagreement, "length": found.length, "costs": found.costs,
        "held": held and {key: value for key, value in held.items() if key != "run"},
    }  # fmt: skip
    site = _vector(arm.pose(balance.q)[:3])
    sheets = [_place(values, site), *_elsewhere(values), _actuators(values), *_links(values), _costs(values)]
    sheets += [_held(values)] if held else []
    problem = f"error: {held['run'].divergence}" if held and held["run"].divergence else ""
    return Report(sheets, plain(values), met=held is None or held["agrees"], problem=problem)


def _sheet(title: str, headings: Sequence[str], rows: Iterable[Sequence[Any]], *notes: str) -> Sheet:
    """Return a table of rows of names, numbers and words."""
    cells = [tuple(cell if isinstance(cell, str) else number(cell) for cell in row) for row in rows]
    words = frozenset({0} | {i for i, heading in enumerate(headings) if heading in WORDS})
    return Sheet(title, tuple(headings), cells, words, notes=notes)


def _place(values: Values, site: str) -> Sheet:
    place = ", ".join(f"{name} {number(q)}" for name, q in zip(values["joints"], values["q"], strict=True))
    force, moment = map(_vector, values["wrench_on_arm"].reshape(2, 3))
    acts = f"The wrench acts on the arm: force {force} N, moment {moment} N·m, world axes."
    compensated = "The arm's weight is compensated."
    weight = "The actuators also support the arm's weight." if values["bears_weight"] else compensated
    title = f"{Path(values['model']).name}: site {values['site']} at {site} m; {place}"
    return Sheet(title, notes=(acts, weight))


def _elsewhere(values: Values) -> Iterator[Sheet]:
    if (there := values["at"]) is None:
        return
    title = f"The same wrench at {there['site']} {{A}}, along its axes, from {values['site']} {{B}}"
    rows = zip(WRENCH, *there["force_transform"].T, there["wrench"], strict=True)
    yield _sheet(title, ("force transform", *(f"{axis} of B" for axis in WRENCH), "wrench at A"), rows)
    rows = zip(TWIST, *there["velocity_transform"].T, strict=True)
    note = "The force transform is the inverse transpose of the velocity transform, which preserves power."
    yield _sheet("", ("velocity transform", *(f"{axis} of B" for axis in TWIST)), rows, note)


def _actuators(values: Values) -> Sheet:
    torque = values["torque"]
    columns = {"equivalent": torque["equivalent"], "balancing": torque["equilibrium"]}
    if values["bears_weight"]:
        columns["gravity"] = torque["gravity"]
    if torque["springs"].any():
        columns["springs"] = torque["springs"]
    if len(columns) > 2:
        columns["in all"] = torque["in_all"]
    columns |= {"limit": torque["limit"], "margin": torque["margin"]}
    words = [
        "no limit" if np.isinf(limit) else "EXCEEDED" if name in torque["exceeded"] else "ok"
        for name, limit in zip(values["joints"], torque["limit"], strict=True)
    ]
    rows = zip(_with_units(values), *columns.values(), words, strict=True)
    return _sheet(
        "Actuators", ("actuator", *columns, ""), rows,
        "Equivalent, Jᵀ F: torques with which the site presses on the world with this wrench.",
        "Balancing, −Jᵀ F: torques that hold the arm still while this wrench acts on it.",
    )  # fmt: skip


def _links(values: Values) -> Iterator[Sheet]:
    links = values["links"]
    contents = "Of the wrench and of the weight." if values["bears_weight"] else "Of the wrench alone."
    headings = ("joint", *(f"{name} [{'N' if i < 3 else 'N·m'}]" for i, name in enumerate(WRENCH)))
    title = "Load on each link from the previous one, at its joint; along"
    for key, axes in (("reaction", "its own axes, z along the joint"), ("reaction_world", "world axes")):
        yield _sheet(f"{title} {axes}", headings, [(each["joint"], *each[key]) for each in links], contents)
    rows = []
    for each in links:
        fx, fy, fz, nx, ny, nz = each["structure"]
        name = f"{each['joint']} [{each['unit']}]"
        rows.append((name, each["drive"], fz, np.hypot(fx, fy), nz, np.hypot(nx, ny)))
    title = "The actuator carries one component of the load, bearings and links the rest"
    headings = ("joint", "actuator", "thrust [N]", "radial force [N]", "moment about [N·m]", "bending [N·m]")
    agree = f"Link by link and by −Jᵀ F the actuator torques agree to {number(values['disagreement'])}."
    if values["torque"]["springs"].any():
        contents += " Springs of joints give a part of the actuators' component."
    yield _sheet(title, headings, rows, f"{contents} {agree}")


def _costs(values: Values) -> Sheet:
    rows, notes = [], []
    for kind, group in values["costs"].items():
        name = PLURALS[kind]
        if group["free_only_here"]:
            free = f"{group['free']} cost{'s' * (group['free'] == 1)} no torque here"
            anywhere = f"{group['free_anywhere']} at almost every configuration"
            notes.append(f"Of {name}, {free} and {anywhere}: the arm is singular.")
        for each in group["directions"]:
            gain = each["amplification"] if each["sigma"] else ""
            rows.append((name, each["words"], each["sigma"], gain, each["costs"]))
            name = ""
    title = "Actuator torques for a wrench, a force or a moment of size 1"
    return _sheet(title, ("of all", "", "torque σ", "1/σ", "costs"), rows, *notes)


def _held(values: Values) -> Sheet:
    held = values["held"]
    allowed = held["allowed"] if held["still"] else np.full(len(held["allowed"]), np.nan)
    limits = ["at its limit" if is_there else "" for is_there in held["at_limit"]]
    columns = held["statics"], held["where_it_rests"], held["measured"], held["difference"], allowed
    rows = zip(_with_units(values), *columns, limits, strict=True)
    headings = ("actuator", "statics", "where it rests", "measured", "difference", "allowed", "")
    way, turn = np.linalg.norm(held["drift"].reshape(2, 3), axis=1)
    off = f"{number(1e3 * way)} mm and {number(np.degrees(turn))} deg from its target"
    where = f"After {number(held['seconds'])} s the site is {off}."
    return _sheet("Held in the physics", headings, rows, where, held["verdict"])


def _with_units(values: Values) -> list[str]:
    names = zip(values["joints"], values["torque"]["unit"], strict=True)
    return [f"{name} [{unit}]" for name, unit in names]


def _vector(v: NDArray[np.float64]) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.round(v, 9) + 0.0)})"
