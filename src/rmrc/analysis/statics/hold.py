"""Hold a wrench in the physics, and read from the actuators what it takes.

The run machinery does it: rate servos, and feedback of the position. The law is given one row of the task,
one that the arm is far from losing, and the posture in what that leaves; together they bring every joint back
at the same rate, singular or not, as joint servos do. `rmrc.analysis.statics.balance` says what the
actuators should read.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.statics.balance import Balance, balance
from rmrc.arm import Arm
from rmrc.law.task import Task
from rmrc.results.run import Run
from rmrc.scenario import (
    ArmSection,
    Axis,
    ControlSection,
    Hold,
    HoldSegment,
    InverseSection,
    LimitsSection,
    NullspaceSection,
    PlantSection,
    Scenario,
    TargetSection,
    TaskSection,
)
from rmrc.scenario.choices import SERVO
from rmrc.simulation.footprint import footprint
from rmrc.simulation.prepare import Known, Prepared, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import DivergenceError, QuestionError
from rmrc.support.spatial import AXES, pose_error

Array = NDArray[np.float64]

# Control period, which is the time that a servo takes to follow [s]. MuJoCo's step is a fraction of it: at a
# step as long, such servos and the soft constraint of a screw set each other swinging.
PERIOD, TIMESTEP = 1e-3, 2.5e-4
# Rate at which a joint goes back [1/s]: the stiffness of a joint is this times its servo's gain. A fiftieth
# of a second is slow for servos that take a millisecond, and still before a second is over.
FEEDBACK = 50.0
# An arm is still when no joint was faster in the last tenth of a second [rad/s or m/s].
STILL, LAST = 1e-8, 0.1
# What the actuators give may differ by this share of what the torques would be if nothing canceled: far
# above rounding, far below what a drive knows. The constraint that makes a screw of a hinge and a slide is
# soft, and gives by some hundredths of a millimeter under a load.
SHARE, SHARE_OF_SCREWS = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class Held:
    """What it took to hold a wrench.

    Attributes:
        wanted: Where the arm should stay.
        ended: Where it came to rest: what the actuators should give there.
        measured: What they gave, (n,) [N·m or N].
        drift: From where the site should stay to where it rests, [Δp; rotation vector], (6,) [m, rad].
        at_limit: Joints whose drive gave all it can at any time, (n,).
        rate: Fastest joint in the last tenth of a second [rad/s or m/s].
        allowed: How much the actuators may differ, (n,) [N·m or N].
        run: The run.
    """

    wanted: Balance
    ended: Balance
    measured: Array
    drift: Array
    at_limit: NDArray[np.bool_]
    rate: float
    allowed: Array
    run: Run

    @property
    def difference(self) -> Array:
        """Measured less wanted, where the arm came to rest, (n,) [N·m or N]."""
        return np.asarray(self.measured - self.ended.torque)

    @property
    def is_still(self) -> bool:
        """Whether the arm came to rest."""
        return self.run.divergence is None and self.rate <= STILL

    @property
    def agrees(self) -> bool:
        """Whether it came to rest, and its actuators give there what statics says."""
        return self.is_still and bool((np.abs(self.difference) <= self.allowed).all())


class Holding:
    """A wrench that is to be held: checked, and ready to run."""

    def __init__(self, wanted: Balance, gravity: bool = False, seconds: float = 10.0) -> None:
        """Check that the arm may stay there.

        Args:
            wanted: Where, and which wrench.
            gravity: Whether the drives bear the arm's weight; else it is compensated.
            seconds: For how long at most; it ends as soon as the arm is still.

        Raises:
            QuestionError: A joint is beyond its limits or feels no inertia, or so long a run does not fit
                into memory.
        """
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
            if not inertia > 0.0:  # of which the servos' gains are made
                raise QuestionError(
                    f'cannot hold: joint "{name}" must feel an inertia > 0 at home, got {inertia:.6g}; '
                    "mend masses, inertias and armature of the model"
                )
        self.wanted, self.gravity = wanted, gravity
        self.prepared: Prepared = prepare(_scenario(wanted, gravity, seconds), Known(arm))
        self._simulation: Simulation | None = None
        excess = footprint([self.prepared]).excess
        if excess:
            raise QuestionError(f"--hold: {self.ticks} ticks need {excess}; hold for a shorter time")

    @property
    def ticks(self) -> int:
        """How many control ticks it will take at most."""
        return self.prepared.reference.ticks

    def compile(self) -> Simulation:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        if self._simulation is None:
            self._simulation = Simulation([self.prepared])
        return self._simulation

    def run(self, on_ticks: Callable[[int], None] | None = None) -> Held:
        """Hold until the arm is still or the time is over.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.

        Raises:
            DivergenceError: The state was not finite after the first step.
        """
        stop = threading.Event()

        def on_block(_: int, part: Run) -> None:
            if on_ticks is not None:
                on_ticks(len(part))
            if _rate(part) <= STILL:
                stop.set()

        (run,) = self.compile().run(on_block, stop)
        arm, wanted = self.wanted.arm, self.wanted
        if not len(run):
            raise DivergenceError(f"cannot hold: {run.divergence}")
        ended = balance(arm, run["q"][-1], wanted.wrench, self.gravity)
        rate = _rate(run)
        # What still moves is braked by M q̈, and the actuators are those of a step ago: both are within this.
        moving = np.array(self.prepared.scenario.plant.kv) * rate
        share = SHARE_OF_SCREWS if arm.travels else SHARE
        return Held(
            wanted=wanted,
            ended=ended,
            measured=run["tau"][-1],
            drift=-pose_error(arm.pose(wanted.q), run["pose"][-1]),
            at_limit=np.asarray((np.abs(run["tau"]) >= arm.torque_limit).any(axis=0)),
            rate=rate,
            allowed=np.asarray(share * ended.size.max() + moving + arm.friction),
            run=run,
        )


def hold(arm: Arm, q: ArrayLike, wrench: ArrayLike, gravity: bool = False, seconds: float = 10.0) -> Held:
    """Hold a wrench in the physics and return what it took; `rmrc.hold` in a notebook.

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        gravity: Whether the drives bear the arm's weight; else it is compensated.
        seconds: For how long at most.

    Raises:
        QuestionError: The wrench or q will not do, or a joint is beyond its limits.
    """
    return Holding(balance(arm, q, wrench, gravity), gravity, seconds).run()


def _rate(run: Run) -> float:
    """Return the fastest joint rate at the end of a run, infinite if the run is too short to tell."""
    last = round(LAST / run.period)
    return float(np.abs(run["qdot"][-last:]).max()) if len(run) >= last else np.inf


def _scenario(wanted: Balance, gravity: bool, seconds: float) -> Scenario:
    arm = wanted.arm
    # The row that moves most: no arm has lost it.
    rows = Task(arm, np.arange(6)).matrix(arm.jacobian(wanted.q))
    axis: Axis = AXES[int(np.argmax(np.linalg.norm(rows, axis=1)))]  # type: ignore[assignment]
    return Scenario(
        name="hold",
        arm=ArmSection(model=arm.path.resolve(), site=arm.site, start=tuple(wanted.q), joints=arm.joints),
        task=TaskSection(axes=(axis,)),
        control=ControlSection(
            period=PERIOD,
            inverse=InverseSection(method="pseudoinverse"),
            feedback=FEEDBACK,
            nullspace=NullspaceSection(objective="posture", gain=FEEDBACK),
            limits=LimitsSection(position=False, on_excess="none"),
        ),
        target=TargetSection(path=(HoldSegment(hold=Hold(**{"for": seconds})),)),
        plant=PlantSection(
            kind=SERVO.name,
            kv=tuple(arm.inertia / PERIOD),
            timestep=TIMESTEP,
            gravity_compensation=not gravity,
            wrench=tuple(wanted.wrench),
        ),
    )
