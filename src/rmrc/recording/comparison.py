"""The runs of a comparison as one recording: all arms in one picture, each in its color.

Entities; `<variant>` is the label of a variant, and what stands below it is as in a recording of one run:

    variants/<variant>/columns/<name>   every column of the run at every tick, bit for bit
    variants/<variant>/arm/<body>       poses, with the geometries in the color of the variant
    variants/<variant>/tip/..           position and trail
    variants/<variant>/path             the target path, if it is not that of the first variant
    variants/<variant>/believed/<body>  the same, pale, where the law takes the arm to be, if elsewhere
    variants/<variant>/fastest          largest |joint rate|
    variants/<variant>/waiting          largest |qdot_cmd − qdot_arrived|, where commands do not just arrive
    variants/<variant>/belief           largest |q_believed − q| [mrad or mm], where the law is misled
    variants/<variant>/sigma_min        smallest singular value
    variants/<variant>/error/..         position [mm] and rotation [mrad], of the axes that the task has
    status/<variant>                    one lane each, only where it changes
    target/path                         the target path of the first variant
    text/..                             legend, table, scenario
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rmrc.arm import Shape
from rmrc.recording import stream
from rmrc.recording.layout import (
    PALE_ARM,
    STATUS_COLORS,
    eye,
    grid,
    packed,
    page,
    path_line,
    plot,
    time_axis,
    until_now,
)
from rmrc.recording.scene import Frames, Scene
from rmrc.recording.stream import Stream, Values
from rmrc.recording.track import Track, prefix_of
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.palette import WHITE, distinct, mix
from rmrc.simulation.prepare import Prepared

# Arms that coincide would flicker or hide each other. So each variant is thinner than the one before, down to
# this share, and all but the last are glass, at least so dense.
THINNEST = 0.4
FAINTEST = 0.25

# Trails that coincide are drawn above each other, so far apart as a share of the reach: less than a pixel.
LIFT = 3e-4

# Pixels of the curves; those drawn first are wider, and so leave a border to be seen.
WIDEST, NARROWEST = 5.5, 2.0

# Plots of what stands between law and plant, where any variant has it.
WAITING, BELIEF = "Commanded, and not arrived", "Joints as the law takes them, less what they are"

LEGEND = """\
Each variant has its color, in the picture and in the plots, whose legends name them.

| in the picture | is |
|---|---|
| **white line** | the path that the tips shall follow |
| **trail**, **ball** | where a tip has been, and is |
{pale}
Where arms coincide, the first variant is the outermost glass, and the last one is the core.
"""


class Overlay:
    """Writes the runs of several variants, block by block.

    Use it as a context manager. Left without `finish`, it keeps and closes `part_path`.

    Attributes:
        path: Where the finished recording appears.
        part_path: Where it grows until then.
    """

    def __init__(self, path: Path, name: str, variants: Sequence[tuple[str, Prepared]]) -> None:
        """Open the file, and write all that is known before the runs.

        Args:
            path: Of the finished recording, ending in `.rrd`; its folder is made if needed.
            name: Of what is compared.
            variants: Label and world of each; no two labels are equal.

        Raises:
            RecordingError: The file cannot be made.
        """
        labels = [label for label, _ in variants]
        scenes = [Scene(prepared) for _, prepared in variants]
        self._out = Stream(path, name, _layout(name, labels, [one for _, one in variants], scenes))
        self.path, self.part_path = self._out.path, self._out.part_path
        self._arms: list[_Arm] = []
        first = variants[0][1].reference.pose
        self._out.log("target/path", path_line(scenes[0]))
        drawn = sorted(map(prefix_of, labels))  # the viewer's own order
        for i, (label, prepared) in enumerate(variants):
            look = _look(i, drawn.index(prefix_of(label)), len(variants))
            self._arms.append(_Arm(self._out, prepared, label, look))
            if not np.array_equal(prepared.reference.pose, first):
                self._out.log(f"{prefix_of(label)}path", path_line(scenes[i], mix(look.color, WHITE, 0.5)))
        is_misled = any(prepared.hardware.is_misled for _, prepared in variants)
        self._out.log_text("text/legend", LEGEND.format(pale=PALE_ARM * is_misled))
        self._out.log_text("text/scenario", _scenarios(variants))

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file; what was written stays in `part_path` if `finish` was not called."""
        self._out.close()

    def write(self, variant: int, part: Run) -> None:
        """Write and flush one block of ticks; the blocks of a variant come in order.

        Args:
            variant: Which, in the order of `variants`.
            part: A run that holds only the ticks of this block.

        Raises:
            RecordingError: The file cannot be written.
        """
        self._arms[variant].write(part)
        self._out.flush()

    def finish(self, table_markdown: str) -> None:
        """Add the table, close the file and move it to `path`.

        Args:
            table_markdown: Shown below the picture.

        Raises:
            RecordingError: The file cannot be written.
        """
        for arm in self._arms:
            arm.write_last()
        self._out.log_text("text/table", table_markdown)
        self._out.finish()


