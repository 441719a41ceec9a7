"""Margins of a scenario: how much more delay, lag and gain its loop tolerates before it is unstable."""

import math
import os
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rmrc.scenario import Change, Scenario, Source, changes_of, draft_of
from rmrc.simulation.prepare import Prepared
from rmrc.study.margins.ringing import Judged, judged, lateness
from rmrc.study.margins.search import ACCURACY, Edge, Search, close_in, delay, gain, lag
from rmrc.study.study import OnRuns, Study
from rmrc.support.brief import brief
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible
from rmrc.textbook.stability import edge_delay, edge_gain, edge_lag, rule_gain

# In a sparing search, the lateness of commands grows at most by this factor: the size of a larger margin does
# not matter. There, a loop with little feedback, whose response is slow, is judged with this share of the
# feedback that an ideal plant tolerates: a loop that tolerates more also tolerates less.
_ENOUGH, _RAISED = 10.0, 0.5

# The finest accuracy: at its limit a loop takes forever to show on which side of it it is.
_FINEST, _COARSEST = 0.005, 0.5


@dataclass(frozen=True)
class Margin:
    """One stability margin of a loop.

    Attributes:
        name: `gain`, a factor on control.feedback; `delay` or `lag`, an additional time [s].
        edge: Interval in which the loop becomes unstable; infinite above: no limit was found.
        bound: Largest value of the search.
        ideal: Limit of the ideal plant, by equation; infinite if any value is stable.
        rule: Value by the rule of thumb; below 1, or negative, if it allows less than the scenario has.
        tried: Each tried value with its judgment, by rising value.
    """

    name: str
    edge: Edge
    bound: float
    ideal: float
    rule: float
    tried: tuple[tuple[float, Judged], ...]

    @property
    def value(self) -> float:
        """The margin: the limit, or the largest stable value if none was found."""
        return self.edge.value


@brief
@dataclass(frozen=True)
class Margins:
    """The margins of a scenario.

    Attributes:
        scenario: The scenario.
        late: Dead time of its commands, and the longest lag [s].
        written: Judgment of the loop as written; None: interrupted before.
        gain: Factor on control.feedback at the limit; below 1 if the loop is unstable as written.
        delay: Dead time that can be added [s]; None if the loop is unstable as written.
        lag: Lag that can be added at every joint [s]; None as for `delay`.
        rule: The feedback by the rule of thumb [1/s].
        ideal: The feedback at the limit of the ideal plant [1/s].
        runs: Number of runs.
        interrupted: Whether Ctrl-C ended the search.
    """

    scenario: Scenario
    late: tuple[float, float]
    written: Judged | None
    gain: Margin
    delay: Margin | None
    lag: Margin | None
    rule: float
    ideal: float
    runs: int
    interrupted: bool

    @property
    def is_stable(self) -> bool:
        """Whether the loop is stable as written."""
        return self.written is not None and not self.written.is_unstable

    @property
    def all(self) -> tuple[Margin, ...]:
        """All margins of the loop."""
        return tuple(one for one in (self.gain, self.delay, self.lag) if one is not None)


class Asking:
    """A validated scenario and the search for its margins."""

    def __init__(
        self,
        source: Source,
        overrides: Sequence[str] = (),
        *,
        accuracy: float = ACCURACY,
        threads: int | None = None,
    ) -> None:
        """Check everything before the first run.

        Args:
            source: The scenario, or its file.
            overrides: `KEY=VALUE` texts.
            accuracy: Relative accuracy of the limits: of the gain, and of the total lateness of commands.
            threads: Number of threads; None: one per core.

        Raises:
            ScenarioError: Lists all problems.
        """
        if not _FINEST <= accuracy <= _COARSEST:
            wrong = f"must be between {_FINEST:g} and {_COARSEST:g}, got {accuracy:g}"
            raise ScenarioError.about("--accuracy", wrong)
        self._study, self._accuracy = Study(draft_of(source, overrides)), accuracy
        self._threads = threads or os.cpu_count() or 1
        self._prepared: Prepared = self._study.prepare()
        self.scenario = self._prepared.scenario
        if self.scenario.control.feedback == 0.0:
            wrong = "must be > 0, got 0: a loop without feedback cannot be unstable"
            raise ScenarioError([self.scenario.problem("control.feedback", wrong)])

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile([self._prepared])

    def run(self, on_runs: OnRuns | None = None) -> Margins:
        """Find the margins; Ctrl-C ends the search and keeps the results so far.

        Args:
            on_runs: Called after each round with its number of runs.

        Raises:
            ScenarioError: The runs do not fit into memory.
        """
        with interruptible() as stop:
            (found,) = margins_of(
                self._study, [()], stop, accuracy=self._accuracy, threads=self._threads, on_runs=on_runs
            )
        return found


