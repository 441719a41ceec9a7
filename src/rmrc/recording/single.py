"""A run as a rerun recording: every column bit for bit, and a picture of the arm's motion.

Entities:

    columns          every column of the run at every tick, and derived curves: error [mm, mrad], belief
                     [mrad or mm], and the common logarithms of σ and λ
    limits, peak     constant lines, and the mark of a rate beyond its plot
    look, tip/look   the values that the scenario asks to look at, and the tip at that instant
    arm/<body>       poses, with the geometries and the axes of joints; meshes are static children
    believed/<body>  the same, pale, at the law's assumed configuration, if that is different
    target/..        path, and the present target pose
    tip/..           trail, ellipsoids and the lost direction
    now              the line of numbers, as a text
    status           the statuses of a run that lasts, in words, only where they change
    events           the same after any run; short ones are named beside them
    time             its times, where the plots have few
    baseline/..      columns, ghost of the arm and trail of the scenario's baseline, if it has one
    text/..          legend, scorecard, scenario

`sim_time` is rounded to nanoseconds, while the column `time` keeps all its bits.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow.lib as pa
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from rmrc.recording import live, stream
from rmrc.recording.events import CLOCK, Strip, ruled, words
from rmrc.recording.layout import (
    CYAN,
    GHOSTLY,
    PALE,
    YELLOW,
    aside,
    callout,
    legend,
    marks,
    opening,
    packed,
    page,
    pictures,
    ramp,
)
from rmrc.recording.panels import Panels, stacked
from rmrc.recording.plots import Mark, Seen, Span, dashes, logarithm
from rmrc.recording.scene import Frames, Scene
from rmrc.recording.stream import RecordingError, Stream, Values, one_line
from rmrc.recording.thinning import ADDED, OFTEN_FOLLOWING, SAME, completed, restored
from rmrc.recording.track import Track, prefix_of
from rmrc.results.columns import COLUMNS
from rmrc.results.run import Run
from rmrc.show.palette import of_status
from rmrc.simulation.prepare import Prepared

# Period of the line of numbers [s]: nobody could read faster changes.
READ_PERIOD = 0.05
TITLES = {"legend": "Legend", "scorecard": "Scorecard", "scenario": "Scenario"}
# Prefix of the entities of a baseline.
BASELINE = "baseline/"


class Recorder:
    """Writes one run, block by block.

    Use it as a context manager. Without a call of `finish`, it closes and keeps `part_path`.

    Attributes:
        path: Where the finished recording appears.
        part_path: Where it grows until then.
    """

    def __init__(self, path: Path, prepared: Prepared, baseline: Prepared | None = None) -> None:
        """Open the file, and write everything that is known before the run.

        Args:
            path: Path of the finished recording, ending in `.rrd`; its folder is created if missing.
            prepared: The world that will run.
            baseline: Its baseline, if that runs beside it.

        Raises:
            RecordingError: The file cannot be made.
        """
        scene, scenario = Scene(prepared), prepared.scenario
        panels = Panels(prepared, baseline is not None)
        first = opening(pictures(scene, prepared, [])[0])
        self._out = Stream(path, scenario.name, first, lambda: self._story.layout())  # noqa: PLW0108 - it is made below
        self.path, self.part_path = self._out.path, self._out.part_path
        self._ghost = None if baseline is None else _Ghost(self._out, baseline)
        self._story = _Story(self._out, scene, panels, self._ghost)
        self._story.write_arm(scene.painted, has_axes=True)
        for entity, look in marks(scene).items():
            self._out.log(entity, look)
        self._out.log_text("text/legend", legend(prepared, baseline is not None))
        self._out.log_text("text/scenario", f"```yaml\n{scenario.to_yaml()}```\n")

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file; without a call of `finish`, the data stay in `part_path`."""
        with suppress(RecordingError):  # the error that led here says more
            for track in filter(None, (self._ghost, self._story)) if self._out.is_open else ():
                track.write_last()
        self._out.close()

    def write(self, part: Run) -> None:
        """Write and flush one block of ticks; blocks come in order.

        Args:
            part: A run that holds only the ticks of this block.

        Raises:
            RecordingError: The file cannot be written.
        """
        self._story.write(part)
        self._out.flush()

    def write_baseline(self, part: Run) -> None:
        """Write and flush one block of ticks of the baseline; blocks come in order.

        Args:
            part: As in `write`.

        Raises:
            RecordingError: The file cannot be written.
        """
        assert self._ghost is not None
        self._ghost.write(part)
        self._out.flush()

    def finish(self, scorecard_markdown: str) -> None:
        """Add the scorecard, close the file and move it to `path`.

        Args:
            scorecard_markdown: The scorecard to show below the picture.

        Raises:
            RecordingError: The file cannot be written.
        """
        for track in filter(None, (self._ghost, self._story)):
            track.write_last()
        self._story.write_ending()
        self._out.log_text("text/scorecard", scorecard_markdown)
        self._out.finish()


