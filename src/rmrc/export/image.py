"""A world of the ideal plant as a page begins it: its record, and what the record holds addresses of.

The record has room for CAPACITY joints. MuJoCo is absent: the law follows the arm's own chain. `law.mjs`
places the arrays, writes where they are, and does the ticks by the code of `rmrc.export.objects`.
"""

import base64
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.export.objects import NOTHING, name_of
from rmrc.law.compiling import Method
from rmrc.law.record import METHODS, field_offset, new_worlds, world_type
from rmrc.plants.engine import BAD_LAST
from rmrc.plants.stages import transmission
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.reference import TWIST
from rmrc.simulation.world import methods, words_of_columns
from rmrc.support.errors import QuestionError

# Joints, axes and followers that the record of a page holds; the longest delay in a page [s].
CAPACITY, LATEST = 16, 0.2


def begun(prepared: Prepared) -> tuple[NDArray[np.void], dict[str, Method]]:
    """Return a record, (1,), with all that law and hardware write; and the methods, by their fields in it.

    The stage between law and plant is there even where it does nothing, so that delay and lag, which both
    need it, do not depend on each other.
    """
    records = new_worlds(1, prepared.arm.n, CAPACITY)
    prepared.law.write(records[0])
    prepared.hardware.write(records[0])
    return records, {**methods(prepared), "transmission": transmission}


def image(prepared: Prepared) -> dict[str, Any]:
    """Return the start of a world, for `law.mjs`, as JSON can hold it; its path is not in it.

    Args:
        prepared: A scenario with the ideal plant.

    Raises:
        QuestionError: A page cannot run it.
    """
    arm, n = prepared.arm, prepared.arm.n
    room = max(n, len(arm.axis_names), len(arm.followers))
    if room > CAPACITY:
        raise QuestionError(f"a page holds {CAPACITY} joints, axes and followers at most, got {room}")
    if prepared.scenario.plant.stretch:
        raise QuestionError("a page cannot run plant.stretch, which needs MuJoCo; leave it out")
    records, called = begun(prepared)
    record, engine = records[0], records[0]["engine"]
    J, frame, rate = offset("state", "J"), offset("chain", "frame"), offset("limits", "rate")
    words = {
        **words_of_columns(records.dtype, n, int(record["k"])),
        "frame": frame // 8 + np.arange(7 * len(arm.axis_names)),
        "J": (J // 8 + np.arange(n)[:, None] + CAPACITY * np.arange(6)).ravel(),  # by columns
        "limit": rate // 8 + np.arange(n),
    }
    sources = np.concatenate([*words.values()])
    past = max(math.ceil(LATEST / prepared.scenario.control.period), prepared.hardware.span) + 4
    engine["nq"], engine["nv"] = arm.model.nq, arm.model.nv
    engine["record_size"], engine["width"] = records.itemsize // 8, len(sources)
    engine["past_rows"], engine["followers"] = past, len(arm.followers)
    engine["qpos_at"][:n], engine["dof"][:n] = arm.wiring.qpos, arm.wiring.dof
    for f, follower in enumerate(arm.followers):
        engine["follows"][f], engine["follower_qpos"][f] = follower.leader, arm.wiring.follower_qpos[f]
        engine["follower_ratio"][f], engine["follower_offset"][f] = follower.ratio, follower.offset
    arrays = [
        _array("record", records), _array("qpos", prepared.qpos), _array("sources", sources),
        _array("chance", _chance(prepared), 8 * (n + 2)),
        *(_array(name, 8 * (BAD_LAST + 1)) for name in ("warning_count", "warning_info")),
        _array("qvel", 8 * arm.model.nv), _array("past", 8 * past * (2 * n + 1)), _array("path", 0),
        _array("reference", 0, 8 * TWIST), _array("columns", 0, 8 * len(sources)),
        _array("positions", 0, 8 * arm.model.nq),
    ]  # fmt: skip
    firsts = np.cumsum([0, *map(len, words.values())]).tolist()
    fields = ("next", "last", "ticks", "rows", "path_ticks", "path_size", "chance", "diverged")
    return {
        "arrays": arrays,
        "methods": [[offset("methods", field), name_of(method)] for field, method in called.items()]
        + [[offset("engine", "begin"), NOTHING]],
        "fields": {field: offset("methods", field) for field in METHODS.split()},
        "words": {name: offset("engine", name) for name in fields}
        | {"path_tick": offset("memory", "path_tick")},
        "columns": {
            name: [first, 0 if name in COLUMNS and not COLUMNS[name].width else len(part)]
            for (name, part), first in zip(words.items(), firsts, strict=False)
        },
        "width": len(sources), "n": n, "nq": arm.model.nq, "places": arm.wiring.qpos.tolist(),
    }  # fmt: skip


def offset(group: str, field: str) -> int:
    """Return where a field of a group begins in the record of a page [bytes]."""
    return field_offset(world_type(CAPACITY), group, field)


def packed(values: NDArray[Any]) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def _array(name: str, start: NDArray[Any] | int, each: int = 0) -> dict[str, Any]:
    """Return an array at an address in the group `engine`.

    Args:
        name: Field of the address.
        start: Its values, or the size of its zeros [bytes].
        each: Further bytes for each row of columns.
    """
    size, values = (start, "") if isinstance(start, int) else (start.nbytes, packed(start))
    return {"name": name, "word": offset("engine", name), "size": size, "each": each, "values": values}


def _chance(prepared: Prepared) -> NDArray[np.float64] | int:
    """Return the random numbers of all ticks; 0 where none counts."""
    plant, draw = prepared.scenario.plant, prepared.hardware.chance()
    counts = prepared.hardware.encoders.is_noisy or plant.jitter > 0.0 or plant.loss > 0.0
    return draw(prepared.most_ticks) if draw and counts else 0
