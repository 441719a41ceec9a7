"""A scenario's file -> the inverse, the damping and the feedback to use in it."""

import math
import os
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rmrc.results.leaving import refuse_unwritable
from rmrc.scenario import Source, Variant, block, changes_of, draft_of
from rmrc.scenario.choices import POLICIES
from rmrc.simulation.footprint import refuse_excess
from rmrc.study.dataset import Column, write_table
from rmrc.study.margins.margins import Margins, margins_of
from rmrc.study.study import Study
from rmrc.support.brief import brief
from rmrc.support.errors import ScenarioError
from rmrc.support.files import written_whole
from rmrc.support.interruption import interruptible
from rmrc.support.problems import Origin, Problem
from rmrc.textbook.stability import edge_gain
from rmrc.tuning.robot import GAIN_MARGIN, Given, Robot, robot_of
from rmrc.tuning.search import Search
from rmrc.tuning.space import (
    AT_SINGULARITY,
    NUMBERS,
    ON_EXCESS,
    WORDS,
    Only,
    Setting,
    Space,
    Structure,
    all_structures,
    bounds,
    meets_limits,
    own_setting,
    read_only,
)
from rmrc.tuning.trials import Limits, OnRuns, Trials
from rmrc.tuning.verdict import Trial, Verdict
from rmrc.tuning.worlds import Spread, draw_scenarios, loops_between

# Relative accuracy of the printed margins: their second digit.
_ACCURACY = 0.05


@brief
@dataclass(frozen=True)
class Tuned:
    """The result of a search.

    Attributes:
        own: The setting as written, on all scenarios.
        tried: All settings, in the order of trial.
        feasible: Settings that keep the limits on all scenarios.
        verdict: The best of them.
        control: The recommended control section, ready for YAML; None if no setting is feasible.
        scenarios: The scenario itself, and the perturbed scenarios.
        limits: The limits.
        bounds: Smallest and largest value of each tried number, unless `--only` lists its values.
        margins: Margins of the recommended and the second best setting, by role, on the slowest loop.
        runs: Number of runs on scenarios.
        interrupted: Whether Ctrl-C ended it.
    """

    own: Trial
    tried: tuple[Trial, ...]
    feasible: tuple[Trial, ...]
    verdict: Verdict
    control: Mapping[str, Any] | None
    scenarios: tuple[Variant, ...]
    limits: Limits
    bounds: Mapping[str, tuple[float, float]]
    margins: Mapping[str, Margins]
    runs: int
    interrupted: bool

    def role(self, trial: Trial) -> str:
        """Return the name of a setting: recommended, second best, as written; "" if it has none."""
        verdict = self.verdict
        roles = {"recommended": verdict.recommended, "second best": verdict.second, "as written": self.own}
        return ", ".join(name for name, other in roles.items() if other is trial)

    @property
    def block(self) -> str:
        """The control section as YAML, to paste; "" if nothing is feasible."""
        return block({"control": self.control}) if self.control is not None else ""


