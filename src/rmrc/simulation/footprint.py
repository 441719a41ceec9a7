"""Memory of runs: runs that are too large are refused before they start."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rmrc.arm import Wiring
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import Prepared
from rmrc.support import memory
from rmrc.support.errors import ScenarioError

# Ticks that a world holds at most where its columns are not kept.
HELD = 10_000

# Measured [B]: the additional memory of a recording per tick; a world in MuJoCo; libraries and machine code
# that are loaded on the way, and those of a recording. What compiling takes once, 100 MB, is not included.
RECORDED, WORLD = 3 * 13 * 8 + 24, 256_000
LIBRARIES, RECORDER = 160_000_000, 130_000_000


class Footprint(NamedTuple):
    """Memory of some runs.

    Attributes:
        held: Memory that is written [B].
        reserved: Memory that is only reserved, such as MuJoCo's arenas [B].
    """

    held: int
    reserved: int

    def __add__(self, other: "Footprint") -> "Footprint":  # type: ignore[override]
        """Return the sum for two that share nothing."""
        return Footprint(self.held + other.held, self.reserved + other.reserved)

    def times(self, count: int) -> "Footprint":
        """Return the memory of this many that share nothing."""
        return Footprint(self.held * count, self.reserved * count)

    def or_more(self, other: "Footprint") -> "Footprint":
        """Return the larger of each."""
        return Footprint(max(self.held, other.held), max(self.reserved, other.reserved))

    @property
    def excess(self) -> str | None:
        """The reason why this is too much, or None: see `rmrc.support.memory.excess`."""
        return memory.excess(LIBRARIES + self.held, self.reserved)


def has_others(wiring: Wiring, nq: int) -> bool:
    """Return whether a model has other positions, of nq, than those of the arm's joints in their order."""
    return not np.array_equal(wiring.qpos, np.arange(nq))


def width(n: int, k: int, nq: int) -> int:
    """Return how many numbers a tick has in the columns of a run.

    Args:
        n: Number of joints.
        k: Number of singular values.
        nq: Number of the model's positions; 0 where they are those of the joints.
    """
    sizes = {"": 1, "n": n, "k": k, "nq": nq, "6": 6, "7": 7}
    return sum(sizes[column.width] for column in COLUMNS.values())


def footprint(prepared: Sequence[Prepared], keep_columns: bool = True, recorded: bool = False) -> Footprint:
    """Return the memory of runs in one thread, one after another, each at its largest length.

    Args:
        prepared: The worlds.
        keep_columns: Whether the columns of every tick are kept, also after a run.
        recorded: Whether a recording is written.
    """
    total = Footprint(0, 0)
    for world in prepared:
        single = _footprint(world, keep_columns, recorded)
        total = total + single if keep_columns else total.or_more(single)
    return total + Footprint(RECORDER * recorded, 0)


def _footprint(world: Prepared, keep_columns: bool, recorded: bool) -> Footprint:
    """Return the memory of a world while it runs."""
    n, nq = world.arm.n, len(world.qpos)
    ticks = world.most_ticks if keep_columns else min(world.most_ticks, HELD)
    row = width(n, min(n, len(world.task.rows)), nq if has_others(world.arm.wiring, nq) else 0)
    recording = world.reference.ticks * RECORDED * recorded
    models = 1 if world.plant.knows_all else 2  # that of the plant, and the one that its law assumes
    return Footprint(8 * ticks * row + recording + models * WORLD, models * int(world.arm.model.narena))


def refuse_excess(prepared: Sequence[Prepared], keep_columns: bool = True, recorded: bool = False) -> None:
    """Refuse runs that do not fit into memory.

    Args:
        prepared: The worlds, one or more.
        keep_columns: Whether the columns of every tick are kept.
        recorded: Whether a recording is written.

    Raises:
        ScenarioError: They do not fit, with the key that makes the longest of them so long.
    """
    excess = footprint(prepared, keep_columns, recorded).excess
    if excess is None:
        return
    longest = max(prepared, key=lambda world: world.most_ticks)
    key, remedy = "target.path", "shorten it or raise control.period"
    if longest.most_ticks > longest.reference.ticks:
        key, remedy = "control.slow.longest", "lower it, shorten target.path or raise control.period"
    each, fewer = (f" for each of {len(prepared)} runs", ", or run fewer") if len(prepared) > 1 else ("", "")
    text = f"makes up to {longest.most_ticks} ticks{each}, which need {excess}; {remedy}{fewer}"
    raise ScenarioError([longest.scenario.problem(key, text)])
