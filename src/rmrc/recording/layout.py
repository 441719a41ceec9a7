"""How a recording looks: colors, shapes, the legend, and the layout that opens by itself."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, cast

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint.archetypes import ViewBlueprint

from rmrc.recording.scene import FORCE_EQUAL, FORCE_LONGEST, VELOCITY_SECONDS, Scene
from rmrc.recording.shapes import Shape
from rmrc.show.palette import GREEN, RED, WHITE, mix
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import rotate

# The viewer's vertical angle of view. Least width over height of the picture in windows of 1280 × 720 and of
# 1600 × 1000 points, less a margin: of a run, and of a comparison, whose texts may take less room.
VIEW_ANGLE = np.radians(55.0)
VIEW_ASPECT, ASPECT_COMPARED = 0.97, 0.88
# Share of the height for the points; their shapes extend beyond them, and the viewer's window may be wider.
VIEW_HEIGHT = 0.92

# Number of positions in the static line of the target path.
PATH_POINTS = 300

# Least distance from the tip to the edge of its label, as a part of the reach.
CALLOUT = 0.2
# Number of cells in the height of the picture for the search of a place for the label. In heights of the
# picture in a window of 1280 × 720: half the height of the label, half the width of a letter, the distance of
# the label below its point, where the viewer writes it, and the least distance of its edge from the tip.
CELLS, HALF_LINE, HALF_LETTER, BELOW, APART = 48, 0.03, 0.009, 0.03, 0.1

# Opacity of the arm at the law's assumed configuration.
PALE = 0.3

# Position, orientation and size in the numbers of a shape.
PARTS = (slice(0, 3), slice(3, 7), slice(7, 10))

# 0xRRGGBBAA; only in the picture, which is dark in both themes.
PINK, YELLOW, CYAN, GHOSTLY = 0xE77BCBFF, 0xFFD60AFF, 0x3DC9FFFF, 0xB8B8B8FF

LEGEND = f"""\
| in the picture | is |
|---|---|
| **white line** | path of the target; **white ball**: target, if the tip lags |
| **trail**, **ball** | end effector (tip), past and now; **red** near a singularity |
{{pale}}| **green ellipsoid** | tip velocities at unit-norm joint rates; **flat**: lost |
| **pink wires** | tip forces at unit-norm joint torques |
| **thick double arrow** | direction lost first (u_min); **red** as σ_min goes to 0 |
| **thin double arrow** | its rotational part, as an axis; from cyan to red |

Green half axes: {VELOCITY_SECONDS:g} s · σ_i. Pink: c/σ_i, as long as the green ones at \
σ = {FORCE_EQUAL:g} of the reach, at most {FORCE_LONGEST:g} of the reach.
σ_i here are those of the translations that the task has, with its rotations held; joint rates and \
torques have norm 1.
Plots: bold is measured, pale is commanded{{arriving}}, in the color of the joint; links and axes have the \
joints' colors.
"""


PALE_ARM = "| **pale arm** | the arm as the controller sees it |\n"


def legend(prepared: Prepared, has_baseline: bool = False) -> str:
    """Return the texts of the picture and of its plots."""
    changes = ", ".join(f"{key} {value}" for key, value in prepared.scenario.baseline.items())
    ghostly = f"| **gray ghost**, **thin gray trail** | the baseline: {changes} |\n" * has_baseline
    arriving = "" if prepared.hardware.is_direct else ", dark is received by the plant"
    return LEGEND.format(arriving=arriving, pale=PALE_ARM * prepared.hardware.is_misled + ghostly)


def geometries(shapes: Sequence[Shape], has_outlines: bool = False) -> dict[str, list[rr.AsComponents]]:
    """Return the shapes of a body in rerun's form, by the ends of their entities.

    All shapes of a kind are one batch of the body itself. A batch takes a kilobyte or two, as one shape does.
    A mesh has an entity of its own.
    """
    alike, found = dict[str, list[Shape]](), dict[str, list[rr.AsComponents]]()
    for shape in shapes:
        if shape.kind == "mesh":
            found[f"/{rr.escape_entity_path_part(shape.name)}"] = [_mesh(shape)]
        else:
            alike.setdefault("ellipsoid" if shape.kind == "sphere" else shape.kind, []).append(shape)
    if alike:
        found[""] = [_batch(kind, some, has_outlines) for kind, some in alike.items()]
    return found


def _batch(kind: str, shapes: Sequence[Shape], has_outlines: bool) -> rr.AsComponents:
    """Return the shapes of one kind; MuJoCo's sizes are half sizes."""
    position, quat, size = (np.array([(*one.pose, *one.size) for one in shapes])[:, part] for part in PARTS)
    colors = [(one.rgba * 255).round().astype(np.uint8) for one in shapes]
    mode = rr.components.FillMode.MajorWireframe if has_outlines else rr.components.FillMode.Solid
    look: dict[str, Any] = {"colors": colors, "quaternions": xyzw(quat), "fill_mode": mode}
    radius, half = size[:, 0], size[:, 1]
    if kind == "capsule":  # rerun's begins at its origin, MuJoCo's is centered
        start = position - rotate(quat, half[:, None] * [0.0, 0.0, 1.0])
        return rr.Capsules3D(lengths=2 * half, radii=radius, translations=start, **look)
    if kind == "cylinder":
        return rr.Cylinders3D(lengths=2 * half, radii=radius, centers=position, **look)
    if kind == "box":
        return rr.Boxes3D(half_sizes=size, centers=position, **look)
    is_round = np.array([[one.kind == "sphere"] for one in shapes])
    return rr.Ellipsoids3D(half_sizes=np.where(is_round, radius[:, None], size), centers=position, **look)