@dataclass(frozen=True)
class _Look:
    color: int
    thickness: float  # of arm and trail, as a share
    opacity: float  # of the arm
    lift: float  # of the trail, in reaches
    width: float  # of the curves, in pixels


def _look(i: int, drawn: int, count: int) -> _Look:
    """Return the look of variant i, which the viewer draws as number `drawn` of so many."""
    last = max(1, count - 1)
    return _Look(
        color=distinct(count)[i],
        thickness=1.0 - (1.0 - THINNEST) * i / last,
        opacity=1.0 if i == count - 1 else max(FAINTEST, 1.0 / count),
        lift=LIFT * i,
        width=WIDEST - (WIDEST - NARROWEST) * drawn / last,
    )


class _Arm(Track):
    """The track of one variant, with the few curves in which variants are compared."""

    def __init__(self, out: Stream, prepared: Prepared, label: str, look: _Look) -> None:
        super().__init__(out, prepared, prefix_of(label))
        self._look = look
        self._lane = f"status/{rr.escape_entity_path_part(label)}"
        self._states: dict[str, int] = {}
        self._status: int | None = None
        self.write_arm(self._painted)
        thin = 0.004 * self.scene.reach * look.thickness
        self._log("tip/now", rr.Points3D.from_fields(colors=look.color, radii=5.5 * thin))
        self._log("tip/trail", rr.LineStrips3D.from_fields(radii=2.5 * thin))
        self._log("tip/trail", rr.Transform3D(translation=[0.0, 0.0, look.lift * self.scene.reach]))
        for name in ("fastest", *self._only_here(), "sigma_min", "columns/damping", *self._errors()):
            curve = rr.SeriesLines(names=[label], colors=packed([look.color]), widths=look.width)
            self._log(name, curve)

    def write_block(self, part: Run, ticks: NDArray[np.int64]) -> None:
        super().write_block(part, ticks)
        curves = {"fastest": np.abs(part["qdot"]).max(axis=1), "sigma_min": part["sigma"][:, -1]}
        for name, (column, other, factor) in self._only_here().items():
            curves[name] = factor * np.abs(part[column] - part[other]).max(axis=1)
        for name, rows in self._errors().items():
            curves[name] = 1e3 * np.linalg.norm(part["pose_error"][:, rows], axis=1)
        index = stream.index(ticks, part["time"])
        for name, values in curves.items():
            self.send(name, index, Values(stream.SCALARS, values))
        self._write_status(part, ticks)

    def write_divergence(self, text: str, index: list[rr.TimeColumn]) -> None:
        self._write_states([text], [STATUS_COLORS[Status.SINGULAR]], index)

    def trail_colors(self, frames: Frames) -> NDArray[np.uint32]:
        return np.full(len(frames.tip), self._look.color, np.uint32)

    def _painted(self, shape: Shape) -> Shape:
        """Return a geometry in the color of the variant; light and dark ones stay apart."""
        light = float(np.dot(shape.rgba[:3], [0.3, 0.59, 0.11]))
        tint = mix(self._look.color, WHITE if light > 0.5 else 0x000000FF, 0.6 * abs(light - 0.5))
        channels = [(tint >> shift & 255) / 255.0 for shift in (24, 16, 8)]
        size = shape.size.copy()
        size[: 1 if shape.kind == "capsule" else 3] *= self._look.thickness
        return replace(shape, rgba=np.array([*channels, self._look.opacity]), size=size)

    def _write_status(self, part: Run, ticks: NDArray[np.int64]) -> None:
        status = part.columns["status"].astype(np.int64)
        before = -1 if self._status is None else self._status
        rows = np.flatnonzero(np.diff(status, prepend=before))
        self._status = int(status[-1])
        if not len(rows):
            return
        states = [Status(int(status[row])) for row in rows]
        # The gravest one gives the color: the last that is set.
        colors = [[color for flag, color in STATUS_COLORS.items() if flag in state][-1] for state in states]
        texts = [", ".join(str(flag.name) for flag in state) or "OK" for state in states]
        self._write_states(texts, colors, stream.index(ticks[rows], part["time"][rows]))

    def _write_states(self, states: list[str], colors: list[int], index: list[rr.TimeColumn]) -> None:
        known = self._states | dict(zip(states, colors, strict=True))
        if known != self._states:
            self._states = known
            look = rr.StateConfiguration(values=list(known), colors=packed(list(known.values())))
            self.out.log(self._lane, look)
        self.out.send(self._lane, index, rr.StateChange.columns(state=states))

    def _errors(self) -> dict[str, list[int]]:
        rows = {"error/position": self.translations, "error/rotation": self.rotations}
        return {name: some for name, some in rows.items() if some}

    def _only_here(self) -> dict[str, tuple[str, str, float]]:
        """Return the curves of what stands between law and plant here: of which columns, and a factor."""
        hardware, curves = self._prepared.hardware, {}
        if not hardware.is_direct:
            curves["waiting"] = ("qdot_cmd", "qdot_arrived", 1.0)
        if hardware.moves_q:
            curves["belief"] = ("q_believed", "q", 1e3)
        return curves

    def _log(self, path: str, look: rr.AsComponents) -> None:
        self.out.log(self.prefix + path, look)


