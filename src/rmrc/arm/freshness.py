"""Whether MuJoCo's data are up to date: bodies at the poses of the present positions, not of earlier ones."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

# Kinematics of the same positions differ at most by rounding [m, and parts of a quaternion].
ROUNDING = 1e-9


class Freshness:
    """Checks whether the poses of some bodies in the data are those of the data's positions.

    MuJoCo itself computes these again, in data of its own, so it works for any model, whatever else moves.
    """

    def __init__(
        self, data: mujoco.MjData, bodies: Sequence[int], scratch: mujoco.MjData | None = None
    ) -> None:
        """Bind it to data.

        Args:
            data: The data to check.
            bodies: The bodies whose poses are compared.
            scratch: Other data of the same model, which are overwritten; None: new ones.
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
        """Return whether the poses are those of the present positions; True if these are not finite."""
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
