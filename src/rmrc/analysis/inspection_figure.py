"""An arm as a stick figure, with the velocity and force ellipses of its tip."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rmrc.analysis.inspection import Inspection
from rmrc.arm import Arm
from rmrc.law.task import Array
from rmrc.show.figures import explain, lettering, plain, save, sheet
from rmrc.show.sheets import number
from rmrc.textbook.singularity import Ellipsoid, ellipsoid_points, force_ellipsoid, velocity_ellipsoid

# Shares of the arm's length: the longest velocity, the middle force, and where longer forces are cut off.
VELOCITY_SHARE, FORCE_SHARE, CUT_SHARE = 0.25, 0.15, 0.4
# An axis equals the world's up to the rounding of eight digits in a file.
PARALLEL = 1e-7


def draw_arm(found: Inspection, path: Path) -> None:
    """Draw an arm at one configuration, with its velocity and force ellipses.

    A planar arm is drawn in its plane of motion, any other in the planes x-y and x-z. The velocity ellipse is
    the projection of the ellipsoid for unit-norm joint rates; the force ellipse holds the forces in the plane
    that unit-norm joint torques balance.

    Args:
        found: The arm at a configuration.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    with lettering():
        save(figure(found), [path])


def figure(found: Inspection) -> Figure:
    """Return the figure for `draw_arm`."""
    arm, points, planes = found.arm, skeleton(found), moving_planes(found.arm)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    drawn = [ellipses(found, plane) for plane in planes]
    speeds, forces = (np.concatenate([pair[i].half_axes for pair in drawn]) for i in (0, 1))
    per_speed = per_force = 0.0  # of a site that stands still
    if speeds.max() > 0.0:
        per_speed = float(f"{VELOCITY_SHARE * length / speeds.max():.0e}")
        per_force = float(f"{FORCE_SHARE * length / np.median(forces[np.isfinite(forces)]):.0e}")
    cut = CUT_SHARE * length
    picture = sheet(7.0 * len(planes), 7.25)
    for panel, (plane, (velocity, force)) in enumerate(zip(planes, drawn, strict=True)):
        axes = picture.add_subplot(1, len(planes), panel + 1)
        longest = np.minimum(force.half_axes, cut / per_force if per_force else 0.0)
        for directions, sizes, style, what in (
            (velocity.axes, per_speed * velocity.half_axes, "-", f"velocity: 1 m/s is {per_speed:g} m"),
            (force.axes, per_force * longest, "--", f"force: 1 N is {per_force:g} m; cut off at {cut:.2g} m"),
        ):
            outline = points[-1, plane] + ellipsoid_points(Ellipsoid(directions, sizes), 181)
            axes.plot(*outline.T, style, color="0.4", linewidth=1.2, label=what)
        axes.plot(*points[:, plane].T, "o-", color="0.0", linewidth=3.0, label="base and joints")
        axes.plot(*points[-1, plane], "X", color="0.0", markersize=10, label="site")
        axes.set(aspect="equal", adjustable="datalim")
        axes.set(xlabel=f"${'xyz'[plane[0]]}$ [m]", ylabel=f"${'xyz'[plane[1]]}$ [m]")
        axes.margins(0.08)
        axes.grid(color="0.9", linewidth=0.8)
    slides = f", slides per {number(found.task.length)} m" if arm.is_slide.any() else ""
    place = f"$q$ = {', '.join(map(number, found.q))}; joint rates and torques of norm 1{slides}"
    picture.suptitle(f"{plain(f'{arm.path.name}, site {arm.site}')}\n{place}")
    explain(picture, handles=picture.axes[0].get_legend_handles_labels()[0], loc="outside lower left")
    return picture


def moving_planes(arm: Arm) -> list[list[int]]:
    """Return the planes to draw, two world axes each: that of a planar arm, else x-y and x-z."""
    largest = np.abs(arm.proportions.jacobian[:, :3]).max(axis=(0, 2))
    still = largest <= PARALLEL * largest.max()
    return [np.flatnonzero(~still).tolist()] if still.sum() == 1 else [[0, 1], [0, 2]]


def skeleton(found: Inspection) -> Array:
    """Return the points of a stick figure: base, a point on each axis, site, (ℓ + 2, 3) [m]."""
    data = found.arm.data_at(found.arm.configuration(found.q))
    wiring = found.arm.wiring
    return np.vstack([data.xpos[wiring.base], data.xanchor[wiring.axis], found.pose[:3]])


def ellipses(found: Inspection, plane: Sequence[int]) -> tuple[Ellipsoid, Ellipsoid]:
    """Return the velocity ellipse and the force ellipse in a plane of the world's axes [m/s], [N]."""
    J = found.arm.jacobian(found.q)[list(plane)] * found.task.joint_scale
    return velocity_ellipsoid(J), force_ellipsoid(J)