class Tuning:
    """A search for the control law of a scenario.

    Attributes:
        scenario: The scenario with the overrides.
        scenarios: The scenario itself, and the perturbed scenarios.
        loops: The scenario on further loops for the final checks; none without perturbed scenarios.
        left_out: Why some structures are impossible here.
        slower: Factor on the duration as written that another setting may take.
        robot: Robot with the loops of the perturbed scenarios.
        margin: Gain margin that a recommendation must have on the slowest loop; 1: any.
        spread: Sizes of the perturbations.
    """

    def __init__(
        self,
        source: Source,
        overrides: Sequence[str] = (),
        *,
        only: Only = (),
        perturbed: int = 4,
        seed: int = 0,
        spread: Spread | None = None,
        robot: Mapping[str, Given] = MappingProxyType({}),
        ideal: bool = False,
        gain_margin: float | None = None,
        slower: float = 1.1,
        runs: int = 2000,
        threads: int | None = None,
    ) -> None:
        """Check everything before the first run.

        Args:
            source: The scenario, or its file.
            overrides: `KEY=VALUE` texts.
            only: Values to which keys are restricted.
            perturbed: Number of perturbed scenarios.
            seed: Seed of the perturbed scenarios and of the search.
            spread: Sizes of the perturbations; None: the defaults.
            robot: Ranges by name, `delay`, `lag` and `noise` of its loop, and its `calibration`.
            ideal: Whether to keep the loop of the scenario, and assume nothing.
            gain_margin: Gain margin that a recommendation must have on the slowest robot; None: 2, or 1 with
                `ideal`.
            slower: Factor on the duration with the scenario's own setting that another may take.
            runs: Largest number of runs, without the final checks.
            threads: Number of threads, one world each; None: one per core.

        Raises:
            ScenarioError: Lists all problems.
        """
        self.spread = spread or Spread()
        self.margin = gain_margin if gain_margin is not None else 1.0 if ideal else GAIN_MARGIN
        _check(perturbed, seed, self.spread, self.margin, slower, runs, threads)
        self._seed, self.slower, self._runs = seed, slower, runs
        self._threads = threads or os.cpu_count() or 1
        self._draft = draft_of(source, overrides)
        self._study = Study(self._draft)
        self.nominal = self._study.prepare()
        self.scenario = self.nominal.scenario
        words, self._only = read_only(only)
        numbers = [changes_of({key: value}, "--only") for key, values in self._only.items() for value in values]
        self._study.prepare_all([Variant("", number) for number in numbers], "")
        self._structures, self.left_out = self._possible(words)
        self._asks_for_excess = ON_EXCESS in words
        self.robot = self._bearable(robot_of(self.scenario, robot, ideal=ideal))
        self.scenarios = draw_scenarios(self.nominal, perturbed, seed, self.spread, self.robot)
        self.loops = loops_between(self.nominal, self.robot) if perturbed else ()
        refuse_excess([self.nominal])
        refuse_excess(self._study.prepare_all(self.scenarios, ""), keep_columns=False)

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile([self.nominal])

    def run(self, on_runs: OnRuns | None = None) -> Tuned:
        """Search; Ctrl-C ends it with the results so far.

        Args:
            on_runs: Called with the number of finished runs.

        Raises:
            KeyboardInterrupt: Ctrl-C, before anything was found.
        """
        with interruptible() as stop:
            (nominal,) = self._study.step([self.nominal], stop)
            edge = edge_gain(self.scenario.control.period, *self.robot.slowest(self.scenario)) / self.margin
            limits = bounds(self.nominal, nominal.run, edge)
            matters = self._asks_for_excess or meets_limits(nominal.run)
            structures = tuple(it for it in self._structures if matters or not it.on_excess)
            values = {key: float(attrgetter(key)(self.scenario)) for key in NUMBERS}
            space = Space(structures, limits, self._only, values)
            worlds = (*self.scenarios, *self.loops)
            trials = Trials(self._study, worlds, self._threads, stop, on_runs or (lambda _: None))
            search = Search(self._study, space, trials, len(self.scenarios), self.margin, self._runs, self._seed)
            if not search.begin(own_setting(self.scenario), self.slower):
                raise KeyboardInterrupt
            verdict = search.run()
            margins = self._margins(verdict, stop)
            interrupted = stop.is_set()
        best = verdict.recommended
        return Tuned(
            search.own, tuple(search.trials.values()), tuple(search.feasible), verdict,
            self._written(best.setting).get("control", {}) if best else None, self.scenarios, trials.limits,
            {key: pair for key, pair in limits.items() if key not in self._only}, margins, trials.done,
            interrupted,
        )  # fmt: skip

    def _margins(self, verdict: Verdict, stop: threading.Event) -> dict[str, Margins]:
        """Return the margins of recommendations on the slowest of the robots; nothing if interrupted."""
        chosen = {"recommended": verdict.recommended, "second best": verdict.second}
        loops = {
            name: (*trial.setting.changes, *self.scenarios[0].changes)
            for name, trial in chosen.items()
            if trial is not None and trial.setting.feedback > 0.0
        }
        every = [*loops.values()]
        margins = margins_of(self._study, every, stop, accuracy=_ACCURACY, threads=self._threads)
        return {} if stop.is_set() else dict(zip(loops, margins, strict=True))

    def files(self, folder: Path, picture: Path | None = None) -> list[Path]:
        """Return the files that `write` may leave: the best setting, the picture, all settings.

        Args:
            folder: Their folder.
            picture: Path of the picture instead.
        """
        files = [folder / f"{self.scenario.name}.tune.{kind}" for kind in ("yaml", "png", "parquet")]
        return [files[0], picture or files[1], files[2]]

    def write(self, tuned: Tuned, folder: Path, picture: Path | None = None) -> list[Path]:
        """Write NAME.tune.parquet with all settings, NAME.tune.yaml with the best one, and a picture.

        Args:
            tuned: The result; the last two files need a feasible setting.
            folder: Created if missing.
            picture: Path of the picture; None: NAME.tune.png.

        Returns:
            The files.
        """
        from rmrc.show.figures import save
        from rmrc.tuning.answer import answer_of
        from rmrc.tuning.figure import front_figure

        files, answer = self.files(folder, picture), answer_of(self, tuned)
        rows = [_row(index, trial, tuned) for index, trial in enumerate(tuned.tried)]
        write_table(files[2], _columns(), rows, answer)
        best = tuned.verdict.recommended
        if best is None:
            return files[2:]
        data = self._written(best.setting)
        # beside the scenario's own files; the model stays where it is
        data["name"] = f"{self.scenario.name[:94]}-tuned"
        vary = (data.get("sweep") or {}).get("vary") or {}
        for arm in (data["arm"], *vary.get("arm", ())):
            if "model" in arm:
                arm["model"] = self._seen_from(folder, arm["model"])
        if "arm.model" in vary:
            vary["arm.model"] = [self._seen_from(folder, name) for name in vary["arm.model"]]
        name = Path(self._draft.source).name or self.scenario.name
        head = f"# {name} with the control section that `rmrc tune` recommends."
        with written_whole(files[0]) as temporary:
            temporary.write_text(f"{head}\n{block(data)}", "utf-8")
        save(front_figure(answer, rows), [files[1]])
        return files

    def _seen_from(self, folder: Path, model: str) -> str:
        """Return a model's file, which is relative to the scenario's folder, relative to another."""
        return os.path.relpath((self._draft.folder / model).resolve(), folder.resolve())

    def _written(self, setting: Setting) -> dict[str, Any]:
        """Return the scenario as written, with a setting, and without keys that the setting does not read."""
        data = self._draft.changed(*setting.changes).values()
        if not setting.is_written:
            read = (*setting.values, ON_EXCESS)  # rates are limited whatever it is
            for key in (*WORDS, *NUMBERS):
                if key not in read:
                    _remove(data, key.split("."))
        return data

    def _possible(self, words: Mapping[str, Sequence[str]]) -> tuple[tuple[Structure, ...], tuple[str, ...]]:
        """Return the structures that the scenario can have, and why the others are impossible."""
        structures, reasons = list[Structure](), dict[Problem, None]()
        control = self.scenario.control
        tried = [policy.name for policy in POLICIES.options if policy.is_tried]
        usual = words.get(AT_SINGULARITY, (*tried, control.at_singularity))
        own = control.limits.on_excess
        for structure in all_structures(name for name in POLICIES.names if name in usual):
            values = {ON_EXCESS: own, **structure.words}
            is_asked = all(value in words.get(key, (value,)) for key, value in values.items())
            if not is_asked or structure.on_excess == own:  # that is one of the others
                continue
            try:
                self._study.prepare(changes_of(structure.words))
            except ScenarioError as error:
                reasons |= dict.fromkeys(error.problems)
            else:
                structures.append(structure)
        if not structures:
            rule = f"{ON_EXCESS}: must be {own}, as the scenario has it, or optimal, with the method damped"
            raise ScenarioError(Problem((), f"--only {reason}") for reason in reasons or (rule,))
        return tuple(structures), tuple(map(str, reasons))

    def _bearable(self, robot: Robot) -> Robot:
        """Return a robot without assumed properties that the scenario cannot have, and report these."""
        for name in robot.ranges if robot.is_assumed else ():
            try:
                self._study.prepare(changes_of(robot.only(name).values(self.nominal, {})))
            except ScenarioError as error:
                self.left_out += tuple(map(str, error.problems))
                robot = robot.without(name)
        return robot


