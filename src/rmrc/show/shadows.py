"""An arm and its velocity ellipsoids along a path, as shadows on the plane of a figure."""

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.support.spatial import AXES
from rmrc.textbook.ellipsoid import ellipsoid_points, holding_jacobian, velocity_ellipsoid
from rmrc.textbook.screws import geometric_from_screws, space_jacobian

Array = NDArray[np.float64]

# Number of ellipsoids on the way out, beside that at the smallest singular value.
COUNT = 4
# The longest half axis is at most this part of the path's extent. It is the motion at unit-norm joint rates
# in one of these times [s].
PART, TIMES = 0.5, (0.2, 0.1, 0.05, 0.02, 0.01)
# A half axis below this share of the longest is rounding: the ellipsoid lies in the plane.
FLAT = 1e-9


def shadows(run: Run, first: int, second: int) -> tuple[float, list[Array], bool]:
    """Return the shadows of velocity ellipsoids at a few instants, as `velocities` has them.

    The shadow of {M q̇ : ‖q̇‖ = 1} is that of its two rows M_p, an ellipse of the matrix M_p M_pᵀ.

    Args:
        run: The run, with at least one tick.
        first: World axis of the plane.
        second: The other one.

    Returns:
        The time in which a tip at unit-norm joint rates draws them [s], their outlines (p, 3) [m], and
        whether an ellipsoid extends out of the plane, so that its shadow does not show all of it.
    """
    if not run.screws or not {*run.axes} & {"x", "y", "z"}:
        return TIMES[0], [], False
    rows = instants(run)
    M = velocities(run, rows)
    whole = np.linalg.norm(M, axis=(1, 2)).max()
    drawn = M[:, [first, second]]
    longest = float(np.linalg.norm(drawn, ord=2, axis=(1, 2)).max())
    if longest <= FLAT * whole or not whole > 0.0:
        return TIMES[0], [], False
    extent = float(np.ptp(run["pose"][:, :3], axis=0).max())
    time = next((time for time in TIMES if time * longest <= PART * extent), TIMES[-1])
    outlines = []
    for row, both in zip(rows, drawn, strict=True):
        outline = np.tile(run["pose"][row, :3], (73, 1))
        outline[:, [first, second]] += time * ellipsoid_points(velocity_ellipsoid(both), 73)
        outlines.append(outline)
    across = np.delete(M, [first, second], axis=1)
    return time, outlines, bool(np.abs(across).max() > FLAT * whole)


def closest(run: Run) -> int:
    """Return the tick of the smallest singular value."""
    return int(np.argmin(run["sigma"][:, -1]))


def skeleton(run: Run, row: int) -> Array:
    """Return an arm at a tick as a chain of points from its first axis to its tip, (p, 3) [m].

    From the tip inward, each is the point of a joint's axis that is nearest to the one before. A sliding
    joint begins where it would be at 0.

    Args:
        run: One that knows its screws.
        row: The tick.
    """
    q, points = run["q"][row, list(run.leaders)], [run["pose"][row, :3]]
    axes = space_jacobian(run.screws, q).T
    for axis, position in zip(axes[::-1], q[::-1], strict=True):
        turn, speed = axis[:3], axis[3:]
        if size := np.linalg.norm(turn):
            foot = np.cross(turn, speed) / size**2
            points.append(foot + turn * (turn @ (points[-1] - foot)) / size**2)
        else:
            points.append(points[-1] - position * speed)
    return np.array(points[::-1])


def instants(run: Run) -> NDArray[np.intp]:
    """Return a few ticks that are evenly apart along the way out, and that of the smallest singular value."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(run["pose"][:, :3], axis=0), axis=1))])
    rows = np.searchsorted(way, np.linspace(0.0, 0.5 * way[-1], COUNT)).clip(0, len(run) - 1)
    return np.unique([*rows, closest(run)])


def velocities(run: Run, rows: NDArray[np.intp]) -> Array:
    """Return M = J_v S_q (1 − J_w⁺ J_w) along world axes at some ticks, (F, 3, n) [m].

    J_v has the translations of the task, J_w = J_ω S_q its rotations, which are held: without the projector M
    would stay round at a wrist singularity, where translations are only possible with a turn.

    Args:
        run: One that knows its screws.
        rows: Ticks, (F,).
    """
    leaders, pose = list(run.leaders), run["pose"][rows]
    chain = geometric_from_screws(space_jacobian(run.screws, run["q"][rows][:, leaders]), pose[:, :3])
    J = chain @ np.eye(len(run.joints))[leaders] * run.joint_scale  # axes that one joint moves add up
    J = run.view.turned(J, pose)
    axes = np.array([AXES.index(axis) for axis in run.axes])
    M = np.zeros((len(rows), 3, len(run.joints)))
    M[:, axes[axes < 3]] = holding_jacobian(J[:, axes[axes < 3]], J[:, axes[axes > 2]])
    return run.view.back(M, pose)
