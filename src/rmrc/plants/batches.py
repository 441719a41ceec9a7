"""MuJoCo's batches: worlds that share a model except for some numbers, and that are used again.

A batch takes memory for each of its worlds. Without reuse, every batch of a sweep would allocate and free it.
"""

import threading
from collections.abc import Sequence
from typing import Literal, TypeAlias, overload
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from mujoco.batch import Batch

from rmrc.arm.differences import NEED_CONSTANTS
from rmrc.plants.native import Native
from rmrc.plants.plant import Difference

_Made: TypeAlias = Batch | Native
_Kind = tuple[mujoco.MjModel, int, bool, frozenset[str]]


class Batches:
    """Batches that wait for their next worlds. Threads may share it."""

    def __init__(self) -> None:
        """Start without batches."""
        self._kinds: WeakKeyDictionary[_Made, _Kind] = WeakKeyDictionary()
        self._idle: list[_Made] = []
        self._lock = threading.Lock()

    @overload
    def take(self, model: mujoco.MjModel, worlds: Sequence[Difference]) -> Batch: ...

    @overload
    def take(
        self, model: mujoco.MjModel, worlds: Sequence[Difference], in_blocks: Literal[True]
    ) -> Native: ...

    def take(self, model: mujoco.MjModel, worlds: Sequence[Difference], in_blocks: bool = False) -> _Made:
        """Return a batch of worlds in the state before their first step, for one thread.

        Quantities that MuJoCo cannot keep per world, such as the mean inertia by which its solver scales, are
        the model's own, so they do not depend on the other worlds.

        Args:
            model: The model, as `Arm.adapted` compiled it.
            worlds: The fields that differ in each world, one or more worlds.
            in_blocks: Whether they run many ticks in one call.
        """
        different = {}
        for name in sorted({name for fields in worlds for name in fields}):
            own = model.opt.gravity if name == "opt.gravity" else getattr(model, name)
            values = np.array([fields.get(name, own) for fields in worlds])
            if (values != own).any():
                different[name] = values
        kind = model, len(worlds), in_blocks, frozenset(different)
        batch = self._waiting(kind)
        if batch is None:
            batch = _allocated(model, len(worlds), in_blocks)
            self._kinds[batch] = kind
        else:
            batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        for name, values in different.items():
            batch.expand(name)[:] = values
        if not NEED_CONSTANTS.isdisjoint(different):
            batch.set_const()
        return batch

    def _waiting(self, kind: _Kind) -> _Made | None:
        """Return a batch of a kind; if none waits, make one in place of the one that has waited longest."""
        with self._lock:
            for i, batch in enumerate(self._idle):
                if self._kinds[batch] == kind:
                    return self._idle.pop(i)
            del self._idle[:1]
        return None

    def give_back(self, batch: _Made) -> None:
        """Keep a batch for other worlds; its own worlds have ended, and nothing else reads it."""
        with self._lock:
            self._idle.append(batch)


def _allocated(model: mujoco.MjModel, count: int, in_blocks: bool) -> _Made:
    try:
        return Native(model, count) if in_blocks else Batch(model, count, 1, persistent=True)
    except ValueError as error:
        if "allocate" in str(error):
            raise MemoryError(f"MuJoCo cannot allocate {count} worlds") from None
        raise
