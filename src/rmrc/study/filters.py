"""The filter g(σ) of a run's inverse over all σ: the response of the law nearer to a singularity.

It calls the compiled law, so that no method needs its formula twice: once per σ, at the tick nearest to the
singularity, changing only σ of the direction that is lost first.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.law.record import capacity, new_worlds
from rmrc.law.settings import TaskLaw, link
from rmrc.law.step import resolve_alone
from rmrc.results.run import Run
from rmrc.scenario import LimitsSection, NullspaceSection
from rmrc.simulation.prepare import Prepared

_Array = NDArray[np.float64]

# The smallest σ relative to the largest: three decades, two of them below the threshold of SINGULAR.
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
    """Return the gain of the direction that is lost first as a function of its σ.

    Everything else stays as at the tick of the smallest σ: the other singular values, all directions, and the
    command, on which some methods depend. σ ends where the direction would no longer be the last, or, for a
    single direction, at 1.2 times the largest of the run.

    Args:
        prepared: The world.
        run: Its run, with at least one tick.
    """
    tick = int(np.argmin(run["sigma"][:, -1]))
    task, n = prepared.task, prepared.arm.n
    at, k = _world_at(prepared, run, tick), min(len(task.rows), n)
    scale = np.outer(task.row_scale, task.joint_scale)
    u, sigmas, v = np.linalg.svd(scale * at["state"]["J"][0, task.rows, :n], full_matrices=False)
    largest = float(sigmas[0] if k > 1 else run["sigma"].max())
    end = float(sigmas[-2]) if k > 1 else 1.2 * largest
    resolve = resolve_alone.entry(_capacity(prepared))

    def gain(sigma: float) -> float:
        world = at.copy()  # the law writes into it
        world["state"]["J"][0, task.rows, :n] = (u * [*sigmas[:-1], sigma]) @ v / scale
        resolve(world.ctypes.data)
        return float(world["first"]["gain"][0, k - 1])

    sigma = np.geomspace(min(NEAREST * largest, 0.1 * end), end, POINTS)
    sigma_min = float(run["sigma"][tick, -1])
    return FilterFactor(sigma, np.array([gain(s) for s in sigma]), sigma_min, gain(sigma_min))


def compile_for(prepared: Prepared) -> None:
    """Load the compiled law for a single problem, or compile it on first use, which takes seconds."""
    link(_record(prepared), _law(prepared).methods | {"control": resolve_alone}, late=())


def _capacity(prepared: Prepared) -> int:
    return capacity(max(prepared.arm.n, len(prepared.arm.axis_names)))


def _law(prepared: Prepared) -> TaskLaw:
    """Return the law alone: limits, policies and the null space come after the gains, and are left out."""
    nothing = {"nullspace": NullspaceSection(), "limits": LimitsSection(on_excess="none")}
    alone = prepared.scenario.control.model_copy(update={**nothing, "at_singularity": "damp"})
    return TaskLaw(prepared.task, alone, np.zeros(prepared.arm.n))


def _record(prepared: Prepared) -> NDArray[np.void]:
    """Return the record of the law alone, (1,)."""
    worlds = new_worlds(1, prepared.arm.n, len(prepared.arm.axis_names))
    _law(prepared).write(worlds[0])
    return worlds


def _world_at(prepared: Prepared, run: Run, tick: int) -> NDArray[np.void]:
    """Return the record of a world, (1,), as input of the law at a tick."""
    control, arm, task, world = prepared.scenario.control, prepared.arm, prepared.task, _record(prepared)
    link(world, _law(prepared).methods | {"control": resolve_alone}, late=())
    q = run["q_believed"][tick]
    pose, scratch = arm.pose(q), world["scratch"]
    world["state"]["J"][0, :, : arm.n] = task.turned(arm.jacobian(q), pose)
    error = task.view.error(run["pose_ref"][tick], pose)
    scratch["twist_cmd"] = (
        control.feedforward * task.turned(run["twist_ref"][tick], pose) + control.feedback * error
    )
    scratch["error"] = np.linalg.norm(task.row_scale * error[task.rows])
    return world
