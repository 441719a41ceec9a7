"""Hold a wrench in the physics, and read the torques from the actuators.

It is a study of one scenario, with rate servos and feedback of the position. The law gets one row of the
task, one that is far from singular, and the posture in its null space. Together they bring every joint back
at the same rate, singular or not, as joint servos do. `rmrc.analysis.statics.balance` computes the expected
torques.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.new.text import identity
from rmrc.analysis.statics.balance import Balance, balance
from rmrc.law.task import Task
from rmrc.results.run import Run
from rmrc.scenario import Scenario
from rmrc.scenario.choices import SERVO
from rmrc.simulation.footprint import excess, footprint
from rmrc.simulation.prepare import Cache
from rmrc.study.study import Study
from rmrc.support.errors import DivergenceError, QuestionError
from rmrc.support.spatial import AXES, pose_error

Array = NDArray[np.float64]

# Control period, which is also the time constant of a servo [s]. MuJoCo's step is a fraction of it: with a
# step as long, such servos and the soft constraint of a screw excite each other.
PERIOD, TIMESTEP = 1e-3, 2.5e-4
# Rate at which a joint returns [1/s]: the stiffness of a joint is this times its servo's gain. A fiftieth of
# a second is slow for servos with a millisecond, and the arm still comes to rest within a second.
FEEDBACK = 50.0
# An arm is at rest if no joint was faster in the last tenth of a second [rad/s or m/s].
STILL, LAST = 1e-8, 0.1
# Time between two looks at the arm [s]: fixed, so that the result does not depend on the machine's load.
LOOK = 1.0
# Below its dry friction a joint creeps, as MuJoCo's friction is soft. It is at rest at a rate at which its
# servo brakes by this share of the friction.
CREEP = 1e-2
# Tolerance of the actuator torques, relative to the torques if nothing canceled: far above rounding, far
# below what an actuator can measure. The constraint that makes a screw of a hinge and a slide is soft, and
# yields by some hundredths of a millimeter under a load.
SHARE, SHARE_OF_SCREWS = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class HoldResult:
    """The result of holding a wrench.

    Attributes:
        wanted: The balance at the wanted configuration.
        ended: The balance at the configuration of rest: the expected torques.
        measured: Measured torques, (n,) [N·m or N].
        drift: From the wanted pose of the site to its pose at rest, [Δp; rotation vector], (6,) [m, rad].
        at_limit: Joints whose actuator was at its limit at any time, (n,).
        rate: Rate of the fastest joint in the last tenth of a second [rad/s or m/s].
        is_at_rest: Whether all were below the threshold of rest.
        allowed: Tolerance of the torques, (n,) [N·m or N].
        run: The run.
    """

    wanted: Balance
    ended: Balance
    measured: Array
    drift: Array
    at_limit: NDArray[np.bool_]
    rate: float
    is_at_rest: bool
    allowed: Array
    run: Run

    @property
    def difference(self) -> Array:
        """Measured minus expected torques at the configuration of rest, (n,) [N·m or N]."""
        return np.asarray(self.measured - self.ended.torque)

    @property
    def is_still(self) -> bool:
        """Whether the arm came to rest."""
        return self.run.divergence is None and self.is_at_rest

    @property
    def agrees(self) -> bool:
        """Whether it came to rest, with the torques of statics."""
        return self.is_still and bool((np.abs(self.difference) <= self.allowed).all())


def hold_wrench(
    wanted: Balance, seconds: float = 10.0, on_ticks: Callable[[int], None] | None = None
) -> HoldResult:
    """Hold a wrench in the physics until the arm is at rest or the time is over.

    Args:
        wanted: The configuration and the wrench.
        seconds: Longest duration.
        on_ticks: Called with the number of ticks of each finished block.

    Raises:
        QuestionError: A joint is beyond its limits or moves no inertia, or a run of this length does not fit
            into memory.
        DivergenceError: The state was not finite after the first step.

    Example:
        >>> from rmrc.analysis.subject import subject
        >>> arm = subject("models/planar_2link.xml").arm
        >>> hold_wrench(balance(arm, [0.0, 1.0], [0, -1, 0, 0, 0, 0]), 2.0).agrees
        True
    """
    arm = wanted.arm
    _check(wanted)
    study = Study(hold_scenario(wanted, seconds), Cache(arm))
    prepared, stop = study.prepare(), threading.Event()
    if too_much := excess(footprint([prepared])):
        ticks = prepared.reference.ticks
        raise QuestionError(f"--hold: {ticks} ticks need {too_much}; hold for a shorter time")
    kv = np.array(prepared.scenario.plant.kv)
    friction = arm.model.dof_frictionloss @ np.abs(arm.motion)
    slow = np.maximum(STILL, CREEP * friction / kv)
    share = SHARE_OF_SCREWS if arm.followers else SHARE

    def result(run: Run) -> HoldResult:
        ended, rates = balance(arm, run["q"][-1], wanted.wrench, wanted.bears_weight), _rates(run)
        # M q̈ brakes the remaining motion, and the actuator values are a step old: both are within this.
        moving = kv * np.maximum(rates, min(rates.max(), STILL))
        return HoldResult(
            wanted=wanted, ended=ended, measured=run["tau"][-1],
            drift=-pose_error(arm.pose(wanted.q), run["pose"][-1]),
            at_limit=np.asarray((np.abs(run["tau"]) >= arm.torque_limit).any(axis=0)),
            rate=float(rates.max()), is_at_rest=bool((rates <= slow).all()),
            allowed=np.asarray(share * ended.size.max() + moving + friction), run=run,
        )  # fmt: skip

    look, done = round(LOOK / PERIOD), 0

    def settled(run: Run, before: int = 0) -> HoldResult | None:
        """Return the first look at which an arm is at rest; some ticks came before the run."""
        for last in range(look - before % look, len(run) + 1, look):
            ended = result(replace(run, columns={name: one[:last] for name, one in run.columns.items()}))
            if ended.agrees:
                return ended
        return None

    def watch(_: int, part: Run) -> None:
        nonlocal done
        if settled(part, done):
            stop.set()
        done += len(part)
        if on_ticks is not None:
            on_ticks(len(part))

    run = study.step([prepared], stop, watch)[0].run
    if not len(run):
        raise DivergenceError(f"cannot hold: {run.divergence}")
    return settled(run) or result(run)


def most_ticks(seconds: float) -> int:
    """Return the largest number of ticks of `hold_wrench`, for a progress bar."""
    return round(seconds / PERIOD) + 1


def _check(wanted: Balance) -> None:
    """Refuse an arm that cannot stay where it is, or whose servos cannot be made."""
    arm = wanted.arm
    for name, position, (lower, upper), unit in zip(
        arm.joints, wanted.q, arm.position_limit, arm.units, strict=True
    ):
        if not lower <= position <= upper:
            raise QuestionError(
                f'cannot hold: joint "{name}" must be within its limits [{lower:.6g}, {upper:.6g}] '
                f"{unit}, got {position:.6g}; choose other joint positions"
            )
    for name, inertia in zip(arm.joints, arm.inertia, strict=True):
        if not inertia > 0.0:  # on which the servos' gains depend
            raise QuestionError(
                f'cannot hold: joint "{name}" must have an inertia > 0 at home, got {inertia:.6g}; '
                "correct masses, inertias and armature of the model"
            )


def _rates(run: Run) -> Array:
    """Return the largest rate of each joint at the end of a run, (n,), infinite if it is too short."""
    last, qdot = round(LAST / run.period), np.abs(run["qdot"])
    return np.asarray(qdot[-last:].max(axis=0) if len(run) >= last else np.full(qdot.shape[1], np.inf))


def hold_scenario(wanted: Balance, seconds: float) -> Scenario:
    """Return the scenario of an arm that holds a wrench at its configuration.

    Args:
        wanted: The configuration and the wrench.
        seconds: Duration.
    """
    arm = wanted.arm
    # The row that moves most: no arm has lost it.
    rows = Task(arm, np.arange(6)).matrix(arm.jacobian(wanted.q))
    axis = AXES[int(np.argmax(np.linalg.norm(rows, axis=1)))]
    return Scenario.model_validate({
        "name": "hold",
        "arm": {
            **{key: value for key, value in identity(arm, Path.resolve).items() if key != "stretch"},
            "start": tuple(wanted.q),  # the given arm is stretched already
        },
        "task": {"axes": (axis,)},
        "control": {
            "period": PERIOD, "feedback": FEEDBACK,
            "inverse": {"method": "pseudoinverse"},
            "nullspace": {"objective": "posture", "gain": FEEDBACK},
            "limits": {"position": False, "on_excess": "none"},
        },
        "target": {"path": ({"hold": {"for": seconds}},)},
        "plant": {
            "kind": SERVO.name, "kv": tuple(arm.inertia / PERIOD), "timestep": TIMESTEP,
            "friction_compensation": False,
            "gravity_compensation": not wanted.bears_weight, "wrench": tuple(wanted.wrench),
        },
    })  # fmt: skip