def tune(
    scenario: Source,
    only: Only | None = None,
    *,
    perturbed: int = 4,
    start: float = Spread.start,
    offset: float = Spread.offset,
    payload: float = Spread.payload,
    delay: Given = None,
    lag: Given = None,
    noise: Given = None,
    calibration: Given = None,
    ideal: bool = False,
    gain_margin: float | None = None,
    slower: float = 1.1,
    runs: int = 2000,
    seed: int = 0,
    out: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    on_runs: OnRuns | None = None,
) -> Tuned:
    """Search for the inverse, damping and feedback with the smallest tracking error within the limits.

    The function behind `rmrc tune`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        only: Values to which keys are restricted, such as `{"control.inverse.method": ["damped",
            "filtered"]}`.
        perturbed: Number of perturbed scenarios; the worst of all counts.
        start: Perturbation of the joints' start, to either side [rad]; slides: times `task.length` [m].
        offset: Offset of the target along each axis, to either side [m].
        payload: Largest additional payload of a perturbed scenario [kg].
        delay: Dead time of the robot's commands [s]: a number, the smallest and the largest, or a text such
            as `6ms..12ms`. If neither this nor `lag` or `noise` is given, nor in the scenario, a modest robot
            is assumed.
        lag: Time constant with which its actuators follow [s].
        noise: Standard deviation of its encoders' noise [rad]; of slides, times `task.length` [m].
        calibration: Errors of its link lengths and joint zeros, to either side [1, rad].
        ideal: Whether to keep the loop of the scenario, and assume nothing.
        gain_margin: Factor on its feedback that a recommendation tolerates on the slowest of the robots; 1:
            no margin is required; None: 2, or 1 with `ideal`.
        slower: Factor on the duration with the scenario's own setting that another may take.
        runs: Largest number of runs, without the final checks.
        seed: Seed of the perturbed scenarios and of the search.
        out: Folder for NAME.tune.yaml, .png and .parquet; created if missing. None: writes nothing.
        threads: Number of threads, one world each; None: one per core.
        on_runs: Called with the number of finished runs.

    Returns:
        The result, with `tuned.block`, the control section to paste; Ctrl-C ends the search and keeps the
        results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C, before anything was found.
    """
    work = Tuning(
        scenario, only=only or (), perturbed=perturbed, seed=seed, spread=Spread(start, offset, payload),
        robot={"delay": delay, "lag": lag, "noise": noise, "calibration": calibration}, ideal=ideal,
        gain_margin=gain_margin, slower=slower, runs=runs, threads=threads,
    )  # fmt: skip
    if out is not None:
        refuse_unwritable(work.files(Path(out)))
    tuned = work.run(on_runs)
    if out is not None:
        work.write(tuned, Path(out))
    return tuned


