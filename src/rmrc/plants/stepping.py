"""Worlds of one arm under one plant, stepped together: the compiled tick, and MuJoCo's batch.

Where no Python function of this package is needed between two ticks, one call does many of them: a block.
Otherwise each tick is one call, and each of MuJoCo's steps another. Both give the same bits.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.law.jit import Array, compiling_late, machine_code
from rmrc.plants import native
from rmrc.plants.batches import Batches
from rmrc.plants.blocks import Blocks
from rmrc.plants.contacts import Contacts, can_touch
from rmrc.plants.lockstep import tick
from rmrc.plants.native import Native
from rmrc.plants.plant import Difference, Plant, Wired
from rmrc.plants.wiring import column, write_wiring
from rmrc.support.pace import Pace


class _Left(NamedTuple):
    """The rest of a tick: remaining steps of some worlds, by their numbers, before a tick."""

    ids: NDArray[np.intp]
    steps: int
    tick: int


def has_others(wiring: Wiring, nq: int) -> bool:
    """Return whether qpos, (nq,), holds more than the positions of an arm's joints, or another order."""
    return not np.array_equal(wiring.qpos, np.arange(nq))


def _keep_and(control: Callable[[int], int], positions: Array, kept: Array, t: int) -> int:
    """Keep the positions of all joints, and do the tick."""
    kept[:, t % kept.shape[1]] = positions
    return control(t)


def begin(batch: Batch | Native, plants: Sequence[Plant], qpos: Array, held: tuple[Array, Array]) -> None:
    """Have a batch begin where its worlds do; the arguments are those of a `Stepper`."""
    batch.bind("qpos")[:] = qpos
    for name, values in zip(("ctrl", "act"), held, strict=True):
        if values.size:
            batch.bind(name)[:, : values.shape[1]] = values
    poses = np.array([plant.arm.mocap_now for plant in plants])
    if poses.size:
        batch.bind("mocap_pos")[:] = poses[..., :3]
        batch.bind("mocap_quat")[:] = poses[..., 3:]


def _nothing(count: int) -> Array:
    """Return no values for this many worlds, in the type of MuJoCo's fields."""
    nothing = np.empty((count, 0))
    nothing.flags.writeable = False
    return nothing


def bound(
    batch: Batch, plants: Sequence[Plant], model: mujoco.MjModel, wiring: Wiring, worlds: NDArray[np.void],
    qpos: Array, held: tuple[Array, Array],
) -> tuple[Any, ...]:  # fmt: skip
    """Wire worlds to a batch, set their start, and return the batch's arrays for `lockstep.tick`.

    The first forward pass of the batch fills them. The other arguments are those of a `Stepper`.
    """
    begin(batch, plants, qpos, held)
    write_wiring(worlds, model, wiring, plants, partial(column, model))
    fields = ("site_xpos", "site_xquat", "xanchor", "xaxis", type(plants[0]).forces)
    is_compensated = plants[0].has_physics and model.ngravcomp > 0
    weights = batch.bind("qfrc_gravcomp") if is_compensated else _nothing(len(worlds))
    return batch.state, batch.warning, *map(batch.bind, fields), weights


