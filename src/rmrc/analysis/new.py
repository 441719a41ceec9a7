"""A first scenario for an arm that runs as it is: it is tried before it is returned."""

import math
import os
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.new_motion import MET, WITHIN, Move, judged, moves
from rmrc.analysis.scaling import ASSUMED_RATE, Scales, scales
from rmrc.analysis.singularities import impossible
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.analysis.trial import Seen, identity, overlaps, tried
from rmrc.arm import Arm
from rmrc.arm.geometry import damping_maximum, tidy
from rmrc.arm.inventory import other_joints, shape_masses
from rmrc.arm.tree import code_of
from rmrc.law.task import Array
from rmrc.results.scorecard import Figure
from rmrc.scenario import Scenario, block
from rmrc.scenario.choices import IDEAL, PLANTS, SERVO
from rmrc.show.sheets import Report, Sheet, plain
from rmrc.simulation.prepare import Cache
from rmrc.support.errors import QuestionError
from rmrc.support.files import refuse_unwritable, written_whole
from rmrc.support.text import brief, listed, quoted, visible

# The text of the scenario -------------------------------------------------------------------------
#
# A first scenario as a file for people: what it assumes about the arm, and its keys.

# Control period of a scenario [s]; feedback [1/s], which is stable even with ten ticks of delay.
PERIOD, FEEDBACK = 0.001, 10.0
# Share of the rate limits for the path; the feedback has the rest.
PATH_SHARE = 0.8
# The target reaches its speed in a quarter of a second, and its acceleration in a tenth [s].
RISE, JERK_RISE = 0.25, 0.1
# Width of a line.
WIDTH = 100


def text(name: str, keys: Mapping[str, Any], assumed: Mapping[str, str]) -> str:
    """Return a scenario as YAML, below comments with its assumptions.

    Args:
        name: Name of the model.
        keys: The scenario.
        assumed: A line for each subject.
    """
    wrapper = textwrap.TextWrapper(
        WIDTH, initial_indent="# ", subsequent_indent="#   ", break_on_hyphens=False
    )
    title = f"# A first scenario for {name}: edit it, and `rmrc run` it; `rmrc schema` explains its keys"
    lines = [wrapper.fill(f"{subject}: {line}") for subject, line in assumed.items()]
    return "\n".join([title, *lines, block(keys, WIDTH)])


def draft(scales: Scales, move: Move, name: str, seen: Seen) -> dict[str, Any]:
    """Return a scenario without its plant and expectations.

    Args:
        scales: Scales of the arm.
        move: The motion.
        name: Name of the scenario.
        seen: Path of the model in the scenario.
    """
    arm, task, below = scales.task.arm, scales.task, move.epsilon
    damping = {"schedule": "smallest_singular_value", "maximum": damping_maximum(below), "below": below}
    control = {
        "period": PERIOD, "inverse": {"method": "damped", "damping": damping}, "feedback": FEEDBACK,
        "limits": {"rate": scales.rate.tolist(), "on_excess": "scale"}, "at_singularity": "damp",
    }  # fmt: skip
    if arm.n > len(task.rows):  # redundant joints return slowly
        control["nullspace"] = {"objective": "posture", "gain": 1.0}
    speed = PATH_SHARE * below * scales.slowest / math.sqrt(2.0 if move.by.any() and move.turn.any() else 1.0)
    limits = {
        f"{of}{derivative}": tidy(tidy(speed * size) / rise)
        for of, size in (("", task.length), ("angular_", 1.0))
        for derivative, rise in (("velocity", 1.0), ("acceleration", RISE), ("jerk", RISE * JERK_RISE))
    }
    path = [
        _segment(move.by, move.turn), {"hold": {"for": 0.5}},
        _segment(-move.by, -move.turn), {"hold": {"for": 0.5}},
    ]  # fmt: skip
    return {
        "name": name,
        "arm": identity(arm, seen) | {"start": "home" if move.is_home else move.start.tolist()},
        "task": {"axes": list(task.axes), "length": task.length},
        "control": control,
        "target": {"path": path, "limits": limits},
    }