def _layout(name: str, labels: list[str], prepared: list[Prepared], scenes: list[Scene]) -> rrb.Blueprint:
    prefixes = [f"/{prefix_of(label)}" for label in labels]
    every = list(zip(prefixes, prepared, strict=True))
    points, normals = np.vstack([scene.points for scene in scenes]), {scene.normal for scene in scenes}
    picture = rrb.Spatial3DView(
        name=f"{name}: {len(labels)} variants",
        contents=[
            "/target/**",
            *(f"{prefix}{entity}" for prefix in prefixes for entity in ("arm/**", "tip/**", "path")),
            *(f"{prefix}believed/**" for prefix, one in every if one.hardware.is_misled),
        ],
        overrides={f"{prefix[1:]}tip/trail": until_now() for prefix in prefixes},
        eye_controls=eye(points, normals.pop() if len(normals) == 1 else None),
        line_grid=grid(points),
    )
    is_slowed = any(one.scenario.control.at_singularity == "slow" for one in prepared)
    axis = time_axis(max(one.reference.duration for one in prepared), is_open=is_slowed)
    axes = {axis for one in prepared for axis in one.scenario.task.axes}
    slides = {bool(slide) for one in prepared for slide in one.arm.is_slide}
    unit = " or ".join(unit for unit, is_slide in (("rad/s", False), ("m/s", True)) if is_slide in slides)
    small = " or ".join(unit for unit, is_slide in (("mrad", False), ("mm", True)) if is_slide in slides)
    late = [prefix for prefix, one in every if not one.hardware.is_direct]
    misled = [prefix for prefix, one in every if one.hardware.moves_q]
    curves = {
        f"Fastest joint [{unit}]": ("fastest", prefixes), f"{WAITING} [{unit}]": ("waiting", late),
        f"{BELIEF} [{small}]": ("belief", misled),
        "σ_min": ("sigma_min", prefixes), "λ damping": ("columns/damping", prefixes),
        "Position error [mm]": ("error/position", prefixes if axes & {"x", "y", "z"} else []),
        "Rotation error [mrad]": ("error/rotation", prefixes if axes & {"rx", "ry", "rz"} else []),
    }  # fmt: skip
    curves = {title: (curve, those) for title, (curve, those) in curves.items() if those}
    plots = rrb.Vertical(
        *(
            plot(title, [f"{prefix}{curve}" for prefix in those], axis)
            for title, (curve, those) in curves.items()
        ),
        rrb.StateTimelineView(name="Status", origin="/status", time_view=axis),
        # A lane needs a third of what a plot does; many are scrolled.
        row_shares=[*([1.0] * len(curves)), min(2.5, 0.35 * len(labels) + 0.2)],
    )
    return page(picture, {"table": "Table", "legend": "What you see", "scenario": "Scenario"}, plots)


def _scenarios(variants: Sequence[tuple[str, Prepared]]) -> str:
    """Return every variant as a scenario that can be run."""
    texts = (f"## {label}\n\n```yaml\n{one.scenario.to_yaml()}```\n" for label, one in variants)
    return "\n".join(texts)
