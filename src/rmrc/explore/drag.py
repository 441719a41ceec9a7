"""An arm that is led by hand: the law of a scenario in real time, behind a goal that its reader moves."""

import math
import time

import numpy as np
from numpy.typing import NDArray

from rmrc.explore.answer import Answer
from rmrc.explore.controls import Values
from rmrc.law.controller import Controller
from rmrc.results.run import Run
from rmrc.scenario.sections import TargetLimitsSection
from rmrc.simulation.live import Live
from rmrc.simulation.prepare import Prepared
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import exp_rotation, pose_error, quat_multiply

Array = NDArray[np.float64]

# Period of the control [s]: 250 Hz, if the scenario is faster and its plant can be told so.
PERIOD = 0.004
# The ticks of this time [s] are kept and drawn; this many instants of them are in the trail.
RECENT, TRAIL = 10.0, 60
# The reference has a speed of this times its distance from the goal [1/s], near the goal.
PURSUIT = 10.0
# Simulated time that a slow machine makes up for, at most [s]; it drops the rest.
LATE = 0.1
# Rates below this are none [rad/s or m/s].
STILL = 1e-5
# The real-time factor is of about this time [s].
PACE = 1.0


class Reference:
    """A reference that follows a goal within limits of speed and acceleration, wherever the goal jumps.

    Attributes:
        pose: [p, quat w x y z], (7,) [m, 1].
        twist: [v; ω], (6,) [m/s, rad/s].
    """

    def __init__(self, pose: Array, limits: TargetLimitsSection) -> None:
        """Stand at a pose."""
        self.pose, self.twist = np.array(pose), np.zeros(6)
        self._limits = (
            (slice(0, 3), limits.velocity, limits.acceleration),
            (slice(3, 6), limits.angular_velocity, limits.angular_acceleration),
        )

    def step(self, goal: Array, period: float, pace: float) -> None:
        """Follow the goal for a period.

        The speed falls with the root of the distance, so that half the acceleration stops it, and near the
        goal with the distance itself.

        Args:
            goal: Pose, (7,) [m, 1].
            period: Time [s].
            pace: Part of its way that it goes: what the law leaves of it.
        """
        error = pose_error(goal, self.pose)
        for rows, speed, acceleration in self._limits:
            way = error[rows]
            distance = math.sqrt(way @ way)
            fastest = min(PURSUIT * distance, speed, math.sqrt(acceleration * distance))
            change = way * (fastest / distance if distance else 0.0) - self.twist[rows]
            size, most = math.sqrt(change @ change), acceleration * period
            self.twist[rows] += change * (min(1.0, most / size) if size else 0.0)
        step = pace * period * self.twist
        self.pose[:3] += step[:3]
        if step[3:].any():
            turned = quat_multiply(exp_rotation(step[3:]), self.pose[3:])
            self.pose[3:] = turned / np.linalg.norm(turned)


