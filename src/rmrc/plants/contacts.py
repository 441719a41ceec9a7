"""Contacts of an arm with other things and with itself, examined only when their number changes.

Only contacts that MuJoCo includes in its dynamics matter. The arm consists of all bodies that its first joint
moves, including a gripper. A contact that exists at the start is at rest while it lasts if its other side
belongs to the arm (overlapping geoms, a closed hand), floats (a held object), or is a flex. A contact with
the floor always counts.
"""

from collections.abc import Callable, Iterator

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.arm.wiring import flex_name
from rmrc.scenario.choices import Status

Pair = tuple[str, str]  # names: the arm's body first

# A contact that begins in the same tick as an uncounted one ends is noticed at most this many ticks late.
LOOK_EVERY = 16

CONTACT = int(Status.CONTACT)
FREE = int(mujoco.mjtJoint.mjJNT_FREE)


def can_touch(model: mujoco.MjModel, wiring: Wiring) -> bool:
    """Return whether any geom of an arm may collide with another body's.

    Args:
        model: The stepped model.
        wiring: Wiring of the arm in it.
    """
    off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    if model.opt.disableflags & off:
        return False
    is_own = _moved(model, wiring)[model.geom_bodyid]
    if model.nflex or is_own[model.pair_geom1].any() or is_own[model.pair_geom2].any():
        return True
    fields = model.geom_contype, model.geom_conaffinity, model.body_weldid[model.geom_bodyid], is_own
    kinds = set(zip(*(field.tolist() for field in fields), strict=True))
    return any(
        one[2] != other[2] and (one[0] & other[1] or other[0] & one[1])
        for one in kinds
        if one[3]
        for other in kinds
    )


def _moved(model: mujoco.MjModel, wiring: Wiring) -> NDArray[np.bool_]:
    """Return which bodies the first joint of an arm moves, (nbody,)."""
    moved = np.zeros(model.nbody, bool)
    moved[model.jnt_bodyid[wiring.joint[0]]] = True
    for body in range(1, model.nbody):  # parents come first
        moved[body] |= moved[model.body_parentid[body]]
    return moved


def _floats(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return which bodies belong to a tree with a free joint at its root, (nbody,)."""
    floats = np.zeros(model.nbody, bool)
    floats[model.jnt_bodyid[model.jnt_type == FREE]] = True
    return np.asarray(floats[model.body_rootid])


class Contacts:
    """Contacts of worlds that are stepped together.

    Attributes:
        first: The first contact pair, by world.
        resting: The pairs that touch at the start and do not count while they last, by world.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        wiring: Wiring,
        batch: Batch,
        worlds: NDArray[np.void],
        ticks: NDArray[np.void],
    ) -> None:
        """Bind to the arrays of a batch before its first step.

        Args:
            model: Model of the batch.
            wiring: Wiring of the arm in it.
            batch: MuJoCo's part.
            worlds: World records, (w,).
            ticks: Tick records, (w, rows); the status of ticks with a contact is written.
        """
        self.first: dict[int, Pair] = {}
        self.resting: dict[int, list[Pair]] = {}
        self._rests: dict[int, set[Pair]] = {}  # those that still touch
        self._model, self._batch, self._worlds, self._status = model, batch, worlds, ticks["status"]
        self._is_own, self._may_rest = _moved(model, wiring), _floats(model)
        self._may_rest |= self._is_own
        self._counts = batch.bind("nefc")  # each included contact has rows
        self._last = np.full(self._counts.shape, -1)
        self._known = b""  # the last counts: bytes compare in a tenth of a microsecond
        self._more = set[int]()  # worlds with uncounted contacts, which can hide a new one in the number
        self._touching: list[int] = []
        self._is_busy = True
        self._data: mujoco.MjData | None = None

    def after(self, control: Callable[[int], int]) -> Callable[[int], int]:
        """Return a function that does a tick and notes contacts, at little cost where there are none."""
        counts = self._counts.tobytes

        def control_and_look(t: int) -> int:
            running = control(t)
            if self._is_busy or counts() != self._known:
                self._see(t)
            return running

        return control_and_look

    def _see(self, t: int) -> None:
        """Note the contacts at tick t, whose record is written."""
        counts = self._counts.tobytes()
        again = self._more if t % LOOK_EVERY == 0 else ()
        if counts != self._known or again:
            self._known = counts
            looked = set(np.flatnonzero(self._counts != self._last).tolist()).union(again)
            touching = set(self._touching) - looked
            self._touching = sorted(touching.union(w for w in looked if self._touches(w, t)))
            self._last[:] = self._counts
            self._is_busy = bool(self._touching or self._more)
        row = t % self._status.shape[1]
        for w in self._touching:
            self._status[w, row] |= CONTACT

    def _touches(self, w: int, t: int) -> bool:
        """Examine the contacts of a world; return whether any of them counts."""
        if self._worlds["diverged"][w] >= 0 or t >= self._worlds["ticks"][w]:  # it has already ended
            return False
        pairs = list(self._pairs(w)) if self._counts[w] else []
        own = {names: rests for names, is_own, rests in pairs if is_own}
        if t == 0:
            self.resting[w] = [names for names, rests in own.items() if rests]
            self._rests[w] = set(self.resting[w])
        self._rests[w] &= own.keys()
        count = [names for names in own if names not in self._rests[w]]
        if count:
            self.first.setdefault(w, count[0])
        counts_all = len(count) == len({names for names, *_ in pairs})
        (self._more.discard if counts_all else self._more.add)(w)
        return bool(count)

    def _pairs(self, w: int) -> Iterator[tuple[Pair, bool, bool]]:
        """Yield the names of a contact's two sides, whether one is the arm, and whether they may rest."""
        if self._data is None:
            self._data = mujoco.MjData(self._model)
        contact = self._batch.get_data(w, self._data).contact
        included = contact.exclude == 0
        for geoms, flexes in zip(contact.geom[included], contact.flex[included], strict=True):
            ends = [self._end(int(geom), int(flex)) for geom, flex in zip(geoms, flexes, strict=True)]
            bodies = [body for _, body in ends]
            owns = [body >= 0 and bool(self._is_own[body]) for body in bodies]
            rests = all(body < 0 or self._may_rest[body] for body in bodies)
            (first, _), (second, _) = ends if owns[0] else reversed(ends)
            yield (first, second), any(owns), rests

    def _end(self, geom: int, flex: int) -> tuple[str, int]:
        """Return a body's name and id; for the world the name of its geom; for a flex -1."""
        model = self._model
        if geom < 0:
            return flex_name(model, flex), -1
        body = int(model.geom_bodyid[geom])
        name = model.body(body).name if body else model.geom(geom).name
        return name.removeprefix("rmrc:") or (f"body{body}" if body else f"geom{geom}"), body
