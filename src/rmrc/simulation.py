"""Scenarios that were prepared -> runs: worlds stepped together, in blocks.

Worlds that share a model and a plant share a batch; each thread steps batches of its own. The bits of
a run do not depend on the worlds and threads beside it.
"""

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from rmrc.control.records import tick_type, world_type
from rmrc.plant import PlantBatch
from rmrc.preparation import Prepared, world_record
from rmrc.run import COLUMNS, Divergence, Run

# Ticks between two looks at the clock, the keyboard and the recording: a second at 1 kHz. Large enough that a
# block costs little, small enough that a killed process loses little.
BLOCK = 1000

OnBlock = Callable[[int, Run], None]


@dataclass
class _Shard:
    """Worlds that are stepped together, and where their results belong."""

    members: list[int]
    prepared: list[Prepared]
    batch: PlantBatch
    wall_time: float = 0.0

    def advance(self, on_block: OnBlock | None, lock: threading.Lock) -> bool:
        """Step one block of ticks and show it; return whether any world still runs."""
        first, started = self.batch.done, time.perf_counter()
        try:
            running = self.batch.advance(BLOCK)
        finally:  # an interrupted block is shown as well
            self.wall_time += time.perf_counter() - started
            if on_block is not None:
                with lock:
                    for w, index in enumerate(self.members):
                        part = self.run(w, first, self.batch.done)
                        if len(part) or part.divergence:
                            on_block(index, part)
        return running > 0

    def run(self, w: int, first: int, last: int) -> Run:
        """Return ticks [first, last) of world w, or what there is of them."""
        prepared, world = self.prepared[w], self.batch.worlds[w]
        diverged = int(world["diverged"])
        end = diverged if diverged >= 0 else int(world["ticks"])
        rows = self.batch.ticks[first : max(first, min(last, end)), w]
        arm, scenario = prepared.arm, prepared.scenario
        width = {"n": int(world["n"]), "k": int(world["k"])}
        columns = {
            name: rows[name][:, : width[column.width]] if column.width in width else rows[name]
            for name, column in COLUMNS.items()
        }
        return Run(
            name=scenario.name,
            joints=arm.joints,
            is_slide=tuple(bool(s) for s in arm.is_slide),
            axes=scenario.task.axes,
            length=scenario.task.length,
            period=scenario.control.period,
            columns=columns,
            planned=int(world["path_ticks"]),
            divergence=self._divergence(w) if first <= diverged <= last else None,
            wall_time=self.wall_time / len(self.members),
        )

    def _divergence(self, w: int) -> Divergence:
        world = self.batch.worlds[w]
        tick, joint = int(world["diverged"]), int(world["diverged_joint"])
        reason = self.batch.error(w) or "position, rate or command is not finite or beyond 1e10"
        name = self.prepared[w].arm.joints[joint] if joint >= 0 else ""
        return Divergence(tick, tick * float(world["period"]), name, reason)


class Simulation:
    """Prepared scenarios, being run; whatever was recorded so far can be had at any time."""

    def __init__(self, prepared: Sequence[Prepared], threads: int = 1) -> None:
        """Wire the worlds to MuJoCo.

        Args:
            prepared: At least one.
            threads: Number of threads; each steps its share of the worlds.
        """
        self._threads = threads
        self._shards = [_shard(prepared, members) for members in _groups(prepared, threads)]

    def run(self, on_block: OnBlock | None = None, stop: threading.Event | None = None) -> list[Run]:
        """Step every world to its end and return a run for each, in the order of `prepared`.

        Args:
            on_block: Called after each block of ticks with the index of a world and the run of that
                block alone; from any thread, one call at a time.
            stop: Once it is set, every world stops after its current block.

        Raises:
            KeyboardInterrupt: Passed on, after `on_block` saw the last, shorter block.
        """
        stop, failed, lock = stop or threading.Event(), threading.Event(), threading.Lock()

        def work(shard: _Shard) -> None:
            while not (stop.is_set() or failed.is_set()) and shard.advance(on_block, lock):
                pass

        if len(self._shards) == 1:  # in the caller's thread, where Ctrl-C arrives
            work(self._shards[0])
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                try:
                    for result in [pool.submit(work, shard) for shard in self._shards]:
                        result.result()
                except BaseException:  # an interrupt, or an error of one thread: the others must not go on
                    failed.set()
                    raise
        return self.runs()

    def runs(self) -> list[Run]:
        """Return what was recorded so far, a run for each world."""
        runs = {i: s.run(w, 0, s.batch.done) for s in self._shards for w, i in enumerate(s.members)}
        return [runs[i] for i in sorted(runs)]


def _groups(prepared: Sequence[Prepared], threads: int) -> list[list[int]]:
    """Split worlds by what a batch must share, then among the threads."""
    alike: dict[object, list[int]] = {}
    for i, one in enumerate(prepared):
        alike.setdefault(one.batch_key, []).append(i)
    return [
        members[part::threads] for members in alike.values() for part in range(min(threads, len(members)))
    ]


def _shard(prepared: Sequence[Prepared], members: list[int]) -> _Shard:
    chosen = [prepared[i] for i in members]
    plant, arm = chosen[0].scenario.plant, chosen[0].arm
    references = {id(one.reference): one.reference for one in chosen}
    order = {key: r for r, key in enumerate(references)}
    longest = max(len(reference.time) for reference in references.values())
    wanted = np.zeros((len(references), longest, 13))
    for r, reference in enumerate(references.values()):
        wanted[r, : len(reference.time), :7] = reference.pose
        wanted[r, : len(reference.time), 7:] = reference.twist
    worlds = np.empty(len(chosen), world_type(arm.n))
    for w, one in enumerate(chosen):
        worlds[w] = world_record(one, order[id(one.reference)])
    batch = PlantBatch(
        arm,
        arm.adapted(
            plant.kind, chosen[0].kv, plant.timestep, plant.gravity_compensation, loaded=chosen[0].is_loaded
        ),
        chosen[0].substeps,
        worlds,
        np.array([one.qpos for one in chosen]),
        wanted,
        np.empty((int(worlds["ticks"].max()), len(chosen)), tick_type(arm.n)),
        [one.change for one in chosen],
    )
    return _Shard(members, chosen, batch)