def _mesh(shape: Shape) -> rr.AsComponents:
    """Return a mesh, always solid."""
    vertices = shape.pose[:3] + rotate(shape.pose[3:], shape.vertices)
    color = (shape.rgba * 255).round().astype(np.uint8)
    return rr.Mesh3D(vertex_positions=vertices, triangle_indices=shape.faces, albedo_factor=color)


def marks(scene: Scene) -> dict[str, rr.AsComponents]:
    """Return the target path, and the styles of everything that moves at the tip, by entity."""
    thin = 0.004 * scene.reach
    fill, wires = rr.components.FillMode.TransparentFillMajorWireframe, rr.components.FillMode.MajorWireframe
    return {
        "target/path": path_line(scene),
        "target/now": rr.Points3D.from_fields(colors=WHITE, radii=4 * thin),
        "tip/now": rr.Points3D.from_fields(colors=YELLOW, radii=5.5 * thin),
        "tip/trail": rr.LineStrips3D.from_fields(radii=1.6 * thin),
        "tip/velocity_ellipsoid": rr.Ellipsoids3D.from_fields(
            colors=GREEN, line_radii=0.7 * thin, fill_mode=fill
        ),
        "tip/force_ellipsoid": rr.Ellipsoids3D.from_fields(
            colors=PINK, line_radii=0.7 * thin, fill_mode=wires
        ),
    }


def path_line(scene: Scene, color: int = WHITE) -> rr.LineStrips3D:
    """Return the target path."""
    line = scene.path[np.linspace(0, len(scene.path) - 1, PATH_POINTS).round().astype(int)]
    return rr.LineStrips3D([line], colors=color, radii=0.0028 * scene.reach)


def ghost(shape: Shape) -> Shape:
    """Return a shape of the arm at the law's assumed configuration, in its pale style."""
    return replace(shape, rgba=np.array([*shape.rgba[:3], PALE * shape.rgba[3]]))


def pictures(
    scene: Scene,
    prepared: Prepared,
    seen: Sequence[NDArray[np.float64]],
    look: tuple[str, NDArray[np.float64]] | None = None,
    more: Sequence[str] = (),
) -> list[rrb.Spatial3DView]:
    """Return the picture with everything in its frame, and one of the instant to look at.

    Args:
        scene: The arm and its path.
        prepared: The world.
        seen: Points that the run reaches, (p, 3) each [m].
        look: Name of the second one, and the points in its frame, (p, 3) [m].
        more: Other entities to show.
    """
    points = np.vstack([scene.points, *seen])
    frames = {f"{prepared.scenario.name}: {prepared.scenario.control.inverse.method}": points}
    frames |= dict([look]) if look else {}
    return [
        rrb.Spatial3DView(
            name=name,
            contents=[
                *("/arm/**", "/target/**", "/tip/**"),
                *(["/believed/**"] * prepared.hardware.is_misled),
                *more,
            ],
            overrides={f"{begin}tip/trail": until_now() for begin in ("", *(["baseline/"] if more else []))},
            eye_controls=eye(framed, scene.normal),
            line_grid=grid(points),
            background=backdrop(),
        )
        for name, framed in frames.items()
    ]


