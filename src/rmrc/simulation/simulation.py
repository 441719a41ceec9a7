"""From prepared scenarios to runs: worlds are stepped together, in blocks.

Worlds that share a model and a plant share a batch; each thread steps batches of its own. The bits of
a run do not depend on the worlds and threads beside it.
"""

import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from rmrc.law.record import tick_type
from rmrc.plants.batches import Batches
from rmrc.plants.stepping import Stepper
from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard, figures, tallies_of
from rmrc.results.tally import adder
from rmrc.scenario import InverseSection
from rmrc.scenario.choices import DAMPING_BELOW, INVERSES, SCHEDULES
from rmrc.simulation.footprint import refuse_excess, rows_of
from rmrc.simulation.prepare import Prepared, world_records
from rmrc.support.threads import side_by_side

# Ticks that are recorded at once, and how long they may take [s]: a second at 1 kHz. A block is large enough
# to cost little, and small enough that a killed process loses little. Stops are checked more often: see
# `rmrc.support.pace`.
BLOCK, LONGEST_BLOCK = 1000, 0.5

# Gets each block of ticks after it was stepped, with the index of its world: for progress, a recording, or a
# rule that ends the runs.
Watcher: TypeAlias = Callable[[int, Run], None]

# Returns which worlds end here, from their indices and from their tallies so far, (w,). It is called once per
# fixed number of ticks of a world, and gets nothing else, so that the end of a world does not depend on
# others.
Rule: TypeAlias = Callable[[Sequence[int], NDArray[np.void]], NDArray[np.bool_]]
ASKED = 128

_Result = TypeVar("_Result")


@dataclass
class _Shard:
    """Worlds that are stepped together, and where their results belong."""

    members: list[int]
    prepared: list[Prepared]
    batch: Stepper
    keeps: bool
    wall_time: float = 0.0

    def __post_init__(self) -> None:
        self._facts = [about(one, {}) for one in self.prepared]
        self._tallies = tallies_of(self._facts)
        self._adder = adder(self._tallies, self.batch.ticks)
        self._adding = threading.Lock()
        self.ended = np.zeros(len(self.members), bool)

    def advance(
        self,
        on_block: Watcher | None,
        lock: threading.Lock,
        is_stopped: Callable[[], bool],
        rule: Rule | None = None,
        columns: Collection[str] | None = None,
    ) -> bool:
        """Step one block of ticks and show it; return whether any world still runs."""
        if not self.keeps or rule:
            self._add()  # before the next block overwrites the ticks, and before a rule reads the tallies
        first, started = self.batch.done, time.perf_counter()
        if rule and first and first % ASKED == 0:
            self._end(rule)
        try:
            running = self._step_block(is_stopped, first - first % ASKED + ASKED if rule else first + BLOCK)
        finally:  # an interrupted block is shown as well
            self.wall_time += time.perf_counter() - started
            if on_block is not None:
                with lock:
                    for w, index in enumerate(self.members):
                        part = self.run(w, first, self.batch.done, columns)
                        if len(part) or part.divergence:
                            on_block(index, part)
        return running > 0

    def _end(self, rule: Rule) -> None:
        """End the worlds that a rule ends."""
        going = np.flatnonzero(self._ends() > self.batch.done)
        ended = going[rule([self.members[w] for w in going], self._tallies[going])]
        self.batch.worlds["ticks"][ended] = self.batch.done
        self.ended[ended] = True

    def _step_block(self, is_stopped: Callable[[], bool], last: int) -> int:
        """Step up to a tick, or less if there is a stop; return how many worlds still run."""
        batch, end, row = self.batch, time.perf_counter() + LONGEST_BLOCK, -1
        running = len(self.members)
        # where rows are used again, a block ends with the last of them
        while running and batch.done < last and row != 0 and time.perf_counter() < end and not is_stopped():
            running = batch.advance(last - batch.done, is_stopped)
            row = batch.done % batch.ticks.shape[1]
        return running

    def run(self, w: int, first: int, last: int, names: Collection[str] | None = None) -> Run:
        """Return the existing ticks of [first, last) of world w, with some columns or all."""
        world = self.batch.worlds[w]
        diverged = int(world["diverged"])
        count = max(0, min(last, int(self._ends()[w])) - first)
        begin = first % self.batch.ticks.shape[1]
        rows = self.batch.ticks[w, begin:][:count]
        width = {"n": int(world["n"]), "k": int(world["k"])}
        qpos = self.batch.whole(w, begin, rows["q"][:, : width["n"]])
        if not self.keeps and names is None:
            rows, qpos = rows.copy(), qpos.copy()
        columns: dict[str, NDArray[np.generic]] = {}
        for name, column in COLUMNS.items():
            if names is not None and name not in names and name != "time":
                continue
            values = qpos if column.width == "nq" else rows[name]
            values = values[:, : width[column.width]] if column.width in width else values
            columns[name] = values if self.keeps or names is None else values.copy()
        divergence = self.divergence(w) if first <= diverged <= last else None
        return self._about(w, columns, divergence)

    def _abouts(self) -> list[Run]:
        return [self._about(w, {}) for w in range(len(self.prepared))]

    def _about(
        self,
        w: int,
        columns: Mapping[str, NDArray[np.generic]],
        divergence: Divergence | None = None,
    ) -> Run:
        """Return a run of a world with its columns and further data."""
        contacts = self.batch.contacts
        return replace(
            self._facts[w],
            columns=columns,
            divergence=divergence,
            wall_time=self.wall_time / len(self.members),
            touching=contacts.first.get(w, ()) if contacts else (),
            resting=tuple(contacts.resting.get(w, ())) if contacts else (),
        )

    def scorecards(self) -> list[Scorecard]:
        """Return the metrics of each world so far."""
        self._add()
        return figures(self._abouts(), self._tallies)

    def _add(self) -> None:
        """Add the newly stepped ticks to the tallies: each tick once, wherever an interrupt came."""
        with self._adding:  # another thread may ask for scorecards
            self._adder(np.minimum(self._ends(), self.batch.done))

    def _ends(self) -> NDArray[np.int64]:
        """Return the tick before which each world ends, or the latest possible one, (w,)."""
        worlds = self.batch.worlds
        return np.where(worlds["diverged"] >= 0, worlds["diverged"], worlds["ticks"])

    def divergence(self, w: int) -> Divergence | None:
        """Return the divergence of world w."""
        world = self.batch.worlds[w]
        tick, joint = int(world["diverged"]), int(world["diverged_joint"])
        if tick < 0:
            return None
        reason = self.batch.error(w) or "position, rate or command is not finite or beyond 1e10"
        name = self.prepared[w].arm.joints[joint] if joint >= 0 else ""
        return Divergence(tick, tick * float(world["period"]), name, reason)


