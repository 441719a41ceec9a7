"""The entities of one run in a recording, and values over its two timelines.

`tick` counts control ticks; `sim_time` is the time rounded to nanoseconds, while the column `time` keeps all
its bits.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as untyped
import rerun as rr
from numpy.typing import NDArray

pa: Any = untyped


@dataclass(frozen=True)
class Stream:
    """Writes the entities of one run.

    Attributes:
        recording: Where to write.
        prefix: Begins the path of each entity; "" or ends with a slash.
    """

    recording: rr.RecordingStream
    prefix: str = ""

    def log(self, path: str, *values: rr.AsComponents) -> None:
        """Write values that stay the same."""
        self.recording.log(self.prefix + path, *values, static=True)

    def send(self, path: str, ticks: NDArray[np.int64], time: NDArray[np.float64], columns: Any) -> None:
        """Write values at some ticks, (T,), and their time [s]."""
        nanoseconds = np.rint(1e9 * time).astype("timedelta64[ns]")
        index = [rr.TimeColumn("sim_time", duration=nanoseconds), rr.TimeColumn("tick", sequence=ticks)]
        self.recording.send_columns(self.prefix + path, index, columns)


def struct(columns: Mapping[str, NDArray[Any]], part: slice) -> Any:
    """Return some ticks of columns, (T,) or (T, width) each, as structs, bit for bit.

    No item may be null: the viewer draws nothing from a list that may hold nulls.
    """
    arrays, fields = [], []
    for name, values in columns.items():
        array = pa.array(np.ascontiguousarray(values[part]).reshape(-1))
        if values.ndim > 1:
            items = pa.list_(pa.field("item", array.type, nullable=False), values.shape[1])
            array = pa.FixedSizeListArray.from_arrays(array, type=items)
        arrays.append(array)
        fields.append(pa.field(name, array.type, nullable=False))
    return pa.StructArray.from_arrays(arrays, fields=fields)