def margins_of(
    study: Study,
    settings: Sequence[Sequence[Change]],
    stop: threading.Event,
    *,
    accuracy: float = ACCURACY,
    threads: int = 1,
    on_runs: OnRuns | None = None,
    is_sparing: bool = False,
    expected: float = 0.0,
    stable: float = 0.0,
) -> list[Margins]:
    """Return the margins of several settings of a scenario, searched in parallel.

    Args:
        study: Study of the scenario.
        settings: Changes that make each setting, with a positive feedback.
        stop: Event that ends the runs.
        accuracy: Relative accuracy of the limits.
        threads: Number of threads.
        on_runs: Called after each round with its number of runs.
        is_sparing: Whether to take more rounds of fewer runs, with commands at most ten times as late.
        expected: Expected feedback at the limit [1/s], where a sparing search begins; 0: unknown.
        stable: Factor on the feedback with which each was found stable before; 0: none.

    Raises:
        ScenarioError: A setting is wrong, or they do not fit into memory.
    """
    loops = [_Loop(study.prepare(base), base, accuracy, is_sparing) for base in settings]
    gains = [loop.searches["gain"] for loop in loops]
    for search in gains:
        search.stable = stable
    if expected:
        side = math.sqrt(1.0 + accuracy)
        for loop, search in zip(loops, gains, strict=True):
            search.guess, search.first = expected / loop.scenario.control.feedback, (1.0 / side, side)
    if is_sparing:
        close_in(study, gains, stop, threads, on_runs)
    nominal = [loop.nominal for loop in loops if not loop.is_implied()]
    close_in(study, nominal, stop, threads, on_runs)
    every = [search for loop in loops for search in loop.rest()]
    if is_sparing:
        later = [one for loop in loops for name, one in loop.searches.items() if name != "gain"]
        _imply(study, later, stop, threads)
    close_in(study, every, stop, threads, on_runs)
    return [loop.margins(is_interrupted=stop.is_set()) for loop in loops]


def _imply(study: Study, searches: Sequence[Search], stop: threading.Event, threads: int) -> None:
    """End searches for more time where a loop with more feedback tolerates the largest value."""
    raised = list[tuple[Search, Prepared]]()
    for search in searches:
        search.most = min(search.most, _ENOUGH)
        changes = search.changes(search.most)
        late = study.prepare(changes).scenario
        feedback = _RAISED * edge_gain(late.control.period, *lateness(late))
        if feedback > late.control.feedback:
            raised.append((search, study.prepare((*changes, *changes_of({"control.feedback": feedback})))))
    found = judged(study, [world for _, world in raised], stop, threads)
    for (search, _), one in zip(raised, found, strict=True):
        if one is not None and not one.is_unstable:
            search.known[search.most] = one


class _Loop:
    """A loop and its searches."""

    def __init__(self, prepared: Prepared, base: Sequence[Change], accuracy: float, is_sparing: bool) -> None:
        self._prepared, self._base, self.scenario = prepared, base, prepared.scenario
        self._accuracy, self._is_sparing = accuracy, is_sparing
        self.searches = {"gain": self._as_asked(gain(self.scenario, base))}
        self.nominal = replace(gain(self.scenario, base), guess=1.0, least=1.0, most=1.0)

    def _as_asked(self, search: Search) -> Search:
        return replace(search, accuracy=self._accuracy, is_sparing=self._is_sparing)

    def is_implied(self) -> bool:
        """Return whether the loop is stable because one with more feedback is, and adopt that result."""
        low, known = self.searches["gain"].edge.low, self.searches["gain"].known
        if low >= 1.0:
            self.nominal.known[1.0] = known.get(low, Judged("", math.nan, math.nan))  # known before
        return low >= 1.0

    @property
    def _written(self) -> Judged | None:
        return self.nominal.known.get(1.0)

    def rest(self) -> list[Search]:
        """Return the searches that follow the judgment of the loop as written; none if interrupted."""
        if self._written is None:
            return []
        if not self._written.is_unstable:
            longest = self._prepared.reference.duration
            self.searches["delay"] = self._as_asked(delay(self.scenario, longest, self._base))
            self.searches["lag"] = self._as_asked(lag(self.scenario, self._base))
        for search in self.searches.values():
            search.known[1.0] = self._written
        return list(self.searches.values())

    def margins(self, *, is_interrupted: bool) -> Margins:
        """Return the result."""
        one = self.scenario
        late, period = lateness(one), one.control.period
        found = {name: self._margin(name, search) for name, search in self.searches.items()}
        others = sum(len(search.known.keys() - {1.0}) for search in self.searches.values())
        runs = 2 * (len(self.nominal.known) + others)
        return Margins(
            one, late, self._written, found["gain"], found.get("delay"), found.get("lag"),
            rule_gain(period, *late), edge_gain(period, *late), runs, is_interrupted,
        )  # fmt: skip

    def _margin(self, name: str, search: Search) -> Margin:
        """Return the result of a search, with the limit of the ideal plant."""
        feedback, period = self.scenario.control.feedback, self.scenario.control.period
        tau, slowest = lateness(self.scenario)
        rule = 1.0 / feedback - 1.0 / rule_gain(period, tau, slowest)  # of the total lateness of commands
        if name == "gain":
            rule = rule_gain(period, tau, slowest) / feedback
            ideal = edge_gain(period, tau, slowest) / feedback
        elif name == "delay":
            ideal = max(0.0, edge_delay(feedback, period, slowest) - tau)
        else:
            ideal = max(0.0, edge_lag(feedback, period, tau) - slowest)
        low, high = search.edge
        edge = Edge(search.value(low) if low else 0.0, search.value(high))
        return Margin(name, edge, search.value(search.most), ideal, rule, tuple(search.tried))


def margins(
    scenario: Source,
    *,
    accuracy: float = ACCURACY,
    threads: int | None = None,
    on_runs: OnRuns | None = None,
) -> Margins:
    """Find by simulation how much more gain, delay and lag a loop tolerates before it is unstable.

    The function behind `rmrc margins`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        accuracy: Relative accuracy of the limits: of the gain, and of the total lateness of commands.
        threads: Number of threads; None: one per core.
        on_runs: Called after each round with its number of runs.

    Returns:
        The margins; Ctrl-C ends the search and keeps the results so far.

    Raises:
        ScenarioError: Lists all problems, before the first run; or the runs do not fit into memory.
    """
    return Asking(scenario, accuracy=accuracy, threads=threads).run(on_runs)
