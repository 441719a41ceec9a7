"""Whether MuJoCo's data are fresh: bodies where the positions put them, and not where they were before."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

# Kinematics of the same positions differ by rounding at the most, if by that [m, and parts of a quaternion].
ROUNDING = 1e-9


class Freshness:
    """Tells of some bodies of data whether their poses are those that the data's positions give.

    MuJoCo itself computes these once more, in data of its own: so any model is served, whatever else moves.
    """

    def __init__(
        self, data: mujoco.MjData, bodies: Sequence[int], scratch: mujoco.MjData | None = None
    ) -> None:
        """Bind it.

        Args:
            data: To look at.
            bodies: Whose poses count.
            scratch: Other data of the same model, which are written over; None: new ones.
        """
        self.scratch = mujoco.MjData(data.model) if scratch is None else scratch
        of, rows = self.scratch, np.unique(np.asarray(bodies, np.int64))
        follows = bool((np.diff(rows) == 1).all())
        where: Any = slice(int(rows[0]), int(rows[-1]) + 1) if follows else rows
        self._model, self._where = data.model, where
        self._given = [(of.qpos, data.qpos)]
        if data.model.nmocap:
            self._given += [(of.mocap_pos, data.mocap_pos), (of.mocap_quat, data.mocap_quat)]
        self._poses = [(of.xpos, data.xpos), (of.xquat, data.xquat)]

    def __call__(self) -> bool:
        """Return whether the poses are those of the positions now; of what is not finite, yes."""
        for own, given in self._given:
            own[:] = given
        mujoco.mj_kinematics(self._model, self.scratch)
        for own, found in self._poses:
            want, is_ = own[self._where], found[self._where]
            if want.tobytes() == is_.tobytes():
                continue
            with np.errstate(invalid="ignore"):
                if (np.abs(want - is_) > ROUNDING).any():
                    return False
        return True
