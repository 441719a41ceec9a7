"""A run as a rerun recording: every column bit for bit, and a picture of the arm that tells the story.

Entities, one name everywhere:

    columns/<name>   every column of the run at every tick; float64 scalars, status as int64
    error            position [mm] and rotation [mrad], of the axes that the task has
    arm/<body>       poses, with the geometries as static children
    believed/<body>  the same, pale, where the law takes the arm to be, if that is elsewhere
    belief           q_believed − q [mrad or mm], where the law takes the joints to be elsewhere
    target/..        path, and the pose wanted at the moment
    tip/..           trail, ellipsoids and the dying direction
    status/<flag>    one lane for each status, only where it changes
    baseline/..      columns of the scenario's baseline, if it has one
    text/..          legend, scorecard, scenario

`sim_time` is rounded to nanoseconds, while columns/time keeps all its bits.
"""

import re
import tempfile
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow.lib as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from rmrc.recording import stream
from rmrc.recording.layout import (
    CYAN,
    STATUS_COLORS,
    YELLOW,
    blueprint,
    curves,
    lane,
    legend,
    marks,
    ramp,
    xyzw,
)
from rmrc.recording.scene import Frames, Scene
from rmrc.recording.stream import RecordingError, Stream, Values, one_line
from rmrc.recording.track import Track, prefix_of
from rmrc.recording.viewer import repair
from rmrc.results.columns import ADDED, COLUMNS, completed
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import Prepared

# Begins the entities of a baseline.
BASELINE = "baseline/"


class Recorder:
    """Writes one run, block by block.

    Use it as a context manager. Left without `finish`, it keeps and closes `part_path`.

    Attributes:
        path: Where the finished recording appears.
        part_path: Where it grows until then.
    """

    def __init__(self, path: Path, prepared: Prepared, baseline: Prepared | None = None) -> None:
        """Open the file, and write all that is known before the run.

        Args:
            path: Of the finished recording, ending in `.rrd`; its folder is made if needed.
            prepared: The world that will run.
            baseline: Its baseline, if that runs beside it.

        Raises:
            RecordingError: The file cannot be made.
        """
        scene, scenario = Scene(prepared), prepared.scenario
        self._out = Stream(path, scenario.name, blueprint(scene, prepared))
        self.path, self.part_path = self._out.path, self._out.part_path
        self._story = _Story(self._out, prepared)
        self._baseline = None if baseline is None else _Columns(self._out, baseline, BASELINE)
        self._story.write_arm()
        for looks in (marks(scene), curves(prepared)):
            for entity, look in looks.items():
                self._out.log(entity, look)
        self._out.log_text("text/legend", legend(prepared))
        self._out.log_text("text/scenario", f"```yaml\n{scenario.to_yaml()}```\n")

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file; what was written stays in `part_path` if `finish` was not called."""
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
        assert self._baseline is not None
        self._baseline.write(part)
        self._out.flush()

    def finish(self, scorecard_markdown: str) -> None:
        """Add the scorecard, close the file and move it to `path`.

        Args:
            scorecard_markdown: Shown below the picture.

        Raises:
            RecordingError: The file cannot be written.
        """
        self._story.write_last()
        self._out.log_text("text/scorecard", scorecard_markdown)
        self._out.finish()


class _Columns(Track):
    """A track of nothing but columns."""

    def write(self, part: Run) -> None:
        """Write one block of ticks; blocks come in order."""
        if len(part):
            self.write_block(part, np.arange(self._ticks, self._ticks + len(part)))
            self._ticks += len(part)


class _Story(Track):
    """A track that also shows what the arm can and cannot do at each instant."""

    def __init__(self, out: Stream, prepared: Prepared) -> None:
        super().__init__(out, prepared)
        self._status: int | None = None
        self._lanes: set[Status] = set()

    def write_block(self, part: Run, ticks: NDArray[np.int64]) -> None:
        super().write_block(part, ticks)
        kinds = [rows for rows in (self.translations, self.rotations) if rows]
        norms = [1e3 * np.linalg.norm(part["pose_error"][:, rows], axis=1) for rows in kinds]
        errors = Values(stream.SCALARS, np.column_stack(norms))
        index = stream.index(ticks, part["time"])
        self.send("error", index, errors)
        if self._prepared.hardware.moves_q:
            self.send("belief", index, Values(stream.SCALARS, 1e3 * (part["q_believed"] - part["q"])))
        self._write_status(part, ticks)

    def write_divergence(self, text: str, index: list[rr.TimeColumn]) -> None:
        self.out.send("status/diverged", index, rr.StateChange.columns(state=[text]))

    def trail_colors(self, frames: Frames) -> NDArray[np.uint32]:
        return ramp(frames.nearness, YELLOW)

    def _write_status(self, part: Run, ticks: NDArray[np.int64]) -> None:
        status = part.columns["status"].astype(np.int64)
        before, self._status = self._status, int(status[-1])
        if (status == before).all():
            return
        for flag in STATUS_COLORS:
            is_on = (status & flag) > 0 if flag else status == 0
            was_on = False if before is None else bool(before & flag) if flag else before == 0
            rows = np.flatnonzero(np.diff(is_on, prepend=was_on))
            if not len(rows):
                continue
            if flag not in self._lanes:  # a look alone makes a lane, even of what never occurs
                self._lanes.add(flag)
                self.out.log(f"status/{flag.name}", lane(flag))
            states = [str(flag.name) if on else "" for on in is_on[rows]]  # an empty state ends the last
            index = stream.index(ticks[rows], part["time"][rows])
            self.out.send(f"status/{flag.name}", index, rr.StateChange.columns(state=states))

    def write_frames(self, frames: Frames, index: list[rr.TimeColumn]) -> None:
        super().write_frames(frames, index)
        self.send("target/now", index, Values(stream.POINT, frames.target))
        turned = Values(stream.TURN, xyzw(frames.axes))
        for name, half in (("velocity", frames.velocity), ("force", frames.force)):
            where, size = Values(stream.CENTER, frames.tip), Values(stream.HALF, half)
            self.send(f"tip/{name}_ellipsoid", index, where, size, turned)
        origins = np.stack([frames.tip, frames.tip], axis=1)
        arrows = (
            ("move", self.translations, frames.dying_move, YELLOW),
            ("turn", self.rotations, frames.dying_turn, CYAN),
        )
        for name, rows, vector, calm in arrows:
            if not rows:
                continue
            both_ways = Values(stream.VECTOR, np.stack([vector, -vector], axis=1))
            colors = np.repeat(ramp(frames.nearness, calm)[:, None], 2, axis=1)
            shade = Values(stream.ARROW_COLOR, colors)
            self.send(f"tip/dying_{name}", index, both_ways, Values(stream.ORIGIN, origins), shade)


def read_columns(path: Path, variant: str | None = None) -> dict[str, NDArray[np.generic]]:
    """Return all columns of a recording, or of what a killed process left of one, bit for bit.

    Args:
        path: A `.rrd` or `.rrd.part` file.
        variant: Label of a variant, of the recording of a comparison.

    Returns:
        Arrays by the names of `rmrc.results.columns.COLUMNS`, sorted by tick: (T,) or (T, width). A block
        that was torn is left out.

    Raises:
        RecordingError: The file is missing, damaged, or no recording of a run or of that variant.
        ViewerError: A `.part` that cannot be repaired.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: no such recording")
    with tempfile.TemporaryDirectory(prefix="rmrc-") as folder:
        whole = path
        if path.suffix == ".part":
            whole = Path(folder) / path.stem
            repair(path, whole)
        pieces = _pieces(path, whole, variant)
    columns, complete = {}, []
    for name, found in pieces.items():
        ticks = np.concatenate([ticks for ticks, _ in found])
        order = np.argsort(ticks)
        gaps = np.flatnonzero(ticks[order] != np.arange(len(ticks)))
        complete.append(int(gaps[0]) if len(gaps) else len(ticks))
        values = np.concatenate([values for _, values in found])[order]
        columns[name] = values if COLUMNS[name].width else values[:, 0]
    return completed({name: values[: min(complete)].copy() for name, values in columns.items()})


