"""Memory of runs: runs that are too large are refused before they start."""

from collections.abc import Sequence

import numpy as np

from rmrc.arm import Wiring
from rmrc.results.columns import widths
from rmrc.simulation.prepare import Prepared
from rmrc.support import process
from rmrc.support.errors import ScenarioError

# Measured [B]: the additional memory of a recording per tick; a world in MuJoCo; libraries and machine code
# that are loaded on the way, and those of a recording. What compiling takes once, 100 MB, is not included.
RECORDED, WORLD = 700, 256_000
LIBRARIES, RECORDER = 160_000_000, 130_000_000


def has_others(wiring: Wiring, nq: int) -> bool:
    """Return whether a model has other positions, of nq, than those of the arm's joints in their order."""
    return not np.array_equal(wiring.qpos, np.arange(nq))


def excess(
    prepared: Sequence[Prepared], keep_columns: bool = True, recorded: bool = False, threads: int = 1
) -> str | None:
    """Return why runs, each at its largest length, do not fit into memory, or None if they fit.

    Args:
        prepared: The worlds.
        keep_columns: Whether columns are kept after the end of a run.
        recorded: Whether a recording is written.
        threads: Number of worlds that run at a time.
    """
    each = []
    for world in prepared:
        n, nq, path = world.arm.n, len(world.qpos), world.reference.ticks
        others = nq if has_others(world.arm.wiring, nq) else 0
        columns = 8 * world.most_ticks * sum(widths(n, min(n, len(world.task.rows)), others).values())
        models = 1 if world.plant.knows_all else 2  # that of the plant, and the one that its law assumes
        each.append(columns + path * RECORDED * recorded + models * WORLD)
    need = sum(each) if keep_columns else min(threads, len(prepared)) * max(each)
    return process.excess(LIBRARIES + RECORDER * recorded + need)


def refuse_excess(
    prepared: Sequence[Prepared], keep_columns: bool = True, recorded: bool = False, threads: int = 1
) -> None:
    """Refuse runs that do not fit into memory; arguments as in `excess`.

    Raises:
        ScenarioError: They do not fit, with the key that makes the longest of them so long.
    """
    too_much = excess(prepared, keep_columns, recorded, threads)
    if too_much is None:
        return
    longest = max(prepared, key=lambda world: world.most_ticks)
    key, remedy = "target.path", "shorten it or raise control.period"
    if longest.most_ticks > longest.reference.ticks:
        key, remedy = "control.slow.longest", "lower it, shorten target.path or raise control.period"
    each, fewer = (f" for each of {len(prepared)} runs", ", or run fewer") if len(prepared) > 1 else ("", "")
    text = f"makes up to {longest.most_ticks} ticks{each}, which need {too_much}; {remedy}{fewer}"
    raise ScenarioError([longest.scenario.problem(key, text)])
