"""Drag mode: the law of a scenario follows, in real time, a goal that the user moves."""

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

# Period of the control [s]: 250 Hz, if the scenario is faster and its plant accepts it.
PERIOD = 0.004
# The last ticks within this time [s] are kept and drawn; the trail has this many instants of them.
RECENT, TRAIL = 10.0, 60
# The reference has a speed of this times its distance from the goal [1/s], near the goal.
PURSUIT = 10.0
# Largest delay that a slow machine catches up [s]; it drops the rest.
LATE = 0.1
# Smaller rates count as rest [rad/s or m/s].
STILL = 1e-5
# The real-time factor is an average over about this time [s].
PACE = 1.0


class Reference:
    """A reference that follows a goal within limits of speed and acceleration, even if the goal jumps.

    Attributes:
        pose: [p, quat w x y z], (7,) [m, 1].
        twist: [v; ω], (6,) [m/s, rad/s].
    """

    def __init__(self, pose: Array, limits: TargetLimitsSection) -> None:
        """Begin at rest at a pose."""
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
            pace: Share of the step that it moves: the path rate of the law.
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
    """An arm with its plant and its law, which run while the user moves a goal; for one thread at a time.

    Attributes:
        prepared: The scenario; its path has no effect.
        values: Its changed keys, with their values.
        goal: Pose that the reference follows, (7,) [m, 1]; another thread may replace it.
        joints: Target positions of the joints in place of the goal, (n,) [rad or m]; None: the goal counts.
        factor: Simulated over real time; 1: the machine keeps up.
        trouble: The reason why the arm stands still; "": it moves.
    """

    def __init__(
        self, prepared: Prepared, values: Values, like: Answer, before: "Drag | None" = None
    ) -> None:
        """Start at the start of the scenario, or continue from an arm with other settings.

        Args:
            prepared: The scenario; its `control.period` is the period of the loop.
            values: Its changed keys, with their values.
            like: An answer whose arm looks the same.
            before: The previous arm, with the same joints; it must not run again.

        Raises:
            QuestionError: The arm has a joint without an actuator on its chain.
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
        """Joint positions that the law believes, (n,) [rad or m]."""
        return self._live.q

    @property
    def pose(self) -> Array:
        """Pose of the end effector that the law believes, (7,) [m, 1]."""
        return np.array(self._law.command.pose)

    def jog(self, joint: int, position: float) -> None:
        """Send one joint to a position, within all limits; the others keep their targets, or stay.

        Args:
            joint: Index of the joint.
            position: The position [rad or m].
        """
        wanted = np.array(self.q if self.joints is None else self.joints)
        wanted[joint] = position
        self.joints, self._still = wanted, 0.0

    def lead(self, goal: Array) -> None:
        """Let the reference follow a goal, (7,) [m, 1], from the present pose of the end effector."""
        self.goal, self.joints, self._still = np.array(goal), None, 0.0

    def advance(self, passed: float) -> None:
        """Simulate the real time that passed, or the part of it that the machine manages in that time.

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
        """Whether nothing has moved during all kept ticks."""
        return self._still >= RECENT

    def now(self) -> Answer:
        """Return the last tick as an answer."""
        return self._shown(self._live.run(1))

    def recent(self) -> Answer:
        """Return the last seconds as an answer."""
        return self._shown(self._live.run(round(RECENT / self.period)))

    def _shown(self, run: Run) -> Answer:
        return Answer(self.values, self.prepared, run, self._like, TRAIL)
