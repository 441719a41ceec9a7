"""Whether MuJoCo's data are up to date: bodies at the poses of the present positions, not of earlier ones."""

from collections.abc import Sequence

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
        self._data, self._bodies = data, np.unique(np.asarray(bodies, np.int64))

    def __call__(self) -> bool:
        """Return whether the poses are those of the present positions; True if these are not finite."""
        data, scratch, bodies = self._data, self.scratch, self._bodies
        scratch.qpos[:], scratch.mocap_pos[:], scratch.mocap_quat[:] = (
            data.qpos,
            data.mocap_pos,
            data.mocap_quat,
        )
        mujoco.mj_kinematics(data.model, scratch)
        with np.errstate(invalid="ignore"):
            moved = np.abs(scratch.xpos[bodies] - data.xpos[bodies]) > ROUNDING
            turned = np.abs(scratch.xquat[bodies] - data.xquat[bodies]) > ROUNDING
        return not (moved.any() or turned.any())