def _segment(by: Array, turn: Array) -> dict[str, Any]:
    """Return a line with a rotation, or one of the two."""
    angle = float(np.linalg.norm(turn))
    axis = [tidy(float(x), 5) + 0.0 for x in turn / (angle or 1.0)]
    about = {"turn": {"axis": axis, "angle": tidy(angle, 5)}} if angle else {}
    return {"line": {"by": (by + 0.0).tolist(), **about}} if by.any() else about


def assumptions(scales: Scales, move: Move) -> dict[str, str]:
    """Return what a scenario assumes about an arm, and its motion, a line each by its subject."""
    arm, near = scales.task.arm, move.nearest
    frames = [note for note in arm.notes if code_of(note).startswith("frame")]
    weights = [note for note in arm.notes if " kg" in note]
    shapes = listed(f"{body} {mass:.3g} kg" for body, mass in shape_masses(arm).items())
    idle = listed(other_joints(arm))
    lacking = listed(name for name, missing in zip(arm.joints, scales.is_assumed, strict=True) if missing)
    rates = f"ASSUMED {ASSUMED_RATE:g} rad/s, and on slides that times the length: {lacking}"
    way = f"{move.how} the nearest singularity found, at {scales.listed(near.q)}; there the arm "
    lines = {
        "joints": "all on the chain: " * (not arm.idle()) + ", ".join(arm.joints)
        + f"; not driven: {idle}" * bool(idle),
        "tool": "; ".join(frames) or f"{arm.frame[0] if arm.frame else 'site'} {arm.site}",
        "masses": "; ".join(weights)
        or (f"ASSUMED, from shapes of 1000 kg/m^3: {shapes}" if shapes else "those of the file"),
        "rate limits": rates if lacking else "the model's",
        "notes": "; ".join(note for note in arm.notes if note not in (*frames, *weights)),
        "motion": "aside; the search found no reachable singularity within the limits"
        if move.how == "aside" else way + impossible(near.wrench),
        "faults of the motion": ", ".join(move.faults),
    }  # fmt: skip
    return {subject: visible(line) for subject, line in lines.items() if line}


