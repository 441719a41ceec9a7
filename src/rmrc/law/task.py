"""What an arm is asked to move: the rows of its Jacobian that count, scaled as in the law."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.record import world_type
from rmrc.support.spatial import AXES

Array = NDArray[np.float64]

# The rank of a task almost everywhere is the largest at so many random configurations. One would do with
# probability 1; more are for those that come near a singularity by chance.
SAMPLES = 20
# A singular value below this share of the largest, at a random configuration, is rounding.
RANK_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Task:
    """Rows of an arm's Jacobian, made comparable by a characteristic length.

    Attributes:
        arm: The arm.
        rows: Rows of the twist that count, (m,), rising.
        length: Characteristic length L, which makes meters and radians comparable [m].
    """

    arm: Arm
    rows: NDArray[np.intp]
    length: float = 1.0

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the rows: of x y z rx ry rz."""
        return tuple(AXES[row] for row in self.rows)

    @property
    def row_scale(self) -> Array:
        """Diagonal of S_x, (m,): linear rows over L."""
        return np.where(self.rows < 3, 1.0 / self.length, 1.0)

    @property
    def joint_scale(self) -> Array:
        """Diagonal of S_q, (n,): sliding joints times L."""
        return np.where(self.arm.is_slide, self.length, 1.0)

    def matrix(self, jacobian: Array) -> Array:
        """Return A = S_x J S_q, (..., m, n), of a Jacobian (..., 6, n): what the law decomposes."""
        return self.row_scale[:, None] * jacobian[..., self.rows, :] * self.joint_scale

    def record(self) -> np.void:
        """Return the law's record of a world with this arm and task, for compiled kernels.

        Its joints are rows of its own `axis` and `anchor`, which `follow_chain` writes.
        """
        arm, chain, m, n = self.arm, self.arm.chain, len(self.rows), self.arm.n
        world = np.zeros(1, world_type(n))
        world["n"], world["m"], world["k"] = n, m, min(m, n)
        world["joint"][0, :n] = np.arange(n)
        world["is_slide"][0, :n], world["pitch"][0, :n] = arm.is_slide, arm.pitch
        world["zero_axis"][0, :n], world["zero_step"][0, :n] = chain.axis, chain.step
        world["tip_step"], world["tip_quat"] = chain.tip_step, chain.tip_quat
        world["row"][0, :m], world["row_scale"][0, :m] = self.rows, self.row_scale
        world["joint_scale"][0, :n] = self.joint_scale
        world["position_limit"][0, :, :n] = arm.position_limit.T
        return world[0]  # type: ignore[no-any-return]


def choose(arm: Arm, axes: Sequence[str] | None = None, length: float = 1.0) -> Task:
    """Return the task of some axes, or of those that the arm can move independently of each other.

    These are the rows of its reduced Jacobian [Khatib08]: of x y z rx ry rz, in this order, each that raises
    the rank that the rows before it have almost everywhere. A 2-link planar arm gets x and y, a SCARA arm
    x, y, z and rz, an arm with six joints or more usually all. The rotations come first if they alone can
    tell all joints and the translations cannot: a spherical wrist gets rx, ry and rz at any of its points.

    Args:
        arm: The arm.
        axes: Of x y z rx ry rz; None to choose.
        length: Characteristic length [m].

    Raises:
        ValueError: No such axis.
    """
    if axes is not None:
        return Task(arm, np.array(sorted({AXES.index(axis) for axis in axes})), length)

    def rank(rows: Sequence[int]) -> int:
        task = Task(arm, np.array(rows), length)
        return structural_rank(arm, task.rows, task.row_scale, task.joint_scale)

    turns_first = rank([3, 4, 5]) == arm.n > rank([0, 1, 2])
    rows: list[int] = []
    for row in (3, 4, 5, 0, 1, 2) if turns_first else range(6):
        if rank([*rows, row]) > len(rows):
            rows.append(row)
    return Task(arm, np.sort(rows), length)


def structural_rank(arm: Arm, rows: NDArray[np.intp], row_scale: Array, joint_scale: Array) -> int:
    """Return the rank of S_x J S_q almost everywhere: the largest at random but always equal configurations.

    Args:
        arm: The arm.
        rows: Rows of the twist that count, (m,).
        row_scale: Diagonal of S_x, (m,).
        joint_scale: Diagonal of S_q, (n,).
    """
    ranks = []
    for q in arm.sampled(SAMPLES):
        sigma = np.linalg.svd(row_scale[:, None] * arm.jacobian(q)[rows] * joint_scale, compute_uv=False)
        ranks.append(int(np.count_nonzero(sigma > RANK_TOLERANCE * sigma[0])))
    return max(ranks)
