"""The law for an arm in the caller's own loop. With the same input it gives the rates of a run to the bit.

c = Controller("ur5e.xml", site="tool", control="tuned.yaml", period=0.002)
c.reset(q)
while True:
    out = c.step(q, qdot, pose=T, twist=v)
    data.ctrl[c.actuators] = out.qdot_cmd
    ...
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from operator import is_
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm import Arm, DriveKind, is_model, load, load_model
from rmrc.arm.location import Freshness
from rmrc.arm.others import Servo
from rmrc.law import settings
from rmrc.law.active_set import give_way
from rmrc.law.command import Command
from rmrc.law.compiling import Array
from rmrc.law.defaults import fitted
from rmrc.law.joint_motion import POSITION_TARGET, RATE_TARGET
from rmrc.law.kinematics import FRAMES
from rmrc.law.measurement import CHAIN_ALONE, look_at
from rmrc.law.record import POSE, TWIST
from rmrc.law.settings import TaskLaw, rate_limit
from rmrc.law.step import FRAME, PLACED, RATES
from rmrc.law.stepping import SteppedLaw, started
from rmrc.law.task import Task, choose
from rmrc.scenario import ArmSection, ControlSource, TaskSection, read_controls, read_task
from rmrc.scenario.changes import hinted
from rmrc.support import shipped
from rmrc.support.errors import ModelError, ModelWarning, QuestionError
from rmrc.support.spatial import exp_rotation
from rmrc.support.text import shortened

# A matrix that differs more from that of its quaternion is no rotation.
SKEWEST = 5e-4
LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])

ControlledModel: TypeAlias = "str | os.PathLike[str] | Arm | mujoco.MjModel | mujoco.MjSpec"
"""An MJCF or URDF file, the name of a shipped model, an Arm, or a loaded model."""

STALE = (
    "the kinematics of data do not belong to its qpos: call mj_fwdPosition, or mj_kinematics, after the last "
    "change"
)


class Controller(SteppedLaw):
    """The law for one arm, or for a batch of arms, stepped once per control period.

    `step` raises nothing. Input that is not finite, has a wrong shape, is no rotation or comes too late
    brakes the joints from the last command, as their accelerations and jerks allow, and the status reports
    it. The status also reports a joint outside its position limits: that joint comes back slowly while the
    others come to rest.
    Near a singularity the status says so, and the law applies the chosen policy.

    Attributes:
        arm: The arm.
        task: The task: which components of the site's motion are controlled.
        control: The settings of the law; numbers that nobody gave are those of the arm.
        assumed: Assumptions about the model, and the numbers that came from the arm, one line each.
        unseen: Why `step` cannot tell where the site is, "" if it can.
        actuators: Indices of the arm's actuators in `data.ctrl` of the model, (n,).
    """

    @hinted
    def __init__(
        self,
        model: ControlledModel,
        site: str | None = None,
        control: ControlSource = None,
        *,
        period: float | None = None,
        task: Task | TaskSection | Mapping[str, Any] | None = None,
        body: str | None = None,
        joints: Sequence[str] | None = None,
        actuators: bool = True,
        watchdog: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Load the arm and its law. Nothing is compiled yet.

        Args:
            model: The arm, or the model that contains it.
            site: Name of the site to control. None: that of the scenario given as `control`, or else that of
                the hand, see `rmrc.arm.tree`.
            control: The law: a mapping or a YAML file with the keys of the section `control`, or with that
                section, as `rmrc tune` prints it; a scenario, whose task, frame and joints apply where none
                are given here; or a ControlSection. None: all defaults.
            period: Time between two steps [s]; None: the period of `control`.
            task: A section `task` or its keys: axes, weights, length, frame. None: the task of `control`, or
                else the axes that the arm can move independently of each other.
            body: Name of the body whose frame to control, instead of a site.
            joints: Names of the joints to actuate; None: all joints on the chain to the site.
            actuators: Whether the model's actuators get the commands, so that their ranges and forces limit
                these: a position servo's range limits q_cmd, a rate servo's qdot_cmd. False: another drive
                gets them, and the rates are those of a run.
            watchdog: See `watchdog`.
            clock: Returns the time that the watchdog compares [s], such as that of a simulation.

        Raises:
            ModelError: The model, the site or a joint is missing or not usable.
            ScenarioError: `control` or `task` has an unusable value, or does not fit the arm.
            QuestionError: The period or the watchdog is not a positive time.
        """
        sections = read_controls(control, period)
        self.control = sections.control
        self.arm = _arm(model, site, body, joints, sections.arm)
        self.arm.require_open()
        wanted = sections.task if task is None else task
        section = wanted if isinstance(wanted, Task | None) else read_task(wanted)
        self.task = self._task(section)
        settings.refuse([
            *settings.misfits(self.control, len(self.task.rows), self.arm),
            *settings.second_task_misfits(self.control, self.arm),
            *settings.scale_misfits("task.length", (self.task.length,), is_list=False),
            *settings.scale_misfits("task.weights", tuple(self.task.weights or ())),
        ])  # fmt: skip
        self.control, by_arm = fitted(self.control, self.task, section.length if section else None)
        self.assumed = (*self.arm.notes, *filter(None, [by_arm]))
        super().__init__(self.arm.joints, self.control.period, watchdog, clock)
        self._drives = actuators
        self.reset()
        slow = settings.slow_servos(rate_limit(self.arm, self.control.limits), self.arm) if actuators else ""
        if slow:
            warnings.warn(f"{self.arm.path}: {slow}", ModelWarning, stacklevel=2)

    def _task(self, section: Task | TaskSection | None) -> Task:
        weights = self.control.joint_weights
        if isinstance(section, Task):
            return section
        if section is None:
            return replace(choose(self.arm), joint_weights=weights)
        chosen = choose(self.arm, section.axes, section.length, section.frame)
        return replace(chosen, weights=section.weights, joint_weights=weights)

    @property
    def actuators(self) -> NDArray[np.int64]:
        """Indices of the arm's actuators in `data.ctrl` of the model, (n,).

        Raises:
            ModelError: A joint has no actuator of its own.
        """
        return np.asarray(self.arm.model.actuator_ctrladr[self._actuator_ids], np.int64)

    @cached_property
    def _actuator_ids(self) -> NDArray[np.int64]:
        """Ids of the actuators that take the commands, (n,): position before rate servos, before others."""
        ids = self.arm.wiring.actuator.copy()
        for i, servo in sorted(self.arm.servos.items(), key=lambda each: each[1].command, reverse=True):
            ids[servo.joint] = i
        if (ids < 0).any():
            without = ", ".join(f'"{name}"' for name, one in zip(self.joints, ids, strict=True) if one < 0)
            raise ModelError(f"{self.arm.path}: no actuator drives joint {without}")
        return ids

    def controls(self, command: Command | None = None) -> Array:
        """Return the controls of `actuators` for a command, (n,) or (w, n): positions or rates, geared.

        Args:
            command: The command; None: that of the last step.

        Raises:
            ModelError: A joint has no servo of its own.
        """
        takes_positions, slope, offset = self._servos
        command = self.command if command is None else command
        commanded: Array = np.where(takes_positions, command.q_cmd, command.qdot_cmd)
        return commanded * slope + offset

    @cached_property
    def _servos(self) -> tuple[NDArray[np.bool_], Array, Array]:
        """Return whether each of the actuators takes positions, and its slope and offset, (n,) each."""
        servos = list[Servo]()
        for name, i in zip(self.joints, self._actuator_ids, strict=True):
            if int(i) not in self.arm.servos:
                raise ModelError(
                    f'{self.arm.path}: the actuator of joint "{name}" is no position or rate servo; compute '
                    "its control from qdot_cmd, or add a servo"
                )
            servos.append(self.arm.servos[int(i)])
        takes_positions = np.array([servo.command == DriveKind.POSITION for servo in servos])
        return takes_positions, np.array([s.slope for s in servos]), np.array([s.offset for s in servos])

    def reset(self, q: ArrayLike | mujoco.MjData | Sequence[mujoco.MjData] | None = None) -> None:
        """Forget all steps: the next one is the first, from rest.

        Args:
            q: Positions of the joints, (n,), or (w, n) for a batch of w worlds [rad or m]; all of qpos of the
                arm's model, (nq,) or (w, nq); or MuJoCo's data of any model with the arm, or a list of w such
                data. Commanded positions start there, and the null space holds them where `control` gives no
                posture. None: q comes from the next step, and the null space keeps its posture, at first the
                keyframe `home`.

        Raises:
            QuestionError: q has another shape, or is not finite.
            ModelError: The model of the data lacks a part of the arm.
        """
        if q is None and hasattr(self, "_worlds"):
            self._forget()
            return
        n, is_given = self.arm.n, q is not None
        q = self.arm.configuration("home") if q is None else q
        starts = started(self.arm.positions(q), n, self.arm.forms)
        seen: Any = [q] if starts.ndim == 1 else q
        rows = zip(starts.reshape(-1, n), seen, strict=True)
        laws = [TaskLaw(self.task, self.control, *each) for each in rows]
        self._renew(laws, len(self.arm.axis_names), starts.ndim == 1)
        self._place("pose", self._worlds["tick"]["pose_ref"])
        self._place("twist", self._worlds["tick"]["twist_ref"])
        self._second, self._data, self._are_fresh = laws[0].second, list[Any](), list[Freshness]()
        if is_given:
            self._worlds["input"]["q_cmd"][:, :n] = starts
        if self._drives:
            self._limit_by_drives()
        self._watch()
        idle = self.arm.idle() or (self.arm.idle(self._second.site) if self._second else ())
        self.unseen = ""  # why the chain alone does not determine the poses of the sites
        if idle:
            self.unseen = (
                f'joint "{idle[0]}" moves the site and is not actuated: step_data reads its position'
            )

    def _limit_by_drives(self) -> None:
        """Write what the model's actuators can take."""
        n, arm, input_, limits = self.arm.n, self.arm, self._worlds["input"], self._worlds["limits"]
        limits["torque"][:, :n] = arm.torque_limit
        positions, rates = arm.servo_limits
        limits["rate"][:, :n] = np.minimum(limits["rate"][:, :n], rates)
        input_["servo"][:, :, :n] = positions
        input_["has_servos"] = np.isfinite(positions).any()
        if np.isfinite(positions).any():
            self._methods["give_way"] = give_way

    # Kinematics -----------------------------------------------------------------------------------

    def _follow_chain(self) -> None:
        """Have steps compute the kinematics from the arm's own chain."""
        self._data = []
        self._worlds["input"]["sites"], self._worlds["task"]["base"] = CHAIN_ALONE, self.task.view.base

    def _look_at(self, data: mujoco.MjData | Sequence[mujoco.MjData]) -> None:
        """Have steps read state and kinematics from MuJoCo's data, one object per world.

        Raises:
            QuestionError: The model of the data lacks a part of the arm, their number differs from that of
                the worlds, or one is no MjData.
        """
        self._follow_chain()  # not the data that were read before
        seen: list[Any] = [data] if self._is_single else list(data) if isinstance(data, Sequence) else []
        if len(seen) != len(self._worlds):
            count = len(seen) if isinstance(data, Sequence) else type(data).__name__
            text = f"reset made a batch of {len(self._worlds)}: step_data reads a list of as many"
            raise QuestionError(f"{text} mujoco.MjData, got {count}")
        self._are_fresh, scratch = [], dict[int, mujoco.MjData]()  # one for each model
        try:
            for world, one in zip(self._worlds, seen, strict=True):
                if not isinstance(one, mujoco.MjData):
                    raise QuestionError(f"step_data reads an mujoco.MjData, got {type(one).__name__}")
                bodies = look_at(world, one, self.arm, self._second)
                self._are_fresh.append(Freshness(one, bodies, scratch.get(id(one.model))))
                scratch[id(one.model)] = self._are_fresh[-1].scratch
        except (ModelError, QuestionError) as error:
            self._follow_chain()  # some have been read
            raise QuestionError(str(error)) from None
        self._data = seen

    def _sees(self, data: Any) -> bool:
        """Return whether steps already read these data."""
        seen = [data] if self._is_single else data
        is_alike = isinstance(seen, Sequence) and bool(seen) and len(seen) == len(self._data)
        return is_alike and all(map(is_, seen, self._data))

    # Steps ----------------------------------------------------------------------------------------

    @np.errstate(all="ignore")  # the law reports numbers that are not finite
    def _quaternion_pose(self, pose: Array) -> Array:
        """Return poses as [p, quat w x y z], (..., 7), from any of their forms; NaN where none is one."""
        if pose.shape[-1:] == (6,):
            return np.concatenate([pose[..., :3], exp_rotation(pose[..., 3:])], axis=-1)
        if pose.shape[-2:] != (4, 4):
            return pose
        poses = np.empty((*pose.shape[:-2], 7))
        for T, row in zip(pose.reshape(-1, 4, 4), poses.reshape(-1, 7), strict=True):
            row[:3], R, back = T[:3, 3], T[:3, :3].ravel(), np.empty(9)
            mujoco.mju_mat2Quat(row[3:], R)
            mujoco.mju_quat2Mat(back, row[3:])
            if not np.abs([*(back - R), *(T[3] - LAST_ROW)]).max() <= SKEWEST:
                row[3:] = np.nan
        return poses

    def step(
        self,
        q: ArrayLike,
        qdot: ArrayLike | None = None,
        *,
        pose: ArrayLike | None = None,
        twist: ArrayLike | None = None,
        frame: str = "world",
        q_target: ArrayLike | None = None,
        qdot_target: ArrayLike | None = None,
        dt: ArrayLike | None = None,
    ) -> Command:
        """Return the command for the next period, with the arm's own kinematics. It raises and keeps nothing.

        The target is a pose, a twist or both; or joint positions, rates or both, which the joints reach and
        follow within the same limits. Without a target the site stands still. For a batch, each array has one
        row per world, or one value that all worlds share.

        Args:
            q: Joint positions, as measured, (n,) or (w, n) [rad or m].
            qdot: Joint rates, as measured, (n,) or (w, n) [rad/s or m/s]; with a jerk limit the law estimates
                from them how far a joint lags behind its commands, so that it stops in time. Give them at
                each step, or never.
            pose: Target pose of the site: [p, quat w x y z], (7,) [m, 1]; [p, rotation vector], (6,) [m,
                rad]; or a homogeneous matrix, (4, 4). Without it there is no feedback.
            twist: Target twist at full pace, [v; ω], (6,) [m/s, rad/s]. Without it there is no feed-forward.
            frame: Frame of pose and twist: `world`; `base`, the body that carries the first joint; or
                `site`, the site at its current pose. In `site`, pose is the remaining displacement, and twist
                is along the site's axes.
            q_target: Target positions of the joints, (n,) or (w, n) [rad or m]. A hinge without range takes
                the shorter way round.
            qdot_target: Target rates of the joints, (n,) or (w, n) [rad/s or m/s].
            dt: Time since the last step, () or (w,) [s]; None: `period`. With it, the limits hold in a loop
                whose period varies: the command changes by what they allow in this time, and `q_cmd` advances
                by it. At most 0.1 s, or two periods if these are longer, count.

        Returns:
            Views that the next step overwrites.
        """
        try:
            self._take_time(dt)
            if self._data:
                self._follow_chain()
            if self.unseen:
                raise QuestionError(self.unseen)
            self._take_each("q", q)
            bits = self._take_target(
                frame, qdot=qdot, pose=pose, twist=twist, q_target=q_target, qdot_target=qdot_target
            )
        except QuestionError as unusable:
            return self._refuse(unusable)
        return self._finish(bits)

    def step_data(
        self,
        data: mujoco.MjData | Sequence[mujoco.MjData],
        *,
        pose: ArrayLike | None = None,
        twist: ArrayLike | None = None,
        frame: str = "world",
        q_target: ArrayLike | None = None,
        qdot_target: ArrayLike | None = None,
        dt: ArrayLike | None = None,
    ) -> Command:
        """Return the command for the next period, with MuJoCo's kinematics: the same bits as in a run.

        Args:
            data: Positions, rates and kinematics of any model that contains the arm, up to date as after
                `mj_fwdPosition`; for a batch, a list of objects, one per world. Kinematics of other
                positions, which `mj_step` leaves behind, brake the joints.
            pose: This and the other arguments are as in `step`.
            twist: Target twist of the site.
            frame: Frame of pose and twist.
            q_target: Target positions of the joints.
            qdot_target: Target rates of the joints.
            dt: Time since the last step.

        Returns:
            Views that the next step overwrites.
        """
        try:
            self._take_time(dt)
            if not self._sees(data):
                self._look_at(data)
            self._refused = {w: STALE for w, is_fresh in enumerate(self._are_fresh) if not is_fresh()}
            bits = self._take_target(
                frame, pose=pose, twist=twist, q_target=q_target, qdot_target=qdot_target
            )
        except QuestionError as unusable:
            return self._refuse(unusable)
        return self._finish(RATES | bits)

    def _take_target(self, frame: str, **arguments: ArrayLike | None) -> int:
        """Write the target, and other arguments, where the law reads them; return all bits.

        Raises:
            QuestionError: A part has another form.
        """
        if not isinstance(frame, str) or frame not in FRAMES:
            text = f"frame must be one of {', '.join(FRAMES)}, got {shortened(repr(frame))}"
            raise QuestionError(text)
        bits = PLACED | self._take_all(**arguments)
        if bits & (POSE | TWIST) and bits & (POSITION_TARGET | RATE_TARGET):
            raise QuestionError("give pose and twist, or q_target and qdot_target, not both")
        return bits + FRAMES.index(frame) * FRAME


def _arm(
    model: ControlledModel,
    site: str | None,
    body: str | None,
    joints: Sequence[str] | None,
    section: ArmSection | None,
) -> Arm:
    """Return the arm of a model.

    Raises:
        ModelError: The model, the site or a joint is missing or not usable.
        QuestionError: It is no model, site and body are both given, or they are given with a loaded arm.
    """
    if site is not None and body is not None:
        raise QuestionError("give site or body, not both")
    if isinstance(model, Arm):
        if (site, body, joints) != (None, None, None):
            raise QuestionError("an Arm has its site and joints; load it with those that you want")
        return model
    tool = None
    if section is not None:
        if site is None and body is None:
            site, body, tool = section.site, section.body, section.tool
        joints = section.joints if joints is None else joints
    if isinstance(model, str) and model.lstrip().startswith("<"):
        raise QuestionError("model is the text of a model: give a file, or mujoco.MjSpec.from_string(text)")
    if isinstance(model, str | os.PathLike):
        return load(shipped.found(model, "models"), site, joints, body=body, tool=tool)
    if not is_model(model):
        raise QuestionError(
            f"model must be a file, an Arm, an MjModel or an MjSpec, got {type(model).__name__}"
        )
    return load_model(model, site, joints, body=body)
