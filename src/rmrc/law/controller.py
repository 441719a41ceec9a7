"""The law for an arm in the caller's own loop. With the same input it gives the rates of a run to the bit.

c = Controller("ur5e.xml", site="tool", control="tuned.yaml", period=0.002)
c.reset(q)
while True:
    out = c.step(q, qdot, pose=T, twist=v)
    data.ctrl[c.actuators] = out.qdot_cmd
    ...
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from operator import is_
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc import arm as arms
from rmrc.arm import Arm
from rmrc.arm.freshness import Freshness
from rmrc.law import fit
from rmrc.law.bare import started
from rmrc.law.command import Command
from rmrc.law.kinematics import FRAMES
from rmrc.law.law import TaskLaw
from rmrc.law.loop import NOTHING, RATES, REFUSED, Loop, taken
from rmrc.law.sight import Sight
from rmrc.law.step import CHAIN_ALONE, FRAME, Given
from rmrc.law.task import Task, choose
from rmrc.scenario import ArmSection, ControlSource, TaskSection, read_controls, read_task
from rmrc.support import shipped
from rmrc.support.errors import ModelError, QuestionError, ScenarioError
from rmrc.support.legible import shortened
from rmrc.support.problems import Problem
from rmrc.support.spatial import AXES

if TYPE_CHECKING:
    import mujoco

TWIST, QUATERNION, MATRIX, ROTVEC = map(int, (Given.TWIST, Given.QUATERNION, Given.MATRIX, Given.ROTVEC))
POSITION_TARGET, RATE_TARGET = int(Given.POSITION_TARGET), int(Given.RATE_TARGET)

ControlledModel: TypeAlias = "str | os.PathLike[str] | Arm | mujoco.MjModel | mujoco.MjSpec"
"""An MJCF or URDF file, the name of a shipped model, an Arm, or a loaded model."""

STALE = (
    "the kinematics of data do not belong to its qpos: call mj_fwdPosition, or mj_kinematics, after the last "
    "change"
)
FRAME_CODES = {name: code * FRAME for code, name in enumerate(FRAMES)}
# The representation of an orientation in a pose, by the size of its last axis.
POSES = {7: QUATERNION, 6: ROTVEC, 4: MATRIX}


class Controller(Loop):
    """The law for one arm, or for a batch of arms, stepped once per control period.

    `step` raises nothing. Input that is not finite, has a wrong shape, is no rotation or comes too late
    brakes the joints from the last command within all limits, and the status reports it. The status also
    reports a joint outside its position limits: that joint comes back slowly while the others come to rest.
    Near a singularity the status says so, and the law applies the chosen policy.

    Attributes:
        arm: The arm.
        task: The task: which components of the site's motion are controlled.
        control: The settings of the law.
        actuators: Indices of the arm's actuators in `data.ctrl` of the model, (n,).
    """

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
        watchdog: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Load the arm and its law. Nothing is compiled yet.

        Args:
            model: The arm, or the model that contains it.
            site: Name of the site to control. None: that of the scenario given as `control`, or else that of
                the hand, see `rmrc.arm.frames`.
            control: The law: a mapping or a YAML file with the keys of the section `control`, or with that
                section, as `rmrc tune` prints it; a scenario, whose task, frame and joints apply where none
                are given here; or a ControlSection. None: all defaults.
            period: Time between two steps [s]; None: the period of `control`.
            task: A section `task` or its keys: axes, weights, length, frame. None: the task of `control`, or
                else the axes that the arm can move independently of each other.
            body: Name of the body whose frame to control, instead of a site.
            joints: Names of the joints to actuate; None: all joints on the chain to the site.
            watchdog: See `watchdog`.
            clock: Returns the time that the watchdog compares [s], such as that of a simulation.

        Raises:
            ModelError: The model, the site or a joint is missing or not usable.
            ScenarioError: `control` or `task` has an unusable value, or does not fit the arm.
            QuestionError: The period or the watchdog is not a positive time.
        """
        told = read_controls(control, period)
        self.control = told.control
        self.arm = _arm(model, site, body, joints, told.arm)
        self.arm.require_open()
        self.task = self._task(told.task if task is None else task)
        found = list(fit.misfits(self.control, len(self.task.rows), self.arm))
        found += fit.second_task_misfits(self.control, self.arm)
        found += fit.scale_misfits("task.length", (self.task.length,), is_list=False)
        found += fit.scale_misfits("task.weights", tuple(self.task.weights or ()))
        if found:
            raise ScenarioError([Problem(tuple(key.split(".")), text) for key, text in found])
        super().__init__(self.arm.joints, 6, self.control.period, clock)
        self._data: list[mujoco.MjData] = []
        self.reset()
        self.watchdog = watchdog

    def _task(self, task: Task | TaskSection | Mapping[str, Any] | None) -> Task:
        weights = self.control.joint_weights
        if isinstance(task, Task):
            return task
        if task is None:
            chosen = choose(self.arm)
            return Task(self.arm, chosen.rows, chosen.length, None, weights)
        section = read_task(task)
        rows = np.array([AXES.index(axis) for axis in section.axes])
        return Task(self.arm, rows, section.length, section.weights, weights, section.frame)

    @property
    def actuators(self) -> NDArray[np.int64]:
        """Indices of the arm's actuators in `data.ctrl` of the model, (n,).

        Raises:
            ModelError: A joint has no actuator of its own.
        """
        ids = self.arm.wiring.actuator
        if (ids < 0).any():
            without = ", ".join(f'"{name}"' for name, one in zip(self.joints, ids, strict=True) if one < 0)
            raise ModelError(f"{self.arm.path}: no actuator drives joint {without}")
        return np.asarray(self.arm.model.actuator_ctrladr[ids], np.int64)

    def reset(self, q: ArrayLike | None = None) -> None:
        """Forget all steps: the next one is the first, from rest.

        Args:
            q: Positions of the joints, (n,), or (w, n) for a batch of w worlds [rad or m]. Commanded
                positions start there, and the null space holds them where `control` gives no posture. None:
                q comes from the next step, and the null space keeps its posture, at first the keyframe
                `home`.

        Raises:
            QuestionError: q has another shape, or is not finite.
        """
        if q is None and hasattr(self, "_worlds"):
            self._forget()
            return
        n, home = self.arm.n, self.arm.configuration("home")[self.arm.wiring.qpos]
        starts = started("q", home if q is None else q, n)
        self._laws = [TaskLaw(self.task, self.control, start) for start in starts.reshape(-1, n)]
        writers = [(self.task, law, Sight(self.arm, law.second)) for law in self._laws]
        self._renew(writers, self.arm.n + len(self.arm.followers), starts.ndim == 1)
        self._pose, self._vector = self._put["pose"], self._put["vector"]
        self._data, self._stale, self._unseen = [], list[int](), self._idle()
        if q is not None:
            self._worlds["q_cmd"][:, :n] = starts

    # Kinematics -----------------------------------------------------------------------------------

    def _idle(self) -> str:
        """Return why the chain alone does not determine the poses of the sites, "" if it does."""
        second = self._laws[0].second
        idle = self.arm.idle or (self.arm.idle_before(second.site) if second else ())
        if idle:
            return f'joint "{idle[0]}" moves the site and is not actuated: step_data reads its position'
        return ""

    def _follow_chain(self) -> None:
        """Have steps compute the kinematics from the arm's own chain."""
        self._data, self._stale = [], []
        self._worlds["sites"] = CHAIN_ALONE
        self._point_at(NOTHING)

    def _look_at(self, data: "mujoco.MjData | Sequence[mujoco.MjData]") -> None:
        """Have steps read state and kinematics from MuJoCo's data, one object per world.

        Raises:
            ModelError: The model of the data lacks a part of the arm.
            QuestionError: Their number differs from that of the worlds, or one is no MjData.
        """
        self._data = []
        found: list[Any] = [data] if self._is_one else list(data) if isinstance(data, Sequence) else []
        if len(found) != len(self._worlds):
            given = len(found) if isinstance(data, Sequence) else type(data).__name__
            raise QuestionError(
                f"reset made a batch of {len(self._worlds)}: step_data reads a list of as many "
                f"mujoco.MjData, got {given}"
            )
        self._seen, places = list[_Seen](), []
        for world, one in zip(self._worlds, found, strict=True):
            try:
                model, arrays = one.model, (one.xquat, one.xanchor, one.xaxis)
            except AttributeError:
                raise QuestionError(f"step_data reads an mujoco.MjData, got {type(one).__name__}") from None
            try:
                sight = Sight(self.arm, self._laws[0].second, model)
                alike = [seen.is_fresh.scratch for seen in self._seen if seen.model is model]
                self._seen.append(_Seen(world, one, self.joints, sight, *alike[:1]))
            except KeyError as error:
                told = " ".join(str(error).strip("'\"").split())
                raise ModelError(f"the model of the data lacks a part of {self.arm.path}: {told}") from None
            sight.write(world)
            places.append((one.xpos if sight.is_beside else one.site_xpos, *arrays))
        self._point_at(*places)
        self._data = found

    def _sees(self, data: Any) -> bool:
        """Return whether steps already read these data."""
        if self._is_one:
            return bool(self._data) and data is self._data[0]
        is_list = bool(self._data) and isinstance(data, Sequence)
        return is_list and len(data) == len(self._data) and all(map(is_, data, self._data))

    def _finish_seen(self, given: int) -> Command:
        """Call the law; worlds with stale kinematics brake."""
        if not self._stale:
            return self._finish(given)
        self.command.refusal = STALE
        self._codes[:], self._given = given, given
        self._codes[self._stale] = REFUSED
        out, self._given = self._finish(given), -1
        return out

    def _read_data(self) -> int:
        """Read the states and find the worlds with stale kinematics; return the bits of `Given`."""
        self._stale = [w for w, seen in enumerate(self._seen) if not seen.read()]
        return RATES

    # Steps ----------------------------------------------------------------------------------------

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
            q_target: Target positions of the joints, (n,) or (w, n) [rad or m].
            qdot_target: Target rates of the joints, (n,) or (w, n) [rad/s or m/s].

        Returns:
            Views that the next step overwrites.
        """
        try:
            if self._data:
                self._follow_chain()
            given = FRAME_CODES[frame]
            self._q[:] = q
            if qdot is not None:
                self._qdot[:] = qdot
                given |= RATES
            given |= self._take(pose, twist, q_target, qdot_target)
        except Exception:
            return self._step_with_care(q, qdot, pose, twist, frame, q_target, qdot_target)
        return self._refuse(self._unseen) if self._unseen else self._finish(given)

    def step_data(
        self,
        data: "mujoco.MjData | Sequence[mujoco.MjData]",
        *,
        pose: ArrayLike | None = None,
        twist: ArrayLike | None = None,
        frame: str = "world",
        q_target: ArrayLike | None = None,
        qdot_target: ArrayLike | None = None,
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

        Returns:
            Views that the next step overwrites.
        """
        try:
            if not self._sees(data):
                self._look_at(data)
            given = FRAME_CODES[frame] | self._read_data()
            given |= self._take(pose, twist, q_target, qdot_target)
        except Exception as error:
            if not self._data:
                self._follow_chain()  # not the data that were read before
                return self._refuse(str(error))
            state = (self._worlds[name][:, : self.arm.n] for name in ("q", "qdot"))
            q, qdot = (rows[0] if self._is_one else rows for rows in state)
            return self._step_with_care(q, qdot, pose, twist, frame, q_target, qdot_target)
        return self._finish_seen(given)

    def _take(
        self,
        pose: ArrayLike | None,
        twist: ArrayLike | None,
        q_target: ArrayLike | None,
        qdot_target: ArrayLike | None,
    ) -> int:
        """Write the target where the law reads it; let the error of an array that does not fit pass."""
        given = 0
        if pose is not None:
            size = pose.shape[-1]  # type: ignore[union-attr]
            given = POSES[size]
            if size == 7:
                self._pose[:] = pose
            elif size == 6:
                self._vector[:] = pose
            else:
                self._matrix[:] = pose
        if twist is not None:
            self._twist[:] = twist
            given |= TWIST
        if q_target is None and qdot_target is None:
            return given
        if given:
            raise ValueError
        if q_target is not None:
            self._put["q_target"][:] = q_target
            given |= POSITION_TARGET
        if qdot_target is not None:
            self._put["qdot_target"][:] = qdot_target
            given |= RATE_TARGET
        return given

    def _step_with_care(
        self,
        q: ArrayLike,
        qdot: ArrayLike | None,
        pose: ArrayLike | None,
        twist: ArrayLike | None,
        frame: str,
        q_target: ArrayLike | None,
        qdot_target: ArrayLike | None,
    ) -> Command:
        """Convert input that is not a 64-bit array of the right shape, or refuse it with a reason."""
        given, wrong = 0, "" if self._data else self._unseen
        if q is None:
            wrong = wrong or f"q must be ({self.arm.n},), got None"
        if frame in FRAME_CODES if isinstance(frame, str) else False:
            given = FRAME_CODES[frame]
        else:
            wrong = wrong or f"frame must be one of {', '.join(FRAMES)}, got {shortened(repr(frame))}"
        if (pose is not None or twist is not None) and (q_target is not None or qdot_target is not None):
            wrong = wrong or "give pose and twist, or q_target and qdot_target, not both"
        try:
            sizes = np.shape(pose)[-1:]  # type: ignore[arg-type]
        except ValueError:  # lists of different lengths
            sizes = ()
        kind = POSES.get(sizes[0] if sizes else 0, QUATERNION)
        named = {QUATERNION: "pose", ROTVEC: "vector", MATRIX: "matrix"}[kind]
        for name, values, bit, where in (
            ("q", q, 0, "q"), ("qdot", qdot, RATES, "qdot"),
            ("pose", pose, kind, named), ("twist", twist, TWIST, "twist"),
            ("q_target", q_target, POSITION_TARGET, "q_target"),
            ("qdot_target", qdot_target, RATE_TARGET, "qdot_target"),
        ):  # fmt: skip
            if wrong or values is None:
                continue
            wrong = self._taken(name, values, where)
            given |= bit
        return self._refuse(wrong) if wrong else self._finish_seen(given)

    def _taken(self, name: str, values: ArrayLike, where: str) -> str:
        n, w = self.arm.n, len(self._worlds)
        size = {
            "q": n,
            "qdot": n,
            "q_target": n,
            "qdot_target": n,
            "pose": 7,
            "vector": 6,
            "matrix": 4,
            "twist": 6,
        }[where]
        shape = (size, size) if where == "matrix" else (size,)
        wrong = taken(name, values, self._put[where], [shape] if self._is_one else [(w, *shape), shape])
        if wrong and name == "pose":
            many, got = "" if self._is_one else f", or {w} of them", wrong.rpartition(", got ")[2]
            return f"pose must be (7,), (6,) or (4, 4){many}, got {got}"
        return f"{wrong}; reset made a batch of {w}" if wrong and not self._is_one else wrong


