"""An arm as a stick figure, with the velocity and force ellipses of its tip."""

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from rmrc.analysis.inspect.inspection import Inspection
from rmrc.analysis.inspect.routes import Array, link_transforms
from rmrc.arm import Arm
from rmrc.show.figures import explain, lettering, plain, save, sheet
from rmrc.show.sheets import number
from rmrc.textbook.ellipsoid import Ellipsoid, ellipsoid_points, force_ellipsoid, velocity_ellipsoid
from rmrc.textbook.reference_frame import rotate_jacobian

# Shares of the arm's length: the length of the longest velocity, and of the longest force; forces longer than
# the third are cut off there.
VELOCITY_SHARE, FORCE_SHARE, CUT_SHARE = 0.25, 0.15, 0.4
# An axis equals the world's up to the rounding of eight digits in a file.
PARALLEL = 1e-7
# Lighter gray for the later configurations, still dark enough on white paper.
LIGHTEST = 0.55
MARKS = {"hinge": "o", "slide": "s", "screw": "D"}


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
    planes = moving_planes(found[0].arm)
    sticks = [skeleton(one) for one in found]
    length = max(float(np.linalg.norm(np.diff(stick, axis=0), axis=1).sum()) for stick in sticks)
    scales = _scales(found, planes, length)
    picture = sheet(7.0 * len(planes), 7.0 + 0.25 * len(found))
    for panel, plane in enumerate(planes):
        axes = picture.add_subplot(1, len(planes), panel + 1)
        for i, (one, stick) in enumerate(zip(found, sticks, strict=True)):
            gray = f"{LIGHTEST * i / max(1, len(found) - 1):.2f}"
            _draw(axes, one, stick, plane, gray, scales, CUT_SHARE * length)
            if len(found) > 1:
                axes.annotate(
                    f"{i + 1}",
                    tuple(stick[-1, plane]),
                    xytext=(7, 7),
                    textcoords="offset points",
                    weight="bold",
                )
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        axes.set_xlabel(f"${'xyz'[plane[0]]}$ [m]")
        axes.set_ylabel(f"${'xyz'[plane[1]]}$ [m]")
        axes.grid(color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
    arm = found[0].arm
    picture.suptitle(plain(f"{arm.path.name}, site {arm.site}"))
    explain(picture, handles=_legend(found, scales, CUT_SHARE * length), loc="outside lower left")
    return picture


def moving_planes(arm: Arm) -> list[list[int]]:
    """Return the planes to draw, two world axes each: that of a planar arm, else x-y and x-z."""
    slides, axis = np.isinf(arm.chain.pitch), np.abs(arm.chain.axis)
    for normal in range(3):
        across = np.all(axis[slides, normal] < PARALLEL)
        if (
            not slides.all()
            and across
            and np.all(axis[~slides, normal] > 1.0 - PARALLEL)
            and "screw" not in arm.kinds
        ):
            return [[i for i in range(3) if i != normal]]
    return [[0, 1], [0, 2]]


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


def _scales(
    found: Sequence[Inspection], planes: Sequence[Sequence[int]], length: float
) -> tuple[float, float]:
    """Return the drawn lengths of 1 m/s and 1 N [m]; 0 if there is nothing to draw."""
    both = [ellipses(one, plane) for one in found for plane in planes]
    fastest = max(velocity.half_axes.max() for velocity, _ in both)
    forces = np.concatenate([force.half_axes[np.isfinite(force.half_axes)] for _, force in both])
    if fastest <= 0.0:
        return 0.0, 0.0
    return _round(VELOCITY_SHARE * length / fastest), _round(FORCE_SHARE * length / float(np.median(forces)))


def _round(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-9)))


def _draw(
    axes: Axes, found: Inspection, stick: Array, plane: list[int], gray: str, scales: tuple[float, float],
    cut: float,
) -> None:  # fmt: skip
    points, tip = stick[:, plane], stick[-1, plane]
    if scales[0] > 0.0:
        velocity, force = (
            Ellipsoid(one.axes, np.minimum(one.half_axes * scale, cut))
            for one, scale in zip(ellipses(found, plane), scales, strict=True)
        )
        for one, style, fill in ((velocity, "-", "0.85"), (force, "--", "none")):
            outline = tip + ellipsoid_points(one, 181)
            axes.add_patch(
                Polygon(
                    outline, facecolor=fill, alpha=0.5 if fill != "none" else None, edgecolor="none", zorder=1
                )
            )
            axes.plot(*outline.T, style, color=gray, linewidth=1.2, zorder=2)
    axes.plot(*points.T, "-", color=gray, linewidth=3.0, solid_capstyle="round", zorder=3)
    axes.plot(*points[0], "^", color=gray, markersize=11, zorder=4)
    for kind, mark in MARKS.items():
        at = points[1:-1][[one == kind for one in found.arm.chain.kinds]]
        axes.plot(
            *at.T, mark, markerfacecolor="white", markeredgecolor=gray, markersize=8, zorder=5, linestyle=""
        )
    axes.plot(*tip, "x", color=gray, markersize=10, markeredgewidth=2.5, zorder=6)


def _legend(found: Sequence[Inspection], scales: tuple[float, float], cut: float) -> list[Line2D]:
    """Return the legend: the marks, the scales of the ellipses, and the numbers of the configurations."""
    arm = found[0].arm
    kinds = set(arm.chain.kinds)
    marks = [("base", "^", "black")]
    marks += [(kind, mark, "white") for kind, mark in MARKS.items() if kind in kinds]
    marks.append(("site", "x", "black"))
    entries = [
        Line2D([], [], color="black", linestyle="", marker=mark, markerfacecolor=fill, label=name)
        for name, mark, fill in marks
    ]
    if scales[0] > 0.0:
        slides = f", slides per {number(found[0].task.length)} m" if arm.is_slide.any() else ""
        norm = f"of norm 1{slides}"
        entries += [
            Line2D([], [], color="black", label=f"velocity for joint rates {norm}: 1 m/s is {scales[0]:g} m"),
            Line2D(
                [], [], color="black", linestyle="--",
                label=f"force for joint torques {norm}: 1 N is {scales[1]:g} m; cut off at {cut:.2g} m",
            ),
        ]  # fmt: skip
    for i, one in enumerate(found):
        which = f"{i + 1}: " if len(found) > 1 else ""
        values = ", ".join(number(value) for value in one.q)
        entries.append(Line2D([], [], linestyle="", label=f"{which}$q$ = {values}"))
    return entries
