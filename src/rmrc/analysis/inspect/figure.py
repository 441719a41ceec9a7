"""An arm as a stick figure, with the velocity and force ellipses of its tip."""

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rmrc.analysis.inspect.inspection import Inspection
from rmrc.analysis.routes import link_transforms
from rmrc.arm import Arm
from rmrc.law.task import Array
from rmrc.show.figures import explain, lettering, plain, save, sheet
from rmrc.show.sheets import number
from rmrc.textbook.ellipsoid import Ellipsoid, ellipsoid_points, force_ellipsoid, velocity_ellipsoid
from rmrc.textbook.reference_frame import rotate_jacobian

# Shares of the arm's length: the longest velocity, the middle force, and where longer forces are cut off.
VELOCITY_SHARE, FORCE_SHARE, CUT_SHARE = 0.25, 0.15, 0.4
# An axis equals the world's up to the rounding of eight digits in a file.
PARALLEL = 1e-7
# Lighter gray for the later configurations, still dark enough on white paper.
LIGHTEST = 0.55
TINY = 1e-300
MARKS = (("base", "^", 15, [0]), ("joint", "o", 8, slice(1, -1)), ("site", "X", 10, [-1]))


def draw_arm(found: Sequence[Inspection], path: Path) -> None:
    """Draw one arm at one configuration or several, with its velocity and force ellipses.

    A planar arm is drawn in its plane of motion, any other in the planes x-y and x-z. The velocity ellipse is
    the projection of the ellipsoid for unit-norm joint rates; the force ellipse holds the forces in the plane
    that unit-norm joint torques balance.

    Args:
        found: Inspections of one arm, one or more.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    with lettering():
        save(figure(found), [path])


def figure(found: Sequence[Inspection]) -> Figure:
    """Return the figure for `draw_arm`."""
    arm, planes = found[0].arm, moving_planes(found[0].arm)
    sticks = [skeleton(each) for each in found]
    length = max(float(np.linalg.norm(np.diff(stick, axis=0), axis=1).sum()) for stick in sticks)
    scales = _scales([ellipses(each, plane) for each in found for plane in planes], length)
    slides = f", slides per {number(found[0].task.length)} m" if arm.is_slide.any() else ""
    words = (
        f"velocity for joint rates of norm 1{slides}: 1 m/s is {scales[0]:g} m",
        f"force for joint torques of norm 1{slides}: 1 N is {scales[1]:g} m; "
        f"cut off at {CUT_SHARE * length:.2g} m",
    )
    picture = sheet(7.0 * len(planes), 7.0 + 0.25 * len(found))
    for panel, plane in enumerate(planes):
        axes = picture.add_subplot(1, len(planes), panel + 1)
        for i, (each, stick) in enumerate(zip(found, sticks, strict=True)):
            points, gray = stick[:, plane], f"{LIGHTEST * i / max(1, len(found) - 1):.2f}"
            hidden = "_" * (i > 0)  # the legend has each mark once
            for some, scale, style, text in zip(
                ellipses(each, plane), scales, ("-", "--"), words, strict=True
            ):
                sizes = np.minimum(some.half_axes, CUT_SHARE * length / max(scale, TINY)) * scale
                outline = points[-1] + ellipsoid_points(Ellipsoid(some.axes, sizes), 181)
                axes.plot(*outline.T, style, color=gray, linewidth=1.2, label=hidden + text)
            for name, mark, size, at in MARKS:
                axes.plot(*points[at].T, mark, color=gray, markersize=size, label=hidden + name)
            positions = f"{i + 1}: $q$ = {', '.join(map(number, each.q))}"
            axes.plot(*points.T, "-", color=gray, linewidth=3.0, label=positions)
            axes.annotate(f"{i + 1}", points[-1], (7, 7), textcoords="offset points", weight="bold")
        axes.set(aspect="equal", adjustable="datalim")
        axes.set(xlabel=f"${'xyz'[plane[0]]}$ [m]", ylabel=f"${'xyz'[plane[1]]}$ [m]")
        axes.margins(0.08)
        axes.grid(color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
    picture.suptitle(plain(f"{arm.path.name}, site {arm.site}"))
    explain(picture, handles=picture.axes[0].get_legend_handles_labels()[0], loc="outside lower left")
    return picture


def moving_planes(arm: Arm) -> list[list[int]]:
    """Return the planes to draw, two world axes each: that of a planar arm, else x-y and x-z."""
    largest = np.abs(arm.proportions.jacobian[:, :3]).max(axis=(0, 2))
    still = largest <= PARALLEL * largest.max()
    return [np.flatnonzero(~still).tolist()] if still.sum() == 1 else [[0, 1], [0, 2]]


def skeleton(found: Inspection) -> Array:
    """Return the points of a stick figure: base, a point on each axis, site, (ℓ + 2, 3) [m]."""
    arm = found.arm
    poses, _ = arm.frames(arm.configuration(found.q)[None])
    frames = accumulate(link_transforms(arm, found.q)[0], np.matmul)
    return np.array([poses[0, arm.wiring.base, :3], *(T[:3, 3] for T in frames), found.pose[:3]])


def ellipses(found: Inspection, plane: Sequence[int]) -> tuple[Ellipsoid, Ellipsoid]:
    """Return the velocity ellipse and the force ellipse in a plane of the world's axes [m/s], [N]."""
    J = rotate_jacobian(found.jacobian, found.R_world_frame)[list(plane)] * found.task.joint_scale
    return velocity_ellipsoid(J), force_ellipsoid(J)


def _scales(drawn: Sequence[tuple[Ellipsoid, Ellipsoid]], length: float) -> tuple[float, float]:
    """Return the drawn lengths of 1 m/s and 1 N [m], of one digit; 0 if the site stands still."""
    speeds, forces = (np.concatenate([pair[i].half_axes for pair in drawn]) for i in (0, 1))
    if speeds.max() <= 0.0:
        return 0.0, 0.0
    middle = np.median(forces[np.isfinite(forces)])
    velocity, force = VELOCITY_SHARE * length / speeds.max(), FORCE_SHARE * length / middle
    return float(f"{velocity:.0e}"), float(f"{force:.0e}")