class Simulation:
    """Prepared scenarios during their run; all records so far are available at any time.

    Without columns, the results of the runs are their scorecards. Only the references then take more memory
    for longer runs.
    """

    def __init__(
        self,
        prepared: Sequence[Prepared],
        threads: int = 1,
        keep_columns: bool = True,
        batches: Batches | None = None,
        is_shown: bool = False,
    ) -> None:
        """Wire the worlds to MuJoCo.

        Args:
            prepared: One or more scenarios.
            threads: Number of threads; each steps its share of the worlds.
            keep_columns: Whether to keep every tick, for `run` and `runs`.
            batches: Batches of earlier simulations, to be used again; see `release`.
            is_shown: Whether blocks will be shown to a watcher; without columns they are longer then.

        Raises:
            ScenarioError: They do not fit into memory.
        """
        refuse_excess(prepared, keep_columns, is_shown=is_shown)
        batches = batches or Batches()
        self._threads, self._keeps = threads, keep_columns
        self._shards = [
            _shard(prepared, members, (keep_columns, is_shown), batches)
            for members in _groups(prepared, threads)
        ]

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
        self,
        on_block: Watcher | None = None,
        stop: threading.Event | None = None,
        rule: Rule | None = None,
        columns: Collection[str] | None = None,
    ) -> None:
        """Step every world to its end.

        Args:
            on_block: Called after each block of ticks with the index of a world and the run of that
                block alone; from any thread, one call at a time.
            stop: Once it is set, every world stops within a moment.
            rule: Ends worlds early.
            columns: Columns that `on_block` gets beside `time`; None: all, which takes longer.

        Raises:
            KeyboardInterrupt: Passed on, after `on_block` saw the last, shorter block.
        """
        stop, failed, lock = stop or threading.Event(), threading.Event(), threading.Lock()

        def is_stopped() -> bool:
            return stop.is_set() or failed.is_set()

        def work(shard: _Shard) -> None:
            while not is_stopped() and shard.advance(on_block, lock, is_stopped, rule, columns):
                pass

        if len(self._shards) == 1:  # in the caller's thread, where Ctrl-C arrives
            work(self._shards[0])
        else:
            with side_by_side(self._threads) as pool:
                try:
                    for result in [pool.submit(work, shard) for shard in self._shards]:
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
        return self._in_order(
            [[s.run(w, 0, s.batch.done) for w in range(len(s.members))] for s in self._shards]
        )

    def scorecards(self) -> list[Scorecard]:
        """Return the metrics of each world so far: those of `scorecard(run)`."""
        return self._in_order([shard.scorecards() for shard in self._shards])

    def divergences(self) -> list[Divergence | None]:
        """Return the divergence of each world, or None."""
        return self._in_order([[s.divergence(w) for w in range(len(s.members))] for s in self._shards])

    def ended(self) -> list[bool]:
        """Return whether a rule ended each world."""
        return self._in_order([shard.ended.tolist() for shard in self._shards])

    def warnings(self) -> list[dict[str, int]]:
        """Return the number of MuJoCo's warnings in each world, by their names."""
        return self._in_order([list(map(s.batch.warnings, range(len(s.members)))) for s in self._shards])

    def release(self) -> None:
        """Return the batches that `batches` lent, for other simulations; this one cannot continue."""
        for shard in self._shards:
            shard.batch.release()

    def _refuse_without_columns(self) -> None:
        if not self._keeps:
            raise ValueError("columns are not kept: call step(), then scorecards() and divergences()")

    def _in_order(self, of_shards: Sequence[Sequence[_Result]]) -> list[_Result]:
        """Return the results of the shards by world, in the order of `prepared`."""
        found = {
            index: one
            for shard, results in zip(self._shards, of_shards, strict=True)
            for index, one in zip(shard.members, results, strict=True)
        }
        return [found[index] for index in sorted(found)]