def _check(
    perturbed: int, seed: int, spread: Spread, margin: float, slower: float, runs: int, threads: int | None
) -> None:
    least = {
        "perturbed": (perturbed, 0), "seed": (seed, 0), "start": (spread.start, 0),
        "offset": (spread.offset, 0), "payload": (spread.payload, 0), "gain-margin": (margin, 1),
        "slower": (slower, 1), "runs": (runs, 2 * (perturbed + 1)), "threads": (threads or 1, 1),
    }  # fmt: skip
    problems = [
        Problem((), f"must be finite and >= {low}, got {value:g}", Origin(f"--{name}"))
        for name, (value, low) in least.items()
        if not low <= value < math.inf
    ]
    if problems:
        raise ScenarioError(problems)


def _remove(data: dict[str, Any], steps: Sequence[str]) -> None:
    """Remove a key of nested mappings, and those that it leaves empty."""
    first, *rest = steps
    if rest and isinstance(data.get(first), dict):
        _remove(data[first], rest)
    if not rest or data.get(first) == {}:
        data.pop(first, None)


def _columns() -> list[Column]:
    words = [Column(key, "text", "", "null if the setting has none") for key in WORDS]
    numbers = [Column(key, "number", "as the key", "NaN if the setting does not use it") for key in NUMBERS]
    others = [
        ("role", "text", "", "as written, recommended or second best; null for the others"),
        ("scenarios", "count", "1", "number of scenarios run: the scenario itself and perturbed ones"),
        ("error", "number", "m", "largest error of all its runs; angles times task.length"),
        ("peak_rate", "number", "rad/s", "largest joint rate of its runs; slides divided by task.length"),
        ("time", "number", "s", "longest duration of its runs"),
        ("completed", "number", "1", "smallest completed fraction of the path"),
        ("excess", "number", "1", "largest relative excess over a limit; <= 0: all limits are kept"),
        ("tightest", "text", "", "the limit with the largest excess"),
        ("feasible", "switch", "", "whether it keeps all limits on all scenarios; null if not run on all"),
        ("on_front", "switch", "", "whether it is on the Pareto front: feasible, and not dominated"),
    ]
    first = Column("index", "count", "1", "number of the setting, in the order of trial")
    return [first, *words, *numbers, *(Column(*column) for column in others)]


def _row(index: int, trial: Trial, tuned: Tuned) -> dict[str, Any]:
    outcome, count = trial.worst, sum(world < len(tuned.scenarios) for world in trial.outcomes)
    is_whole = count == len(tuned.scenarios)
    return {
        "index": index,
        **trial.setting.values,
        "role": tuned.role(trial) or None,
        "scenarios": count,
        "error": outcome.error,
        "peak_rate": outcome.peak_rate,
        "time": outcome.time,
        "completed": outcome.completed,
        "excess": outcome.excess,
        "tightest": outcome.missed or None,
        "feasible": trial.keeps_limits if is_whole else None if trial.keeps_limits else False,
        "on_front": trial in tuned.verdict.front,
    }
