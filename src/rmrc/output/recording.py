"""A run as a rerun recording: every column bit for bit, and a picture of the arm that tells the story.

While a run goes on, the recording is `NAME.rrd.part` beside its final name; each block is flushed, so
that a killed process loses at most one block. `finish` closes it and renames it to `NAME.rrd`.

Entities, one name everywhere:

    columns/<name>   every column of the run at every tick; float64 scalars, status as int64
    error            position [mm] and rotation [mrad], of the axes that the task has
    arm/<body>       poses, with the geometries as static children
    target/..        path, and the pose wanted at the moment
    tip/..           trail, ellipsoids and the dying direction
    status/<flag>    one lane for each status, only where it changes
    text/..          legend, scorecard, scenario

Timelines: `tick` counts control ticks; `sim_time` is `time` rounded to the nearest nanosecond, while
columns/time keeps all its bits.
"""

import tempfile
from functools import lru_cache
from pathlib import Path
from threading import Thread
from types import TracebackType
from typing import Any, Self
from uuid import uuid4

import numpy as np
import pyarrow.lib as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from rmrc.control.records import Status
from rmrc.errors import RmrcError
from rmrc.output.look import (
    CYAN,
    LEGEND,
    STATUS_COLORS,
    YELLOW,
    blueprint,
    curves,
    geometry,
    lane,
    marks,
    ramp,
    xyzw,
)
from rmrc.output.scene import Frames, Scene
from rmrc.output.viewer import repair
from rmrc.preparation import Prepared
from rmrc.run import COLUMNS, Run
from rmrc.spatial import AXES

# What is drawn is stored so often: more than a screen shows, a tenth of the ticks at 1 kHz.
FRAME_PERIOD = 0.01

# Seconds that a block of some 0.5 MB may take to reach the disk. Rerun waits for ever for a writer that
# found the disk full, if the writer ends at the wrong moment.
PATIENCE = 10.0


class RecordingError(RmrcError, OSError):
    """A recording cannot be written or read."""


