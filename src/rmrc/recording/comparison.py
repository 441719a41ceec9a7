"""The runs of a comparison as one recording: all arms in one picture, each in its color.

Entities; `<variant>` is the label of a variant, with the same entities below it as in a recording of one run:

    variants/<variant>/columns every column of the run at every tick, bit for bit, and derived curves:
                                        largest |joint rate| measured and commanded, largest torque
                                        as a share of its limit or as it is, logarithms of σ_min and λ, errors
    variants/<variant>/arm/<body>       poses, with the geometries in the color of the variant
    variants/<variant>/tip/..           position, trail and velocity ellipsoid
    variants/<variant>/path             the target path, if it is not that of the first variant
    variants/<variant>/believed/<body>  the same, pale, at the law's assumed configuration, if different
    limits                              the limit of the rates, if all joints of all variants have the same
    status/<variant>                    one lane each, only where it changes
    events/<variant>                    the same when the runs are over, with room for the label of each
    variants/<variant>/look, tip/look   the value that the scenario asks to look at, and the tip then
    target/path                         the target path of the first variant
    text/..                             legend, table, times of the limits, scenario
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rmrc.recording import stream
from rmrc.recording.events import CLOCK, Strip, ruled, words
from rmrc.recording.layout import (
    ASPECT_COMPARED,
    PALE_ARM,
    aside,
    backdrop,
    callout,
    eye,
    grid,
    opening,
    packed,
    page,
    path_line,
    until_now,
)
from rmrc.recording.panels import OF_THE_ARM, heights, stacked
from rmrc.recording.plots import (
    HEIGHT,
    NUMBER,
    Curve,
    Mark,
    Panel,
    Seen,
    Span,
    below,
    clipped,
    decades,
    logarithm,
    rounded,
    ruler,
    spell,
)
from rmrc.recording.scene import Frames, Scene
from rmrc.recording.shapes import Shape
from rmrc.recording.stream import RecordingError, Stream, Values
from rmrc.recording.track import Track, prefix_of
from rmrc.results.run import Run
from rmrc.scenario.choices import IN_RUNS, POLICIES
from rmrc.show.palette import GRAY, RED, WHITE, distinct, mix, of_status
from rmrc.simulation.prepare import Prepared

# The first variant is solid. The others are outlines around its moving parts. Each is thicker than the one
# before by a constant, the last one by half at most. Meshes have no outlines and are ghosts.
THICKER, THICKEST = 0.18, 0.5
GHOST = 0.3

# The plot of a quantity to look at, if it has another name.
SIGHTS = {"error": "position", "path": "position", "status": "rates"}
# The curve of a plot, if it has another name.
CURVES = {"rates": "fastest_cmd", "sigma": "log_sigma_min"}

# Height of the table below the picture, and of each of its rows [points].
TABLE, ROW = 105.0, 24.0

# Distance between coinciding trails, drawn above each other, as a share of the reach: less than a pixel.
LIFT = 3e-4

# Widths of the curves [pixels]; the first ones are wider, so that a border of them stays visible.
WIDEST, NARROWEST = 5.5, 2.0

TITLES = {"table": "Table", "limits": "Limits", "legend": "Legend", "scenario": "Scenario"}

LEGEND = """\
Each variant has its color, in the picture and in the plots, whose legends name them.

