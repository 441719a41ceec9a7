"""A scenario's file -> the inverse, the damping and the feedback to use in it."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rmrc.scenario import Source, Variant, block, changes_of, draft_of
from rmrc.scenario.choices import POLICIES
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.simulation import Simulation
from rmrc.study.study import Study
from rmrc.support.errors import Problem, ScenarioError
from rmrc.support.process import interruptible
from rmrc.support.text import brief
from rmrc.textbook.stability import edge_gain
from rmrc.tuning import space
from rmrc.tuning.robot import GAIN_MARGIN, Options, Robot, draw_scenarios, loops_between, robot_of
from rmrc.tuning.search import Search
from rmrc.tuning.space import Setting, Space, Structure, own_setting, read_only
from rmrc.tuning.trials import OnRuns, Trials, ends
from rmrc.tuning.verdict import Trial, Verdict


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
        runs: Number of runs on scenarios.
        interrupted: Whether Ctrl-C ended it.
        per_kilogram: By how much a payload moves the end of the path: length and angle, with the recommended
            setting and that as written [m/kg, rad/kg]; empty without a payload.
    """

    own: Trial
    tried: tuple[Trial, ...]
    feasible: tuple[Trial, ...]
    verdict: Verdict
    control: Mapping[str, Any] | None
    scenarios: tuple[Variant, ...]
    runs: int
    interrupted: bool
    per_kilogram: tuple[tuple[float, float], ...] = ()

    @property
    def is_worse(self) -> bool:
        """Whether the recommended setting has a larger error than that as written, which breaks a limit."""
        best = self.verdict.recommended
        return best is not None and best.worst.error > self.own.worst.error

    @property
    def block(self) -> str:
        """The control section as YAML, to paste; "" if nothing is feasible."""
        return block({"control": self.control}) if self.control is not None else ""


