"""What obeys the rates: an ideal arm, joint-rate servos, or computed torque, on MuJoCo's batch.

`tick` is the one compiled call of a control tick: for every world it measures, applies the law and
sets the plant's input. MuJoCo then steps all worlds and leaves their kinematics fresh.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from typing import Any, ClassVar, NamedTuple, cast

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from rmrc.arm import Arm, Change, Wiring
from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.law.kinematics import follow_chain, geometric_jacobian, pose_error, second_jacobian
from rmrc.law.law import control
from rmrc.law.record import JOINTS, Field
from rmrc.plants.batches import Batches
from rmrc.support.pace import Pace

# MuJoCo calls a larger position, velocity or acceleration bad (its mjMAXVAL).
LARGEST = 1e10
BAD_FIRST, BAD_LAST = int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC)


class Plant(IntEnum):
    """What turns commanded rates into motion."""

    IDEAL = 0
    SERVO = 1
    TORQUE = 2


IDEAL, TORQUE = int(Plant.IDEAL), int(Plant.TORQUE)

# MuJoCo's ids, and columns of the state row; of the slide of a screw joint, or -1, with what it moves for
# each radian; from the center of mass of the body that carries the site to the site, in the site's frame.
WIRING = (
    Field("joint", np.int64, (JOINTS,)), Field("dof", np.int64, (JOINTS,)),
    Field("actuator", np.int64, (JOINTS,)), Field("site", np.int64), Field("body", np.int64),
    Field("qpos_column", np.int64, (JOINTS,)), Field("qvel_column", np.int64, (JOINTS,)),
    Field("ctrl_column", np.int64, (JOINTS,)), Field("wrench_column", np.int64),
    Field("travel_column", np.int64, (JOINTS,)), Field("travel_ratio", size=(JOINTS,)),
    Field("lever", size=(3,)),
)  # fmt: skip


@dataclass(frozen=True)
class Course:
    """What a world has before it: it owns the fields of its record that say how far it goes.

    Attributes:
        reference: Index of its reference in the batch.
        path_ticks: Ticks of that.
        ticks: Ticks to run at most.
    """

    reference: int
    path_ticks: int
    ticks: int

    fields: ClassVar[tuple[Field, ...]] = (
        Field("reference", np.int64), Field("path_ticks", np.int64), Field("ticks", np.int64),
        # the tick at which it diverged or -1, and the joint
        Field("diverged", np.int64), Field("diverged_joint", np.int64),
    )  # fmt: skip

    def write(self, world: np.void) -> None:
        """Write its fields of a world's record."""
        world["reference"], world["path_ticks"], world["ticks"] = self.reference, self.path_ticks, self.ticks
        world["diverged"], world["diverged_joint"] = -1, 0


@entry
def tick(
    worlds: Record,
    ticks: Record,
    reference: Array,
    state: Array,
    warning: NDArray[np.int32],
    site_xpos: Array,
    site_xquat: Array,
    xanchor: Array,
    xaxis: Array,
    actuator_force: Array,
    t: int,
) -> int:
    """Control all worlds for one tick; return how many of them are to be stepped.

    Each argument costs a call as much as a joint costs the law, so they are few.

    Args:
        worlds: World records, (w,).
        ticks: Tick records, (rows, w): tick t is written to row t modulo rows.
        reference: Pose and twist of each reference at each tick, (r, ticks, 13).
        state: MuJoCo's state rows, (w, nstate); controls and wrenches are written.
        warning: MuJoCo's warning counters, (w, 7, 2).
        site_xpos: And the other fields of MjData of the same names: fresh, (w, …).
        site_xquat: Orientation of each site.
        xanchor: Joint anchors.
        xaxis: Joint axes.
        actuator_force: Forces of the last step.
        t: Number of the tick.
    """
    running, row = 0, t % ticks.shape[0]
    for w in range(worlds.shape[0]):
        world, out = worlds[w], ticks[row, w]
        if world.diverged >= 0 or t >= world.ticks:
            continue
        measure(world, out, state[w], site_xpos[w], site_xquat[w], actuator_force[w])
        world.diverged_joint = bad_joint(world, warning[w])
        if world.diverged_joint >= -1:
            world.diverged = t
            continue
        geometric_jacobian(world, site_xpos[w, world.site], xanchor[w], xaxis[w], world.J)
        if world.m_2 > 0:
            measure_second(world, site_xpos[w], site_xquat[w], xanchor[w], xaxis[w])
        out.time = t * world.period
        read_reference(world, out, reference[world.reference])
        control(world, out)
        world.diverged_joint = bad_command(world, out)
        if world.diverged_joint >= 0:
            world.diverged = t
            continue
        obey(world, out, state[w])
        proceed(world, t)
        if t + 1 < world.ticks:
            running += 1
    return running


