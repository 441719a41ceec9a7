"""The filter g(σ) of a run's inverse over all σ: what the law would do nearer to a singularity.

The compiled law itself is asked, so that no method needs its formula written twice: a small problem with a
diagonal Jacobian has exactly the singular values that it is given.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.control.law import resolve
from rmrc.control.records import OnExcess, tick_type
from rmrc.preparation import Prepared, world_record
from rmrc.run import Run
from rmrc.spatial import AXES

_Array = NDArray[np.float64]

# From this share of the largest σ on: three decades, two of them below what is called SINGULAR.
NEAREST = 1e-3

POINTS = 400


@dataclass(frozen=True, eq=False)
class FilterFactor:
    """The curve g(σ) of one run.

    Attributes:
        sigma: Rising, (p,).
        gain: g(σ), (p,).
        sigma_min: Smallest singular value of the run; it may be below `sigma`, or 0.
        gain_min: g(sigma_min).
    """

    sigma: _Array
    gain: _Array
    sigma_min: float
    gain_min: float


def filter_factor(prepared: Prepared, run: Run) -> FilterFactor:
    """Return the gain of the direction that is lost first, as it would be for other σ of that direction.

    All else is as it was at the tick of the smallest σ: the other singular values, and how fast the command
    asks to move in that direction, on which some methods depend. σ ends where the direction would not be the
    last any more, or, if there is no other, at 1.2 times the largest of the run.

    Args:
        prepared: The world.
        run: What it did, one tick or more.
    """
    tick = int(np.argmin(run["sigma"][:, -1]))
    others = run["sigma"][tick, :-1]
    largest = float(others[0]) if len(others) else float(run["sigma"].max())
    end = float(others[-1]) if len(others) else 1.2 * largest
    sigma_min = float(run["sigma"][tick, -1])
    sigma = np.geomspace(min(NEAREST * largest, 0.1 * end), end, POINTS)
    command = lost_command(prepared, run, tick)
    gain = np.array([_gain(prepared, others, s, command) for s in sigma])
    return FilterFactor(sigma, gain, sigma_min, _gain(prepared, others, sigma_min, command))


def compile_for(prepared: Prepared) -> None:
    """Load the compiled law for one problem alone, or compile it the first time, which takes seconds."""
    _gain(prepared, np.empty(0), 1.0, 1.0)


def lost_command(prepared: Prepared, run: Run, tick: int) -> float:
    """Return |u_min · S_x twist_cmd| of a tick, or 1 if that is 0 and no direction was asked for."""
    control, task = prepared.scenario.control, prepared.scenario.task
    twist_cmd = control.feedforward * run["twist_ref"][tick] + control.feedback * run["pose_error"][tick]
    world = world_record(prepared, 0)
    rows = [AXES.index(axis) for axis in task.axes]
    scaled = world["row_scale"][: len(rows)] * twist_cmd[rows]
    return abs(float(run["u_min"][tick, rows] @ scaled)) or 1.0


def _gain(prepared: Prepared, others: _Array, sigma: float, command: float) -> float:
    """Return g of the last direction of diag(others, sigma), at a command along it."""
    k = len(others) + 1
    worlds, ticks = np.array([world_record(prepared, 0)]), np.zeros(1, tick_type(prepared.arm.n))
    world = worlds[0]
    for size in ("n", "m", "k", "rank"):
        if size in (world.dtype.names or ()):
            world[size] = k
    world["row"], world["row_scale"], world["joint_scale"] = np.arange(6), 1.0, 1.0
    world["J"][:k, :k] = np.diag([*others, sigma])
    world["twist_cmd"][k - 1] = command
    for choice in ("objective", "at_singularity"):  # the first of each is the one that does nothing
        if choice in (world.dtype.names or ()):
            world[choice] = 0
    world["on_excess"] = OnExcess.NONE
    resolve(world, ticks[0])
    return float(ticks["gain"][0, k - 1])