def aside(
    tip: NDArray[np.float64],
    text: str,
    scene: Scene,
    framed: NDArray[np.float64],
    taken: NDArray[np.float64],
    aspect: float = VIEW_ASPECT,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the nearest free place for a text beside the tip, and the end of a line to it, (3,) each.

    Both are as far from the eye as the tip.

    Args:
        tip: (3,) [m].
        text: The text.
        scene: The arm and its path.
        framed: Points in the frame of the picture, (p, 3) [m].
        taken: Points that the text must not cover, (p, 3) [m].
        aspect: Width of the picture over its height.
    """
    axes, (center, distance) = screen(scene.normal), view(framed, scene.normal, aspect)
    height = 2.0 * np.tan(VIEW_ANGLE / 2)
    size = np.array([int(CELLS * aspect), CELLS])

    def cells(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return points in cells from the lower left corner, (p, 2), and their distances from the eye."""
        seen = (points - center) @ axes.T
        away = distance - seen[:, 2]
        return CELLS * (seen[:, :2] / away[:, None] / height) + size / 2, away

    at = cells(np.vstack([taken, scene.path]))[0].astype(int)
    is_taken = np.zeros(size, dtype=int)
    is_taken[tuple(at[((at >= 0) & (at < size)).all(axis=1)].T)] = 1
    half = np.ceil(CELLS * np.array([HALF_LETTER * len(text), HALF_LINE])).astype(int)
    sums = np.pad(is_taken.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    wide, high = 2 * half + 1
    counts = sums[wide:, high:] - sums[:-wide, high:] - sums[wide:, :-high] + sums[:-wide, :-high]
    places = np.argwhere(counts == counts.min()) + half + 0.5
    (own,), (away,) = cells(tip[None])
    cell = height * away / CELLS
    # the nearest place beyond the ellipsoids around the tip, or else the farthest place
    gap = np.linalg.norm(np.maximum(np.abs(places - own) - half, 0.0), axis=1)
    far = gap - max(CALLOUT * scene.reach / cell, APART * CELLS)
    place = places[np.where(far >= 0.0, far, 2 * CELLS - far).argmin()]
    # the text is at most as large as that, and smaller in a larger window: it hides a line that is too long
    ends = np.array([place, np.clip(own, place - half / 3, place + half / 3)])
    ends[0, 1] += BELOW * CELLS
    there = tip + cell * (ends - own) @ axes[:2]
    return there[0], there[1]


def callout(
    tip: NDArray[np.float64],
    text: str,
    scene: Scene,
    place: tuple[NDArray[np.float64], NDArray[np.float64]],
    color: int = WHITE,
) -> dict[str, list[rr.AsComponents]]:
    """Return a ball where the tip is, (3,), and a line from it to a text, by the ends of their entities.

    Without a text, the ball alone. The place is that of `aside`.
    """
    ball, thin = 0.01 * scene.reach, 0.0015 * scene.reach
    found: dict[str, list[rr.AsComponents]] = {"": [rr.Points3D([tip], colors=color, radii=ball)]}
    if text:
        line = rr.LineStrips3D([[tip, place[1]]], colors=mix(color, WHITE, 0.5), radii=thin)
        # The viewer puts words on gray in the light theme, where only white is legible.
        words = rr.Points3D([place[0]], colors=WHITE, radii=thin, labels=[text], show_labels=True)
        found["/text"] = [line, words]
    return found


def backdrop() -> rrb.Background:
    """Return the background of the picture: the same dark color in both themes, to show the path."""
    return rrb.Background(kind=rrb.BackgroundKind.SolidColor, color=[13, 16, 17])


def page(
    pictures: Sequence[rrb.Spatial3DView],
    titles: dict[str, str],
    plots: rrb.Vertical,
    now: str = "",
    texts_share: float = 2.1,
) -> rrb.Blueprint:
    """Return a layout: the picture with its texts at the left, the plots at the right, and no panels.

    Args:
        pictures: The 3-D view, and perhaps one of the instant to look at, in a tab behind it.
        titles: Titles of the texts, by the name of their entity.
        plots: The plots, from the top.
        now: Entity of the line of numbers, if there is one.
        texts_share: Share of the height, of 10 in all.
    """
    left: list[rrb.View | rrb.Container] = [rrb.Tabs(*pictures) if len(pictures) > 1 else pictures[0]]
    if now:
        left.append(rrb.TextDocumentView(origin=now, name="Now", titlebar=False))
    texts = rrb.Tabs(
        *(rrb.TextDocumentView(origin=f"/text/{name}", name=title) for name, title in titles.items())
    )
    return Page(
        rrb.Horizontal(
            rrb.Vertical(*left, texts, row_shares=[9 - texts_share, *[1.15] * bool(now), texts_share]),
            plots,
            column_shares=[8, 12],
        ),
        *_panels(),
        auto_views=False,
        auto_layout=False,
    )


class Page(rrb.Blueprint):
    """A layout with one write for each of its entities, and without the viewer's own defaults.

    Each write takes a kilobyte or two, and each component of an entity takes another. Rerun itself writes a
    curve in several writes, and each takes time.
    """

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.set_log_time_enabled(False)
        writes = _Writes()
        super()._log_to_stream(cast(rr.RecordingStream, writes))
        for (path, static), what in writes.found.items():
            stream.log(path, *what, static=static)


class _Writes:
    """The writes of a layout, by entity, and whether they are static."""

    def __init__(self) -> None:
        self.found: dict[tuple[str, bool], list[rr.AsComponents]] = {}

    def log(self, path: str, what: rr.AsComponents, *, static: bool = False) -> None:
        origin = what.space_origin if isinstance(what, ViewBlueprint) else None
        if origin is not None and origin.as_arrow_array().to_pylist() == ["/"]:
            cast(ViewBlueprint, what).space_origin = None
        self.found.setdefault((path, static), []).append(what)


def opening(picture: rrb.Spatial3DView) -> rrb.Blueprint:
    """Return the layout of a page while it loads the rest: the picture alone."""
    return Page(picture, *_panels(), auto_views=False, auto_layout=False)


def _panels() -> tuple[rrb.BlueprintPanel, rrb.SelectionPanel, rrb.TimePanel]:
    """Return the viewer's own panels, closed, and have it play."""
    return (
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="playing", loop_mode="all"),
    )


def until_now() -> rrb.VisibleTimeRanges:
    """Return the visible part of a trail: all of it up to the cursor."""
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(
                "sim_time",
                start=rrb.TimeRangeBoundary.infinite(),
                end=rrb.TimeRangeBoundary.cursor_relative(),
            )
        ]
    )