| in the picture | is |
|---|---|
| **white line** | path of the target |
| **trail**, **ball** | past path and position of an end effector (tip) |
| **solid arm** | the first variant |
| **outlines**, **ghosts** | the others, each a little thicker than the one before |
| **ellipsoids** | tip velocities reachable with unit-norm joint rates, as wires in the color of the variant |
{pale}
Thin curves are commanded.
"""


class Overlay:
    """Writes the runs of several variants, block by block.

    Use it as a context manager. Without a call of `finish`, it closes and keeps `part_path`.

    Attributes:
        path: Where the finished recording appears.
        part_path: Where it grows until then.
    """

    def __init__(self, path: Path, name: str, variants: Sequence[tuple[str, Prepared]]) -> None:
        """Open the file, and write everything that is known before the runs.

        Args:
            path: Path of the finished recording, ending in `.rrd`; its folder is created if missing.
            name: Name of the comparison.
            variants: Label and world of each; no two labels are equal.

        Raises:
            RecordingError: The file cannot be made.
        """
        labels = [label for label, _ in variants]
        scenes = [Scene(prepared) for _, prepared in variants]
        self._layout = _Layout(name, labels, [one for _, one in variants], scenes)
        opened = opening(self._layout.pictures()[0])
        self._out = Stream(path, name, opened, lambda: self._layout.blueprint()[0])
        self._out.open()
        self.path, self.part_path = self._out.path, self._out.part_path
        self._arms: list[_Arm] = []
        first = variants[0][1].reference.pose
        self._out.log("target/path", path_line(scenes[0]))
        drawn = sorted(map(prefix_of, labels))  # the viewer's own order
        for i, (label, prepared) in enumerate(variants):
            look = _look(i, drawn.index(prefix_of(label)), len(variants))
            self._arms.append(_Arm(self._out, scenes[i], prepared, label, look, self._layout.is_share))
            if not np.array_equal(prepared.reference.pose, first):
                self._out.log(f"{prefix_of(label)}path", path_line(scenes[i], mix(look.color, WHITE, 0.5)))
        is_misled = any(prepared.hardware.is_misled for _, prepared in variants)
        self._out.log_text("text/legend", LEGEND.format(pale=PALE_ARM * is_misled))
        self._out.log_text("text/scenario", _scenarios(variants))

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file; without a call of `finish`, the data stay in `part_path`."""
        with suppress(RecordingError):  # the error that led here says more
            for arm in self._arms if self._out.is_open else ():
                arm.write_last()
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
            table_markdown: The table to show below the picture.

        Raises:
            RecordingError: The file cannot be written.
        """
        for arm in self._arms:
            arm.write_last()
        end = max([arm.seen.end for arm in self._arms] + [self._layout.duration])
        levels = self._layout.levels()
        if levels:
            lines = Values(stream.short("rate"), np.array([levels, levels]))
            self._out.send("limits", self._arms[0].at([0.0, end]), [lines])
        self._out.log_text("text/table", table_markdown)
        self._out.log_text("text/limits", _times([(arm.label, arm.strip) for arm in self._arms], end))
        layout, span = self._layout.blueprint(
            [arm.seen for arm in self._arms], [arm.reached for arm in self._arms]
        )
        range_ = self._layout.range_of_sight([arm.seen for arm in self._arms])
        framed = np.vstack([part for arm in self._arms for part in (arm.scene.points, arm.reached)])
        marks = [(arm.scene, arm.seen.mark) for arm in self._arms if arm.seen.mark]
        hands = [scene.hand(mark.instant) for scene, mark in marks]
        taken = np.vstack([*(arm.covered for arm in self._arms), *hands])
        for i, arm in enumerate(self._arms):
            arm.write_ending(span, range_, framed, taken, is_first=i == 0)
        self._out.lay_out(layout)
        self._out.finish()


def _times(strips: Sequence[tuple[str, Strip]], end: float) -> str:
    """Return a table of the duration of each status in each variant [s]."""
    held = {label: strip.held(end) for label, strip in strips}
    flags = [flag for flag in IN_RUNS if flag and any(flag in times for times in held.values())]
    head = "| variant | " + " | ".join(f"{words(flag)} [s]" for flag in flags) + " |\n"
    rule = "|---|" + "---:|" * len(flags) + "\n"
    rows = (
        f"| {label} | " + " | ".join(f"{times[flag]:.3f}" if flag in times else "" for flag in flags) + " |\n"
        for label, times in held.items()
    )
    return head + rule + "".join(rows) if flags else "No limit acts in any variant."


@dataclass(frozen=True)
class _Look:
    color: int
    is_solid: bool
    thickness: float  # of the arm, as a share
    lift: float  # of the trail, in reaches
    width: float  # of the curves, in pixels


def _look(i: int, drawn: int, count: int) -> _Look:
    """Return the look of variant i, which the viewer draws as number `drawn` of all."""
    return _Look(
        color=distinct(count)[i],
        is_solid=i == 0,
        thickness=1.0 + i * min(THICKER, THICKEST / max(1, count - 1)),
        lift=LIFT * i,
        width=WIDEST - (WIDEST - NARROWEST) * drawn / max(1, count - 1),
    )


class _Arm(Track):
    """The track of one variant, with the few curves in which variants are compared."""

    def __init__(
        self, out: Stream, scene: Scene, prepared: Prepared, label: str, look: _Look, is_share: bool
    ) -> None:
        super().__init__(out, prepared, prefix_of(label), scene)
        self.label, self.seen, self.strip = label, Seen(), Strip()
        self._look, self._is_share = look, is_share
        self._lane = f"status/{rr.escape_entity_path_part(label)}"
        self._states: dict[str, int] = {}
        self.write_arm(self._painted, has_outlines=not look.is_solid)
        thin = 0.004 * self.scene.reach
        self._log("tip/now", rr.Points3D.from_fields(colors=look.color, radii=5.5 * thin))
        lifted = rr.Transform3D(translation=[0.0, 0.0, look.lift * self.scene.reach])
        self._log("tip/trail", rr.LineStrips3D.from_fields(radii=1.8 * thin), lifted)
        wires = rr.components.FillMode.MajorWireframe
        ellipsoid = rr.Ellipsoids3D.from_fields(colors=look.color, line_radii=0.5 * thin, fill_mode=wires)
        self._log("tip/velocity_ellipsoid", ellipsoid)

    def write_block(self, part: Run, ticks: NDArray[np.int64]) -> None:
        super().write_block(part, ticks)
        self._write_status(part, ticks)

    def write_divergence(self, text: str, time: float, index: list[rr.TimeColumn]) -> None:
        self.strip.end_with(time, text)
        self._write_states([text], [RED], index)

    def write_frames(self, frames: Frames, index: list[rr.TimeColumn]) -> None:
        super().write_frames(frames, index)
        self.send_ellipsoid("velocity", frames.velocity, frames, index)

    def trail_colors(self, frames: Frames) -> NDArray[np.uint32]:
        return np.full(len(frames.tip), self._look.color, np.uint32)

    def curves(self, part: Run) -> dict[str, NDArray[np.float64]]:
        """Return one number per tick for each quantity that is compared."""
        damping, load = part["damping"], np.abs(part["tau"])
        if self._is_share:
            load = 100.0 * load / self._prepared.arm.torque_limit
        found = {
            "fastest": np.abs(part["qdot"]).max(axis=1),
            "fastest_cmd": np.abs(part["qdot_cmd"]).max(axis=1),
            "torque": load.max(axis=1),
            "log_sigma_min": logarithm(part["sigma"][:, -1]),
            "log_damping": np.where(damping > 0.0, logarithm(damping), np.nan),
        }
        for name, (column, other, factor) in self._only_here().items():
            found[name] = factor * np.abs(part[column] - part[other]).max(axis=1)
        for name, rows in (("position", self.translations), ("rotation", self.rotations)):
            if rows:
                found[name] = 1e3 * np.linalg.norm(part["pose_error"][:, rows], axis=1)
        if POLICIES[self._prepared.scenario.control.at_singularity].slows:
            found["pace"] = part["path_rate"]
        self.seen.add(part["time"], found | {"sigma": part["sigma"][:, -1], "1/sigma": _inverse(part)})
        self._look_at(part, found)
        return {name: values[:, None] for name, values in found.items()}

    def _look_at(self, part: Run, found: dict[str, NDArray[np.float64]]) -> None:
        """Keep the instant to look at, if it is in a block: the requested one, or the worst one."""
        look = self._prepared.scenario.look
        if look is None:
            return
        sight = SIGHTS.get(look.quantity, look.quantity)
        sight = "rotation" if sight == "position" and sight not in found else sight
        values = np.abs(part["q"]).max(axis=1) if sight == "joints" else found.get(CURVES.get(sight, sight))
        if values is None:
            return
        worth = {
            "sigma": -values, "pace": -values, "status": (part["status"] != 0).astype(float)
        }.get(look.quantity, values) if look.at is None else -np.abs(part["time"] - look.at)  # fmt: skip
        row = int(np.nan_to_num(worth, nan=-np.inf).argmax())
        if self.seen.mark is None or worth[row] > self.seen.mark.worth:
            self.seen.mark = Mark.of(part, row, values[:, None], float(worth[row]))

    def write_ending(
        self,
        span: Span,
        range_: tuple[float, float] | None,
        framed: NDArray[np.float64],
        taken: NDArray[np.float64],
        *,
        is_first: bool,
    ) -> None:
        """Write the facts that are known after the run: its events in words, and the instant to look at.

        Args:
            span: Span of the plots.
            range_: Range of the plot to look at; None: there is none.
            framed: Points in the frame of the picture, (p, 3) [m].
            taken: Points that the text at the instant must not cover, (p, 3) [m].
            is_first: Whether it is the variant that determines the instant.
        """
        events = self.strip.labels(self.seen.end, span.letters)
        lane, times = self._lane.replace("status", "events", 1), ruled(span.ruler) if is_first else []
        for entity, labels in ((lane, events), (CLOCK, times)):
            if labels:
                self.write_strip(entity, labels)
        mark = self.seen.mark
        if mark is not None:
            if range_ is not None:
                value = Values(stream.short("look"), np.clip(mark.values, *range_)[None])
                self.send("look", self.at([mark.time]), value)
            tip, text = mark.instant["pose"][0, :3], mark.text if is_first else ""
            place = aside(tip, text, self.scene, framed, taken, ASPECT_COMPARED)
            for rest, what in callout(tip, text, self.scene, place, self._look.color).items():
                self._log(f"tip/look{rest}", *what)

    def _painted(self, shape: Shape) -> Shape | None:
        """Return a geom in the color of the variant; none for resting parts, which the first variant shows.

        Light and dark geoms stay distinct.
        """
        if not self._look.is_solid and self.scene.is_fixed[shape.body]:
            return None
        light = float(np.dot(shape.rgba[:3], [0.3, 0.59, 0.11]))
        tint = mix(self._look.color, WHITE if light > 0.5 else 0x000000FF, 0.6 * abs(light - 0.5))
        channels = [(tint >> shift & 255) / 255.0 for shift in (24, 16, 8)]
        is_ghost = shape.kind == "mesh" and not self._look.is_solid
        size = shape.size.copy()
        size[: 1 if shape.kind == "capsule" else 3] *= self._look.thickness
        return replace(shape, rgba=np.array([*channels, GHOST if is_ghost else 1.0]), size=size)

    def _write_status(self, part: Run, ticks: NDArray[np.int64]) -> None:
        status = part.columns["status"].astype(np.int64)
        rows = self.strip.add(part["time"], status)
        if len(rows):
            found = status[rows].tolist()
            index = stream.index(ticks[rows], part["time"][rows])
            self._write_states([words(one) for one in found], [of_status(one) for one in found], index)

    def _write_states(self, states: list[str], colors: list[int], index: list[rr.TimeColumn]) -> None:
        known = self._states | dict(zip(states, colors, strict=True))
        if known != self._states:
            self._states = known
            look = rr.StateConfiguration(values=list(known), colors=packed(list(known.values())))
            self.out.log(self._lane, look)
        self.out.send(self._lane, index, rr.StateChange.columns(state=states))

    def _only_here(self) -> dict[str, tuple[str, str, float]]:
        """Return the curves of the stages between law and plant: their columns, and a factor."""
        hardware, curves = self._prepared.hardware, {}
        if not hardware.is_direct:
            curves["waiting"] = ("qdot_cmd", "qdot_arrived", 1.0)
        if hardware.moves_q:
            curves["belief"] = ("q_believed", "q", 1e3)
        return curves

    def _log(self, path: str, *look: rr.AsComponents) -> None:
        self.out.log(self.prefix + path, *look)


def _inverse(part: Run) -> NDArray[np.float64]:
    """Return 1/σ_min, whose largest value belongs to the smallest σ_min."""
    return 1.0 / np.maximum(part["sigma"][:, -1], 1e-300)


class _Layout:
    """The viewer's layout; the ranges of the plots are known after the runs."""

    def __init__(
        self, name: str, labels: Sequence[str], prepared: Sequence[Prepared], scenes: Sequence[Scene]
    ) -> None:
        self._name, self._labels, self._prepared, self._scenes = name, labels, prepared, scenes
        self._prefixes, self._colors = [prefix_of(label) for label in labels], distinct(len(labels))
        self.duration = max(one.reference.duration for one in prepared)
        loaded = [one.arm.torque_limit for one in prepared if one.plant.has_physics]
        self._has_torque = bool(loaded)
        self.is_share = bool(loaded) and all(np.isfinite(limit).all() for limit in loaded)
        look = prepared[0].scenario.look
        self._is_of_hand = look is not None and look.quantity not in OF_THE_ARM
        found = self._panels(None)
        wanted = SIGHTS.get(look.quantity, look.quantity) if look else ""
        wanted = "rotation" if wanted == "position" and wanted not in found else wanted
        self.sight = wanted if wanted in found else ""
        lines = len(found["rates"].least) + (self.sight == "rates")
        self._heights = partial(heights, "pace" in found, self.sight, lines)

    def levels(self) -> list[float]:
        """Return the limit of all rates, if there is only one."""
        known = {float(limit) for one in self._prepared for limit in one.law.rate_limit}
        return list(known) if len(known) == 1 and np.isfinite(list(known)).all() else []

    def blueprint(
        self, seen: Sequence[Seen] | None = None, reached: Sequence[NDArray[np.float64]] = ()
    ) -> tuple[rrb.Blueprint, Span]:
        """Return the layout, and the time of its plots.

        Args:
            seen: What the runs show, once they are over.
            reached: Points that they reach, (p, 3) each [m].
        """
        end = max([self.duration, *(one.end for one in seen or ())])
        panels, lanes = self._panels(seen), len(self._labels)
        if seen and self.sight in panels:
            panels[self.sight] = self._marked(panels[self.sight], seen)
        status, time = ("/events/**", f"/{CLOCK}") if seen else ("/status/**", "")
        plots, span = stacked(panels, end, status, lanes, self.sight, time)
        texts_share = 9 * min(270.0, TABLE + ROW * lanes) / HEIGHT
        return page(self.pictures(seen, reached), TITLES, plots, texts_share=texts_share), span

    def range_of_sight(self, seen: Sequence[Seen]) -> tuple[float, float] | None:
        """Return the range of the plot to look at, if there is one."""
        return self._panels(seen)[self.sight].range if self.sight else None

    def _marked(self, panel: Panel, seen: Sequence[Seen]) -> Panel:
        """Return the plot to look at, with the mark of each variant in it."""
        marks = [
            Curve(f"{prefix}look", "look", ["look"], [color], 7.0, "diamond")
            for prefix, color, one in zip(self._prefixes, self._colors, seen, strict=True)
            if one.mark is not None
        ]
        return replace(panel, curves=[*panel.curves, *marks])

    def pictures(
        self, seen: Sequence[Seen] | None = None, reached: Sequence[NDArray[np.float64]] = ()
    ) -> list[rrb.Spatial3DView]:
        """Return the picture, and one of the hands at the instant to look at, as in `blueprint`."""
        points = np.vstack([*(scene.points for scene in self._scenes), *reached])
        frames = {f"{self._name}: {len(self._labels)} variants": points}
        marks = [(scene, one.mark) for scene, one in zip(self._scenes, seen or (), strict=False) if one.mark]
        if marks and self._is_of_hand:
            frames[marks[0][1].text] = np.vstack([scene.around(mark.instant) for scene, mark in marks])
        normals = {scene.normal for scene in self._scenes}
        normal = normals.pop() if len(normals) == 1 else None
        every = list(zip(self._prefixes, self._prepared, strict=True))
        return [
            rrb.Spatial3DView(
                name=name,
                contents=[
                    "/target/**",
                    *(f"/{prefix}{entity}" for prefix, _ in every for entity in ("arm/**", "tip/**", "path")),
                    *(f"/{prefix}believed/**" for prefix, one in every if one.hardware.is_misled),
                ],
                overrides={f"{prefix}tip/trail": until_now() for prefix in self._prefixes},
                eye_controls=eye(framed, normal, ASPECT_COMPARED),
                line_grid=grid(points),
                background=backdrop(),
            )
            for name, framed in frames.items()
        ]

    def _panels(self, seen: Sequence[Seen] | None) -> dict[str, Panel]:
        slides = {bool(slide) for one in self._prepared for slide in one.arm.is_slide}
        unit = " or ".join(unit for unit, is_slide in (("rad/s", False), ("m/s", True)) if is_slide in slides)
        small = " or ".join(unit for unit, is_slide in (("mrad", False), ("mm", True)) if is_slide in slides)
        axes = {axis for one in self._prepared for axis in one.scenario.task.axes}
        found = {"rates": self._rates(unit, seen), "sigma": self._sigma(seen)}
        steps = self._steps("tabs", seen) if seen else 0.0
        for name, title, has_it in (
            ("position", "Position error [mm]", axes & {"x", "y", "z"}),
            ("rotation", "Rotation error [mrad]", axes & {"rx", "ry", "rz"}),
            ("torque", "Largest torque " + ("[% of its limit]" if self.is_share else "[N·m or N]"),
             self._has_torque),
            ("waiting", f"Commanded, and not arrived [{unit}]",
             any(not one.hardware.is_direct for one in self._prepared)),
            ("belief", f"Joints as believed, less true [{small}]",
             any(one.hardware.moves_q for one in self._prepared)),
        ):  # fmt: skip
            if has_it:
                range_ = (0.0, rounded(self._largest(seen, name), steps)) if seen else None
                found[name] = Panel(title, self._curves(name), range_)
        least = 1.0 / self._largest(seen, "1/sigma") if seen else 1.0
        found["damping"] = Panel("Damping λ, as log₁₀", self._curves("log_damping"),
                                 decades(least, 1.0, steps) if seen else None)  # fmt: skip
        if any(POLICIES[one.scenario.control.at_singularity].slows for one in self._prepared):
            title = "Pace ṡ along the path [1 = as planned]"
            found["pace"] = Panel(title, self._curves("pace"), (0.0, 2.2) if seen else None)
        return found

    def _steps(self, name: str, seen: Sequence[Seen]) -> float:
        """Return the number of axis labels that fit into a plot of runs that are over."""
        end = max([self.duration, *(one.end for one in seen)])
        return self._heights(lanes=len(self._labels) + bool(ruler(end)))[name] / NUMBER

    def _rates(self, unit: str, seen: Sequence[Seen] | None) -> Panel:
        curves = [*self._curves("fastest"), *self._curves("fastest_cmd", is_thin=True)]
        limits, line = self.levels(), [Curve("limits", "rate", ["limit"], [GRAY], 1.0)]
        title = f"Fastest joint [{unit}], commanded thin"
        if seen is None:
            return Panel(title, curves + line * bool(limits), is_key=True)
        peak = self._largest(seen, "fastest", "fastest_cmd")
        usual = min((one.mostly("fastest_cmd") for one in seen), default=0.0)
        known = [
            one.law.rate_limit[np.isfinite(one.law.rate_limit)].max(initial=0.0) for one in self._prepared
        ]
        shown = clipped(peak, float(max(known)), usual)
        shown = shown if limits else min(shown, peak)  # no line of a limit is visible
        if peak > shown:
            title += f"; peak {spell(peak)} ↑"
        range_ = (0.0, rounded(shown, self._steps("rates", seen)))
        if limits and limits[0] > range_[1]:
            title += f"; limit {spell(limits[0])} ↑"
        elif limits:
            curves += line
        return Panel(title, curves, range_, is_key=True)

    def _sigma(self, seen: Sequence[Seen] | None) -> Panel:
        range_, title = None, "σ_min, as log₁₀"
        if seen is not None:
            least = 1.0 / self._largest(seen, "1/sigma")
            range_ = decades(least, self._largest(seen, "sigma"), self._steps("sigma", seen))
            title += below(least, range_)
        return Panel(title, self._curves("log_sigma_min"), range_)

    def _curves(self, name: str, *, is_thin: bool = False) -> list[Curve]:
        """Return the curve of each variant that has it."""
        drawn = sorted(self._prefixes)  # the viewer's own order
        found = []
        for label, prefix, tint, one in zip(
            self._labels, self._prefixes, self._colors, self._prepared, strict=True
        ):
            hardware = one.hardware
            lacks = (name == "waiting" and hardware.is_direct) or (name == "belief" and not hardware.moves_q)
            lacks |= name == "pace" and not POLICIES[one.scenario.control.at_singularity].slows
            axes = set(one.scenario.task.axes)
            lacks |= name == "position" and not axes & {"x", "y", "z"}
            lacks |= name == "rotation" and not axes & {"rx", "ry", "rz"}
            if not lacks:
                width = _look(0, drawn.index(prefix), len(self._labels)).width
                shade, width = (mix(tint, WHITE, 0.5), 1.0) if is_thin else (tint, width)
                found.append(Curve(f"{prefix}columns", f"columns.{name}[]", [label], [shade], width))
        return found

    @staticmethod
    def _largest(seen: Sequence[Seen] | None, *names: str) -> float:
        peaks = [one.peak(*names) for one in seen or ()]
        return max((abs(peak.value) for peak in peaks if peak), default=1.0)


def _scenarios(variants: Sequence[tuple[str, Prepared]]) -> str:
    """Return every variant as a scenario that can be run."""
    texts = (f"## {label}\n\n```yaml\n{one.scenario.to_yaml()}```\n" for label, one in variants)
    return "\n".join(texts)
