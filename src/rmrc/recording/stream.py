"""A recording that grows block by block: its file, its two timelines, and columns straight from arrays.

During a run the recording is `NAME.rrd.part` beside its final name. Each block is flushed, so
that a killed process loses the columns of at most one block. `finish` closes it and renames it to `NAME.rrd`.

Timelines: `tick` counts control ticks; `sim_time` is `time` rounded to the nearest nanosecond.
"""

import re
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from threading import Thread
from typing import Any
from uuid import uuid4
from zlib import crc32

import numpy as np
import pyarrow.lib as pa
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rmrc.recording.viewer import is_torn
from rmrc.support.errors import RmrcError

# Seconds that a block of some 0.5 MB may take to reach the disk. Rerun waits forever for a writer that
# found the disk full, if the writer ends at the wrong moment.
PATIENCE = 10.0


# A layout takes 200 kB and some 10 ms, and serves a recording that is never finished. It is written with this
# block, or with the first one after this time [s]. A run that is over by then has a layout of its own.
PATIENT, LONG = 8, 2.0


class RecordingError(RmrcError, OSError):
    """A recording cannot be written or read."""


class Stream:
    """A recording that is being written.

    Attributes:
        path: Where the finished recording appears.
        part_path: Where it grows until then.
        is_open: Whether it takes more.
        is_laid_out: Whether it has a layout.
    """

    def __init__(
        self, path: Path, name: str, opening: rrb.Blueprint, layout: Callable[[], rrb.Blueprint]
    ) -> None:
        """Open the file.

        Args:
            path: Path of the finished recording, ending in `.rrd`; its folder is created if missing.
            name: Name of the recording, as the viewer shows it.
            opening: Blocks that a page shows while it loads the rest, if `open` writes it.
            layout: The viewer's layout if it is never finished; written with block `PATIENT`, or later.

        Raises:
            RecordingError: The file cannot be made.
        """
        self.path, self.part_path = path, path.with_name(path.name + ".part")
        rr.set_strict_mode(True)  # otherwise its errors are only warnings
        try:
            str(self.part_path).encode()
        except UnicodeEncodeError:  # rerun refuses such a path, with a colored message
            raise _cannot_write(
                self.part_path, "its path is not UTF-8; give another folder with --out"
            ) from None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.part_path.unlink(missing_ok=True)
            # The viewer takes no two recordings of one application whose arms have different joints.
            self._stream = rr.RecordingStream(
                application(path.stem), recording_id=f"{name}-{uuid4().hex[:8]}", send_properties=False
            )
            self._stream.set_log_time_enabled(False)
            self._stream.save(self.part_path)
        except (OSError, RuntimeError, ValueError) as error:
            raise _cannot_write(self.part_path, one_line(error)) from None
        self.is_open, self._flushes, self.is_laid_out, self._layout = True, 0, False, layout
        self._opened = time.monotonic()
        self._opening: rrb.Blueprint | None = opening
        self.log("__properties", rr.archetypes.RecordingInfo(name=name, start_time=time.time_ns()))
        self.log("", rr.ViewCoordinates.RIGHT_HAND_Z_UP)

    def log(self, path: str, *what: rr.AsComponents) -> None:
        """Write static values together, as each write of an entity takes a kilobyte or two."""
        self._stream.log(path or "/", *what, static=True)

    def log_text(self, path: str, markdown: str) -> None:
        """Write a static text."""
        self.log(path, rr.TextDocument(markdown, media_type="text/markdown"))

    def open(self) -> None:
        """Write the layout of a page while it loads the rest, once: 50 kB, which short runs do not need."""
        if self._opening is not None:
            self._stream.send_blueprint(self._opening, make_active=False, make_default=True)
            self._opening = None

    def lay_out(self, layout: rrb.Blueprint) -> None:
        """Replace the layout by one with the ranges of the whole run.

        It is made active: a page that reads the file as it comes has opened the first one by then.
        """
        self.is_laid_out = True
        self._stream.send_blueprint(layout, make_active=True, make_default=True)

    def send(self, path: str, index: list[rr.TimeColumn], columns: Any) -> None:
        """Write values over time.

        Raises:
            RecordingError: The file cannot be written.
        """
        try:
            self._stream.send_columns(path, index, columns)
        except (OSError, RuntimeError) as error:
            self._abandon()
            raise _cannot_write(self.part_path, one_line(error)) from None

    def flush(self) -> None:
        """Write everything to the disk.

        Raises:
            RecordingError: The file cannot be written.
        """
        self._flushes += 1
        is_long = self._flushes >= PATIENT and time.monotonic() - self._opened > LONG
        if is_long and not self.is_laid_out:
            self.lay_out(self._layout())
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except (OSError, RuntimeError, ValueError) as error:
            self._abandon()
            raise _cannot_write(self.part_path, f"{one_line(error)}; is the disk full?") from None

    def finish(self) -> None:
        """Close the file and move it to `path`.

        Raises:
            RecordingError: The file cannot be written.
        """
        self.flush()
        self.close()
        if is_torn(self.part_path):  # rerun reports no error at its end
            raise _cannot_write(self.part_path, "its end is missing; is the disk full?")
        try:
            self.part_path.replace(self.path)
        except OSError as error:
            raise _cannot_write(self.path, one_line(error)) from None

    def close(self) -> None:
        """Close the file, wherever it is; once is enough."""
        if self.is_open:
            self.is_open = False
            self._stream.disconnect()

    def _abandon(self) -> None:
        """Close a stream whose writer has failed, which may take forever, here or at exit.

        A hanging thread keeps the stream alive, so that the garbage collector does not close it again.
        """
        self.is_open = False
        rr.unregister_shutdown()
        closing = Thread(target=self._stream.disconnect, daemon=True)
        closing.start()
        closing.join(1.0)  # it takes milliseconds, or forever