@compiled
def measure(
    world: Record, out: Record, state: Array, xpos: Array, xquat: Array, actuator_force: Array
) -> None:
    """Read q, qdot, pose and tau; the ideal arm's rates are those that it was last sent."""
    for j in range(world.n):
        out.q[j] = state[world.qpos_column[j]]
        world.q[j] = out.q[j] + world.encoder_offset[j]
        if world.plant == IDEAL:
            world.qdot[j] = world.qdot_cmd_last[j]
            out.tau[j] = 0.0
        else:
            world.qdot[j] = state[world.qvel_column[j]]
            out.tau[j] = actuator_force[world.actuator[j]]
        out.qdot[j] = world.qdot[j]
    for i in range(3):
        world.pose[i] = xpos[world.site, i]
    for i in range(4):
        world.pose[3 + i] = xquat[world.site, i]
    for i in range(7):
        out.pose[i] = world.pose[i]


@compiled
def measure_second(world: Record, xpos: Array, xquat: Array, anchors: Array, axes: Array) -> None:
    """Read pose and Jacobian of the second task's site."""
    for i in range(3):
        world.pose_2[i] = xpos[world.site_2, i]
    for i in range(4):
        world.pose_2[3 + i] = xquat[world.site_2, i]
    second_jacobian(world, xpos[world.site_2], anchors, axes)


@compiled
def read_reference(world: Record, out: Record, reference: Array) -> None:
    """Read pose and twist wanted at the path tick; between two ticks, of a slowed world, interpolate them.

    Quaternions are interpolated linearly and normalized: neighbors are a fraction of a degree apart, where
    that is as good as the arc.
    """
    before = int(world.path_tick)
    part = world.path_tick - before
    out.path_time = world.path_tick * world.period
    if part == 0.0:
        for i in range(7):
            out.pose_ref[i] = reference[before, i]
        for i in range(6):
            out.twist_ref[i] = reference[before, 7 + i]
        return
    first, second = reference[before], reference[before + 1]
    same = first[3] * second[3] + first[4] * second[4] + first[5] * second[5] + first[6] * second[6] >= 0.0
    norm = 0.0
    for i in range(7):
        end = second[i] if same or i < 3 else -second[i]
        out.pose_ref[i] = first[i] + part * (end - first[i])
        if i > 2:
            norm += out.pose_ref[i] * out.pose_ref[i]
    for i in range(3, 7):
        out.pose_ref[i] /= math.sqrt(norm)
    for i in range(6):
        out.twist_ref[i] = first[7 + i] + part * (second[7 + i] - first[7 + i])


@compiled
def proceed(world: Record, t: int) -> None:
    """Advance along the path; the world ends with the tick that was at the end of its path."""
    end = world.path_ticks - 1.0
    if world.path_tick >= end:
        world.ticks = t + 1
    world.path_tick = min(world.path_tick + world.pace, end)


@compiled
def bad_joint(world: Record, warning: NDArray[np.int32]) -> int:
    """Return the joint whose state is not finite, -1 if it is another's, -2 if all is well."""
    for j in range(world.n):
        if not (abs(world.q[j]) <= LARGEST and abs(world.qdot[j]) <= LARGEST):
            return j
    for kind in range(BAD_FIRST, BAD_LAST + 1):
        if warning[kind, 1] > 0:
            for j in range(world.n):
                if world.dof[j] == warning[kind, 0]:
                    return j
            return -1
    return -2


@compiled
def bad_command(world: Record, out: Record) -> int:
    """Return the joint whose command is not finite, or -2: MuJoCo would take it for 0 and go on."""
    for j in range(world.n):
        if not abs(out.qdot_cmd[j]) <= LARGEST:
            return j
    return -2