class _Seen:
    """Views of the state and kinematics in one world's data."""

    def __init__(
        self, world: Any, data: Any, joints: Sequence[str], sight: Sight, scratch: Any = None
    ) -> None:
        """Find the joints in the data; raise KeyError where one is missing."""
        self.model, n = data.model, len(joints)
        wiring = [self.model.joint(name) for name in joints]
        self._qpos, self._qvel, self._q, self._qdot = data.qpos, data.qvel, world["q"][:n], world["qdot"][:n]
        self._at_q = _address([joint.qposadr[0] for joint in wiring])
        self._at_qdot = _address([joint.dofadr[0] for joint in wiring])
        self.is_fresh = Freshness(data, [*self.model.jnt_bodyid[sight.joint], *sight.bodies], scratch)

    def read(self) -> bool:
        """Read the state; return whether the kinematics belong to it."""
        self._q[:], self._qdot[:] = self._qpos[self._at_q], self._qvel[self._at_qdot]
        return self.is_fresh()


def _address(numbers: Sequence[int]) -> Any:
    """Return an index of these numbers: a slice if they are consecutive, which copies nothing."""
    first = int(numbers[0])
    if list(numbers) == list(range(first, first + len(numbers))):
        return slice(first, first + len(numbers))
    return np.array(numbers, np.int64)


def _arm(
    model: ControlledModel,
    site: str | None,
    body: str | None,
    joints: Sequence[str] | None,
    told: ArmSection | None,
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
    if told is not None:
        if site is None and body is None:
            site, body, tool = told.site, told.body, told.tool
        joints = told.joints if joints is None else joints
    if isinstance(model, str) and model.lstrip().startswith("<"):
        raise QuestionError("model is the text of a model: give a file, or mujoco.MjSpec.from_string(text)")
    if isinstance(model, str | os.PathLike):
        return arms.load(shipped.found(model, "models"), site, joints, body=body, tool=tool)
    if not arms.is_model(model):
        raise QuestionError(
            f"model must be a file, an Arm, an MjModel or an MjSpec, got {type(model).__name__}"
        )
    return arms.load_model(model, site, joints, body=body)
