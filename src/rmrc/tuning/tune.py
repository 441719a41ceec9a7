"""A scenario's file -> the inverse, the damping and the feedback to use in it."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rmrc.scenario import Source, Variant, block, changes_of, draft_of
from rmrc.scenario.choices import POLICIES
from rmrc.simulation.footprint import refuse_excess
from rmrc.study.study import Study
from rmrc.support.brief import brief
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible
from rmrc.support.problems import Origin, Problem
from rmrc.textbook.stability import edge_gain
from rmrc.tuning.robot import GAIN_MARGIN, Given, Range, Robot, robot_of
from rmrc.tuning.search import Search
from rmrc.tuning.space import (
    AT_SINGULARITY,
    FEEDBACK,
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
        margins: Gain margins of the recommended and the second best setting, by role, on the slowest loop:
            the largest factor on the feedback with which it is stable, and the smallest with which not.
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
    margins: Mapping[str, Range]
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
        nominal: The scenario, prepared.
        draft: The scenario as written.
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
        runs: int = 560,
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
        self.draft = draft_of(source, overrides)
        self._study = Study(self.draft)
        self.nominal = self._study.prepare()
        self.scenario = self.nominal.scenario
        self._only = read_only(only)
        values = [(key, value) for key, some in self._only.items() for value in some]
        for key, value in values:
            self.draft.changed(*changes_of({key: value}, "--only")).scenario()
        self._structures, self.left_out = self._possible()
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
            matters = ON_EXCESS in self._only or meets_limits(nominal.run)
            structures = tuple(it for it in self._structures if matters or not it.on_excess)
            values = {key: float(attrgetter(key)(self.scenario)) for key in NUMBERS}
            space = Space(structures, limits, self._only, values)
            told = on_runs or (lambda _: None)
            trials = Trials(self._study, self.scenarios, self.loops, self._threads, stop, told)
            search = Search(space, trials, self.margin, self._runs, self._seed)
            verdict = search.run(own_setting(self.scenario), self.slower)
            if verdict is None:
                raise KeyboardInterrupt
            runs = trials.done
            margins = self._gain_margins(search, verdict, limits[FEEDBACK][1] * self.margin)
            interrupted = stop.is_set()
        best = verdict.recommended
        return Tuned(
            search.tried[0], tuple(search.tried), tuple(search.feasible), verdict,
            self.written(best.setting).get("control", {}) if best else None, self.scenarios, trials.limits,
            {key: pair for key, pair in limits.items() if key not in self._only}, margins, runs,
            interrupted,
        )  # fmt: skip

    def _gain_margins(self, search: Search, verdict: Verdict, limit: float) -> dict[str, Range]:
        """Return the gain margins of the recommendations, by role, on the slowest loop."""
        roles = {"recommended": verdict.recommended, "second best": verdict.second}
        margins = {
            role: search.gain_margin(trial.setting, limit)
            for role, trial in roles.items()
            if trial is not None and trial.setting.feedback > 0.0
        }
        return {role: margin for role, margin in margins.items() if margin is not None}

    def files(self, folder: Path, picture: Path | None = None) -> list[Path]:
        """Return the files that `write` may leave: the best setting, the picture, all settings.

        Args:
            folder: Their folder.
            picture: Path of the picture instead.
        """
        files = [folder / f"{self.scenario.name}.tune.{kind}" for kind in ("yaml", "png", "parquet")]
        return [files[0], picture or files[1], files[2]]

    def written(self, setting: Setting) -> dict[str, Any]:
        """Return the scenario as written, with a setting, and without keys that the setting does not read."""
        data = self.draft.changed(*setting.changes).values()
        if not setting.is_written:
            read = (*setting.values, ON_EXCESS)  # rates are limited whatever it is
            for key in (*WORDS, *NUMBERS):
                if key not in read:
                    _remove(data, key.split("."))
        return data

    def _possible(self) -> tuple[tuple[Structure, ...], tuple[str, ...]]:
        """Return the structures that the scenario can have, and why the others are impossible."""
        structures, reasons = list[Structure](), dict[Problem, None]()
        control = self.scenario.control
        tried = [policy.name for policy in POLICIES.options if policy.is_tried]
        usual = self._only.get(AT_SINGULARITY, (*tried, control.at_singularity))
        own = control.limits.on_excess
        for structure in all_structures(name for name in POLICIES.names if name in usual):
            values = {ON_EXCESS: own, **structure.words}
            is_asked = all(value in self._only.get(key, (value,)) for key, value in values.items())
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
        for name, pair in dict(robot.ranges).items() if robot.is_assumed else ():
            try:
                self._study.prepare(changes_of(Robot({name: pair}).values(self.nominal, {})))
            except ScenarioError as error:
                self.left_out += tuple(map(str, error.problems))
                robot = replace(robot, ranges={key: it for key, it in robot.ranges.items() if key != name})
        return robot


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