@compiled
def obey(world: Record, out: Record, state: Array) -> None:
    """Move Whitney's own arm, q⁺ = q + period · qdot, or tell the rates to the servos.

    The torque plant is told the acceleration that it shall have; `computed_torque` does the rest.
    """
    if world.plant != IDEAL:
        push(world, state)
    for j in range(world.n):
        cmd = out.qdot_cmd[j]
        if world.plant == IDEAL:
            state[world.qpos_column[j]] += world.period * cmd
            if world.travel_column[j] >= 0:
                state[world.travel_column[j]] += world.travel_ratio[j] * world.period * cmd
        elif world.plant == TORQUE:
            world.qddot[j] = (cmd - world.qdot_cmd_last[j]) / world.period
            world.qddot[j] += world.bandwidth * (cmd - world.qdot[j])
        else:
            state[world.ctrl_column[j]] = cmd
        world.qdot_cmd_last[j] = cmd


@compiled
def push(world: Record, state: Array) -> None:
    """Apply the site's external wrench [f; n] at its body's center of mass: n' = n + r × f.

    r, from the center to the site, is fixed to the site; v + 2 w (u × v) + 2 u × (u × v) turns it into
    the world by the quaternion (w, u).
    """
    f, r, w, column = world.wrench, world.lever, world.pose[3], world.wrench_column
    ux, uy, uz = world.pose[4], world.pose[5], world.pose[6]
    cx, cy, cz = uy * r[2] - uz * r[1], uz * r[0] - ux * r[2], ux * r[1] - uy * r[0]
    rx = r[0] + 2.0 * (w * cx + uy * cz - uz * cy)
    ry = r[1] + 2.0 * (w * cy + uz * cx - ux * cz)
    rz = r[2] + 2.0 * (w * cz + ux * cy - uy * cx)
    for i in range(6):
        state[column + i] = f[i]
    state[column + 3] += ry * f[2] - rz * f[1]
    state[column + 4] += rz * f[0] - rx * f[2]
    state[column + 5] += rx * f[1] - ry * f[0]


@entry
def believe_encoders(
    worlds: Record, state: Array, site_xpos: Array, site_xquat: Array, xanchor: Array, xaxis: Array
) -> None:
    """Write over MuJoCo's kinematics, for worlds whose encoders are off, those at q + offset.

    Args:
        worlds: World records, (w,).
        state: MuJoCo's state rows, (w, nstate).
        site_xpos: Copies of the fields of MjData of the same names, (w, …): written.
        site_xquat: Orientation of each site.
        xanchor: Joint anchors.
        xaxis: Joint axes.
    """
    for w in range(worlds.shape[0]):
        world = worlds[w]
        if not world.is_off:
            continue
        for j in range(world.n):
            world.q[j] = state[w, world.qpos_column[j]] + world.encoder_offset[j]
        follow_chain(world, world.q)
        for i in range(3):
            site_xpos[w, world.site, i] = world.pose[i]
            for j in range(world.n):
                xanchor[w, world.joint[j], i] = world.anchor[j, i]
                xaxis[w, world.joint[j], i] = world.axis[j, i]
        for i in range(4):
            site_xquat[w, world.site, i] = world.pose[3 + i]


@entry
def return_to_truth(
    worlds: Record, ticks: Record, state: Array, site_xpos: Array, site_xquat: Array, t: int
) -> None:
    """Record, of worlds whose encoders are off, where the site really is, and push it there.

    Args:
        worlds: World records, (w,).
        ticks: Tick records, (rows, w): pose and error of tick t are written, in row t modulo rows.
        state: MuJoCo's state rows, (w, nstate); wrenches are written.
        site_xpos: The fields of MjData of the same names, (w, …).
        site_xquat: Orientation of each site.
        t: Number of the tick.
    """
    row = t % ticks.shape[0]
    for w in range(worlds.shape[0]):
        world, out = worlds[w], ticks[row, w]
        if world.is_off and t < world.ticks:
            for i in range(3):
                world.pose[i] = site_xpos[w, world.site, i]
            for i in range(4):
                world.pose[3 + i] = site_xquat[w, world.site, i]
            for i in range(7):
                out.pose[i] = world.pose[i]
            pose_error(out.pose, out.pose_ref, out.pose_error)
            if world.plant != IDEAL:
                push(world, state[w])