def index(ticks: NDArray[np.int64], time: NDArray[np.float64]) -> list[rr.TimeColumn]:
    """Return both timelines of some ticks, (T,) each; time in seconds."""
    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn("sim_time", duration=nanoseconds), rr.TimeColumn("tick", sequence=ticks)]


def application(stem: str) -> str:
    """Return the name of the application of a recording, by the name of its file without the suffix.

    Rerun warns of other characters, and of a longer name; a checksum distinguishes names with replacements.

    Example:
        >>> application("reach"), application("reach.compare")
        ('rmrc reach', 'rmrc reach-compare-e545e625')
    """
    plain = re.sub(r"[^A-Za-z0-9 _-]", "-", stem)[:100]
    return f"rmrc {plain}" if plain == stem else f"rmrc {plain}-{crc32(stem.encode(errors='replace')):08x}"


def one_line(error: Exception) -> str:
    """Return a foreign error as part of a message."""
    return " ".join(str(error).split())


def _cannot_write(path: Path, reason: str) -> RecordingError:
    return RecordingError(f"{path}: cannot write the recording: {reason}")


# Columns ----------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def _never_null(kind: pa.DataType, size: int = -1) -> pa.DataType:
    """Return the list type that the viewer needs; it draws nothing from a list that may hold nulls."""
    return pa.list_(pa.field("item", kind, nullable=False), size)


@lru_cache(maxsize=16)
def _kind(dtype: np.dtype[np.generic]) -> pa.DataType:
    return pa.from_numpy_dtype(dtype)


def _flat(values: NDArray[np.generic]) -> pa.Array:
    """Return all numbers of a contiguous array, without a copy."""
    return pa.Array.from_buffers(_kind(values.dtype), values.size, [None, pa.py_buffer(values)])


class Component:
    """The type of a column, whose values each have some numbers of one kind."""

    def __init__(
        self, descriptor: rr.ComponentDescriptor, kind: pa.DataType, size: int = 1, is_strip: bool = False
    ) -> None:
        """Find the types of arrow."""
        self.descriptor, self.size, self.is_strip = descriptor, size, is_strip
        self.dtype: np.dtype[Any] = pa.array([], kind).to_numpy().dtype  # needs no pandas, in any version
        self.value = _never_null(kind, size) if size > 1 else kind
        self.strip = _never_null(self.value)


