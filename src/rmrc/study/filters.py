"""The filter g(σ) of a run's inverse over all σ: what the law would do nearer to a singularity.

The compiled law itself is asked, so that no method needs its formula written twice: once for every σ, about
the tick at which the arm was nearest, with nothing changed but σ of the direction that is lost first.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.law.jit import machine_code
from rmrc.law.law import resolve
from rmrc.law.record import tick_type, world_type
from rmrc.results.run import Run
from rmrc.scenario.choices import LIMITS, OBJECTIVES, POLICIES
from rmrc.simulation.prepare import Prepared, world_record
from rmrc.support.spatial import pose_error

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

    All else is as it was at the tick of the smallest σ: the other singular values, all directions, and what
    the command asks for, on which some methods depend. σ ends where the direction would not be the last any
    more, or, if there is no other, at 1.2 times the largest of the run.

    Args:
        prepared: The world.
        run: What it did, one tick or more.
    """
    tick = int(np.argmin(run["sigma"][:, -1]))
    world, scale = _world_at(prepared, run, tick)
    m, n, k = (int(world[size][0]) for size in ("m", "n", "k"))
    u, sigmas, v = np.linalg.svd(scale * world["J"][0, world["row"][0, :m], :n], full_matrices=False)
    largest = float(sigmas[0] if k > 1 else run["sigma"].max())
    end = float(sigmas[-2]) if k > 1 else 1.2 * largest

    def gain(sigma: float) -> float:
        worlds, ticks = world.copy(), np.zeros(1, tick_type(n))
        worlds["J"][0, world["row"][0, :m], :n] = (u * [*sigmas[:-1], sigma]) @ v / scale
        resolve(worlds[0], ticks[0])
        return float(ticks["gain"][0, k - 1])

    sigma = np.geomspace(min(NEAREST * largest, 0.1 * end), end, POINTS)
    sigma_min = float(run["sigma"][tick, -1])
    return FilterFactor(sigma, np.array([gain(s) for s in sigma]), sigma_min, gain(sigma_min))


def compile_for(prepared: Prepared) -> None:
    """Load the compiled law for one problem alone, or compile it the first time, which takes seconds."""
    n = prepared.arm.n
    machine_code(resolve, np.zeros(1, world_type(n))[0], np.zeros(1, tick_type(n))[0])


def _world_at(prepared: Prepared, run: Run, tick: int) -> tuple[NDArray[np.void], _Array]:
    """Return the record of a world as the law finds it at a tick, and S_x J S_q over J by element, (m, n).

    Limits, policies and the null space come after the gains, and are left out.
    """
    control, arm = prepared.scenario.control, prepared.arm
    world = np.array([world_record(prepared, 0)])
    for choices, nothing in ((OBJECTIVES, "none"), (LIMITS, "none"), (POLICIES, "damp")):
        world[choices.field] = choices.code(nothing)
    q = run["q"][tick] + prepared.encoder_offset  # where the law sees the arm
    world["J"][0, :, : arm.n] = arm.jacobian(q)
    error = pose_error(run["pose_ref"][tick], arm.pose(q))
    world["twist_cmd"] = control.feedforward * run["twist_ref"][tick] + control.feedback * error
    m = int(world["m"][0])
    row_scale = world["row_scale"][0, :m]
    world["error"] = np.linalg.norm(row_scale * error[world["row"][0, :m]])
    return world, np.outer(row_scale, world["joint_scale"][0, : arm.n])