class Stepper:
    """Worlds of one arm under one plant, stepped together on one thread.

    Attributes:
        worlds: Their records, (w,).
        ticks: The latest tick records, (w, rows): tick t is in row t modulo rows.
        positions: All of qpos for these ticks, (w, rows, nq); None where qpos is q in its order.
        contacts: Contacts of the arm; None where it can touch nothing.
        done: Number of finished ticks.
    """

    def __init__(
        self,
        plants: Sequence[Plant],
        worlds: NDArray[np.void],
        qpos: Array,
        held: tuple[Array, Array],
        reference: Array,
        ticks: NDArray[np.void],
        batches: Batches,
    ) -> None:
        """Wire the worlds to MuJoCo and set their start.

        Args:
            plants: The plant of each world: all of one class, with equal `shares`.
            worlds: Records with all parameters set, (w,); the wiring is written.
            qpos: Start, (w, nq).
            held: Controls and activations of the actuators that the model has before those of the plant,
                (w, …) each.
            reference: Pose and twist of each reference at each tick, (r, ticks, 13).
            ticks: Target of the tick records, (w, rows); with fewer rows than ticks, rows are used again.
            batches: Source of MuJoCo's part.
        """
        self.worlds = worlds
        self.ticks = ticks
        self.done = 0
        self._longest = int(worlds["ticks"].max())
        kind, self._substeps = type(plants[0]), plants[0].substeps
        self._pace = Pace(len(worlds))
        self._left: _Left | None = None
        self._errors: dict[int, str] = {}
        self._batches, self._lent = batches, list[Batch | Native]()
        model = kind.model(plants)
        wiring = plants[0].arm.wire(model)
        self.contacts: Contacts | None = None
        self.positions: Array | None = None
        if has_others(wiring, model.nq):
            self.positions = np.empty((*ticks.shape, model.nq))
        self._blocks, self._before, self._stage = None, None, int(kind.stage)
        touches = plants[0].has_physics and can_touch(model, wiring)
        differences = [plant.difference(model, wiring) for plant in plants]
        if not touches and not kind.works_between and native.serves(model):
            self._batch: Batch | Native = (own := batches.take(model, differences, in_blocks=True))
            self._lent.append(own)
            begin(own, plants, qpos, held)
            write_wiring(worlds, model, wiring, plants, own.place)
            given = worlds, ticks, reference
            is_compensated = plants[0].has_physics and model.ngravcomp > 0
            self._blocks = Blocks(own, kind.forces, self._substeps, given, is_compensated, self.positions)
            return

        def take(differences: Sequence[Difference]) -> Batch:
            batch = batches.take(model, differences)
            self._lent.append(batch)
            return batch

        batch = self._batch = take(differences)
        seen = bound(batch, plants, model, wiring, worlds, qpos, held)
        arrays: tuple[Any, ...] = (worlds, ticks, reference, *seen, 0)
        self._tick: Callable[[int], int] = partial(machine_code(tick, *arrays, 0, at_need=True), *arrays)
        if touches:
            self.contacts = Contacts(model, wiring, batch, worlds, ticks)
            self._tick = self.contacts.after(self._tick)
        if self.positions is not None:
            self._tick = partial(_keep_and, self._tick, batch.bind("qpos"), self.positions)
        self._before = kind.before_steps(plants, Wired(model, wiring, worlds, batch, take))
        self._forward: Callable[..., None] = batch.forward
        self._forward(None, self._stage)

    def whole(self, w: int, row: int, q: Array) -> Array:
        """Return qpos of world w, (T, nq), from a row of `ticks` on, where the arm is at q, (T, n)."""
        return q if self.positions is None else self.positions[w, row : row + len(q)]

    def advance(self, count: int, is_stopped: Callable[[], bool] = lambda: False) -> int:
        """Run at most the next `count` ticks; return how many worlds still run.

        It returns after a moment, so that the caller can check for a stop, and at the last row of `ticks`, so
        that one call uses no row twice. After an exception, such as an interrupt, `done` is the number of
        finished ticks.

        Args:
            count: Number of ticks.
            is_stopped: Called between two parts of a tick whose steps take longer than a moment; the next
                call does the remaining parts.
        """
        if self.done >= self._longest:
            return 0
        if self._left is not None:
            self._step_on(self._left, is_stopped)
            return len(self._running(self.done - 1))
        steps = max(1, self._substeps)
        in_parts = steps > self._pace.steps
        rows, before = self.ticks.shape[1], self.done
        count = min(count, rows - before % rows, self._longest - before)
        count = min(count, max(1, self._pace.steps // steps))
        started, do = time.perf_counter(), self._do_block if self._blocks else self._do_ticks
        with native.untimed(), compiling_late():
            running = do(before + count, in_parts, is_stopped)
        if not in_parts:
            self._pace.took(time.perf_counter() - started, (self.done - before) * steps)
        return running if self.done < self._longest else 0

    def _do_block(self, last: int, in_parts: bool, is_stopped: Callable[[], bool]) -> int:
        """Run ticks up to the one before `last` in one call; return how many worlds still run."""
        if native.has_callbacks():
            raise RuntimeError("set callbacks of MuJoCo (mjcb_...) before a simulation is made")
        before, ids, blocks = self.done, self._running(self.done - 1), cast(Blocks, self._blocks)
        if not len(ids):  # a rule has ended the last one
            return 0
        try:
            blocks.run(ids, before, last, steps=not in_parts)
        except SimulationError as error:
            self._stop(error, blocks.finished(error.ids))
        finally:
            ends = blocks.finished(ids)
            ends -= self.worlds["diverged"][ids] == ends - 1  # the tick that finds it is not recorded
            self.done = max(before, int(ends.max()))
        running = self._running(self.done - 1)
        if in_parts and len(running):
            self._step_on(_Left(running, self._substeps, self.done), is_stopped)
            running = self._running(self.done - 1)
        return len(running)

    def _do_ticks(self, last: int, in_parts: bool, is_stopped: Callable[[], bool]) -> int:
        """Run ticks up to the one before `last`, each in its own calls; return how many worlds still run."""
        control, proceed = self._tick, self._proceed(None, in_parts, is_stopped)
        running, expected, t, rows = 0, len(self.worlds), self.done, self.ticks.shape[1]
        self.ticks["time"][:, t % rows : t % rows + last - t] = -1.0  # not yet written
        try:
            for t in range(self.done, last):  # `finally` reads t
                running = control(t)
                if running != expected:
                    expected, proceed = running, self._proceed(self._running(t), in_parts, is_stopped)
                    if running == 0:
                        break
                try:
                    proceed()
                except SimulationError as error:
                    self._stop(error, np.full(len(error.ids), t + 1))
                    expected = -1  # the next tick then checks again
        finally:
            self._note(t)
        return len(self._running(t)) if expected < 0 or in_parts else running

    def _note(self, t: int) -> None:
        """Note that tick t was the last; an interrupt may have come before its row was written."""
        self.done = t + bool((self.ticks["time"][:, t % self.ticks.shape[1]] >= 0.0).any())

    def _proceed(
        self, ids: NDArray[np.intp] | None, in_parts: bool, is_stopped: Callable[[], bool]
    ) -> Callable[[], None]:
        """Return a function that takes some worlds, or all of them, to their next tick."""
        if not self._substeps:
            return partial(self._forward, ids, self._stage)
        step = partial(self._batch.step, ids, self._substeps, self._stage)
        if in_parts:
            chosen = np.arange(len(self.worlds)) if ids is None else ids
            step = partial(self._step_on, _Left(chosen, self._substeps, self.done + 1), is_stopped)
        before = self._before
        if before is None:
            return step

        def prepare_and_step() -> None:
            before(ids)
            step()

        return prepare_and_step

    def _step_on(self, left: _Left, is_stopped: Callable[[], bool]) -> None:
        """Do the remaining steps of a tick, in parts, until they are done or there is a stop.

        The bits are those of all steps at once.
        """
        self._left = left
        while self._left is not None and not is_stopped():
            ids, steps, tick = self._left
            part, started = min(steps, self._pace.steps), time.perf_counter()
            stage = self._stage if part == steps else int(mujoco.mjtStage.mjSTAGE_NONE)
            try:
                self._batch.step(ids, part, stage)
            except SimulationError as error:
                self._stop(error, np.full(len(error.ids), tick))
                ids = np.setdiff1d(ids, error.ids)
            self._pace.took(time.perf_counter() - started, part)
            self._left = _Left(ids, steps - part, tick) if part < steps and len(ids) else None

    def _running(self, t: int) -> NDArray[np.intp]:
        worlds = self.worlds
        return np.flatnonzero((worlds["diverged"] < 0) & (t + 1 < worlds["ticks"]))

    def _stop(self, error: SimulationError, ticks: NDArray[np.int64]) -> None:
        """End the worlds of an error, each at its own tick."""
        for i, t in zip(error.ids, ticks, strict=True):
            self.worlds["diverged"][i], self.worlds["diverged_joint"][i] = t, -1
            self._errors[int(i)] = self._batch.error(int(i)) or str(error)

    def release(self) -> None:
        """Return MuJoCo's part for use by others. There is no next tick; one call is enough."""
        self._longest = self.done
        while self._lent:
            self._batches.give_back(self._lent.pop())

    def error(self, world: int) -> str:
        """Return MuJoCo's message when it refused to step a world, or an empty text."""
        return " ".join(self._errors.get(world, "").split())

    def warnings(self, world: int) -> dict[str, int]:
        """Return the number of MuJoCo's warnings in a world, by their names."""
        counts = self._batch.warning[world, :, 1]
        return {
            mujoco.mjtWarning(kind).name.removeprefix("mjWARN_"): int(count)
            for kind, count in enumerate(counts)
            if count
        }
