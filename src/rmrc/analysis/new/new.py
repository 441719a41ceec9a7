"""A first scenario for an arm that runs as it is: it is tried before it is returned."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.analysis.new.move import Move, moves
from rmrc.analysis.new.scaling import Scales, scales
from rmrc.analysis.new.text import PERIOD, comment
from rmrc.analysis.new.text import text as written
from rmrc.analysis.subject import Model, Packages, read_arm
from rmrc.arm import Arm
from rmrc.arm.geometry import tidy
from rmrc.arm.inventory import contacts
from rmrc.results.leaving import refuse_unwritable
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard, scorecard
from rmrc.scenario import Scenario, loads
from rmrc.scenario.choices import IDEAL, PLANTS, SERVO
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.files import written_whole
from rmrc.support.legible import quoted
from rmrc.support.problems import join

# Factor on the errors at the time of creation, as room for other machines and versions.
SLACK = 1.5
# Smaller errors, relative to the length or in rad, are rounding; this number bounds them.
LEAST = 1e-6
# Preferred motions: largest share of time at rate limits; largest error, relative to the length or in rad;
# and largest duration [s].
LIMITED, ASTRAY, LONG = 0.05, 0.1, 40.0
# Control period of the runs by which motions are chosen [s]: short beside the 0.1 s of the feedback.
COARSE = 5.0 * PERIOD
# Number of configurations of a run that are checked for contacts.
LOOKS = 40


@brief
@dataclass(frozen=True, eq=False)
class New:
    """A new scenario for an arm.

    Attributes:
        arm: The arm.
        text: The scenario as YAML, with comments; `arm.model` is relative to `folder`.
        scenario: The same, checked.
        scales: The source of its numbers.
        move: Its motion.
        plant: Its plant.
        faults: Faults of the motion, if all had some; the file lists them.
        scorecards: Its metrics on the plants on which it was tried, by name.
    """

    arm: Arm
    text: str
    scenario: Scenario
    scales: Scales
    move: Move
    plant: str
    faults: tuple[str, ...]
    scorecards: Mapping[str, Scorecard]


# Possible faults of a motion on the ideal plant, the worst first.
FAULTS = (
    "it cannot run", "a joint reaches its position limit", "the arm touches something",
    "the arm stands still", "the error is large", "rates are limited for a while",
    "sigma_min stays above half of `below`", "it meets no singularity", "it takes long",
    "bodies penetrate each other at the start",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Trial:
    """A motion after its run on the ideal plant, with all its `FAULTS`, or the first with its reason."""

    move: Move
    faults: tuple[bool, ...]
    scenario: Scenario | None = None
    why: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        return tuple(word for word, has in zip(FAULTS, self.faults, strict=False) if has)


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
        model: An arm, an MJCF file, or the name of a shipped one.
        site: The site to control; None: that of the arm, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame to control, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        joints: The joints to actuate; None: those of the arm or scenario, or else all on the chain.
        length: Characteristic length [m]; None: that of the arm.
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
    suits, cache = scales(arm, length), Cache(*() if arm.stretch else (arm,))
    if not suits.below > 0.0:
        raise QuestionError(
            f"{arm.path}: its joints do not move {quoted(arm.site)}; choose another with --site or --body"
        )
    best, ideal = _best(suits, cache)
    move = best.move
    cards, left = _tried(suits, ideal, plant, cache)
    expect, said = _expected(suits, move, cards)
    said += comment(" ".join(left))
    if best.words:
        told = f"The search found no move without a fault; the fault of this one: {', '.join(best.words)}."
        said = [*comment(told), *said]
    folder = Path() if path is None else path.parent

    def seen(path: Path) -> str:
        return _seen_from(path, folder)

    one = written(suits, move, seen, _name(arm.path), plant, expect, said)
    found = New(
        arm, one, loads(_placed(suits, move, plant, expect, said)), suits, move, plant, best.words, cards
    )
    if path is not None:
        with written_whole(path) as temporary:
            temporary.write_text(one, "utf-8")
    return found


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


def _placed(suits: Scales, move: Move, plant: str, expect: Mapping[str, Any], said: list[str]) -> str:
    """Return the text of a scenario that is read in any folder."""
    path = suits.task.arm.path
    return written(suits, move, Path.resolve, _name(path), plant, expect, said)


def _best(suits: Scales, cache: Cache) -> tuple[_Trial, Scenario]:
    """Return the first motion without a fault, or else that with the smallest; and its scenario."""
    best: _Trial | None = None
    for move in moves(suits):
        trial = _trial(suits, move, cache)
        if best is None or trial.faults < best.faults:
            best = trial
        if not any(best.faults):
            break
    if best is None or best.scenario is None or best.faults[0]:
        raise QuestionError(
            f"{suits.task.arm.path}: no move from near home can run{best.why if best else ''}; give "
            "another --site or --body, and run `rmrc check` for details"
        )
    return best, best.scenario


def _trial(suits: Scales, move: Move, cache: Cache) -> _Trial:
    if not (move.by.any() or move.turn.any()):
        return _Trial(move, (True,))
    try:
        run = _run(one := loads(_placed(suits, move, IDEAL.name, {}, [])), IDEAL.name, cache, COARSE)
    except ScenarioError as error:
        return _Trial(move, (True,), why=f": {error.problems[0].text}")
    card = scorecard(run)
    if run.divergence or not run.is_complete:
        return _Trial(move, (True,))
    status = {
        name: _value(card, f"status_time.{name}") for name in ("POSITION_LIMITED", "RATE_LIMITED", "STUCK")
    }
    astray = max(_value(card, "position_error.max") / suits.size, _value(card, "orientation_error.max"))
    is_damped = move.how == "aside" or _value(card, "sigma.min") < 0.5 * move.epsilon
    arm = suits.task.arm
    first = contacts(arm, arm.configuration(move.start)[None])
    touches = {one.geoms for one in first}
    looked = contacts(arm, run["qpos"][:: max(1, len(run) // LOOKS)])
    met = any(one.is_moved and one.geoms not in touches for one in looked)
    return _Trial(
        move,
        (
            False, status["POSITION_LIMITED"] > 0.0, met, status["STUCK"] > 0.0, astray > ASTRAY,
            status["RATE_LIMITED"] > LIMITED * _value(card, "duration"), not is_damped,
            move.how == "aside", _value(card, "duration") > LONG,
            any(one.is_moved for one in first),
        ),
        one,
    )  # fmt: skip


def _run(one: Scenario, plant: str, cache: Cache, period: float = PERIOD) -> Run:
    """Return the run of a scenario on a plant."""
    return Simulation([prepare(one.set({"control.period": period, "plant.kind": plant}), cache)]).run()[0]


def _tried(suits: Scales, one: Scenario, plant: str, cache: Cache) -> tuple[dict[str, Scorecard], list[str]]:
    """Return the metrics on the plants that can run the motion, and a sentence on each of the others."""
    cards, left = {}, []
    for name in PLANTS.names:
        try:
            run = _run(one, name, cache)
        except ScenarioError as error:
            if name == plant:
                key, why = error.problems[0].key, error.problems[0].text
                raise QuestionError(f"{suits.task.arm.path}: cannot be run: {join(key)}: {why}") from None
            left.append(f"The plant {name} refuses it: --set plant.kind={name} says why.")
            continue
        if run.divergence is None:
            cards[name] = scorecard(run)
        elif name != plant:
            left.append(
                f"On the plant {name} it diverges, at {run.divergence.time:g} s; run `rmrc check` for "
                "details."
            )
        else:
            raise QuestionError(
                f"{suits.task.arm.path}: the {name} plant diverges at {run.divergence.time:g} s: "
                f"{run.divergence.reason}; give another --plant, or fix the errors found by `rmrc check`"
            )
    return cards, left


def _expected(suits: Scales, move: Move, cards: Mapping[str, Scorecard]) -> tuple[dict[str, Any], list[str]]:
    """Return checks that pass on the tried plants, and the comment on them."""
    expect: dict[str, Any] = {"completed": {"equals": 1, "within": 0}}
    seen = []
    for figure in ("status_time.POSITION_LIMITED", "status_time.RATE_LIMITED", "status_time.STUCK"):
        if all(_value(card, figure) == 0.0 for card in cards.values()):
            expect[figure] = {"equals": 0, "within": 0}
        else:
            seen.append((figure, "s"))
    told = "status_time.TORQUE_LIMITED", "status_time.CONTACT"
    seen += [(one, "s") for one in told if any(_value(card, one) > 0.0 for card in cards.values())]
    if all(_value(card, "damping.max") > 0.0 for card in cards.values()):
        expect["damping.max"] = {"above": 0}
        expect["sigma.min"] = {"below": move.epsilon}
    rows = suits.task.rows
    for group, counts, unit, size in (
        ("position_error", (rows < 3).any(), "m", suits.size),
        ("orientation_error", (rows >= 3).any(), "rad", 1.0),
    ):
        for figure in (f"{group}.max", f"{group}.end") if counts else ():
            value = max(_value(card, figure) for card in cards.values())
            expect[figure] = {"below": tidy(max(SLACK * value, LEAST * size), up=True)}
            seen.append((figure, unit))
    said = comment(
        f"Results on each plant at the time of writing. The bounds are {SLACK:g} times the worst, to allow "
        "for other machines and versions; use closer ones if you run one plant only."
    )
    lines = [("", *cards)] + [
        (f"{figure} [{unit}]", *(f"{_value(card, figure):.3g}" for card in cards.values()))
        for figure, unit in seen
    ]
    wide = [max(map(len, column)) for column in zip(*lines, strict=True)]
    table = ("   ".join(map(str.ljust, line, wide)) for line in lines)
    return expect, [*said, *(f"#   {line}".rstrip() for line in table)]


def _value(card: Scorecard, name: str) -> float:
    """Return a metric; 0 for the undefined error of rows that do not count."""
    return float(card[name].value) if name in card else 0.0


def _name(path: Path) -> str:
    """Return a file's name in the form of a scenario's name."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", path.stem)[:100] or "new"


def _seen_from(model: Path, folder: Path) -> str:
    """Return a model's path relative to a folder, or absolute if they share only the root."""
    full, seen = model.resolve(), folder.resolve()
    common = os.path.commonpath([full, seen])
    return os.path.relpath(full, seen) if common != os.path.sep else str(full)
