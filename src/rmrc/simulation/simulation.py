"""From prepared scenarios to runs: each world runs from first tick to last; threads take worlds in turn.

A run does not depend on the worlds and threads beside it, as nothing is shared.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.results.columns import Divergence, no_ticks
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard
from rmrc.scenario.choices import DAMPING_BELOW, read_by
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import Prepared, expected_profile
from rmrc.simulation.world import World, compile_for
from rmrc.support.process import side_by_side

# Between two pieces of ticks there is time for stops and progress. A piece is at most a second at 1 kHz, and
# takes about this long [s]; the first is one tick, and each is at most some times as long as the last.
PIECE, MOMENT, GROWTH = 1000, 0.05, 8

# Gets each piece of ticks after it was stepped, with the index of its world: for progress, or a rule
# that ends the runs.
Watcher: TypeAlias = Callable[[int, Run], None]

# Returns whether a world ends here, from its index and its run so far. It is called after each ASKED ticks,
# and gets nothing else, so that the end of a world does not depend on others.
Rule: TypeAlias = Callable[[int, Run], bool]
ASKED = 512


class _Course:
    """The course of one world, from before its start until after its end.

    Attributes:
        scorecard: Its metrics, once it has ended, if columns are not kept.
        has_ended: Whether no tick follows.
        was_cut: Whether a rule ended it.
    """

    def __init__(self, prepared: Prepared, keeps: bool) -> None:
        self.prepared, self.keeps = prepared, keeps
        self.world: World | None = None
        n = prepared.arm.n
        self._facts = about(prepared, no_ticks(n, min(n, len(prepared.task.rows)), len(prepared.qpos)))
        self.scorecard: Scorecard | None = None
        self.has_ended = self.was_cut = False
        self._seconds = 0.0

    @property
    def run(self) -> Run:
        """Its run so far; without ticks after its end, if columns are not kept."""
        return self._facts if self.world is None else self._part(self.world, 0)

    def _part(self, world: World, first: int) -> Run:
        """Return its run from a tick on."""
        contacts = world.contacts
        return replace(
            self._facts,
            columns=world.columns(first, world.done),
            divergence=world.divergence,
            wall_time=self._seconds,
            touching=contacts.first if contacts else (),
            resting=tuple(contacts.resting) if contacts else (),
        )

    def step(
        self,
        show: Callable[[Run], None] | None,
        is_stopped: Callable[[], bool],
        rule: Callable[[Run], bool] | None,
    ) -> None:
        """Run to the end, to a stop, or to where a rule ends it."""
        if self.has_ended:
            return
        world, length = self.world or World(self.prepared), 1
        self.world = world
        while world.is_running and not is_stopped():
            first, started = world.done, time.perf_counter()
            most = min(length, ASKED - first % ASKED) if rule else length
            try:
                world.advance(most)
            finally:  # an interrupted piece counts as well
                seconds = time.perf_counter() - started
                self._seconds += seconds
                if show and (world.done > first or world.divergence):
                    show(self._part(world, first))
            fitting = (world.done - first) * MOMENT / max(seconds, 1e-9)
            length = max(1, min(PIECE, GROWTH * length, int(fitting)))
            if rule and world.done % ASKED == 0 and world.is_running and rule(self.run):
                world.end()
                self.was_cut = True
        if not world.is_running:
            run = self.run
            if not self.keeps:
                self.scorecard = run.scorecard
                run = replace(run, columns=self._facts.columns)
            world.release()
            self._facts, self.world, self.has_ended = run, None, True


class Simulation:
    """Prepared scenarios during their run; all records so far are available at any time.

    Where columns are not kept, those of a world are dropped at its end, and its scorecard remains.
    """

    def __init__(self, prepared: Sequence[Prepared], threads: int = 1, keep_columns: bool = True) -> None:
        """Compile or load the law of the worlds.

        Args:
            prepared: One or more scenarios.
            threads: Number of threads; each steps one world at a time.
            keep_columns: Whether to keep every tick, for `run` and `runs`.

        Raises:
            ScenarioError: They do not fit into memory.
        """
        refuse_excess(prepared, keep_columns, threads=threads)
        for one in prepared:
            compile_for(one)
        self._threads, self._keeps = threads, keep_columns
        self._courses = [_Course(one, keep_columns) for one in prepared]

    def run(self, on_block: Watcher | None = None, stop: threading.Event | None = None) -> list[Run]:
        """Step every world to its end and return a run for each, in the order of `prepared`.

        Args:
            on_block: As in `step`.
            stop: As in `step`.

        Raises:
            KeyboardInterrupt: As in `step`.
            ValueError: Columns are not kept.
        """
        self._refuse_without_columns()
        self.step(on_block, stop)
        return self.runs()

    def step(
        self, on_block: Watcher | None = None, stop: threading.Event | None = None, rule: Rule | None = None
    ) -> None:
        """Step every world to its end.

        Args:
            on_block: Called after each piece of ticks with the index of a world and the run of that piece
                alone; from any thread, but never two at a time.
            stop: Once it is set, every world stops within a moment.
            rule: Ends worlds early.

        Raises:
            KeyboardInterrupt: Passed on, after `on_block` saw the last, shorter piece.
        """
        stop, failed, lock = stop or threading.Event(), threading.Event(), threading.Lock()

        def is_stopped() -> bool:
            return stop.is_set() or failed.is_set()

        def work(index: int) -> None:
            def show(part: Run) -> None:
                assert on_block is not None
                with lock:
                    on_block(index, part)

            ends = None if rule is None else lambda run: rule(index, run)
            if not is_stopped():
                self._courses[index].step(show if on_block else None, is_stopped, ends)

        indices = range(len(self._courses))
        if min(self._threads, len(indices)) == 1:  # in the caller's thread, where Ctrl-C arrives
            for index in indices:
                work(index)
            return
        with side_by_side(self._threads) as pool:
            try:
                for result in [pool.submit(work, index) for index in indices]:
                    result.result()
            except BaseException:  # an interrupt, or an error of one thread: the others must stop
                failed.set()
                raise

    def runs(self) -> list[Run]:
        """Return the records so far, one run per world.

        Raises:
            ValueError: Columns are not kept.
        """
        self._refuse_without_columns()
        return [course.run for course in self._courses]

    def scorecards(self) -> list[Scorecard]:
        """Return the metrics of each world so far: those of `scorecard(run)`."""
        return [course.scorecard or course.run.scorecard for course in self._courses]

    def divergences(self) -> list[Divergence | None]:
        """Return the divergence of each world, or None."""
        return [course.run.divergence for course in self._courses]

    def ended(self) -> list[bool]:
        """Return whether a rule ended each world."""
        return [course.was_cut for course in self._courses]

    def _refuse_without_columns(self) -> None:
        if not self._keeps:
            raise ValueError("columns are not kept: call step(), then scorecards() and divergences()")


def about(prepared: Prepared, columns: Mapping[str, NDArray[np.generic]]) -> Run:
    """Return columns as the run of a world, which took no time and touched nothing."""
    arm, scenario = prepared.arm, prepared.scenario
    chain, inverse = prepared.true_arm.chain, scenario.control.inverse
    read = read_by(inverse.method, inverse.damping.schedule)
    return Run(
        name=scenario.name,
        joints=arm.joints,
        is_slide=tuple(arm.is_slide.tolist()),
        axes=scenario.task.axes,
        length=prepared.task.length,
        period=scenario.control.period,
        columns=columns,
        planned=prepared.reference.ticks,
        divergence=None,
        wall_time=0.0,
        weights=scenario.task.weights or (),
        torque_limit=tuple(arm.torque_limit.tolist()) if prepared.plant.has_physics else (),
        view=prepared.task.view,
        chatter_floor=prepared.chatter_floor,
        profile=expected_profile(scenario),
        rate_limit=tuple(prepared.law.rate_limit.tolist()),
        damping_below=float(inverse.damping.below or 0.0) if DAMPING_BELOW in read else 0.0,
        screws=() if arm.idle() else chain.screws,
        leaders=() if arm.idle() else tuple(chain.leader.tolist()),
        joint_scale=() if arm.idle() else tuple(prepared.task.joint_scale.tolist()),
    )
