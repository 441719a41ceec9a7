"""Memory of runs: runs that are too large are refused before they start."""

from collections.abc import Sequence
from typing import NamedTuple

from rmrc.law.record import tick_type
from rmrc.plants.stepping import has_others
from rmrc.simulation.prepare import Prepared
from rmrc.support import memory
from rmrc.support.errors import ScenarioError

# Ticks that a batch holds where columns are not kept: two megabytes for six joints. They are then added up
# before they leave the processor's caches, which takes half as long. With fewer ticks, blocks of many worlds
# are so short that starting each takes as long as some ticks.
HELD = 2048
# With a watcher, this many times as many, because showing a block takes as long as some ticks.
SHOWN = 4

# Measured [B]: one sample of a reference; the additional memory of a recording per sample, the sample once
# more and the results computed from all of them at once; a world in MuJoCo; libraries that are loaded on the
# way, and those of a recording.
SAMPLE, RECORDED, WORLD = 13 * 8, 3 * 13 * 8 + 24, 256_000
LIBRARIES, RECORDER = 120_000_000, 130_000_000


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


def rows_of(prepared: Sequence[Prepared], keep_columns: bool = True, is_shown: bool = False) -> int:
    """Return how many ticks of runs that are stepped together are held.

    Args:
        prepared: The worlds.
        keep_columns: Whether every tick is kept; otherwise the ticks that stages read back, and some more.
        is_shown: Whether each block is shown, which makes blocks longer.
    """
    longest = max(one.most_ticks for one in prepared)
    if keep_columns:
        return longest
    held = HELD * SHOWN if is_shown else HELD
    return min(longest, max(1 + max(one.hardware.span for one in prepared), held // len(prepared)))


def footprint(
    prepared: Sequence[Prepared], keep_columns: bool = True, recorded: bool = False, is_shown: bool = False
) -> Footprint:
    """Return the memory of runs that are stepped together, each at its largest length.

    Args:
        prepared: The worlds.
        keep_columns: Whether every tick is kept.
        recorded: Whether a recording is written.
        is_shown: Whether each block is shown.
    """
    alike: dict[object, list[Prepared]] = {}
    for one in prepared:
        alike.setdefault(one.plant.shares, []).append(one)
    held, reserved = RECORDER * recorded, 0
    for worlds in alike.values():
        references = {id(one.reference): one.reference.ticks for one in worlds}.values()
        rows = rows_of(worlds, keep_columns, is_shown)
        held += rows * len(worlds) * tick_type(worlds[0].arm.n).itemsize
        if has_others(worlds[0].arm.wiring, len(worlds[0].qpos)):
            held += rows * len(worlds) * worlds[0].qpos.nbytes
        held += len(references) * max(references) * SAMPLE
        held += sum(references) * RECORDED * recorded
        for one in worlds:
            held += one.plant.batches * WORLD
            reserved += one.plant.batches * int(one.arm.model.narena)
    return Footprint(held, reserved)


def refuse_excess(
    prepared: Sequence[Prepared], keep_columns: bool = True, recorded: bool = False, is_shown: bool = False
) -> None:
    """Refuse runs that do not fit into memory.

    Args:
        prepared: The worlds, one or more.
        keep_columns: Whether every tick is kept.
        recorded: Whether a recording is written.
        is_shown: Whether each block is shown.

    Raises:
        ScenarioError: They do not fit, with the key that makes the longest of them so long.
    """
    excess = footprint(prepared, keep_columns, recorded, is_shown).excess
    if excess is None:
        return
    longest = max(prepared, key=lambda one: one.most_ticks if keep_columns else one.reference.ticks)
    ticks = longest.most_ticks if keep_columns else longest.reference.ticks
    others = f" for each of {len(prepared)} runs" if len(prepared) > 1 else ""
    fewer = ", or run fewer at a time" if len(prepared) > 1 else ""
    if ticks > longest.reference.ticks:
        key, way_out = "control.slow.longest", "lower it, shorten target.path or raise control.period"
    else:
        key, way_out = "target.path", "shorten it or raise control.period"
    raise ScenarioError(
        [
            longest.scenario.problem(
                key, f"makes up to {ticks} ticks{others}, which need {excess}; {way_out}{fewer}"
            )
        ]
    )