class Values:
    """A column of one component, straight from an array: four times faster than rerun's archetypes.

    Rows are the first axis; a second axis before the component's own gives several instances per row.
    """

    def __init__(self, component: Component, values: NDArray[np.generic]) -> None:
        """Arrange the values in arrow's layout, without needless copies."""
        self._descriptor = component.descriptor
        flat = _flat(np.ascontiguousarray(values, component.dtype))
        if component.size > 1:
            flat = pa.FixedSizeListArray.from_arrays(flat, type=component.value)
        rows, instances = len(values), len(flat) // len(values)
        if component.is_strip:  # one line of several points per row
            flat = pa.ListArray.from_arrays(_offsets(rows, instances), flat, type=component.strip)
            instances = 1
        self._array = pa.ListArray.from_arrays(_offsets(rows, instances), flat)

    def component_descriptor(self) -> rr.ComponentDescriptor:
        """Return the type of the column; rerun asks for it."""
        return self._descriptor

    def as_arrow_array(self) -> pa.Array:
        """Return the column; rerun asks for it."""
        return self._array


class Table:
    """A component that holds all numbers of a tick by name: a struct, of lists where there are several.

    One component of many fields takes half the bytes of as many components with one list per tick each.
    """

    def __init__(self, name: str, fields: Mapping[str, NDArray[np.generic]]) -> None:
        """Arrange the fields in arrow's layout.

        Args:
            name: Name of the component.
            fields: By name, (T,) or (T, width) each.
        """
        self._name = name
        arrays, types = [], []
        for field, values in fields.items():
            flat = _flat(np.ascontiguousarray(values))
            if values.ndim > 1:
                kind = _never_null(flat.type, values.shape[1])
                flat = pa.FixedSizeListArray.from_arrays(flat, type=kind)
            arrays.append(flat)
            types.append(_named(field, flat.type))
        rows = pa.StructArray.from_arrays(arrays, fields=types)
        self._array = pa.ListArray.from_arrays(_offsets(len(rows), 1), rows)

    def component_descriptor(self) -> rr.ComponentDescriptor:
        """Return the type of the column; rerun asks for it."""
        return _described(self._name)

    def as_arrow_array(self) -> pa.Array:
        """Return the column; rerun asks for it."""
        return self._array


@lru_cache(maxsize=256)
def _named(field: str, kind: pa.DataType) -> pa.Field:
    return pa.field(field, kind, nullable=False)


@lru_cache(maxsize=16)
def _described(name: str) -> rr.ComponentDescriptor:
    return rr.ComponentDescriptor(name)


@lru_cache(maxsize=64)
def _offsets(rows: int, instances: int) -> pa.Array:
    return pa.array(np.arange(rows + 1, dtype=np.int32) * instances)


@lru_cache(maxsize=16)
def short(name: str) -> Component:
    """Return a component of our own that is only drawn: of float32."""
    return Component(_described(name), pa.float32())


TRANSLATION = Component(rr.Transform3D.descriptor_translation(), pa.float32(), 3)
ROTATION = Component(rr.Transform3D.descriptor_quaternion(), pa.float32(), 4)
POINT = Component(rr.Points3D.descriptor_positions(), pa.float32(), 3)
STRIP = Component(rr.LineStrips3D.descriptor_strips(), pa.float32(), 3, is_strip=True)
STRIP_COLOR = Component(rr.LineStrips3D.descriptor_colors(), pa.uint32())
CENTER = Component(rr.Ellipsoids3D.descriptor_centers(), pa.float32(), 3)
HALF = Component(rr.Ellipsoids3D.descriptor_half_sizes(), pa.float32(), 3)
TURN = Component(rr.Ellipsoids3D.descriptor_quaternions(), pa.float32(), 4)
VECTOR = Component(rr.Arrows3D.descriptor_vectors(), pa.float32(), 3)
ORIGIN = Component(rr.Arrows3D.descriptor_origins(), pa.float32(), 3)
ARROW_COLOR = Component(rr.Arrows3D.descriptor_colors(), pa.uint32())
