"""Contacts of an arm with other things and with itself, examined only when their number changes.

Only contacts that MuJoCo includes in its dynamics matter. The arm consists of all bodies that its first joint
moves, including a gripper. A contact that exists at the start is at rest while it lasts if its other side
belongs to the arm (overlapping geoms, a closed hand), floats (a held object), or is a flex. A contact with
the floor always counts.
"""

from collections.abc import Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.arm.adapting import is_behind
from rmrc.arm.wiring import flex_name
from rmrc.scenario.choices import Status

Pair = tuple[str, str]  # names: the arm's body first

# A contact that begins in the same tick as another one ends is noticed at most this many ticks late.
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
    types, affinities, body = model.geom_contype, model.geom_conaffinity, model.body_weldid[model.geom_bodyid]
    collides = (types[is_own, None] & affinities) | (affinities[is_own, None] & types)
    return bool(np.any((collides != 0) & (body[is_own, None] != body)))


def _moved(model: mujoco.MjModel, wiring: Wiring) -> NDArray[np.bool_]:
    """Return which bodies the first joint of an arm moves, (nbody,)."""
    root = int(model.jnt_bodyid[wiring.joint[0]])
    return is_behind(model, root)


class Contacts:
    """Contacts of a world.

    Attributes:
        first: The first contact pair, or () before it.
        resting: The pairs that touch at the start and do not count while they last.
    """

    def __init__(self, model: mujoco.MjModel, wiring: Wiring, data: mujoco.MjData) -> None:
        """Bind to the data of a world before its first step.

        Args:
            model: Model of the world.
            wiring: Wiring of the arm in it.
            data: Its data.
        """
        self.first: Pair | tuple[()] = ()
        self.resting: list[Pair] = []
        self._rests = set[Pair]()  # those that still touch
        self._model, self._data = model, data
        floating = model.jnt_bodyid[model.jnt_type == FREE]
        self._is_own = _moved(model, wiring)
        self._may_rest = self._is_own | np.isin(model.body_rootid, floating)
        self._last, self._status = -1, 0

    def status(self, tick: int) -> int:
        """Return the bit of the status at a tick, whose kinematics are up to date."""
        count = self._data.nefc  # each included contact has rows
        if count != self._last or tick % LOOK_EVERY == 0:
            touching, self._last = dict(self._pairs()) if count else {}, count
            if tick == 0:
                self.resting = [names for names, rests in touching.items() if rests]
                self._rests = set(self.resting)
            self._rests &= touching.keys()
            counted = [names for names in touching if names not in self._rests]
            self.first = self.first or (counted[0] if counted else ())
            self._status = CONTACT if counted else 0
        return self._status

    def _pairs(self) -> Iterator[tuple[Pair, bool]]:
        """Yield the names of the two sides of a contact of the arm, and whether they may rest."""
        contact = self._data.contact
        included = contact.exclude == 0
        for geoms, flexes in zip(contact.geom[included], contact.flex[included], strict=True):
            ends = [self._end(int(geom), int(flex)) for geom, flex in zip(geoms, flexes, strict=True)]
            bodies = [body for _, body in ends]
            owns = [body >= 0 and bool(self._is_own[body]) for body in bodies]
            (first, _), (second, _) = ends if owns[0] else reversed(ends)
            if any(owns):
                yield (first, second), all(body < 0 or self._may_rest[body] for body in bodies)

    def _end(self, geom: int, flex: int) -> tuple[str, int]:
        """Return a body's name and id; for the world the name of its geom; for a flex -1."""
        model = self._model
        if geom < 0:
            return flex_name(model, flex), -1
        body = int(model.geom_bodyid[geom])
        name = model.body(body).name if body else model.geom(geom).name
        return name.removeprefix("rmrc:") or (f"body{body}" if body else f"geom{geom}"), body