class Tuning:
    """A search for the control law of a scenario.

    Attributes:
        options: What is asked of it.
        scenario: The scenario with the overrides.
        scenarios: The scenario itself, and the perturbed scenarios.
        loops: The scenario on further loops for the final checks; none without perturbed scenarios.
        left_out: Why some structures are impossible here.
        robot: Robot with the loops of the perturbed scenarios.
        nominal: The scenario, prepared.
        draft: The scenario as written.
    """

    def __init__(self, source: Source, overrides: Sequence[str] = (), **options: Any) -> None:
        """Check everything before the first run.

        Args:
            source: The scenario, or its file.
            overrides: `KEY=VALUE` texts.
            options: Those of `Options`, by name.

        Raises:
            ScenarioError: Lists all problems.
        """
        self.options = Options(**options)
        self.draft = draft_of(source, overrides)
        self._study = Study(self.draft)
        self.nominal = self._study.prepare()
        self.scenario = self.nominal.scenario
        self._only = read_only(self.options.only)
        for key, values in self._only.items():
            for value in values:
                self.draft.changed(*changes_of({key: value}, "--only")).scenario()
        self._structures, self.left_out = self._possible()
        self.robot = self._bearable(robot_of(self.nominal, self.options))
        self.scenarios = draw_scenarios(self.nominal, self.options, self.robot)
        self.loops = loops_between(self.nominal, self.robot) if self.options.perturbed else ()
        refuse_excess([self.nominal])
        refuse_excess(self._study.prepare_all(self.scenarios, ""), keep_columns=False)

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile([self.nominal])

    def run(self, on_runs: OnRuns = lambda _: None) -> Tuned:
        """Search; Ctrl-C ends it with the results so far.

        Args:
            on_runs: Called with the number of finished runs.

        Raises:
            KeyboardInterrupt: Ctrl-C, before anything was found.
        """
        options, margin = self.options, self.options.margin
        threads = options.threads or os.cpu_count() or 1
        with interruptible() as stop:
            (nominal,) = self._study.step([self.nominal], stop)
            edge = edge_gain(self.scenario.control.period, *self.robot.slowest(self.scenario))
            enough = edge / max(margin, GAIN_MARGIN)
            limits = space.bounds(self.nominal, nominal.run, edge / margin)
            matters = space.ON_EXCESS in self._only or space.meets_limits(nominal.run)
            structures = tuple(it for it in self._structures if matters or not it.on_excess)
            possible = Space(structures, limits, self._only)
            trials = Trials(self._study, self.scenarios, self.loops, threads, stop, on_runs)
            search = Search(possible, trials, margin, enough, options.runs, options.seed)
            verdict = search.run(own_setting(self.scenario), options.slower)
            if verdict is None:
                raise KeyboardInterrupt
            runs, interrupted = trials.done, stop.is_set()
        best = verdict.recommended
        control = self.written(best.setting).get("control", {}) if best else None
        own, tried, feasible = search.tried[0], tuple(search.tried), tuple(search.feasible)
        costs = tuple(map(self._cost, (best, own))) if best and "payload" in self.robot.burdens else ()
        return Tuned(own, tried, feasible, verdict, control, self.scenarios, runs, interrupted, costs)

    def _cost(self, trial: Trial) -> tuple[float, float]:
        """Return by how much a payload moves the end of the path, per kilogram."""
        payload = float(self.robot.burdens["payload"])
        base = *trial.setting.changes, *self.scenarios[0].changes
        load = changes_of({"plant.payload": self.scenario.plant.payload + payload})
        worlds = [self._study.prepare(changes) for changes in (base, (*base, *load))]
        simulation = Simulation(worlds, keep_columns=False)
        simulation.step()
        before, after = map(ends, simulation.scorecards())
        return (after[0] - before[0]) / payload, (after[1] - before[1]) / payload

    def written(self, setting: Setting) -> dict[str, Any]:
        """Return the scenario as written, with a setting, and without keys that the setting does not read."""
        data = self.draft.changed(*setting.changes).values()
        if not setting.is_written:
            read = (*setting.values, space.ON_EXCESS)  # rates are limited whatever it is
            for key in (*space.WORDS, *space.NUMBERS):
                if key not in read:
                    _remove(data, key.split("."))
        return data

    def _possible(self) -> tuple[tuple[Structure, ...], tuple[str, ...]]:
        """Return the structures that the scenario can have, and why the others are impossible."""
        structures, reasons = list[Structure](), dict[Problem, None]()
        control = self.scenario.control
        tried = [policy.name for policy in POLICIES.options if policy.is_tried]
        usual = self._only.get(space.AT_SINGULARITY, (*tried, control.at_singularity))
        own = control.limits.on_excess
        for structure in space.all_structures(name for name in POLICIES.names if name in usual):
            values = {space.ON_EXCESS: own, **structure.words}
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
            rule = f"{space.ON_EXCESS}: must be {own}, as in the scenario, or optimal with the method damped"
            raise ScenarioError(Problem((), f"--only {reason}") for reason in reasons or (rule,))
        return tuple(structures), tuple(map(str, reasons))

    def _bearable(self, robot: Robot) -> Robot:
        """Return a robot without assumed properties that the scenario cannot have, and report these."""
        parts = {
            name: Robot({name: pair}) for name, pair in robot.ranges.items() if robot.origin == "assumed"
        }
        parts |= {
            name: Robot({}, burdens={name: most})
            for name, most in robot.burdens.items()
            if getattr(self.options, name) is None
        }
        for name, part in parts.items():
            values = part.values(self.nominal, {}) | part.burdened(self.nominal, [1.0] * len(part.burdens))
            try:
                self._study.prepare(changes_of(values))
            except ScenarioError as error:
                self.left_out += tuple(map(str, error.problems))
                robot = robot.without(name)
        return robot


def _remove(data: dict[str, Any], steps: Sequence[str]) -> None:
    """Remove a key of nested mappings, and those that it leaves empty."""
    first, *rest = steps
    if rest and isinstance(data.get(first), dict):
        _remove(data[first], rest)
    if not rest or data.get(first) == {}:
        data.pop(first, None)