def screen(normal: int | None) -> NDArray[np.float64]:
    """Return the axes of the picture, to the right, up and to the eye, (3, 3).

    The view of a planar arm is almost along its normal axis; that of the others is oblique.
    """
    toward = {None: (0.75, -1.0, 0.55), 0: (1.0, -0.2, 0.2), 1: (0.2, -1.0, 0.2), 2: (0.0, -0.25, 1.0)}
    direction = np.array(toward[normal]) / np.linalg.norm(toward[normal])
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(direction, right), direction])


def view(points: NDArray[np.float64], normal: int | None, aspect: float) -> tuple[NDArray[np.float64], float]:
    """Return the center, (3,), and the distance of the eye that has all points (p, 3) in its frame."""
    axes = screen(normal)
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    across = np.abs(seen - middle)[:, :2] / [aspect, VIEW_HEIGHT]
    distance = (across.max(axis=1) / np.tan(VIEW_ANGLE / 2) + (seen - middle)[:, 2]).max()
    return middle @ axes, float(distance)


def eye(points: NDArray[np.float64], normal: int | None, aspect: float = VIEW_ASPECT) -> rrb.EyeControls3D:
    """Return the eye that has all points (p, 3) in its frame."""
    center, distance = view(points, normal, aspect)
    return rrb.EyeControls3D(
        position=center + distance * screen(normal)[2],
        look_target=center,
        eye_up=(0.0, 0.0, 1.0),
    )


def grid(points: NDArray[np.float64]) -> rrb.LineGrid3D:
    """Return a floor below all points, (p, 3)."""
    plane = rr.components.Plane3D.XY.with_distance(float(points[:, 2].min()))
    return rrb.LineGrid3D(plane=plane, color=[255, 255, 255, 30])


def xyzw(quat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return quaternions w x y z in rerun's order."""
    return quat[..., [1, 2, 3, 0]]


def packed(colors: Sequence[int]) -> NDArray[np.uint32]:
    """Return colors 0xRRGGBBAA in rerun's form; it would take three integers for red, green and blue."""
    return np.array(colors, np.uint32)


@cache
def _ramp(calm: int) -> NDArray[np.uint32]:
    return packed([mix(calm, RED, part) for part in np.linspace(0, 1, 65)])


def ramp(nearness: NDArray[np.float64], calm: int) -> NDArray[np.uint32]:
    """Return colors from calm (0) to red (1)."""
    colors: NDArray[np.uint32] = _ramp(calm)[(nearness * 64).round().astype(int)]
    return colors
