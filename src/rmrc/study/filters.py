"""The filter g(σ) of a run's inverse over all σ: the response of the law nearer to a singularity.

It calls the compiled law, so that no method needs its formula twice: once per σ, at the tick nearest to the
singularity, changing only σ of the direction that is lost first.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.law.jit import machine_code
from rmrc.law.law import TaskLaw, resolve
from rmrc.law.record import records, tick_type
from rmrc.law.sight import Sight
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
    u, sigmas, v = np.linalg.svd(scale * at["J"][0, task.rows, :n], full_matrices=False)
    largest = float(sigmas[0] if k > 1 else run["sigma"].max())
    end = float(sigmas[-2]) if k > 1 else 1.2 * largest

    out, world = np.zeros(1, tick_type(n)), at.copy()
    law = machine_code(resolve, at, out)  # it fills in `at`, the same for every σ

    def gain(sigma: float) -> float:
        world.view(np.uint8)[:] = at.view(np.uint8)  # as bytes: numpy copies a record field by field
        world["J"][0, task.rows, :n] = (u * [*sigmas[:-1], sigma]) @ v / scale
        law(world, out)
        return float(out["gain"][0, k - 1])

    sigma = np.geomspace(min(NEAREST * largest, 0.1 * end), end, POINTS)
    sigma_min = float(run["sigma"][tick, -1])
    return FilterFactor(sigma, np.array([gain(s) for s in sigma]), sigma_min, gain(sigma_min))


def compile_for(prepared: Prepared) -> None:
    """Load the compiled law for a single problem, or compile it on first use, which takes seconds."""
    machine_code(resolve, _record(prepared), np.zeros(1, tick_type(prepared.arm.n)))


def _record(prepared: Prepared) -> NDArray[np.void]:
    """Return the record of the law alone, (1,): of the type of `resolve_rates`, and so compiled once.

    Limits, policies and the null space come after the gains, and are left out.
    """
    arm, task, control = prepared.arm, prepared.task, prepared.scenario.control
    nothing = {"nullspace": NullspaceSection(), "limits": LimitsSection(on_excess="none")}
    alone = control.model_copy(update={**nothing, "at_singularity": "damp"})
    law = TaskLaw(task, alone, np.zeros(arm.n))
    return records(arm.n, [task, law], beside=Sight.fields, axes=len(arm.axis_names))


def _world_at(prepared: Prepared, run: Run, tick: int) -> NDArray[np.void]:
    """Return the record of a world, (1,), as input of the law at a tick."""
    control, arm, task, world = prepared.scenario.control, prepared.arm, prepared.task, _record(prepared)
    q = run["q_believed"][tick]
    pose = arm.pose(q)
    world["J"][0, :, : arm.n] = task.turned(arm.jacobian(q), pose)
    error = task.view.error(run["pose_ref"][tick], pose)
    world["twist_cmd"] = (
        control.feedforward * task.turned(run["twist_ref"][tick], pose) + control.feedback * error
    )
    world["error"] = np.linalg.norm(task.row_scale * error[task.rows])
    return world
