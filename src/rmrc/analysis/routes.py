"""The Jacobian of an arm by four routes, so that each checks the others.

MuJoCo's own comes from the poses of the bodies at q. Screws and propagation only know the axes at q = 0: one
moves screws by a product of exponentials, the other propagates velocities along frames from link to link.
Differences use only poses.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.support.spatial import normalize, pose_error, quat_to_matrix
from rmrc.textbook.dh import modified_dh_transform
from rmrc.textbook.propagation import jacobian_by_propagation
from rmrc.textbook.screws import geometric_from_screws, joint_screw, product_of_exponentials, space_jacobian

Array = NDArray[np.float64]

# Truncation, step²/6 times a third derivative, and rounding over the step are both about 1e-11 for an arm of
# meters: below 1e-8, the tolerance for a correct Jacobian.
DIFFERENCE_STEP = 1e-5


def jacobians(arm: Arm, q: Sequence[float] | Array) -> dict[str, Array]:
    """Return J by each route, rows [v; ω] of the site along world axes, (6, n) each.

    By screws: the product of exponentials of the joint screws at q = 0 [Selig92, §6.6] [Lynch17, §5.1.1]. By
    differences: central differences of the pose, to about 1e-10 of the arm's size.

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
    """
    q = np.asarray(q, dtype=np.float64)
    points, at_zero = _at_zero(arm)
    screws, moved = joint_screw(arm.chain.axis, points, arm.chain.pitch), arm.chain.positions(q)
    tip = product_of_exponentials(screws, moved, at_zero)[:3, 3]
    steps = DIFFERENCE_STEP * np.eye(arm.n)
    columns = [pose_error(arm.pose(q + step), arm.pose(q - step)) for step in steps]
    return {
        "mujoco": arm.jacobian(q),
        "screws": arm.chain.gathered(geometric_from_screws(space_jacobian(screws, moved), tip), arm.n),
        "propagation": arm.chain.gathered(jacobian_by_propagation(*link_transforms(arm, q)), arm.n),
        "differences": np.array(columns).T / (2.0 * DIFFERENCE_STEP),
    }


def link_transforms(arm: Arm, q: Sequence[float] | Array) -> tuple[Array, Array, Array]:
    """Return the link transforms of the arm, for `rmrc.textbook.propagation`.

    Frame {i} is fixed in link i, its z along axis i of the chain; at q = 0 its origin is MuJoCo's anchor. It
    moves as a modified DH link of no length and twist: q turns about z, or slides along it.

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].

    Returns:
        T_i-1_i, (ℓ, 4, 4); the pitch of each axis, (ℓ,) [m/rad]; and T_n_site, (4, 4).
    """
    q, z, pitch = arm.chain.positions(q), arm.chain.axis, arm.chain.pitch
    still = np.tile(np.eye(4), (len(q) + 2, 1, 1))
    x = normalize(np.cross(np.eye(3)[np.argmin(np.abs(z), axis=-1)], z))
    still[1:-1, :3, :3] = np.stack([x, np.cross(z, x), z], axis=-1)
    still[1:-1, :3, 3], still[-1] = _at_zero(arm)
    steps = np.linalg.inv(still[:-1]) @ still[1:]
    slides, none = np.isinf(pitch), np.zeros(len(q))
    advance = np.where(slides, 1.0, np.where(slides, 0.0, pitch)) * q
    return steps[:-1] @ modified_dh_transform(none, none, advance, np.where(slides, 0.0, q)), pitch, steps[-1]


def _at_zero(arm: Arm) -> tuple[Array, Array]:
    """Return a point on each axis at q = 0, (ℓ, 3) [m], and the site's transform there, (4, 4)."""
    points, tip = np.cumsum(arm.chain.step, axis=0), np.eye(4)
    tip[:3, :3], tip[:3, 3] = quat_to_matrix(arm.chain.tip_quat), points[-1] + arm.chain.tip_step
    return points, tip