_Pieces = dict[str, list[tuple[NDArray[np.int64], NDArray[np.generic]]]]


def _pieces(path: Path, whole: Path, variant: str | None) -> _Pieces:
    """Return ticks and values of the chunks of each column, in any order."""
    pieces: _Pieces = {name: [] for name in COLUMNS}
    prefix = "/" if variant is None else f"/{prefix_of(variant)}"
    try:
        for chunk in RrdReader(whole).stream().filter(content=f"{prefix}columns/**", is_static=False):
            name = chunk.entity_path.rpartition("/")[2]
            if name in pieces:
                pieces[name].append(_decoded(chunk.to_record_batch()))
        pieces = {name: found for name, found in pieces.items() if found or name not in ADDED}
        variants = [] if all(pieces.values()) else _variants(whole)
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"{path}: is damaged, or not a recording: {one_line(error)}") from None
    if all(pieces.values()):
        return pieces
    if variants:
        wanted = "holds variants" if variant is None else f'has no columns of the variant "{variant}"'
        raise RecordingError(f"{path}: {wanted}; its variants: {'; '.join(variants)}")
    raise RecordingError(f"{path}: has no columns of a run of rmrc")


def _variants(whole: Path) -> list[str]:
    """Return the labels of the variants that a recording holds."""
    chunks = RrdReader(whole).stream().filter(content="/variants/**", is_static=False)
    found = (re.match(r"/variants/((?:\\.|[^/\\])+)/columns/", chunk.entity_path) for chunk in chunks)
    return list(dict.fromkeys(re.sub(r"\\(.)", r"\1", match[1]) for match in found if match))


def _decoded(batch: pa.RecordBatch) -> tuple[NDArray[np.int64], NDArray[np.generic]]:
    """Return ticks (T,) and values (T, width) of a chunk that has one component."""
    (values,) = [
        c for c, f in zip(batch.columns, batch.schema, strict=True) if isinstance(f.type, pa.ListType)
    ]
    ticks = batch.column("tick").to_numpy(zero_copy_only=False)
    return ticks, values.flatten().to_numpy(zero_copy_only=False).reshape(len(batch), -1)
