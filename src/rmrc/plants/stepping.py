"""Worlds of one arm under one plant, stepped together: the compiled tick, and MuJoCo's batch."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.law.jit import Array, machine_code
from rmrc.plants.batches import Batches
from rmrc.plants.contacts import Contacts, can_touch
from rmrc.plants.lockstep import tick
from rmrc.plants.plant import Difference, Plant, Wired
from rmrc.plants.wiring import write_wiring
from rmrc.support.pace import Pace


class _Left(NamedTuple):
    """What is left of a tick: steps of some worlds, by their numbers, before a tick."""

    ids: NDArray[np.intp]
    steps: int
    tick: int


def has_others(wiring: Wiring, nq: int) -> bool:
    """Return whether qpos, (nq,), is more than the positions of an arm's joints, or in another order."""
    return not np.array_equal(wiring.qpos, np.arange(nq))


def _keep_and(control: Callable[[int], int], positions: Array, kept: Array, t: int) -> int:
    """Keep where all joints are, and do the tick."""
    kept[t % len(kept)] = positions
    return control(t)


def _nothing(count: int) -> Array:
    """Return no values of so many worlds, of the type of what MuJoCo computes."""
    nothing = np.empty((count, 0))
    nothing.flags.writeable = False
    return nothing


class Stepper:
    """Worlds of one arm under one plant, stepped together on one thread.

    Attributes:
        worlds: Their records, (w,).
        ticks: What was recorded last, (rows, w): tick t is in row t modulo rows.
        positions: All of qpos beside them, (rows, w, nq); None where that is q in its order.
        contacts: Of the arm; None where it can touch nothing.
        done: Ticks finished so far.
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
            plants: That of each world: of one class, and what they share is equal.
            worlds: Records with all parameters set, (w,); the wiring is written.
            qpos: Start, (w, nq).
            held: Controls and activations of the actuators that the model has before those of the plant,
                (w, …) each.
            reference: Pose and twist of each reference at each tick, (r, ticks, 13).
            ticks: Where the tick records go, (rows, w); with fewer rows than ticks, they are used again.
            batches: Where MuJoCo's part comes from.
        """
        self.worlds = worlds
        self.ticks = ticks
        self.done = 0
        self._longest = int(worlds["ticks"].max())
        kind, self._substeps = type(plants[0]), plants[0].substeps
        self._pace = Pace(len(worlds))
        self._left: _Left | None = None
        self._errors: dict[int, str] = {}
        self._batches, self._lent = batches, list[Batch]()
        model = kind.model(plants)
        wiring = plants[0].arm.wire(model)

        def take(differences: Sequence[Difference]) -> Batch:
            self._lent.append(batches.take(model, differences))
            return self._lent[-1]

        self._batch = take([plant.difference(model, wiring) for plant in plants])
        positions = self._batch.bind("qpos")
        positions[:] = qpos
        for name, values in zip(("ctrl", "act"), held, strict=True):
            if values.size:
                self._batch.bind(name)[:, : values.shape[1]] = values
        if model.nmocap:
            poses = np.array([plant.arm.mocap_now for plant in plants])
            self._batch.bind("mocap_pos")[:] = poses[..., :3]
            self._batch.bind("mocap_quat")[:] = poses[..., 3:]
        write_wiring(worlds, model, wiring, plants)
        # bound before the first forward, so that it fills them
        fields = ("site_xpos", "site_xquat", "xanchor", "xaxis", kind.forces)
        seen = [self._batch.bind(field) for field in fields]
        is_compensated = plants[0].has_physics and model.ngravcomp > 0
        seen.append(self._batch.bind("qfrc_gravcomp") if is_compensated else _nothing(len(worlds)))
        arrays: tuple[Any, ...] = (worlds, ticks, reference, self._batch.state, self._batch.warning, *seen)
        self._tick: Callable[[int], int] = partial(machine_code(tick, *arrays, 0), *arrays)
        self.contacts: Contacts | None = None
        if plants[0].has_physics and can_touch(model, wiring):
            self.contacts = Contacts(model, wiring, self._batch, worlds, ticks)
            self._tick = self.contacts.after(self._tick)
        self.positions: Array | None = None
        if has_others(wiring, model.nq):
            self.positions = np.empty((len(ticks), *positions.shape))
            self._tick = partial(_keep_and, self._tick, positions, self.positions)
        self._before = kind.before_steps(plants, Wired(model, wiring, worlds, self._batch, take))
        self._stage = int(kind.stage)
        self._batch.forward(stage=self._stage)

    def whole(self, w: int, row: int, q: Array) -> Array:
        """Return qpos of world w, (T, nq), from a row of `ticks` on, where the arm is at q, (T, n)."""
        return q if self.positions is None else self.positions[row : row + len(q), w]

    def advance(self, count: int, is_stopped: Callable[[], bool] = lambda: False) -> int:
        """Run the next `count` ticks at most; return how many worlds still run.

        It returns after a moment, so that one can look whether to stop, and at the last row of `ticks`, so
        that no row is used twice in one call. After an exception, an interrupt among them, `done` says how
        far it came.

        Args:
            count: Number of ticks.
            is_stopped: Asked between two parts of a tick whose steps take longer than a moment; the next call
                does what is left of them.
        """
        if self.done >= self._longest:
            return 0
        if self._left is not None:
            self._step_on(self._left, is_stopped)
            return len(self._running(self.done - 1))
        steps = max(1, self._substeps)
        in_parts = steps > self._pace.steps
        proceed = self._proceed(None, in_parts, is_stopped)
        first, before = self.done % len(self.ticks), self.done
        count = min(count, len(self.ticks) - first, self._longest - before)
        count = min(count, max(1, self._pace.steps // steps))
        self.ticks["time"][first : first + count] = -1.0  # not yet written
        control = self._tick
        running, expected, t, started = 0, len(self.worlds), before, time.perf_counter()
        try:
            for t in range(before, before + count):  # `finally` reads t
                running = control(t)
                if running != expected:
                    expected, proceed = running, self._proceed(self._running(t), in_parts, is_stopped)
                    if running == 0:
                        break
                try:
                    proceed()
                except SimulationError as error:
                    self._stop(error, t + 1)
                    expected = -1  # so that the next tick looks again
        finally:  # an interrupt may come before the row was written
            self.done = t + bool((self.ticks["time"][t % len(self.ticks)] >= 0.0).any())
        if not in_parts:
            self._pace.took(time.perf_counter() - started, (self.done - before) * steps)
        if expected < 0 or in_parts:
            running = len(self._running(t))
        return running if self.done < self._longest else 0

    def _proceed(
        self, ids: NDArray[np.intp] | None, in_parts: bool, is_stopped: Callable[[], bool]
    ) -> Callable[[], None]:
        """Return what brings some worlds, or all of them, to their next tick."""
        if not self._substeps:
            return partial(self._batch.forward, ids, self._stage)
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
        """Do what is left of the steps of a tick, in parts, or as much of it until there is a stop.

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
                self._stop(error, tick)
                ids = np.setdiff1d(ids, error.ids)
            self._pace.took(time.perf_counter() - started, part)
            self._left = _Left(ids, steps - part, tick) if part < steps and len(ids) else None

    def _running(self, t: int) -> NDArray[np.intp]:
        worlds = self.worlds
        return np.flatnonzero((worlds["diverged"] < 0) & (t + 1 < worlds["ticks"]))

    def _stop(self, error: SimulationError, t: int) -> None:
        for i in error.ids:
            self.worlds["diverged"][i], self.worlds["diverged_joint"][i] = t, -1
            self._errors[int(i)] = self._batch.error(int(i)) or str(error)

    def release(self) -> None:
        """Let others have MuJoCo's part; there is no next tick. Once is enough."""
        self._longest = self.done
        while self._lent:
            self._batches.give_back(self._lent.pop())

    def error(self, world: int) -> str:
        """Return what MuJoCo said when it refused to step a world, or nothing."""
        return " ".join(self._errors.get(world, "").split())

    def warnings(self, world: int) -> dict[str, int]:
        """Return what MuJoCo warned of in a world, and how often, by the names of its warnings."""
        counts = self._batch.warning[world, :, 1]
        return {
            mujoco.mjtWarning(kind).name.removeprefix("mjWARN_"): int(count)
            for kind, count in enumerate(counts)
            if count
        }
