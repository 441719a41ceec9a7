"""A world of the ideal plant as a page begins it: its record, and what the record holds addresses of.

The record is that of a run, with room for CAPACITY joints. MuJoCo is absent: the law follows the arm's own
chain. A page places the arrays, writes where they are, and does the ticks by `rmrc.export.objects`' code.
"""

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.export.objects import NOTHING, name_of
from rmrc.law.measurement import CHAIN_ALONE
from rmrc.law.record import field_offset, new_worlds, world_type
from rmrc.plants.engine import BAD_LAST
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.reference import TWIST
from rmrc.simulation.world import World, words_of_columns
from rmrc.support.errors import QuestionError

# Joints, axes and followers that the record of a page holds.
CAPACITY = 16
# Words of the engine that count something; all others are addresses.
_COUNTS = (
    "nq nv qpos_at dof followers follows follower_qpos follower_dof follower_ratio follower_offset ticks "
    "path_size path_ticks record_size width rows past_rows"
)


def image(prepared: Prepared, more: Mapping[str, NDArray[np.int64]] | None = None) -> dict[str, Any]:
    """Return the start of a world, for `law.mjs`, as JSON can hold it.

    Args:
        prepared: A scenario with the ideal plant.
        more: Further columns: words of the record by their names.

    Raises:
        QuestionError: A page cannot run it.
    """
    _refuse(prepared)
    world = World(prepared)
    records = _widened(world.record)
    record, arm = records[0], prepared.arm
    engine = record["engine"]
    words = {**words_of_columns(records.dtype, arm.n, int(record["k"])), **(more or {})}
    sources = np.concatenate([*words.values()])
    ticks, path = prepared.most_ticks, prepared.reference.numbers
    engine["ticks"] = engine["rows"] = ticks
    engine["path_ticks"], engine["path_size"] = prepared.reference.ticks, len(path)
    engine["record_size"], engine["width"] = records.itemsize // 8, len(sources)
    arrays: dict[str, NDArray[Any] | int] = {
        "qpos": prepared.qpos,
        "qvel": 8 * int(engine["nv"]),
        "warning_count": 8 * (BAD_LAST + 1),
        "warning_info": 8 * (BAD_LAST + 1),
        "path": path,
        "reference": 8 * TWIST * prepared.reference.ticks,
        "sources": sources,
        "columns": 8 * len(sources) * ticks,
        "past": 8 * int(engine["past_rows"]) * (2 * arm.n + 1),
        "chance": _chance(prepared),
    }
    if world.positions is not None:
        arrays["positions"] = 8 * int(engine["nq"]) * ticks
    world.release()
    firsts = np.cumsum([0, *map(len, words.values())]).tolist()
    return {
        "record": _text(records),
        "methods": [[offset("methods", field), name_of(method)] for field, method in world.methods.items()]
        + [[offset("engine", "begin"), NOTHING]],
        "arrays": {name: _array(name, values) for name, values in arrays.items()},
        "words": {name: offset("engine", name) for name in ("next", "last", "ticks", "diverged", "record")},
        "columns": {
            name: [first, 0 if name in COLUMNS and not COLUMNS[name].width else len(part)]
            for (name, part), first in zip(words.items(), firsts, strict=False)
        },
        "width": len(sources),
        "nq": int(engine["nq"]),
    }


def offset(group: str, field: str) -> int:
    """Return where a field of a group begins in the record of a page [bytes]."""
    return field_offset(world_type(CAPACITY), group, field)


def _refuse(prepared: Prepared) -> None:
    """Refuse what a page cannot run.

    Raises:
        QuestionError: It cannot run this.
    """
    arm, plant = prepared.arm, prepared.scenario.plant
    room = max(arm.n, len(arm.axis_names), len(arm.followers))
    if plant.kind != "ideal":
        raise QuestionError(f'a page runs plant.kind "ideal" alone, got "{plant.kind}"')
    if room > CAPACITY:
        raise QuestionError(f"a page holds {CAPACITY} joints, axes and followers at most, got {room}")
    if plant.stretch:
        raise QuestionError("a page cannot run plant.stretch, which needs MuJoCo; leave it out")


def _widened(source: np.void) -> NDArray[np.void]:
    """Return the record of a world with room for CAPACITY joints, and without addresses, (1,)."""
    records = new_worlds(1, int(source["n"]), CAPACITY)
    names: Any = records.dtype.names
    for group in names:
        fields = records[group].dtype.names or ()
        if not fields:
            records[group] = source[group]
        for field in _COUNTS.split() if group == "engine" else () if group == "methods" else fields:
            values = source[group][field]
            wide = records[group][field][0] if values.ndim else records[group][field]
            wide[tuple(map(slice, values.shape)) or ...] = values
    records["input"]["sites"] = CHAIN_ALONE
    return records


def _chance(prepared: Prepared) -> NDArray[np.float64] | int:
    """Return the random numbers of all ticks, or the room for them where none counts."""
    plant, draw = prepared.scenario.plant, prepared.hardware.chance()
    counts = prepared.hardware.encoders.is_noisy or plant.jitter > 0.0 or plant.loss > 0.0
    return draw(prepared.most_ticks) if draw and counts else 8 * prepared.most_ticks * (prepared.arm.n + 2)


def _array(name: str, values: NDArray[Any] | int) -> list[Any]:
    """Return where the address of an array stands, its size [bytes], and its values, empty for zeros."""
    if isinstance(values, int):
        return [offset("engine", name), values, ""]
    return [offset("engine", name), values.nbytes, _text(values)]


def _text(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
