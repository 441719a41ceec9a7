"""A first scenario for an arm that runs as it is: it is tried before it is returned."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.new.motion import CONTACT, FAULTS, PERIOD, Move, judged, moves, rank_of
from rmrc.analysis.new.text import assumptions, comment, expectations, text
from rmrc.analysis.scaling import Scales, scales
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.arm import Arm
from rmrc.arm.geometry import tidy
from rmrc.results.leaving import refuse_unwritable
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Scenario, loads
from rmrc.scenario.choices import IDEAL, PLANTS, SERVO
from rmrc.show.report import Report, plain
from rmrc.show.sheets import Sheet, number
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.files import written_whole
from rmrc.support.legible import listed, quoted, visible
from rmrc.support.problems import join

# Factor on the errors at the time of creation, as room for other machines and versions.
SLACK = 1.5
# Smaller errors, relative to the length or in rad, are rounding; this number bounds them.
LEAST = 1e-6
# Control period of the runs by which motions are chosen [s]: short beside the 0.1 s of the feedback.
COARSE = 5.0 * PERIOD


@brief
@dataclass(frozen=True, eq=False)
class New:
    """A new scenario for an arm.

    Attributes:
        arm: The arm.
        text: The scenario as YAML, with comments; `arm.model` is relative to the folder of its file.
        scenario: The same, checked.
        scales: The source of its numbers.
        move: Its motion, with its faults if all motions had some.
        assumed: What it assumes: a line each for joints, tool, masses and so on, which begin the text.
        scorecards: Its metrics on the plants on which it was tried, by name.
        problem: The contact that it must not have and has on its plant, in a line; "" without.
    """

    arm: Arm
    text: str
    scenario: Scenario
    scales: Scales
    move: Move
    assumed: Mapping[str, str]
    scorecards: Mapping[str, Scorecard]
    problem: str


def new(
    model: Model,
    *,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    joints: Sequence[str] | None = None,
    length: float | None = None,
    plant: str = SERVO.name,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
) -> New:
    """Make a scenario for an arm, with all numbers scaled to it, and run it before it is returned.

    Args:
        model: An arm, an MJCF file, the name of a shipped one, or a scenario, whose arm and length count.
        site: The site to control; None: that of the arm, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame to control, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        joints: The joints to actuate; None: those of the arm or scenario, or else all on the chain.
        length: Characteristic length [m]; None: that of the scenario, or else of the arm.
        plant: Kind of the plant.
        out: File to write, atomically; None: writes nothing.
        force: Whether an existing file may be overwritten.

    Raises:
        ModelError: The file or the site is missing or unusable.
        QuestionError: There is no such plant, the file exists, or the arm cannot be run.
        OSError: The file cannot be written.

    Example:
        >>> made = new("planar_2link")
        >>> made.scenario.task.axes, made.move.how, made.scorecards["servo"]["completed"].value
        (('x', 'y'), 'towards', 1.0)
    """
    if plant not in PLANTS.names:
        raise QuestionError(f"plant must be one of {', '.join(PLANTS.names)}, got {quoted(plant)}")
    path = None if out is None else Path(out)
    if path is not None:
        refuse_there(path, force)
        refuse_unwritable([path])
    if length is not None and not (np.isfinite(length) and length > 0.0):
        raise QuestionError(f"length must be > 0 and finite, got {length:g}")
    arm = read_arm(model, site, body, packages, joints)
    arm.require_open()
    length = model.task.length if length is None and isinstance(model, Scenario) else length
    suits, cache = scales(arm, length), Cache(*() if arm.stretch else (arm,))
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", arm.path.stem)[:100] or "new"
    move, scenario = _best(suits, name, cache)
    cards, remarks = _tried(arm, scenario, plant, cache)
    expect, table = _expected(suits, move, cards)
    assumed = assumptions(suits, move)
    faults = {"faults of the motion": ", ".join(move.faults)} if move.faults else {}
    title = f"# A first scenario for {visible(arm.path.name)}, by `rmrc new`: edit it, and `rmrc run` it.\n"
    tail = expectations(expect, table, remarks)
    folder = Path() if path is None else path.parent
    whole = (
        title
        + comment(assumed | faults)
        + text(suits, move, lambda file: _seen_from(file, folder), name, plant)
        + tail
    )
    scenario = loads(text(suits, move, Path.resolve, name, plant) + tail)
    faulty, problem = [fault for fault in move.faults if fault in CONTACT], ""
    has_met = cards[plant]["contact.time"].value or cards[plant]["contact.resting"].value
    if faulty and has_met:
        pairs = listed(dict.fromkeys(" and ".join(contact.bodies) for contact in move.touching))
        problem = f"{arm.path}: {', '.join(faulty)}: {pairs}; set arm.start, or exclude the pair"
    made = New(arm, whole, scenario, suits, move, assumed | faults, cards, problem)
    if path is not None:
        with written_whole(path) as temporary:
            temporary.write_text(whole, "utf-8")
    return made


def refuse_there(path: Path, force: bool) -> None:
    """Refuse to overwrite a file.

    Raises:
        QuestionError: It exists, and may not be overwritten.
    """
    if path.is_dir():
        raise QuestionError(f"{path}: is a folder, give a file")
    if os.path.lexists(path) and not force:
        raise QuestionError(
            f"{path}: already exists; give another file with -o, or overwrite it with --force"
        )


def report(made: New) -> Report:
    """Return the report of a new scenario; its condition is met unless its run has a forbidden contact.

    Args:
        made: The result of `new`.

    Example:
        >>> report(new("planar_2link")).json["damping"]["below"] > 0.0
        True
    """
    control, target = made.scenario.control, made.scenario.target.limits
    damping, move, task = control.inverse.damping, made.move, made.scales.task
    table = shown_table(made.scorecards)
    answer = {
        "model": made.arm.path.name, "site": made.arm.site, "joints": made.arm.joints, "axes": task.axes,
        "length": task.length, "start": move.start, "move": move.how, "assumed": made.assumed,
        "singularity": {"q": move.nearest.q, "is_singular": move.nearest.is_singular},
        "rate": made.scales.rate, "damping": {"maximum": damping.maximum, "below": damping.below},
        "faults": move.faults, "velocity": target.velocity, "angular_velocity": target.angular_velocity,
        "plants": {name: {key: card[key].value for key in METRICS if key in card}
                   for name, card in made.scorecards.items()},
    }  # fmt: skip
    sheets = [
        Sheet(made.arm.path.name, ("", ""), tuple(made.assumed.items()), frozenset({0, 1})),
        Sheet("Results on each plant", table[0], table[1:]),
    ]
    return Report(sheets, plain(answer), met=not made.problem, problem=made.problem)


# Metrics of each plant that are shown; those that are 0 on all plants are left out.
METRICS = (
    "duration", "position_error.max", "position_error.end", "orientation_error.max", "orientation_error.end",
    "sigma.min", "joint_rate.peak", "status_time.DAMPED", "status_time.RATE_LIMITED",
    "status_time.POSITION_LIMITED", "status_time.STUCK", "status_time.TORQUE_LIMITED", "contact.time",
    "contact.resting",
)  # fmt: skip


def shown_table(cards: Mapping[str, Scorecard]) -> list[tuple[str, ...]]:
    """Return the table of metrics on each plant, the headings first."""
    rows: list[tuple[str, ...]] = [("", *cards)]
    for name in METRICS:
        figures = [card[name] for card in cards.values() if name in card]
        if any(figure.value for figure in figures):
            unit = figures[0].unit
            rows.append((f"{name} [{unit}]", *(number(float(figure.value)) for figure in figures)))
    return rows


def _best(suits: Scales, name: str, cache: Cache) -> tuple[Move, Scenario]:
    """Return the first motion without a fault, or else that with the smallest, and its scenario."""
    best: tuple[Move, Scenario] | None = None
    why = ""
    for move in (each for each in moves(suits) if each.by.any() or each.turn.any()):
        scenario = loads(text(suits, move, Path.resolve, name, IDEAL.name))
        try:
            tried = judged(suits, move, _run(scenario, IDEAL.name, cache, COARSE))
        except ScenarioError as error:
            why = why or f": {error.problems[0].text}"
            continue
        if FAULTS[0] not in tried.faults and (best is None or rank_of(tried) < rank_of(best[0])):
            best = tried, scenario
        if not tried.faults:
            break
    if best is None:
        raise QuestionError(
            f"{suits.task.arm.path}: no move from near home can run{why}; give another --site or --body, and "
            "run `rmrc check` for details"
        )
    return best


def _run(scenario: Scenario, plant: str, cache: Cache, period: float = PERIOD) -> Run:
    changed = scenario.set({"control.period": period, "plant.kind": plant})
    return Simulation([prepare(changed, cache)]).run()[0]


def _tried(arm: Arm, scenario: Scenario, plant: str, cache: Cache) -> tuple[dict[str, Scorecard], list[str]]:
    """Return the metrics on the plants that can run a motion, and a sentence on each of the others."""
    cards, remarks = {}, []
    for name in PLANTS.names:
        try:
            run = _run(scenario, name, cache)
        except ScenarioError as error:
            why = f"{join(error.problems[0].key)}: {error.problems[0].text}"
        else:
            if run.divergence is None:
                cards[name] = run.scorecard
                continue
            why = f"it diverges at {run.divergence.time:g} s: {run.divergence.reason}"
        if name == plant:
            cure = "give another --plant, or see `rmrc check`"
            raise QuestionError(f"{arm.path}: the {name} plant cannot run it: {why}; {cure}")
        remarks.append(f"The plant {name} cannot run it: --set plant.kind={name} says why.")
    return cards, remarks


def _expected(
    suits: Scales, move: Move, cards: Mapping[str, Scorecard]
) -> tuple[dict[str, Any], list[tuple[str, ...]]]:
    """Return checks that pass on the tried plants unless there is contact from the start, and the metrics."""
    none: dict[str, float] = {"equals": 0, "within": 0}
    expect: dict[str, dict[str, float]] = {"completed": {"equals": 1, "within": 0}}
    for name in ("POSITION_LIMITED", "RATE_LIMITED", "STUCK", "CONTACT"):
        if not any(card[f"status_time.{name}"].value for card in cards.values()):
            expect[f"status_time.{name}"] = none
    if CONTACT & {*move.faults}:
        expect |= {"contact.time": none, "contact.resting": none}
    if all(float(card["damping.max"].value) > 0.0 for card in cards.values()):
        expect |= {"damping.max": {"above": 0}, "sigma.min": {"below": move.epsilon}}
    for name, size in (("position_error", suits.size), ("orientation_error", 1.0)):
        for figure in (f"{name}.max", f"{name}.end"):
            worst = [float(card[figure].value) for card in cards.values() if figure in card]
            if worst:
                expect[figure] = {"below": tidy(max(SLACK * max(worst), LEAST * size), up=True)}
    return expect, shown_table(cards)


def _seen_from(model: Path, folder: Path) -> str:
    """Return a model's path relative to a folder, or absolute if they share only the root."""
    full, seen = model.resolve(), folder.resolve()
    common = os.path.commonpath([full, seen])
    return os.path.relpath(full, seen) if common != os.path.sep else str(full)