def _layout(
    scene: Scene, panels: Panels, seen: Seen | None = None, reached: Sequence[NDArray[np.float64]] = ()
) -> tuple[rrb.Blueprint, Span, Mark | None]:
    """Return the layout of a finished run, the time axis of its plots, and the instant to look at."""
    prepared = panels.prepared
    end = max(prepared.reference.duration, seen.end if seen else 0.0)
    found, look = panels.all(seen), None
    mark = panels.mark(seen, found) if seen else None
    if mark is not None:
        found[panels.sight] = panels.marked(found[panels.sight], mark)
        look = (mark.text, scene.around(mark.instant)) if panels.is_of_hand else None
    status, time = ("/events", f"/{CLOCK}") if seen else ("/status", "")
    plots, span = stacked(found, end, status, first=panels.sight, time=time)
    views = pictures(scene, prepared, reached, look, ["/baseline/**"] * panels.has_baseline)
    return page(views, TITLES, plots, "/now"), span, mark


class _Ghost(Track):
    """The track of a baseline: gray and pale, and its commands as dashes.

    Attributes:
        seen: Its commands.
    """

    def __init__(self, out: Stream, prepared: Prepared) -> None:
        super().__init__(out, prepared, BASELINE)
        self.seen = Seen()
        self.write_arm(lambda shape: replace(shape, rgba=np.array([0.8, 0.8, 0.8, PALE])))
        thin = 0.004 * self.scene.reach
        self.out.log(f"{self.prefix}tip/now", rr.Points3D.from_fields(colors=GHOSTLY, radii=4 * thin))
        self.out.log(f"{self.prefix}tip/trail", rr.LineStrips3D.from_fields(radii=0.7 * thin))

    def curves(self, part: Run) -> dict[str, NDArray[np.float64]]:
        self.seen.add(part["time"], {"baseline": part["qdot_cmd"]})
        return {"dashed": dashes(part["time"], part["qdot_cmd"], self._prepared.reference.duration)}

    def trail_colors(self, frames: Frames) -> NDArray[np.uint32]:
        return np.full(len(frames.tip), GHOSTLY, np.uint32)

    def write_divergence(self, text: str, time: float, index: list[rr.TimeColumn]) -> None:  # noqa: ARG002
        self.out.send(f"{self.prefix}status", index, rr.StateChange.columns(state=[text]))