# The new scenario ---------------------------------------------------------------------------------

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
        scorecards: Its metrics on the plants that can run it, by name.
        problem: The contact that it must not have and has on its plant, in a line; "" without.
    """

    arm: Arm
    text: str
    scenario: Scenario
    scales: Scales
    move: Move
    assumed: Mapping[str, str]
    scorecards: Mapping[str, Mapping[str, Figure]]
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
            `rmrc.arm.tree`.
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
        refuse_unwritable([path])
        if os.path.lexists(path) and not force:
            raise QuestionError(f"{path}: already exists; give another by -o, or overwrite it by --force")
    if length is not None and not (np.isfinite(length) and length > 0.0):
        raise QuestionError(f"length must be > 0 and finite, got {length:g}")
    arm = read_arm(model, site, body, packages, joints)
    arm.require_open()
    length = model.task.length if length is None and isinstance(model, Scenario) else length
    suits, cache = scales(arm, length), Cache(*() if arm.stretch else (arm,))
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", arm.path.stem)[:100] or "new"
    move, scenario = _best(suits, name, cache)
    trials = [tried(scenario, kind, cache) for kind in PLANTS.names]
    failed = {trial.plant: trial.refused or trial.diverged for trial in trials}
    if failed[plant]:
        cure = "give another --plant, or see `rmrc check`"
        raise QuestionError(f"{arm.path}: the {plant} plant cannot run it: {failed[plant]}; {cure}")
    cards = {trial.plant: trial.scorecard for trial in trials if not failed[trial.plant]}
    more = {"plant": {"kind": plant}, "expect": _expected(suits, move, cards)}
    assumed, problem = assumptions(suits, move), ""
    faults = [fault for fault in move.faults if fault in (MET, WITHIN)]
    if faults and (cards[plant]["contact.time"].value or cards[plant]["contact.resting"].value):
        what = f"{', '.join(faults)}: {overlaps(move.contacts)}"
        problem = f"{arm.path}: {what}; set arm.start, or exclude the pair"
    folder = Path() if path is None else path.parent
    keys = draft(suits, move, name, lambda file: os.path.relpath(file.resolve(), folder.resolve()))
    whole = text(visible(arm.path.name), keys | more, assumed)
    if path is not None:
        with written_whole(path) as temporary:
            temporary.write_text(whole, "utf-8")
    return New(arm, whole, scenario.set(more), suits, move, assumed, cards, problem)


def _best(suits: Scales, name: str, cache: Cache) -> tuple[Move, Scenario]:
    """Return the first motion without a fault, or else that with the least, and its scenario."""
    candidates: list[tuple[Move, Scenario]] = []
    why = ""
    for move in (each for each in moves(suits) if each.by.any() or each.turn.any()):
        scenario = Scenario.model_validate(draft(suits, move, name, Path.resolve))
        trial = tried(scenario.set({"control.period": COARSE}), IDEAL.name, cache)
        if trial.run is None or not trial.run.is_complete:
            why = why or f": {trial.refused or trial.diverged}"
            continue
        candidates.append((judged(suits, move, trial.run), scenario))
        if not candidates[-1][0].faults:
            break
    if not candidates:
        cure = "give another --site or --body, and run `rmrc check` for details"
        raise QuestionError(f"{suits.task.arm.path}: no move from near home can run{why}; {cure}")
    return min(candidates, key=lambda candidate: candidate[0].rank)


def _expected(
    suits: Scales, move: Move, cards: Mapping[str, Mapping[str, Figure]]
) -> dict[str, dict[str, float]]:
    """Return checks that pass on all plants that can run a motion, unless it has a contact as its fault."""

    def values(name: str) -> list[float]:
        return [float(card[name].value) for card in cards.values() if name in card]

    expect: dict[str, dict[str, float]] = {"completed": {"equals": 1, "within": 0}}
    statuses = ("POSITION_LIMITED", "RATE_LIMITED", "STUCK", "CONTACT")
    zeros = [name for name in map("status_time.{}".format, statuses) if not any(values(name))]
    zeros += ["contact.time", "contact.resting"] if {MET, WITHIN} & {*move.faults} else []
    expect |= {name: {"equals": 0, "within": 0} for name in zeros}
    if all(values("damping.max")):
        expect |= {"damping.max": {"above": 0}, "sigma.min": {"below": move.epsilon}}
    for name, size in (("position_error", suits.size), ("orientation_error", 1.0)):
        for figure in (f"{name}.max", f"{name}.end"):
            if worst := values(figure):
                expect[figure] = {"below": tidy(max(SLACK * max(worst), LEAST * size), up=True)}
    return expect


def report(made: New) -> Report:
    """Return the report of a new scenario; its condition is met unless its run has a forbidden contact.

    Args:
        made: The result of `new`.

    Example:
        >>> report(new("planar_2link")).json["scenario"]["task"]["axes"]
        ['x', 'y']
    """
    arm, move = made.arm, made.move
    answer = {
        "model": arm.path.name, "site": arm.site, "move": move.how, "faults": move.faults,
        "singularity": {"q": move.nearest.q, "is_singular": move.nearest.is_singular},
        "assumed": made.assumed, "scenario": made.scenario.model_dump(mode="json", exclude_defaults=True),
    }  # fmt: skip
    sheet = Sheet(arm.path.name, ("", ""), tuple(made.assumed.items()), frozenset({0, 1}))
    return Report([sheet], plain(answer), met=not made.problem, problem=made.problem)