def about(prepared: Prepared, columns: Mapping[str, NDArray[np.generic]]) -> Run:
    """Return columns as the run of a world, which took no time and touched nothing."""
    arm, scenario = prepared.arm, prepared.scenario
    chain = prepared.true_arm.chain
    reach = 0.0 if arm.idle else chain.reach  # a joint without an actuator may move the links apart
    return Run(
        name=scenario.name,
        joints=arm.joints,
        is_slide=tuple(arm.is_slide.tolist()),
        axes=scenario.task.axes,
        length=scenario.task.length,
        period=scenario.control.period,
        columns=columns,
        planned=prepared.reference.ticks,
        divergence=None,
        wall_time=0.0,
        weights=scenario.task.weights or (),
        torque_limit=tuple(arm.torque_limit.tolist()) if prepared.plant.has_physics else (),
        view=prepared.task.view,
        chatter_floor=prepared.chatter_floor,
        profile=prepared.expected_profile,
        rate_limit=tuple(prepared.law.rate_limit.tolist()),
        damping_below=_damping_below(scenario.control.inverse),
        shoulder=tuple(chain.step[0].tolist()) if reach else (),
        reach=reach,
        screws=() if arm.idle else chain.screws,
        leaders=() if arm.idle else tuple(chain.leader.tolist()),
        joint_scale=() if arm.idle else tuple(prepared.task.joint_scale.tolist()),
    )


def _damping_below(inverse: InverseSection) -> float:
    """Return ε if the inverse in use reads it, or 0."""
    method, schedule = INVERSES[inverse.method], SCHEDULES[inverse.damping.schedule]
    read = (*method.parameters, *(schedule.parameters if method.is_scheduled else ()))
    return inverse.damping.below if DAMPING_BELOW in read else 0.0


def _groups(prepared: Sequence[Prepared], threads: int) -> list[list[int]]:
    """Split worlds by the properties that a batch must share, then among the threads."""
    alike: dict[object, list[int]] = {}
    for i, one in enumerate(prepared):
        alike.setdefault(one.plant.shares, []).append(i)
    return [
        members[part::threads] for members in alike.values() for part in range(min(threads, len(members)))
    ]


def _shard(
    prepared: Sequence[Prepared], members: list[int], held: tuple[bool, bool], batches: Batches
) -> _Shard:
    chosen = [prepared[i] for i in members]
    references = {id(one.reference): one.reference for one in chosen}
    order = {key: r for r, key in enumerate(references)}
    longest = max(reference.ticks for reference in references.values())
    wanted = np.empty((len(references), longest, 13))
    for r, reference in enumerate(references.values()):
        reference.write(wanted[r, : reference.ticks])
        wanted[r, reference.ticks :] = 0.0
    worlds = world_records(chosen, [order[id(one.reference)] for one in chosen])
    batch = Stepper(
        [one.plant for one in chosen],
        worlds,
        np.array([one.qpos for one in chosen]),
        (np.array([one.held[0] for one in chosen]), np.array([one.held[1] for one in chosen])),
        wanted,
        np.empty((len(chosen), rows_of(chosen, *held)), tick_type(chosen[0].arm.n)),
        batches,
    )
    return _Shard(members, chosen, batch, held[0])
