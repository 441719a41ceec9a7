"""The author's actuators that move the arm: which they are, and the command that each takes."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from rmrc.arm.actuators import EVERYWHERE, Array, DriveKind, Ends, kind_of, moments_of, terms_of
from rmrc.arm.others import Others
from rmrc.support.legible import listed

# With moments scaled to a largest one of 1, less than this is rounding.
_RANK = 1e-9


class Servo(NamedTuple):
    """A servo of one joint, in constant proportion: its control is slope · (position or rate) + offset.

    Attributes:
        command: Kind of its command.
        joint: The joint, by its place in the arm.
        slope: Control for each unit of the joint's position or rate.
        offset: Control at 0.
        position: Least and largest position that it takes as a command [rad or m].
        rate: Least and largest rate [rad/s or m/s].
    """

    command: DriveKind
    joint: int
    slope: float
    offset: float
    position: Ends
    rate: Ends


class OwnDrives:
    """The author's actuators that act on an arm's joints and on no others.

    A motor moves joints without a servo. Beside a servo it keeps its control, and so do actuators of other
    kinds.

    Attributes:
        kinds: Kind of the command of each actuator, by its id.
        idle: Ids of actuators that act on the arm's joints and get no commands.
    """

    def __init__(self, model: mujoco.MjModel, others: Others, F: Array) -> None:
        """Examine the actuators of a model.

        Args:
            model: The author's model.
            others: Its parts that are not the arm.
            F: Rates of all joints of the model for unit rates of the arm's, (nv, n).
        """
        self._model, self._others, self._F = model, others, F
        kinds = {i: kind for i in sorted(others.replaced) if (kind := kind_of(model, i)) is not None}
        motors = {i for i, kind in kinds.items() if kind == DriveKind.MOTOR}
        served = frozenset().union(*(others.pulled[i] for i in kinds.keys() - motors))
        beside = {i for i in motors if not served.isdisjoint(others.pulled[i])}
        self.kinds = {i: kind for i, kind in kinds.items() if i not in beside}
        self.idle = tuple(sorted(others.replaced - self.kinds.keys()))

    def moments(self, data: mujoco.MjData) -> Array:
        """Return the rate of length of each actuator at unit rate of each joint, (d, n)."""
        return np.asarray(moments_of(self._model, data)[list(self.kinds)] @ self._F)

    def servos(self, data: mujoco.MjData, q: Array) -> dict[int, Servo]:
        """Return the servos that move one joint each in constant proportion, by their ids.

        Args:
            data: Data at a configuration, with its transmissions.
            q: Positions of the arm's joints there, (n,).
        """
        model, servos = self._model, dict[int, Servo]()
        for row, (i, kind) in zip(self.moments(data), self.kinds.items(), strict=True):
            driven = np.flatnonzero(np.abs(row) > _RANK * np.abs(row).max())
            if kind == DriveKind.MOTOR or len(driven) != 1 or not self._others.is_linear[i]:
                continue
            j, terms = int(driven[0]), terms_of(model, i, kind)
            slope = float(terms.scale * row[j])
            length = float(data.actuator_length[model.actuator_outadr[i]])
            start = terms.offset + terms.scale * length - slope * q[j]  # control or activation at q = 0
            position = _ends(terms.state, slope, start)
            if kind == DriveKind.POSITION:
                low, high = _ends(terms.control, slope, start)
                position = max(low, position[0]), min(high, position[1])
                servos[i] = Servo(kind, j, slope, start, position, EVERYWHERE)
            else:
                offset = terms.offset if kind == DriveKind.VELOCITY else 0.0
                servos[i] = Servo(kind, j, slope, offset, position, _ends(terms.control, slope, offset))
        return servos

    def undriven(self, data: mujoco.MjData) -> list[int]:
        """Return the joints of the arm that the actuators cannot move one by one, by their indices.

        Args:
            data: Data at a configuration, with its transmissions.
        """
        moments = self.moments(data)
        size = np.abs(moments).max(axis=1, initial=0.0)
        _, sigma, right = np.linalg.svd(moments[size > mujoco.mjMINVAL] / size[size > mujoco.mjMINVAL, None])
        free = np.abs(right[int((sigma > _RANK).sum()) :]).max(axis=0, initial=0.0)
        return np.flatnonzero(free > _RANK).tolist()

    def named(self, actuators: Sequence[int]) -> str:
        """Return the names of actuators, or their numbers, as a list."""
        return listed(self._model.actuator(i).name or f"actuator{i}" for i in actuators)


def _ends(ends: Ends, slope: float, offset: float) -> Ends:
    """Return least and largest value whose control, slope · value + offset, is between two ends."""
    first, last = sorted((end - offset) / slope for end in ends)
    return first, last