class _Story(Track):
    """A track that also shows the ellipsoids and the lost direction at each instant."""

    def __init__(self, out: Stream, scene: Scene, panels: Panels, ghost: _Ghost | None) -> None:
        prepared = panels.prepared
        super().__init__(out, prepared, scene=scene)
        self._ghost, self._panels = ghost, panels
        self._seen, self._strip = Seen() if ghost is None else ghost.seen, Strip()
        self._changes: list[tuple[int, float, int]] = []
        self._looks: dict[str, int] = {}
        frame = self.stride * prepared.scenario.control.period
        self._read = self.stride * max(1, round(READ_PERIOD / frame))
        kinds = ((self.translations, 2.0), (self.rotations, 1.0))
        radii = [0.004 * scene.reach * width for rows, width in kinds if rows for _ in ("there", "back")]
        out.log("tip/dying", rr.Arrows3D.from_fields(radii=radii))
        out.log("now", rr.TextDocument.from_fields(media_type="text/markdown"))
        self._write_limits([0.0, prepared.reference.duration])

    def write_block(self, part: Run, ticks: NDArray[np.int64]) -> None:
        super().write_block(part, ticks)
        self._write_status(part, ticks)

    def write_drawn(self, part: Run, ticks: NDArray[np.int64]) -> None:
        super().write_drawn(part, ticks)
        rows = np.flatnonzero(ticks % self._read == 0)
        if len(rows):
            texts = rr.TextDocument.columns(text=live.lines(self._prepared, part, rows))
            self.out.send("now", stream.index(ticks[rows], part["time"][rows]), texts)

    def curves(self, part: Run) -> dict[str, NDArray[np.float64]]:
        """Return the errors, and the curves with logarithmic axes."""
        sigma, damping = logarithm(part["sigma"]), part["damping"][:, None]
        kinds = [rows for rows in (self.translations, self.rotations) if rows]
        found = {
            "error": 1e3
            * np.column_stack([np.linalg.norm(part["pose_error"][:, rows], axis=1) for rows in kinds]),
            "plain": dashes(part["time"], part["qdot_plain"], self._prepared.reference.duration),
        }
        # a gap where there is no damping
        logs = [sigma[:, -1:], sigma[:, :-1], np.where(damping > 0.0, logarithm(damping), np.nan)]
        if self._panels.has_second:
            logs.append(logarithm(part["secondary_sigma"])[:, None])
        found["logs"] = np.hstack(logs)
        if self._panels.moves_q:
            found["belief"] = 1e3 * (part["q_believed"] - part["q"])
        found |= self._panels.only_if_looked_at(part)
        self._panels.watch(self._seen, part, found)
        self._panels.look(self._seen, part, found)
        return found

    def write_ending(self) -> None:
        """Write the facts that are known after the run: events, the peak off the scale, and the layout."""
        seen = self._seen
        reached = [self.reached] if self._ghost is None else [self.reached, self._ghost.reached]
        layout, span, looked_at = _layout(self.scene, self._panels, seen, reached)
        for entity, labels in (
            ("events", self._strip.labels(seen.end, span.letters)), (CLOCK, ruled(span.ruler)),
        ):  # fmt: skip
            if labels:
                self.write_strip(entity, labels)
        if seen.end > self._prepared.reference.duration:
            self._write_limits([seen.end])
        for name, peak in self._panels.off_scale(seen).items():
            mark = np.array([self._panels.mark_of(peak, seen)])
            self.send(f"peak/{name}", self.at([peak.time]), Values(stream.short("rate"), mark))
        sunk = self._panels.sunk(seen)
        if sunk is not None:
            self.send(
                "peak/sigma", self.at([sunk.time]), Values(stream.short("rate"), np.array([[sunk.value]]))
            )
        if looked_at is not None:
            values = Values(stream.short("look"), looked_at.values[None])
            self.send("look", self.at([looked_at.time]), values)
            now = live.lines(self._prepared, looked_at.instant, np.zeros(1, np.int64))
            self.out.send("now", self.at([looked_at.time]), rr.TextDocument.columns(text=now))
            tip = looked_at.instant["pose"][0, :3]
            framed = np.vstack([self.scene.points, *reached])
            taken = np.vstack([self.covered, self.scene.hand(looked_at.instant)])
            place = aside(tip, looked_at.text, self.scene, framed, taken)
            for rest, what in callout(tip, looked_at.text, self.scene, place).items():
                self.out.log(f"tip/look{rest}", *what)
        self.out.lay_out(layout)

    def _write_limits(self, times: list[float]) -> None:
        levels = {name: one for name, one in self._panels.limits().items() if one}
        values = [Values(stream.short(name), np.array([one] * len(times))) for name, one in levels.items()]
        self.send("limits", self.at(times), *values)

    def write_divergence(self, text: str, time: float, index: list[rr.TimeColumn]) -> None:
        self._strip.end_with(time, text)
        if self.out.is_laid_out:
            self.out.send("status", index, rr.StateChange.columns(state=[text]))

    def trail_colors(self, frames: Frames) -> NDArray[np.uint32]:
        return ramp(frames.nearness, YELLOW)

    def _write_status(self, part: Run, ticks: NDArray[np.int64]) -> None:
        status = part.columns["status"].astype(np.int64)
        rows = self._strip.add(part["time"], status)
        self._changes += zip(ticks[rows], part["time"][rows], status[rows].tolist(), strict=True)
        if self.out.is_laid_out:
            self._write_changes()

    def layout(self) -> rrb.Blueprint:
        """Return the layout of a run that may be killed; it alone shows the statuses, which are written."""
        self._write_changes()
        return _layout(self.scene, self._panels)[0]

    def _write_changes(self) -> None:
        if not self._changes:
            return
        when, times, found = (np.array(one) for one in zip(*self._changes, strict=True))
        self._changes.clear()
        texts = [words(one) for one in found.tolist()]
        looks = {text: of_status(one) for text, one in zip(texts, found.tolist(), strict=True)}
        if not looks.items() <= self._looks.items():
            self._looks |= looks
            values, colors = list(self._looks), packed(list(self._looks.values()))
            self.out.log("status", rr.StateConfiguration(values=values, colors=colors))
        self.out.send("status", stream.index(when, times), rr.StateChange.columns(state=texts))

    def write_frames(self, frames: Frames, index: list[rr.TimeColumn]) -> None:
        super().write_frames(frames, index)
        self.send("target/now", index, Values(stream.POINT, frames.target))
        self.send_ellipsoid("velocity", frames.velocity, frames, index)
        self.send_ellipsoid("force", frames.force, frames, index)
        kinds = ((self.translations, frames.dying_move, YELLOW), (self.rotations, frames.dying_turn, CYAN))
        arrows = [(way * vector, calm) for rows, vector, calm in kinds if rows for way in (1.0, -1.0)]
        shades = np.stack([ramp(frames.nearness, calm) for _, calm in arrows], axis=1)
        self.send(
            "tip/dying",
            index,
            Values(stream.VECTOR, np.stack([vector for vector, _ in arrows], axis=1)),
            Values(stream.ORIGIN, np.stack([frames.tip] * len(arrows), axis=1)),
            Values(stream.ARROW_COLOR, shades),
        )


