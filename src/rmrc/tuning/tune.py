"""A scenario's file -> the inverse, the damping and the feedback to use in it."""

import math
import os
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rmrc.scenario import Source, Variant, block, changes_of, draft_of
from rmrc.simulation.footprint import excess, footprint, refuse_excess
from rmrc.simulation.prepare import Prepared
from rmrc.study.dataset import Column, write_table
from rmrc.study.margins.margins import Margins, margins_of
from rmrc.study.study import OnRuns, Ran, Study
from rmrc.support.brief import brief
from rmrc.support.errors import ScenarioError
from rmrc.support.files import written_whole
from rmrc.support.interruption import interruptible
from rmrc.support.problems import Origin, Problem
from rmrc.support.threads import side_by_side
from rmrc.tuning.only import Only, read_only
from rmrc.tuning.perturbed import Spread, draw_scenarios, has_points, loops_between
from rmrc.tuning.robot import GAIN_MARGIN, Given, Robot, robot_of
from rmrc.tuning.search import Search
from rmrc.tuning.space import (
    AT_SINGULARITY,
    FEEDBACK,
    NUMBERS,
    ON_EXCESS,
    TRIED,
    WORDS,
    Setting,
    Space,
    Structure,
    all_structures,
    bounds,
    meets_limits,
    own_setting,
)
from rmrc.tuning.tables import Row
from rmrc.tuning.trials import Limits, Trials
from rmrc.tuning.tried import Tried
from rmrc.tuning.verdict import Verdict

# Relative accuracy of the printed margins: their second digit.
_ACCURACY = 0.05

# A tick of the model corrects at most this share of an error, and its path has at least this many ticks.
_COARSE, _FEWEST = 0.6, 300