class Drag:
    """An arm, its plant and its law, which run while its reader moves a goal; for one thread at a time.

    Attributes:
        prepared: The scenario; its path has no effect.
        values: Its changed keys, with their values.
        goal: Pose that the reference follows, (7,) [m, 1]; the reader's thread replaces it.
        joints: Positions that the joints go to instead, (n,) [rad or m]; None: the goal counts.
        factor: Simulated over real time; 1: the machine keeps up.
        trouble: Why the arm stands still; "": it moves.
    """

    def __init__(
        self, prepared: Prepared, values: Values, like: Answer, before: "Drag | None" = None
    ) -> None:
        """Stand at the start, or go on from where an arm is under other settings.

        Args:
            prepared: The scenario, whose `control.period` is that of the loop.
            values: Its changed keys, with their values.
            like: An answer whose arm looks the same.
            before: The arm before this one, which has the same joints and goes no further.

        Raises:
            QuestionError: The arm cannot be led.
        """
        arm, scenario = prepared.arm, prepared.scenario
        if arm.idle:
            raise QuestionError(f'drag needs an arm whose joints are all actuated; "{arm.idle[0]}" is not')
        self.prepared, self.values, self.period = prepared, values, scenario.control.period
        self._like = like
        self._live = Live(prepared, round(RECENT / self.period))
        self._law = Controller(arm, control=scenario, task=prepared.task)
        q = prepared.qpos[arm.wiring.qpos] - prepared.joint_offset
        self._law.reset(q)
        self._law.warm_up()
        self._reference = Reference(arm.pose(q), scenario.target.limits)
        self.goal, self.joints, self.trouble = self._reference.pose.copy(), None, ""
        self._pace: float = 1.0 if before is None else before._pace
        self.factor, self._owed, self._spans, self._still = 1.0, 0.0, (0.0, 0.0), 0.0
        if before is not None and before.period == self.period:
            self._live.take_over(before._live)
            self._law.take_over(before._law)
            self._reference.pose, self._reference.twist = before._reference.pose, before._reference.twist
            self.goal, self.joints = before.goal, before.joints
        self._tick()

    joints: Array | None

    @property
    def q(self) -> Array:
        """Joint positions as the law is told them, (n,) [rad or m]."""
        return self._live.q

    @property
    def pose(self) -> Array:
        """Pose of the end effector as the law sees it, (7,) [m, 1]."""
        return np.array(self._law.command.pose)

    def jog(self, joint: int, position: float) -> None:
        """Send one joint to a position, within all limits; the others stay where they are or go.

        Args:
            joint: Its number.
            position: The position [rad or m].
        """
        wanted = np.array(self.q if self.joints is None else self.joints)
        wanted[joint] = position
        self.joints, self._still = wanted, 0.0

    def lead(self, goal: Array) -> None:
        """Have the reference follow a goal, (7,) [m, 1], from where the end effector is now."""
        self.goal, self.joints, self._still = np.array(goal), None, 0.0

    def advance(self, passed: float) -> None:
        """Run for the real time that passed, or for as much of it as the machine manages in that time.

        Args:
            passed: Real time since the last call [s].
        """
        self._owed = min(self._owed + passed, LATE)
        end, first = time.perf_counter() + max(passed, self.period), self._live.done
        while self._owed >= self.period and not self.trouble and time.perf_counter() < end:
            self._owed -= self.period
            self._tick()
        real, simulated = self._spans
        kept = max(0.0, 1.0 - passed / PACE)
        real, simulated = kept * real + passed, kept * simulated + self.period * (self._live.done - first)
        self._spans, self.factor = (real, simulated), min(1.0, simulated / real) if real else 1.0

    def _tick(self) -> None:
        live, law, reference = self._live, self._law, self._reference
        fine, joints = live.sense(), self.joints
        if joints is None:
            reference.step(self.goal, self.period, self._pace)
            out = law.step(live.q, live.qdot, pose=reference.pose, twist=reference.twist)
        else:
            out = law.step(live.q, live.qdot, q_target=joints)
            reference.pose[:], reference.twist[:] = out.pose, 0.0
        self._pace = out.path_rate
        moves = np.abs(out.qdot_cmd).max() > STILL or np.abs(live.qdot).max() > STILL
        self._still = 0.0 if moves else self._still + self.period
        if not (fine and live.obey(out, reference.pose, reference.twist)):
            self.trouble = "the motion diverged: reset the arm, and lower feedback, delay or lag"

    @property
    def is_still(self) -> bool:
        """Whether nothing has moved for as long as ticks are kept."""
        return self._still >= RECENT

    def now(self) -> Answer:
        """Return the last tick as an answer."""
        return self._shown(self._live.run(1))

    def recent(self) -> Answer:
        """Return the last seconds as an answer."""
        return self._shown(self._live.run(round(RECENT / self.period)))

    def _shown(self, run: Run) -> Answer:
        return Answer(self.values, self.prepared, run, self._like, TRAIL)