def read_columns(
    path: Path, variant: str | None = None, baseline: bool = False
) -> dict[str, NDArray[np.generic]]:
    """Return all columns of a recording, bit for bit.

    Args:
        path: A `.rrd` file.
        variant: Label of a variant, of the recording of a comparison.
        baseline: Whether those of the baseline, of the recording of a run that has one.

    Returns:
        Arrays by the names of `rmrc.results.columns.COLUMNS`, sorted by tick: (T,) or (T, width). A block
        that was torn is left out.

    Raises:
        RecordingError: The file is missing, damaged, or no recording of a run or of that variant.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: no such recording")
    pieces = _pieces(path, path, variant, BASELINE if baseline else "")
    columns, complete = {}, []
    for name, found in pieces.items():
        ticks = np.concatenate([ticks for ticks, _ in found])
        order = np.argsort(ticks)
        gaps = np.flatnonzero(ticks[order] != np.arange(len(ticks)))
        complete.append(int(gaps[0]) if len(gaps) else len(ticks))
        values = np.concatenate([values for _, values in found])[order]
        columns[name] = values if COLUMNS[name].width else values[:, 0]
    whole_ticks = {name: values[: min(complete)].copy() for name, values in columns.items()}
    return completed(whole_ticks, SAME | {"qpos": "q", "path_time": "time"})


_Pieces = dict[str, list[tuple[NDArray[np.int64], NDArray[np.generic]]]]


def _pieces(path: Path, whole: Path, variant: str | None, whose: str) -> _Pieces:
    """Return ticks and values of the chunks of each column, in any order."""
    pieces: _Pieces = {name: [] for name in COLUMNS}
    prefix = f"/{whose}" if variant is None else f"/{prefix_of(variant)}"
    try:
        for chunk in RrdReader(whole).stream().filter(content=f"{prefix}columns", is_static=False):
            batch = chunk.to_record_batch()
            ticks = batch.column("tick").to_numpy(zero_copy_only=False)
            rows, found = batch.column("columns").flatten(), {}
            for name in (pieces.keys() | {"rotation_error"}) & {one.name for one in rows.type}:
                found[name] = _rows(rows.field(name), len(batch))
            blocks = {name: block.reshape(len(batch), -1) for name, block in restored(found).items()}
            for name in set(OFTEN_FOLLOWING).intersection(batch.schema.names):
                is_there = batch.column(name).is_valid().to_numpy(zero_copy_only=False)
                blocks[name][is_there] = _rows(batch.column(name).flatten().field(name), is_there.sum())
            for name, block in blocks.items():
                pieces[name].append((ticks, block))
        left_out = ADDED | {"path_time"}
        pieces = {name: found for name, found in pieces.items() if found or name not in left_out}
        variants = [] if all(pieces.values()) else _variants(whole)
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"{path}: is damaged, or not a recording: {one_line(error)}") from None
    if all(pieces.values()):
        return pieces
    if variants:
        wanted = "holds variants" if variant is None else f'has no columns of the variant "{variant}"'
        raise RecordingError(f"{path}: {wanted}; its variants: {'; '.join(variants)}")
    raise RecordingError(f"{path}: has no columns of a run of rmrc")


def _rows(values: pa.Array, rows: int) -> NDArray[np.generic]:
    """Return a field of a table, (rows, width)."""
    flat = values if values.type.num_fields == 0 else values.flatten()
    return np.asarray(flat.to_numpy(zero_copy_only=False)).reshape(rows, -1)


def _variants(whole: Path) -> list[str]:
    """Return the labels of the variants that a recording holds."""
    chunks = RrdReader(whole).stream().filter(content="/variants/**", is_static=False)
    found = (re.match(r"/variants/((?:\\.|[^/\\])+)/columns$", chunk.entity_path) for chunk in chunks)
    return list(dict.fromkeys(re.sub(r"\\(.)", r"\1", match[1]) for match in found if match))