@entry
def computed_torque(
    worlds: Record,
    state: Array,
    qfrc_bias: Array,
    qfrc_passive: Array,
    mass: Array,
    mass_entries: NDArray[np.int64],
) -> None:
    """Set tau = M (Δqdot_cmd/period + bandwidth · (qdot_cmd − qdot)) + bias − passive [Luh80].

    The other degrees of freedom of the model are taken to be at rest.

    Args:
        worlds: World records with the wanted acceleration, (w,).
        state: MuJoCo's state rows, (w, nstate); controls are written.
        qfrc_bias: Gravity and velocity forces, (w, nv).
        qfrc_passive: Springs, dampers and gravity compensation, (w, nv).
        mass: Joint-space inertia, the entries of its lower triangle, (w, nM).
        mass_entries: For each entry between two joints of the arm: both joints and its index, (e, 3).
    """
    for w in range(worlds.shape[0]):
        world = worlds[w]
        for j in range(world.n):
            dof = world.dof[j]
            state[w, world.ctrl_column[j]] = qfrc_bias[w, dof] - qfrc_passive[w, dof]
        for e in range(mass_entries.shape[0]):
            i, j, inertia = mass_entries[e, 0], mass_entries[e, 1], mass[w, mass_entries[e, 2]]
            state[w, world.ctrl_column[i]] += inertia * world.qddot[j]
            if i != j:  # only the lower triangle is stored
                state[w, world.ctrl_column[j]] += inertia * world.qddot[i]


class _Left(NamedTuple):
    """What is left of a tick: steps of some worlds, by their numbers, before a tick."""

    ids: NDArray[np.intp]
    steps: int
    tick: int