@brief
@dataclass(frozen=True)
class Tuned:
    """The result of a search.

    Attributes:
        own: The setting as written, on all scenarios.
        tried: All settings.
        feasible: Settings that keep the limits on all scenarios.
        verdict: The best of them.
        control: The recommended control section, ready for YAML; None if no setting is feasible.
        scenarios: The scenario itself, and the perturbed scenarios.
        limits: The limits.
        bounds: Smallest and largest value of each tried number, unless `--only` lists its values.
        margins: Margins of the recommended and the second best setting, by role, on the slowest loop.
        looks: Number of settings examined on a model.
        tick: Tick of that model [s].
        runs: Number of runs on scenarios.
        interrupted: Whether Ctrl-C ended it.
    """

    own: Tried
    tried: tuple[Tried, ...]
    feasible: tuple[Tried, ...]
    verdict: Verdict
    control: Mapping[str, Any] | None
    scenarios: tuple[Variant, ...]
    limits: Limits
    bounds: Mapping[str, tuple[float, float]]
    margins: Mapping[str, Margins]
    looks: int
    tick: float
    runs: int
    interrupted: bool

    @property
    def roles(self) -> dict[str, Tried | None]:
        """The settings with names, the most important first."""
        verdict = self.verdict
        return {"recommended": verdict.recommended, "second best": verdict.second, "as written": self.own}

    def role(self, one: Tried) -> str:
        """Return the name of a setting; "" if it has none."""
        return ", ".join(name for name, other in self.roles.items() if other is one)

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
            runs: Largest number of runs, without the final checks; runs on the model count by their ticks.
            threads: Number of threads, one batch each; None: one per core.

        Raises:
            ScenarioError: Lists all problems.
        """
        spread = spread or Spread()
        self.margin = gain_margin if gain_margin is not None else 1.0 if ideal else GAIN_MARGIN
        _check(perturbed, seed, spread, self.margin, slower, runs, threads)
        self._seed, self.slower, self._runs = seed, slower, runs
        self._spread = spread
        self._threads = threads or os.cpu_count() or 1
        self._draft = draft_of(source, overrides)
        self._study = Study(self._draft)
        self._nominal: Prepared = self._study.prepare()
        self._first: Ran | None = None
        self.scenario = self._nominal.scenario
        words, self._only = read_only(only)
        self._check_numbers()
        self._own = own_setting(self.scenario)
        self._values = {key: float(attrgetter(key)(self.scenario)) for key in NUMBERS}
        self._structures, self.left_out = self._possible(words)
        self._asks_for_excess = ON_EXCESS in words
        self.robot = self._bearable(robot_of(self.scenario, robot, ideal=ideal))
        self.scenarios = draw_scenarios(self._nominal, perturbed, seed, spread, self.robot)
        self.loops = loops_between(self._nominal, self.robot) if perturbed else ()
        self._refuse_excess(self._study.prepare_all(self.scenarios, ""))

    @property
    def least_runs(self) -> int:
        """The fewest runs of a search: twice as many as there are scenarios."""
        return 2 * len(self.scenarios)

    @property
    def spread_in_words(self) -> str:
        """The sizes of the perturbations."""
        spread = self._spread
        degrees = f"joints start within {math.degrees(spread.start):.4g} deg"
        slides = f" (slides: {spread.start:.3g} task.length)" if self._nominal.arm.is_slide.any() else ""
        target = f"target within {spread.offset:g} m along each axis"
        if not has_points(self.scenario):
            target = "no target offset, because the task has no absolute point"
        parts = (degrees + slides, target, f"payload up to {spread.payload:g} kg more")
        used = (spread.start, spread.offset, spread.payload)
        return "; ".join(part for part, size in zip(parts, used, strict=True) if size) or "no perturbation"

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile([self._nominal])

    def begin(self) -> float:
        """Run the scenario as written, with which the search begins, and return its computing time [s].

        Raises:
            KeyboardInterrupt: Ctrl-C.
        """
        started = time.perf_counter()
        with interruptible() as stop:
            (self._first,) = self._study.step([self._nominal], stop)
            if stop.is_set():
                raise KeyboardInterrupt
        return time.perf_counter() - started

    def longest(self, seconds: float, runs: int) -> float:
        """Return the longest time of this many runs [s]; a search often ends sooner.

        Args:
            seconds: Time of one.
            runs: Their number.
        """
        return seconds * runs / min(self._threads, os.cpu_count() or 1)

    def run(self, on_runs: OnRuns | None = None) -> Tuned:
        """Search; Ctrl-C ends it with the results so far.

        Args:
            on_runs: Called with the number of finished runs of each batch.

        Raises:
            KeyboardInterrupt: Ctrl-C, before anything was found.
        """
        if self._first is None:
            self.begin()
        assert self._first is not None  # begun
        nominal, self._first = self._first, None
        # one setting of the interpreter for the pools of all trials: finding it out takes 16 ms
        with interruptible() as stop, side_by_side(self._threads):
            limits = bounds(self._nominal, nominal.run, self.robot, self.margin)
            model = self._model(limits[FEEDBACK][1])
            trials = Trials(
                self._study, self.scenarios, self._threads, stop, on_runs, self.margin, model, self.loops
            )
            matters = self._asks_for_excess or meets_limits(nominal.run)
            structures = tuple(one for one in self._structures if matters or not one.on_excess)
            space = Space(structures, limits, self._only, self._values)
            search = Search(space, trials, self._runs, self._seed)
            if not search.begin(self._own, self.slower):
                raise KeyboardInterrupt
            search.run()
            verdict = search.judge()
            tried, feasible = tuple(search.tried), tuple(search.feasible)
            best = verdict.recommended
            control = self._written(best.setting).get("control", {}) if best else None
            bears = self._margins(verdict, stop)
            interrupted = stop.is_set()
        free = {key: one for key, one in limits.items() if key not in self._only}
        return Tuned(
            tried[0], tried, feasible, verdict, control, self.scenarios, trials.limits, free, bears,
            search.looks, trials.tick, trials.done, interrupted,
        )  # fmt: skip

    def _margins(self, verdict: Verdict, stop: threading.Event) -> dict[str, Margins]:
        """Return the margins of recommendations on the slowest of the robots; nothing if interrupted.

        Args:
            verdict: The recommendations.
            stop: Event that ends the runs.
        """
        chosen = {"recommended": verdict.recommended, "second best": verdict.second}
        loops = {
            name: (*one.setting.changes, *self.scenarios[0].changes)
            for name, one in chosen.items()
            if one is not None and one.feedback > 0.0
        }
        found = margins_of(self._study, [*loops.values()], stop, accuracy=_ACCURACY, threads=self._threads)
        return {} if stop.is_set() else dict(zip(loops, found, strict=True))

    def write(
        self, tuned: Tuned, folder: Path, picture: Path | None = None, told: Mapping[str, Any] | None = None
    ) -> list[Path]:
        """Write NAME.tune.parquet with all settings, NAME.tune.yaml with the best one, and a picture.

        Args:
            tuned: The result; the last two files need a feasible setting.
            folder: Created if missing.
            picture: Path of the picture; None: NAME.tune.png.
            told: The result of `rmrc.tuning.report.told`, which the page of a search needs.

        Returns:
            The files.
        """
        files = self.files(folder, picture)
        write_table(files[2], _columns(), [_row(one, tuned) for one in tuned.tried], told)
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
        self._draw(tuned, files[1])
        return files

    def files(self, folder: Path, picture: Path | None = None) -> list[Path]:
        """Return the files that `write` may leave: the best setting, the picture, all settings.

        Args:
            folder: Their folder.
            picture: Path of the picture instead.
        """
        files = [folder / f"{self.scenario.name}.tune.{kind}" for kind in ("yaml", "png", "parquet")]
        files[1] = picture or files[1]
        return files

    def _seen_from(self, folder: Path, model: str) -> str:
        """Return a model's file, which is relative to the scenario's folder, relative to another."""
        return os.path.relpath((self._draft.folder / model).resolve(), folder.resolve())

    def _draw(self, tuned: Tuned, path: Path) -> None:
        from rmrc.tuning.figure import draw_front

        def row(one: Tried, name: str = "") -> Row:
            return Row(name, one.setting.structure.method, "", *one.worst[:3])

        points, front = ([row(one) for one in some] for some in (tuned.feasible, tuned.verdict.front))
        marks = [row(one, name) for name, one in tuned.roles.items() if one]
        limits = sorted(filter(math.isfinite, set((tuned.limits.rate / tuned.limits.scale).tolist())))
        draw_front(self.scenario.name, points, front, marks, limits, path)

    def _written(self, setting: Setting) -> dict[str, Any]:
        """Return the scenario as written, with a setting, and without keys that the setting does not read."""
        data = self._draft.changed(*setting.changes).values()
        if not setting.is_written:
            for key in setting.structure.unread:
                _remove(data, key.split("."))
        return data

    def _check_numbers(self) -> None:
        """Refuse numbers that no scenario may have."""
        numbers = (({key: one}, "--only") for key, values in self._only.items() for one in values)
        self._study.prepare_all([Variant("", changes_of(*number)) for number in numbers], "")

    def _possible(self, words: Mapping[str, Sequence[str]]) -> tuple[tuple[Structure, ...], tuple[str, ...]]:
        """Return the structures that the scenario can have, and why the others are impossible."""
        found, reasons = list[Structure](), dict[Problem, None]()
        own, policy = self.scenario.control.limits.on_excess, self.scenario.control.at_singularity
        policies = [
            one for one in WORDS[AT_SINGULARITY] if one in words.get(AT_SINGULARITY, (*TRIED, policy))
        ]
        for one in all_structures(policies):
            if any(
                value not in words.get(key, (value,)) for key, value in {ON_EXCESS: own, **one.words}.items()
            ):
                continue
            if one.on_excess == own:  # is one of the others
                continue
            try:
                self._study.prepare(changes_of(one.words))
            except ScenarioError as error:
                reasons |= dict.fromkeys(error.problems)
            else:
                found.append(one)
        if not found:
            tried = f"{ON_EXCESS}: must be {own}, as the scenario has it, or optimal, with the method damped"
            raise ScenarioError(Problem((), f"--only {reason}") for reason in reasons or (tried,))
        return tuple(found), tuple(map(str, reasons))

    def _bearable(self, robot: Robot) -> Robot:
        """Return a robot without assumed properties that the scenario cannot have, and report these."""
        for name in robot.ranges if robot.is_assumed else ():
            try:
                self._study.prepare(changes_of(robot.only(name).values(self._nominal, {})))
            except ScenarioError as error:
                self.left_out += tuple(map(str, error.problems))
                robot = robot.without(name)
        return robot

    def _model(self, feedback: float) -> Variant | None:
        """Return a model of the slowest loop at a tenth of its cost: an ideal plant with one dead time.

        The relevant property of a loop is the sum of its delay, its lags and half a tick. Its ticks may be
        longer, as long as feedback corrects little in one; then its dead time is shorter.

        Args:
            feedback: The largest that will be tried.
        """
        late, period = sum(self.robot.slowest(self.scenario)), self.scenario.control.period
        ticks = max(1, min(int(_COARSE / (feedback * period)), self._nominal.reference.ticks // _FEWEST))
        for times in dict.fromkeys((ticks, 1)):
            if times == 1 and not (late and self._nominal.plant.has_physics):
                return None  # it costs as much, or servos differ from an ideal plant
            left = max(0.0, late - 0.5 * (times - 1) * period)
            ideal = {"plant.kind": "ideal", "plant.delay": round(left, 9), "plant.lag": 0.0}
            model = Variant("the model", changes_of(ideal | {"control.period": round(times * period, 9)}))
            with suppress(ScenarioError):  # such as a scenario with a payload
                self._study.prepare(model.changes)
                return model
        return None

    def _refuse_excess(self, scenarios: Sequence[Prepared]) -> None:
        """Refuse a search that does not fit into memory: the run as written, and batches of the scenarios."""
        refuse_excess([self._nominal])
        batches = self._threads * footprint(scenarios, keep_columns=False)
        if too_much := excess(batches + footprint([self._nominal])):
            wrong = (
                f"has {self._nominal.reference.ticks} ticks, which on {len(scenarios)} scenarios and "
                f"{self._threads} threads need {too_much}; shorten it, or lower --perturbed or --threads"
            )
            raise ScenarioError([self.scenario.problem("target.path", wrong)])


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
    return [
        Column("index", "count", "1", "number of the setting, in the order of trial"),
        *words,
        *numbers,
        Column("role", "text", "", "as written, recommended or second best; null for the others"),
        Column("scenarios", "count", "1", "number of scenarios run: the scenario itself and perturbed ones"),
        Column("error", "number", "m", "largest error of all its runs; angles times task.length"),
        Column(
            "peak_rate",
            "number",
            "rad/s",
            "largest joint rate of all its runs; slides divided by task.length",
        ),
        Column("time", "number", "s", "longest duration of its runs"),
        Column("completed", "number", "1", "smallest completed fraction of the path"),
        Column("excess", "number", "1", "largest relative excess over a limit; <= 0: all limits are kept"),
        Column("tightest", "text", "", "the limit with the largest excess"),
        Column(
            "feasible",
            "switch",
            "",
            "whether it keeps all limits on all perturbed scenarios; null if not run on all",
        ),
        Column(
            "on_front",
            "switch",
            "",
            "whether it is on the Pareto front: feasible, within --only, and not dominated",
        ),
    ]


def _row(one: Tried, tuned: Tuned) -> dict[str, Any]:
    out, whole = one.worst, len(one.outcomes) == len(tuned.scenarios)
    return {
        "index": next(i for i, other in enumerate(tuned.tried) if other is one),
        **one.setting.values,
        "role": tuned.role(one) or None,
        "scenarios": len(one.outcomes),
        "error": out.error,
        "peak_rate": out.peak_rate,
        "time": out.time,
        "completed": out.completed,
        "excess": out.excess,
        "tightest": out.missed or None,
        "feasible": one.keeps_limits if whole else None if one.keeps_limits else False,
        "on_front": any(other is one for other in tuned.verdict.front),
    }