class Recorder:
    """Writes one run, block by block.

    Use it as a context manager. Left without `finish`, it keeps and closes `part_path`.

    Attributes:
        path: Where the finished recording appears.
        part_path: Where it grows until then.
    """

    def __init__(self, path: Path, prepared: Prepared) -> None:
        """Open the file, and write all that is known before the run.

        Args:
            path: Of the finished recording, ending in `.rrd`; its folder is made if needed.
            prepared: The world that will run.

        Raises:
            RecordingError: The file cannot be made.
        """
        self.path, self.part_path = path, path.with_name(path.name + ".part")
        self._scene, self._name = Scene(prepared), prepared.scenario.name
        self._stride = max(1, round(FRAME_PERIOD / prepared.scenario.control.period))
        self._ticks = self._framed = 0
        self._planned = len(prepared.reference.time)
        rows = [AXES.index(axis) for axis in prepared.scenario.task.axes]
        self._translations = [row for row in rows if row < 3]
        self._rotations = [row for row in rows if row > 2]
        self._last: Run | None = None
        self._tip = self._scene.path[:1]
        self._status: int | None = None
        self._lanes: set[Status] = set()
        rr.set_strict_mode(True)  # its errors are only warnings otherwise
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.part_path.unlink(missing_ok=True)
            self._stream = rr.RecordingStream("rmrc", recording_id=f"{self._name}-{uuid4().hex[:8]}")
            self._stream.set_log_time_enabled(False)
            self._stream.save(self.part_path, default_blueprint=blueprint(self._scene, prepared))
        except (OSError, RuntimeError, ValueError) as error:
            raise _cannot_write(self.part_path, _one_line(error)) from None
        self._open = True
        self._write_static(prepared)

    def __enter__(self) -> Self:
        """Return the recorder."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; what was written stays in `part_path` if `finish` was not called."""
        self._close()

    def write(self, part: Run) -> None:
        """Write and flush one block of ticks; blocks come in order.

        Args:
            part: A run that holds only the ticks of this block.

        Raises:
            RecordingError: The file cannot be written.
        """
        if len(part):
            ticks = np.arange(self._ticks, self._ticks + len(part))
            index = _index(ticks, part["time"])
            self._write_columns(part, index)
            self._write_status(part, ticks)
            shown = np.flatnonzero((ticks % self._stride == 0) | (ticks == self._planned - 1))
            self._write_frames(part, ticks, shown)
            self._ticks += len(part)
            self._last = part
        if part.divergence is not None:
            at = _index(np.array([part.divergence.tick]), np.array([part.divergence.time]))
            self._send("status/diverged", at, rr.StateChange.columns(state=[str(part.divergence)]))
        self._flush()

    def finish(self, scorecard_markdown: str) -> None:
        """Add the scorecard, close the file and move it to `path`.

        Args:
            scorecard_markdown: Shown below the picture.

        Raises:
            RecordingError: The file cannot be written.
        """
        if self._last is not None and self._framed < self._ticks:  # a run that was cut short
            ticks = np.arange(self._ticks - len(self._last), self._ticks)
            self._write_frames(self._last, ticks, np.array([len(ticks) - 1]))
        self._log_text("text/scorecard", scorecard_markdown)
        self._flush()
        self._close()
        try:
            self.part_path.replace(self.path)
        except OSError as error:
            raise _cannot_write(self.path, _one_line(error)) from None

    # What never changes -------------------------------------------------------------------------

    def _write_static(self, prepared: Prepared) -> None:
        stream, scene = self._stream, self._scene
        stream.send_recording_name(self._name)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for body in sorted({shape.body for shape in scene.shapes}):
            if scene.is_fixed[body]:
                pose = prepared.arm.frames(prepared.qpos[prepared.arm.wiring.qpos][None])[0][0, body]
                quaternion = rr.Quaternion(xyzw=xyzw(pose[3:]))
                transform = rr.Transform3D(translation=pose[:3], quaternion=quaternion)
                stream.log(self._body_path(body), transform, static=True)
        for shape in scene.shapes:
            path = f"{self._body_path(shape.body)}/{rr.escape_entity_path_part(shape.name)}"
            stream.log(path, geometry(shape), static=True)

        for path, look in marks(scene).items():
            stream.log(path, look, static=True)
        for path, look in curves(prepared).items():
            stream.log(path, look, static=True)
        self._log_text("text/legend", LEGEND)
        self._log_text("text/scenario", f"```yaml\n{prepared.scenario.to_yaml()}```\n")

    # Blocks -------------------------------------------------------------------------------------

    def _write_columns(self, part: Run, index: list[rr.TimeColumn]) -> None:
        for name, values in part.columns.items():
            descriptor = STATUS if name == "status" else SCALARS
            self._send(f"columns/{name}", index, [_Values(descriptor, values)])
        kinds = [rows for rows in (self._translations, self._rotations) if rows]
        norms = [1e3 * np.linalg.norm(part["pose_error"][:, rows], axis=1) for rows in kinds]
        self._send("error", index, [_Values(SCALARS, np.column_stack(norms))])

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
                self._stream.log(f"status/{flag.name}", lane(flag), static=True)
            states = [str(flag.name) if on else "" for on in is_on[rows]]  # an empty state ends the last
            index = _index(ticks[rows], part["time"][rows])
            self._send(f"status/{flag.name}", index, rr.StateChange.columns(state=states))

    def _write_frames(self, part: Run, ticks: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        if not len(rows):
            return
        frames = self._scene.frames(part, rows)
        index = _index(ticks[rows], part["time"][rows])
        for body in range(1, len(self._scene.body_names)):
            if not self._scene.is_fixed[body]:
                pose = frames.bodies[:, body]
                values = [_Values(TRANSLATION, pose[:, :3]), _Values(ROTATION, xyzw(pose[:, 3:]))]
                self._send(self._body_path(body), index, values)
        self._send("tip/now", index, [_Values(POINT, frames.tip)])
        self._send("target/now", index, [_Values(POINT, frames.target)])
        self._write_tip(frames, index)
        self._framed = int(ticks[rows[-1]]) + 1

    def _write_tip(self, frames: Frames, index: list[rr.TimeColumn]) -> None:
        before = np.concatenate([self._tip, frames.tip[:-1]])
        self._tip = frames.tip[-1:]
        colors = ramp(frames.nearness, YELLOW)
        segments = np.stack([before, frames.tip], axis=1)
        self._send("tip/trail", index, [_Values(STRIP, segments), _Values(STRIP_COLOR, colors)])
        turned = xyzw(frames.axes)
        for name, half in (("velocity", frames.velocity), ("force", frames.force)):
            values = [_Values(CENTER, frames.tip), _Values(HALF, half), _Values(TURN, turned)]
            self._send(f"tip/{name}_ellipsoid", index, values)
        origins = np.stack([frames.tip, frames.tip], axis=1)
        arrows = (
            ("move", self._translations, frames.dying_move, YELLOW),
            ("turn", self._rotations, frames.dying_turn, CYAN),
        )
        for name, rows, vector, calm in arrows:
            if not rows:
                continue
            both_ways = np.stack([vector, -vector], axis=1)
            colors = np.repeat(ramp(frames.nearness, calm)[:, None], 2, axis=1)
            values = [_Values(VECTOR, both_ways), _Values(ORIGIN, origins), _Values(ARROW_COLOR, colors)]
            self._send(f"tip/dying_{name}", index, values)

    # The stream ---------------------------------------------------------------------------------

    def _send(self, path: str, index: list[rr.TimeColumn], columns: Any) -> None:
        try:
            self._stream.send_columns(path, index, columns)
        except (OSError, RuntimeError) as error:
            self._abandon()
            raise _cannot_write(self.part_path, _one_line(error)) from None

    def _flush(self) -> None:
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except (OSError, RuntimeError, ValueError) as error:
            self._abandon()
            raise _cannot_write(self.part_path, f"{_one_line(error)}; is the disk full?") from None

    def _abandon(self) -> None:
        """Close a stream whose writer has failed, which may last for ever: here, or else at exit.

        A thread that hangs keeps the stream from being closed once more as garbage.
        """
        self._open = False
        rr.unregister_shutdown()
        closing = Thread(target=self._stream.disconnect, daemon=True)
        closing.start()
        closing.join(1.0)  # it takes milliseconds, or for ever

    def _close(self) -> None:
        if self._open:
            self._open = False
            self._stream.disconnect()

    def _log_text(self, path: str, markdown: str) -> None:
        self._stream.log(path, rr.TextDocument(markdown, media_type="text/markdown"), static=True)

    def _body_path(self, body: int) -> str:
        return f"arm/{rr.escape_entity_path_part(self._scene.body_names[body])}"


def read_columns(path: Path) -> dict[str, NDArray[np.generic]]:
    """Return all columns of a recording, or of what a killed process left of one, bit for bit.

    Args:
        path: A `.rrd` or `.rrd.part` file.

    Returns:
        Arrays by the names of `rmrc.run.COLUMNS`, sorted by tick: (T,) or (T, width). A block that
        was torn is left out.

    Raises:
        RecordingError: The file is missing, damaged, or no recording of a run.
        ViewerError: A `.part` that cannot be repaired.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: no such recording")
    with tempfile.TemporaryDirectory(prefix="rmrc-") as folder:
        whole = path
        if path.suffix == ".part":
            whole = Path(folder) / path.stem
            repair(path, whole)
        pieces = _pieces(path, whole)
    columns, complete = {}, []
    for name, found in pieces.items():
        ticks = np.concatenate([ticks for ticks, _ in found])
        order = np.argsort(ticks)
        gaps = np.flatnonzero(ticks[order] != np.arange(len(ticks)))
        complete.append(int(gaps[0]) if len(gaps) else len(ticks))
        values = np.concatenate([values for _, values in found])[order]
        columns[name] = values if COLUMNS[name].width else values[:, 0]
    return {name: values[: min(complete)].copy() for name, values in columns.items()}


_Pieces = dict[str, list[tuple[NDArray[np.int64], NDArray[np.generic]]]]


def _pieces(path: Path, whole: Path) -> _Pieces:
    """Return ticks and values of the chunks of each column, in any order."""
    pieces: _Pieces = {name: [] for name in COLUMNS}
    try:
        for chunk in RrdReader(whole).stream().filter(content="/columns/**", is_static=False):
            name = chunk.entity_path.rpartition("/")[2]
            if name in pieces:
                pieces[name].append(_decoded(chunk.to_record_batch()))
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"{path}: is damaged, or not a recording: {_one_line(error)}") from None
    if not all(pieces.values()):
        raise RecordingError(f"{path}: has no columns of a run of rmrc")
    return pieces


def _decoded(batch: pa.RecordBatch) -> tuple[NDArray[np.int64], NDArray[np.generic]]:
    """Return ticks (T,) and values (T, width) of a chunk that has one component."""
    (values,) = [
        c for c, f in zip(batch.columns, batch.schema, strict=True) if isinstance(f.type, pa.ListType)
    ]
    ticks = batch.column("tick").to_numpy(zero_copy_only=False)
    return ticks, values.flatten().to_numpy(zero_copy_only=False).reshape(len(batch), -1)


def _never_null(kind: pa.DataType, size: int = -1) -> pa.DataType:
    """Return the list type that the viewer asks for; it draws nothing from a list that may hold nulls."""
    return pa.list_(pa.field("item", kind, nullable=False), size)


class _Component:
    """What a column holds: so many numbers of a kind make one value."""

    def __init__(
        self, descriptor: rr.ComponentDescriptor, kind: pa.DataType, size: int = 1, is_strip: bool = False
    ) -> None:
        self.descriptor, self.size, self.is_strip = descriptor, size, is_strip
        self.dtype = np.dtype(kind.to_pandas_dtype())
        self.value = _never_null(kind, size) if size > 1 else kind
        self.strip = _never_null(self.value)


class _Values:
    """A column of one component, straight from an array: four times faster than rerun's archetypes.

    Rows are the first axis; a second axis before the components' own makes several instances a row.
    """

    def __init__(self, component: _Component, values: NDArray[np.generic]) -> None:
        self._descriptor = component.descriptor
        flat = pa.array(np.ascontiguousarray(values, component.dtype).reshape(-1))
        if component.size > 1:
            flat = pa.FixedSizeListArray.from_arrays(flat, type=component.value)
        rows, instances = len(values), len(flat) // len(values)
        if component.is_strip:  # one line of several points a row
            flat = pa.ListArray.from_arrays(_offsets(rows, instances), flat, type=component.strip)
            instances = 1
        self._array = pa.ListArray.from_arrays(_offsets(rows, instances), flat)

    def component_descriptor(self) -> rr.ComponentDescriptor:
        return self._descriptor

    def as_arrow_array(self) -> pa.Array:
        return self._array


@lru_cache(maxsize=64)
def _offsets(rows: int, instances: int) -> pa.Array:
    return pa.array(np.arange(rows + 1, dtype=np.int32) * instances)


SCALARS = _Component(rr.Scalars.descriptor_scalars(), pa.float64())
STATUS = _Component(rr.ComponentDescriptor("status"), pa.int64())
TRANSLATION = _Component(rr.Transform3D.descriptor_translation(), pa.float32(), 3)
ROTATION = _Component(rr.Transform3D.descriptor_quaternion(), pa.float32(), 4)
POINT = _Component(rr.Points3D.descriptor_positions(), pa.float32(), 3)
STRIP = _Component(rr.LineStrips3D.descriptor_strips(), pa.float32(), 3, is_strip=True)
STRIP_COLOR = _Component(rr.LineStrips3D.descriptor_colors(), pa.uint32())
CENTER = _Component(rr.Ellipsoids3D.descriptor_centers(), pa.float32(), 3)
HALF = _Component(rr.Ellipsoids3D.descriptor_half_sizes(), pa.float32(), 3)
TURN = _Component(rr.Ellipsoids3D.descriptor_quaternions(), pa.float32(), 4)
VECTOR = _Component(rr.Arrows3D.descriptor_vectors(), pa.float32(), 3)
ORIGIN = _Component(rr.Arrows3D.descriptor_origins(), pa.float32(), 3)
ARROW_COLOR = _Component(rr.Arrows3D.descriptor_colors(), pa.uint32())


def _index(ticks: NDArray[np.int64], time: NDArray[np.float64]) -> list[rr.TimeColumn]:
    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn("sim_time", duration=nanoseconds), rr.TimeColumn("tick", sequence=ticks)]


def _cannot_write(path: Path, reason: str) -> RecordingError:
    return RecordingError(f"{path}: cannot write the recording: {reason}")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