class PlantBatch:
    """Worlds of one arm under one plant, stepped together on one thread.

    Attributes:
        worlds: Their records, (w,).
        ticks: What was recorded last, (rows, w): tick t is in row t modulo rows.
        done: Ticks finished so far.
    """

    def __init__(
        self,
        arm: Arm,
        model: mujoco.MjModel,
        substeps: int,
        worlds: NDArray[np.void],
        qpos: Array,
        reference: Array,
        ticks: NDArray[np.void],
        changes: Sequence[Change],
        batches: Batches,
    ) -> None:
        """Wire the worlds to MuJoCo and set their start.

        Args:
            arm: The arm.
            model: As `Arm.adapted` compiled it.
            substeps: MuJoCo's steps in a control period.
            worlds: Records with all parameters set, (w,); the wiring is written.
            qpos: Start, (w, nq).
            reference: Pose and twist of each reference at each tick, (r, ticks, 13).
            ticks: Where the tick records go, (rows, w); with fewer rows than ticks, they are used again.
            changes: What each world has different from the model, w of them.
            batches: Where MuJoCo's part comes from.
        """
        self.worlds = worlds
        self.ticks = ticks
        self.done = 0
        self._longest = int(worlds["ticks"].max())
        self._plant = Plant(int(worlds["plant"][0]))
        self._substeps = 1 if self._plant == Plant.IDEAL else substeps
        self._pace, self._left = Pace(len(worlds)), cast(_Left | None, None)
        self._errors: dict[int, str] = {}
        wiring = arm.wire(model)
        self._batches, self._batch = batches, batches.take(model, wiring, changes)
        self._lent = [self._batch]
        self._batch.bind("qpos")[:] = qpos
        self._wire(arm, model, wiring, changes)
        # bound before the first forward, so that it fills them
        fields = ("site_xpos", "site_xquat", "xanchor", "xaxis", "actuator_force")
        read = [self._batch.bind(field) for field in fields]
        self._is_off = bool(worlds["is_off"].any())
        seen = self._wire_encoders(read) if self._is_off else read
        arrays: tuple[Any, ...] = (
            worlds, ticks, reference, self._batch.state, self._batch.warning, *seen
        )  # fmt: skip
        self._tick: Callable[[int], int] = partial(machine_code(tick, *arrays, 0), *arrays)
        self._known: Batch | None = None  # the worlds as computed torque takes them to be, if it is wrong
        if self._plant == Plant.TORQUE:
            if any(change.payload for change in changes):
                self._known = batches.take(
                    model, wiring, [replace(change, payload=0.0) for change in changes]
                )
                self._lent.append(self._known)
            known = self._known or self._batch
            forces = [known.bind(field) for field in ("qfrc_bias", "qfrc_passive", "M")]
            arrays = (worlds, self._batch.state, *forces, _mass_entries(model, wiring))
            self._torque: Callable[[], None] = partial(machine_code(computed_torque, *arrays), *arrays)
        is_ideal = self._plant == Plant.IDEAL
        self._stage = int(mujoco.mjtStage.mjSTAGE_POS if is_ideal else mujoco.mjtStage.mjSTAGE_VEL)
        self._batch.forward(stage=self._stage)

    def _wire(self, arm: Arm, model: mujoco.MjModel, wiring: Wiring, changes: Sequence[Change]) -> None:
        """Write ids and state columns into the records."""
        worlds, n = self.worlds, arm.n
        worlds["joint"][:, :n], worlds["dof"][:, :n] = wiring.joint, wiring.dof
        worlds["actuator"][:, :n] = wiring.actuator
        worlds["travel_column"] = -1
        for address, travel in zip(wiring.travel_qpos, arm.travels, strict=True):
            worlds["travel_column"][:, travel.hinge] = _column(model, "QPOS") + address
            worlds["travel_ratio"][:, travel.hinge] = travel.ratio
        worlds["site"], worlds["body"] = wiring.site, wiring.body
        worlds["qpos_column"][:, :n] = _column(model, "QPOS") + wiring.qpos
        worlds["qvel_column"][:, :n] = _column(model, "QVEL") + wiring.dof
        worlds["ctrl_column"][:, :n] = _column(model, "CTRL") + model.actuator_ctrladr[wiring.actuator]
        carrier = model.body(wiring.body).name
        stretch = np.array([change.stretch.get(carrier, 1.0) for change in changes])
        worlds["lever"] = _lever(model, wiring) * stretch[:, None]
        worlds["wrench_column"] = _column(model, "XFRC_APPLIED") + 6 * wiring.body

    def _wire_encoders(self, read: list[Array]) -> list[Array]:
        """Return what the law sees in place of MuJoCo's fields: copies, in part as the encoders have it."""
        truth, seen = read[:4], [np.empty_like(field) for field in read[:4]]
        arrays: tuple[Any, ...] = (self.worlds, self._batch.state, *seen)
        believe: Callable[[], None] = partial(machine_code(believe_encoders, *arrays), *arrays)
        arrays = (self.worlds, self.ticks, self._batch.state, *truth[:2])
        self._return: Callable[[int], None] = partial(machine_code(return_to_truth, *arrays, 0), *arrays)

        def see() -> None:
            for copy, field in zip(seen, truth, strict=True):
                copy[:] = field
            believe()

        self._see = see
        # MuJoCo's fields may not be written: the tick compiled for them must not be compiled again for these.
        shown = [copy.view() for copy in seen]
        for view in shown:
            view.flags.writeable = False
        return [*shown, *read[4:]]

    def _control(self, t: int) -> int:
        """Control all worlds, some of whose encoders are off, for one tick; return how many still run."""
        self._see()
        running = self._tick(t)
        self._return(t)
        return running

    def advance(self, count: int, is_stopped: Callable[[], bool] = lambda: False) -> int:
        """Run the next `count` ticks at most; return how many worlds still run.

        It returns after a moment, so that one can look whether to stop, and at the last row of `ticks`, so
        that no row is used twice in one call. After an exception, an interrupt among them, `done` says how
        far it came.

        Args:
            count: Number of ticks.
            is_stopped: Asked between two parts of a tick whose steps take longer than a moment; the next call
                does what is left of them.
        """
        if self.done >= self._longest:
            return 0
        if self._left is not None:
            self._step_on(self._left, is_stopped)
            return len(self._running(self.done - 1))
        in_parts = self._substeps > self._pace.steps
        proceed = self._proceed(None, in_parts, is_stopped)
        first, before = self.done % len(self.ticks), self.done
        count = min(count, len(self.ticks) - first, self._longest - before)
        count = min(count, max(1, self._pace.steps // self._substeps))
        self.ticks["time"][first : first + count] = -1.0  # not yet written
        control = self._control if self._is_off else self._tick
        running, expected, t, started = 0, len(self.worlds), before, time.perf_counter()
        try:
            for t in range(before, before + count):  # `finally` reads t
                running = control(t)
                if running != expected:
                    expected, proceed = running, self._proceed(self._running(t), in_parts, is_stopped)
                    if running == 0:
                        break
                try:
                    proceed()
                except SimulationError as error:
                    self._stop(error, t + 1)
                    expected = -1  # so that the next tick looks again
        finally:  # an interrupt may come before the row was written
            self.done = t + bool((self.ticks["time"][t % len(self.ticks)] >= 0.0).any())
        if not in_parts:
            self._pace.took(time.perf_counter() - started, (self.done - before) * self._substeps)
        if expected < 0 or in_parts:
            running = len(self._running(t))
        return running if self.done < self._longest else 0

    def _proceed(
        self, ids: NDArray[np.intp] | None, in_parts: bool, is_stopped: Callable[[], bool]
    ) -> Callable[[], None]:
        """Return what brings some worlds, or all of them, to their next tick."""
        if self._plant == Plant.IDEAL:
            return partial(self._batch.forward, ids, self._stage)
        step = partial(self._batch.step, ids, self._substeps, self._stage)
        if in_parts:
            chosen = np.arange(len(self.worlds)) if ids is None else ids
            step = partial(self._step_on, _Left(chosen, self._substeps, self.done + 1), is_stopped)
        if self._plant == Plant.SERVO:
            return step

        def push_and_step() -> None:
            if self._known is not None:
                self._known.state[:] = self._batch.state
                self._known.forward(ids, self._stage)
            self._torque()
            step()

        return push_and_step

    def _step_on(self, left: "_Left", is_stopped: Callable[[], bool]) -> None:
        """Do what is left of the steps of a tick, in parts, or as much of it until there is a stop.

        The bits are those of all steps at once.
        """
        self._left = left
        while self._left is not None and not is_stopped():
            ids, steps, tick = self._left
            part, started = min(steps, self._pace.steps), time.perf_counter()
            stage = self._stage if part == steps else int(mujoco.mjtStage.mjSTAGE_NONE)
            try:
                self._batch.step(ids, part, stage)
            except SimulationError as error:
                self._stop(error, tick)
                ids = np.setdiff1d(ids, error.ids)
            self._pace.took(time.perf_counter() - started, part)
            self._left = _Left(ids, steps - part, tick) if part < steps and len(ids) else None

    def _running(self, t: int) -> NDArray[np.intp]:
        worlds = self.worlds
        return np.flatnonzero((worlds["diverged"] < 0) & (t + 1 < worlds["ticks"]))

    def _stop(self, error: SimulationError, t: int) -> None:
        for i in error.ids:
            self.worlds["diverged"][i], self.worlds["diverged_joint"][i] = t, -1
            self._errors[int(i)] = self._batch.error(int(i)) or str(error)

    def release(self) -> None:
        """Let others have MuJoCo's part; there is no next tick. Once is enough."""
        self._longest = self.done
        while self._lent:
            self._batches.give_back(self._lent.pop())

    def error(self, world: int) -> str:
        """Return what MuJoCo said when it refused to step a world, or nothing."""
        return " ".join(self._errors.get(world, "").split())


def _column(model: mujoco.MjModel, component: str) -> int:
    """Return where a component begins in a state row: components are stored in the order of their bits."""
    bit = int(getattr(mujoco.mjtState, f"mjSTATE_{component}"))
    return int(mujoco.mj_stateSize(model, int(mujoco.mjtState.mjSTATE_INTEGRATION) & (bit - 1)))


def _lever(model: mujoco.MjModel, wiring: Wiring) -> Array:
    """Return the vector from the body's center of mass to the site, in the site's frame, (3,) [m]."""
    inverse = np.empty(4)
    mujoco.mju_negQuat(inverse, model.site_quat[wiring.site])
    lever = np.empty(3)
    offset = model.site_pos[wiring.site] - model.body_ipos[wiring.body]
    mujoco.mju_rotVecQuat(lever, offset, inverse)
    return lever


def _mass_entries(model: mujoco.MjModel, wiring: Wiring) -> NDArray[np.int64]:
    """Return (joint, joint, index) of each stored entry of M between joints of the arm, (e, 3)."""
    joint = {int(dof): j for j, dof in enumerate(wiring.dof)}
    entries = [
        (joint[row], joint[int(model.M_colind[e])], e)
        for row in joint
        for e in range(model.M_rowadr[row], model.M_rowadr[row] + model.M_rownnz[row])
        if int(model.M_colind[e]) in joint
    ]
    return np.array(entries, np.int64)
