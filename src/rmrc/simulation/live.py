"""One world in real time: the plant and the stages of a scenario, around a law that Python calls."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.law.command import Command
from rmrc.law.record import tick_type
from rmrc.plants.batches import Batches
from rmrc.plants.halves import halves
from rmrc.plants.hardware import Hardware
from rmrc.plants.plant import Difference, Wired
from rmrc.plants.stepping import bound
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from rmrc.simulation.prepare import Prepared, world_records
from rmrc.simulation.simulation import about

Array = NDArray[np.float64]

# Results of the law at a tick: names in its record, and in `Command`.
SAID = {
    "qdot_cmd": "qdot_cmd", "qdot_plain": "qdot_plain", "sigma": "sigma", "gain": "gain",
    "u_min": "lost_direction", "v_min": "lost_motion", "pose_error": "pose_error", "damping": "damping",
    "path_rate": "path_rate", "manipulability": "manipulability", "condition": "condition",
    "status": "status",
}  # fmt: skip


class Live:
    """A world whose caller runs the law between `sense` and `obey`, tick by tick, without an end.

    Attributes:
        prepared: The scenario.
        done: Ticks since the start.
    """

    def __init__(self, prepared: Prepared, kept: int) -> None:
        """Begin at the start of the scenario.

        Args:
            prepared: The scenario; its path has no effect.
            kept: The number of last ticks that `run` has.
        """
        plant, arm = prepared.plant, prepared.arm
        kind, batches = type(plant), Batches()
        model = kind.model([plant])
        wiring, n = arm.wire(model), arm.n
        self.prepared, self.done, self._n = prepared, 0, n
        self._worlds = world_records([prepared], [0])
        self._k = int(self._worlds["k"][0])
        self._ticks = np.zeros((1, max(kept, prepared.hardware.span + 2)), tick_type(n))
        self._positions = np.empty((self._ticks.shape[1], model.nq))
        batch = batches.take(model, [plant.difference(model, wiring)])
        held = prepared.held[0][None], prepared.held[1][None]
        seen = bound(batch, [plant], model, wiring, self._worlds, prepared.qpos[None], held)
        self._sense, self._obey = halves(self._worlds, self._ticks, np.zeros((1, 1, 13)), *seen)
        lent = list[Any]()

        def take(differences: Sequence[Difference]) -> Any:
            lent.append(batches.take(model, differences))
            return lent[-1]

        self._before = kind.before_steps([plant], Wired(model, wiring, self._worlds, batch, take))
        self._batch, self._lent, stage = batch, lent, int(kind.stage)
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._refresh = partial(batch.forward, None, stage)
        self._step = partial(batch.step, None, plant.substeps, stage) if plant.substeps else self._refresh
        self._refresh()

    def take_over(self, other: "Live") -> None:
        """Continue from the state of another world of the same arm and period, which must not run again.

        A plant of another kind starts with an empty memory: it loses commands that have not arrived.
        """
        self._qpos[:], self._qvel[:] = other._qpos, other._qvel
        if type(self.prepared.plant) is type(other.prepared.plant):
            for field in Hardware.memory:
                self._worlds[field.name] = other._worlds[field.name]
        if self._ticks.shape == other._ticks.shape:
            self._ticks[:], self._positions[:], self.done = other._ticks, other._positions, other.done
        self._refresh()

    @property
    def q(self) -> Array:
        """Joint positions that the law believes, (n,) [rad or m]: a view that `sense` overwrites."""
        return np.asarray(self._worlds["q"][0, : self._n])

    @property
    def qdot(self) -> Array:
        """Joint rates that the law believes, (n,) [rad/s or m/s]: a view that `sense` overwrites."""
        return np.asarray(self._worlds["qdot"][0, : self._n])

    def sense(self) -> bool:
        """Write `q` and `qdot`; return whether all values are finite."""
        row = self.done % len(self._positions)
        self._positions[row] = self._qpos[0]
        return bool(self._sense(self.done) == 1)

    def obey(self, command: Command, pose_ref: Array, twist_ref: Array) -> bool:
        """Follow a command for one period; return whether it is finite.

        Args:
            command: The command of the law.
            pose_ref: Pose of the reference, [p, quat w x y z], (7,) [m, 1].
            twist_ref: Twist of the reference, [v; ω], (6,) [m/s, rad/s].
        """
        out = self._ticks[0, self.done % len(self._positions)]
        for name, said in SAID.items():
            values = getattr(command, said)
            if isinstance(values, np.ndarray):
                out[name][: len(values)] = values
            else:
                out[name] = values
        out["pose_ref"], out["twist_ref"] = pose_ref, twist_ref
        out["secondary_error"] = out["secondary_sigma"] = np.nan
        fine = bool(self._obey(self.done) == 1)
        if fine:
            if self._before is not None:
                self._before(None)
            self._step()
            self.done += 1
        return fine

    def run(self, count: int) -> Run:
        """Return the last ticks as a run, whose time begins at 0.

        Args:
            count: Largest number of ticks.
        """
        count = min(count, self.done, len(self._positions))
        rows = np.arange(self.done - count, self.done) % len(self._positions)
        ticks, period = self._ticks[0, rows], self.prepared.scenario.control.period
        width = {"n": self._n, "k": self._k}
        columns: dict[str, NDArray[np.generic]] = {
            name: ticks[name][:, : width[one.width]] if one.width in width else ticks[name]
            for name, one in COLUMNS.items()
            if one.width != "nq"
        }
        columns |= {"qpos": self._positions[rows], "time": period * np.arange(count)}
        return replace(about(self.prepared, columns), planned=count)
