"""The model plant: the actuators in the model, each with the kind of command that it takes."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Self

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from rmrc.arm import DriveKind, Own
from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.law.metric import backward, forward
from rmrc.law.record import Field
from rmrc.plants.physics import Physical
from rmrc.plants.plant import Assumed, BeforeSteps, Wired
from rmrc.plants.servo import Servo
from rmrc.plants.torque import Torque, choose_acceleration
from rmrc.plants.wiring import column
from rmrc.scenario.choices import Status
from rmrc.support.legible import listed

POSITION, INTEGRATED, RATE, MOTOR = map(int, DriveKind)
RATE_LIMITED, POSITION_LIMITED = int(Status.RATE_LIMITED), int(Status.POSITION_LIMITED)

# Smaller shares of an actuator's largest moment, or of a joint's squared pivot, are rounding.
_NO_MOMENT, _SINGULAR = 1e-12, 1e-18
# Decimal fractions such as 0.003/0.001 are off by some 1e-16.
_ROUNDING = 1e-9

# An actuator in compiled code: its kind, index among actuator outputs, columns of the state row or -1;
# its control is scale · (length, speed or force) + offset; the ranges of its control and activation.
_DRIVE = np.dtype([
    ("kind", np.int64), ("output", np.int64), ("ctrl", np.int64), ("act", np.int64),
    ("scale", float), ("offset", float), ("stiffness", float), ("lower", float), ("upper", float),
    ("act_lower", float), ("act_upper", float),
])  # fmt: skip
# A degree of freedom: its joint of the arm or -1, its speed at unit rate of that joint, and whether the
# actuators compensate its gravity.
_FREEDOM = np.dtype([("joint", np.int64), ("ratio", float), ("is_balanced", np.int64)])


@compiled
def read_joints(world: Record, out: Record, state: Array, force: Array) -> None:
    """Read q, qdot, and tau of the last step: the forces of all actuators at the joints."""
    for j in range(world.n):
        out.q[j] = state[world.qpos_column[j]]
        out.qdot[j] = state[world.qvel_column[j]]
        out.tau[j] = force[world.dof[j]]
    for f in range(world.followers):
        out.tau[world.follows[f]] += world.follower_ratio[f] * force[world.follower_dof[f]]


@compiled
def ask(world: Record, out: Record, state: Array) -> None:
    """Remember the command of the joints; `tell_drives` does the rest. The status is of the last controls."""
    choose_acceleration(world, out, state)
    out.status |= world.clamped


@compiled
def speed_of(world: Record, first: int, count: int, freedoms: Record, dofs: Array, moment: Array) -> float:
    """Return the speed of an actuator at the rates that were sent."""
    speed = 0.0
    for e in range(first, first + count):
        freedom = freedoms[dofs[e]]
        if freedom.joint >= 0:
            speed += moment[e] * freedom.ratio * world.qdot_sent[freedom.joint]
    return float(speed)


@compiled
def within(world: Record, drive: Record, control: float, limited: int) -> float:
    """Return a control within its range, and note the status bit if it was outside."""
    if drive.lower <= control <= drive.upper:
        return control
    world.clamped |= limited
    return float(min(max(control, drive.lower), drive.upper))


@entry
def tell_drives(
    worlds: Record,
    state: Array,
    drives: Record,
    freedoms: Record,
    moment: Array,
    first: NDArray[np.int32],
    count: NDArray[np.int32],
    dofs: NDArray[np.int32],
) -> None:
    """Set the controls of servos.

    A position servo gets the integral of the rates, which stops at the end of its range. The others get the
    rates.

    Args:
        worlds: World records with the rates that were sent, (w,).
        state: MuJoCo's state rows, (w, nstate); controls are written.
        drives: Actuators of the model, (d,).
        freedoms: Its degrees of freedom, (nv,).
        moment: Moments of actuators, the entries of their sparse rows, (w, e).
        first: First entry of each, (w, outputs).
        count: Number of entries of each, (w, outputs).
        dofs: The degree of freedom of each entry, (w, e).
    """
    for w in range(worlds.shape[0]):
        world = worlds[w]
        world.clamped = 0
        for d in range(drives.shape[0]):
            drive = drives[d]
            if drive.kind == MOTOR:
                continue
            k = drive.output
            speed = speed_of(world, first[w, k], count[w, k], freedoms, dofs[w], moment[w])
            control, limited = drive.scale * speed, RATE_LIMITED
            if drive.kind == POSITION:
                control = state[w, drive.ctrl] + control * world.period
                limited = POSITION_LIMITED
            elif drive.kind == RATE:
                control += drive.offset
            elif (state[w, drive.act] >= drive.act_upper and control > 0.0) or (
                state[w, drive.act] <= drive.act_lower and control < 0.0
            ):
                world.clamped |= POSITION_LIMITED
            state[w, drive.ctrl] = within(world, drive, control, limited)


@compiled
def factorize(R: Array, count: int, n: int, N: Array) -> None:
    """Write the Cholesky factor of Rᵀ R; its diagonal is infinite where no actuator moves a joint alone."""
    for i in range(n):
        for j in range(i + 1):
            N[i, j] = 0.0
            for d in range(count):
                N[i, j] += R[d, i] * R[d, j]
        size = N[i, i]
        for j in range(i + 1):
            for k in range(j):
                N[i, j] -= N[i, k] * N[j, k]
            if j < i:
                N[i, j] = N[i, j] / N[j, j]
        N[i, i] = math.sqrt(N[i, i]) if N[i, i] > _SINGULAR * size else math.inf


@compiled
def share_out(tau: Array, R: Array, count: int, n: int, N: Array, force: Array) -> None:
    """Write the smallest forces f that give the joints torques τ: Rᵀ f = τ, so f = R (Rᵀ R)⁻¹ τ.

    Joints without an actuator get none.

    Args:
        tau: Torques, (n,); overwritten.
        R: Moments, (d, n).
        count: Number of actuators.
        n: Number of joints.
        N: Scratch, (n, n).
        force: Forces, (d,), written.
    """
    factorize(R, count, n, N)
    forward(N, tau, n)
    backward(N, tau, n)
    for d in range(count):
        force[d] = 0.0
        for j in range(n):
            force[d] += R[d, j] * tau[j]


@entry
def tell_motors(
    worlds: Record,
    state: Array,
    drives: Record,
    freedoms: Record,
    moment: Array,
    first: NDArray[np.int32],
    count: NDArray[np.int32],
    dofs: NDArray[np.int32],
    qfrc_bias: Array,
    qfrc_passive: Array,
    qfrc_gravcomp: Array,
    mass: Array,
    mass_entries: NDArray[np.int64],
    R: Array,
    N: Array,
) -> None:
    """Set the controls of motors: their forces give tau = M qddot + bias − passive [Luh80].

    Gravity compensation by the actuators is subtracted. Joints that are not the arm's are assumed at rest.

    Args:
        worlds: World records with the wanted acceleration, (w,).
        state: This and the arguments up to `dofs` are as in `tell_drives`.
        drives: Actuators of the model, (d,).
        freedoms: Its degrees of freedom, (nv,).
        moment: Moments of actuators.
        first: First entry of each.
        count: Number of entries of each.
        dofs: The degree of freedom of each entry.
        qfrc_bias: Gravity and velocity forces, (w, nv).
        qfrc_passive: Springs, dampers and gravity compensation that the actuators do not provide, (w, nv).
        qfrc_gravcomp: Gravity compensation, (w, nv).
        mass: Joint-space inertia, the entries of its lower triangle, (w, nM).
        mass_entries: Row, column and index of each entry that is used, (e, 3).
        R: Scratch for moments, (d, n).
        N: Scratch for their products, (n, n).
    """
    tau, force = np.zeros(N.shape[0]), np.zeros(R.shape[0])
    for w in range(worlds.shape[0]):
        world = worlds[w]
        loads(world, freedoms, qfrc_bias[w], qfrc_passive[w], qfrc_gravcomp[w], tau)
        for e in range(mass_entries.shape[0]):
            row, other = freedoms[mass_entries[e, 0]], freedoms[mass_entries[e, 1]]
            inertia = row.ratio * other.ratio * mass[w, mass_entries[e, 2]]
            tau[row.joint] += inertia * world.qddot[other.joint]
            if mass_entries[e, 0] != mass_entries[e, 1]:  # only the lower triangle is stored
                tau[other.joint] += inertia * world.qddot[row.joint]
        chosen = 0
        for d in range(drives.shape[0]):
            if drives[d].kind == MOTOR:
                k = drives[d].output
                dense(world.n, first[w, k], count[w, k], freedoms, dofs[w], moment[w], R[chosen])
                chosen += 1
        share_out(tau, R, chosen, world.n, N, force)
        chosen = 0
        for d in range(drives.shape[0]):
            if drives[d].kind == MOTOR:
                control = drives[d].scale * force[chosen] + drives[d].offset
                state[w, drives[d].ctrl] = within(world, drives[d], control, 0)
                chosen += 1


@compiled
def loads(world: Record, freedoms: Record, bias: Array, passive: Array, gravcomp: Array, tau: Array) -> None:
    """Write the load of the actuators at the arm's joints without inertia: bias − passive."""
    for j in range(world.n):
        tau[j] = 0.0
    for dof in range(freedoms.shape[0]):
        freedom = freedoms[dof]
        if freedom.joint >= 0:
            load = bias[dof] - passive[dof] - (gravcomp[dof] if freedom.is_balanced else 0.0)
            tau[freedom.joint] += freedom.ratio * load


@compiled
def dense(n: int, first: int, count: int, freedoms: Record, dofs: Array, moment: Array, row: Array) -> None:
    """Write the moments of an actuator at the arm's joints, (n,)."""
    for j in range(n):
        row[j] = 0.0
    for e in range(first, first + count):
        freedom = freedoms[dofs[e]]
        if freedom.joint >= 0:
            row[freedom.joint] += moment[e] * freedom.ratio
    largest = 0.0
    for j in range(n):
        largest = max(largest, abs(row[j]))
    for j in range(n):
        if abs(row[j]) <= _NO_MOMENT * largest:
            row[j] = 0.0


@entry
def settle(
    worlds: Record,
    state: Array,
    drives: Record,
    freedoms: Record,
    moment: Array,
    first: NDArray[np.int32],
    count: NDArray[np.int32],
    dofs: NDArray[np.int32],
    length: Array,
    qfrc_bias: Array,
    qfrc_passive: Array,
    qfrc_gravcomp: Array,
    R: Array,
    N: Array,
) -> None:
    """Replace controls and activations that are NaN by values that hold the arm, within their ranges.

    The forces are the smallest that balance the load of the joints at rest. A rate servo gives no force at
    rest.

    Args:
        worlds: World records, (w,).
        state: This and the others are as in `tell_motors`.
        drives: Actuators of the model, (d,).
        freedoms: Its degrees of freedom, (nv,).
        moment: Moments of actuators.
        first: First entry of each.
        count: Number of entries of each.
        dofs: The degree of freedom of each entry.
        length: Lengths of actuators, (w, outputs).
        qfrc_bias: Gravity and velocity forces.
        qfrc_passive: Springs, dampers and gravity compensation that the actuators do not provide.
        qfrc_gravcomp: Gravity compensation.
        R: Scratch for moments, (d, n).
        N: Scratch for their products, (n, n).
    """
    tau, force = np.zeros(N.shape[0]), np.zeros(R.shape[0])
    for w in range(worlds.shape[0]):
        world = worlds[w]
        loads(world, freedoms, qfrc_bias[w], qfrc_passive[w], qfrc_gravcomp[w], tau)
        for d in range(drives.shape[0]):
            k = drives[d].output
            dense(world.n, first[w, k], count[w, k], freedoms, dofs[w], moment[w], R[d])
            if drives[d].kind == RATE:
                R[d] = 0.0
        share_out(tau, R, drives.shape[0], world.n, N, force)
        for d in range(drives.shape[0]):
            settle_drive(drives[d], state[w], length[w, drives[d].output], force[d])


@compiled
def settle_drive(drive: Record, state: Array, length: float, force: float) -> None:
    """Set NaN in the control and activation of an actuator to values at which it gives a force at rest."""
    control = drive.offset
    if drive.kind == MOTOR:
        control += drive.scale * force
    elif drive.kind != RATE:
        control += drive.scale * (length + force / drive.stiffness)
    if drive.act >= 0 and math.isnan(state[drive.act]):
        if drive.kind != INTEGRATED:
            control = min(max(control, drive.lower), drive.upper)
        state[drive.act] = min(max(control, drive.act_lower), drive.act_upper)
    if math.isnan(state[drive.ctrl]):
        if drive.kind == INTEGRATED:
            control = 0.0
        state[drive.ctrl] = min(max(control, drive.lower), drive.upper)


class Model(Physical):
    """The actuators of the model as they are, with its integrator, timestep and gravity compensation.

    It has the knowledge of the torque plant. Where the arm has more, a second MuJoCo batch computes the known
    dynamics for motors from the same states.
    """

    name, drives = "model", ("actuators", "")
    sense, obey = staticmethod(read_joints), staticmethod(ask)
    forces = "qfrc_actuator"
    fields = (*Physical.fields, Field("bandwidth"))
    memory = (*Torque.memory, Field("clamped", np.int64))
    batches, works_between = 2, True

    @property
    def timestep(self) -> float:
        """MuJoCo's step [s]: the model's own, or the longest below it that divides the control period."""
        if self.section.timestep is not None:
            return float(self.section.timestep)
        own = float(self.arm.model.opt.timestep)
        steps = max(1, math.ceil(self.period / own * (1.0 - _ROUNDING)))
        return own if abs(self.period - steps * own) <= _ROUNDING * self.period else self.period / steps

    @property
    def gravity_apart(self) -> Array:
        """0 for joints whose gravity the actuators compensate: their forces include it."""
        return np.where(self.arm.model.jnt_actgravcomp[self.arm.wiring.joint], 0.0, 1.0)

    @classmethod
    def drive(cls, plants: Sequence[Self]) -> Own:
        """Return the marker for the model's own actuators."""
        del plants
        return "own"

    def write(self, world: np.void) -> None:
        """Write the bandwidth of motors as well."""
        super().write(world)
        world["bandwidth"] = self.section.bandwidth

    def assumed(self) -> Iterator[Assumed]:
        """Yield a timestep and gravity compensation that differ from the model's, and idle actuators."""
        own, drives = float(self.arm.model.opt.timestep), self.arm.drives
        if self.timestep != own:
            why = "" if self.section.timestep else f", to divide the control period of {self.period:g} s"
            yield Assumed(f"timestep {self.timestep:g} s instead of the model's {own:g} s{why}", True)
        if self.section.is_compensated and not self.arm.is_balanced:
            yield Assumed("gravity compensation of the arm, which the model does not have", False)
        if drives.idle:
            yield Assumed(f"actuators of the arm keep their controls: {drives.named(drives.idle)}", True)

    @classmethod
    def before_steps(cls, plants: Sequence[Self], wired: Wired) -> BeforeSteps:
        """Return a function that sets the controls of worlds; its first call settles the actuators."""
        model, batch, drives = wired.model, wired.batch, plants[0].arm.drives
        table, freedoms = _drives(model, drives.kinds), _freedoms(model, *drives.joint_of)
        room = np.zeros((len(table), plants[0].arm.n)), np.zeros((plants[0].arm.n,) * 2)
        names = ("actuator_moment", "moment_rowadr", "moment_rownnz", "moment_colind")
        pulls = (wired.worlds, batch.state, table, freedoms, *(batch.bind(name) for name in names))
        dynamics = ("qfrc_bias", "qfrc_passive", "qfrc_gravcomp")
        hold = (*pulls, batch.bind("actuator_length"), *(batch.bind(name) for name in dynamics), *room)
        tell = partial(machine_code(tell_drives, *pulls), *pulls)
        first = [partial(machine_code(settle, *hold), *hold), partial(_fill_history, model, batch)]
        motors, known = None, batch
        if MOTOR in table["kind"]:
            if any(plant.has_secrets for plant in plants):
                known = wired.take([plant.known(model, wired.wiring) for plant in plants])
            entries = _mass_entries(model, freedoms)
            about = (*pulls, *(known.bind(name) for name in (*dynamics, "M")), entries, *room)
            motors = partial(machine_code(tell_motors, *about), *about)

        def before(ids: NDArray[np.intp] | None) -> None:
            while first:
                first.pop(0)()
            tell()
            if motors is not None:
                if known is not batch:
                    known.state[:] = batch.state
                    known.forward(ids, int(cls.stage))
                motors()

        return before

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield joints that no actuator of the model moves, and features that such plants lack."""
        yield from super().misfits()
        arm = self.arm
        if undriven := arm.drives.undriven(arm.configuration("home")):
            idle = arm.drives.idle
            others = f"; it cannot command {arm.drives.named(idle)}" if idle else ""
            yield (
                "plant.kind",
                f'"{self.name}" drives by the actuators of {arm.path}, none of which moves '
                f"{listed(arm.joints[j] for j in undriven)} alone{others}; add position, velocity or motor "
                f'actuators, leave them out of arm.joints, or take "{Servo.name}"',
            )


def _drives(model: mujoco.MjModel, kinds: dict[int, DriveKind]) -> NDArray[np.void]:
    """Return the actuators of a model for compiled code, (d,)."""
    table = np.zeros(len(kinds), _DRIVE)
    for row, (i, kind) in zip(table, kinds.items(), strict=True):
        gain, (b0, b1, b2) = model.actuator_gainprm[i, 0], model.actuator_biasprm[i, :3]
        if model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE:
            b0 = b1 = b2 = 0.0
        scale = 1.0 if kind == MOTOR else -b2 if kind == RATE else -b1
        count = int(model.actuator_actnum[i])
        row["kind"], row["output"] = kind, model.actuator_outadr[i]
        row["ctrl"] = column(model, "CTRL") + model.actuator_ctrladr[i]
        row["act"] = column(model, "ACT") + model.actuator_actadr[i] + count - 1 if count else -1
        row["scale"], row["offset"], row["stiffness"] = scale / gain, -b0 / gain, -b1
        ranges = (
            (model.actuator_ctrllimited[i] and not _is_disabled(model), model.actuator_ctrlrange[i]),
            (model.actuator_actlimited[i], model.actuator_actrange[i]),
        )
        ends = [tuple(ends) if is_limited else (-math.inf, math.inf) for is_limited, ends in ranges]
        (row["lower"], row["upper"]), (row["act_lower"], row["act_upper"]) = ends
    return table


def _is_disabled(model: mujoco.MjModel) -> bool:
    """Return whether an option of the model keeps MuJoCo from clamping controls."""
    return bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)


def _freedoms(model: mujoco.MjModel, joint: NDArray[np.int64], ratio: Array) -> NDArray[np.void]:
    """Return the degrees of freedom of a model for compiled code, (nv,)."""
    table = np.zeros(model.nv, _FREEDOM)
    table["joint"], table["ratio"] = -1, 0.0
    table["joint"][: len(joint)], table["ratio"][: len(ratio)] = joint, ratio
    table["is_balanced"] = model.jnt_actgravcomp[model.dof_jntid]
    return table


def _mass_entries(model: mujoco.MjModel, freedoms: NDArray[np.void]) -> NDArray[np.int64]:
    """Return (row, column, index) of each stored entry of M between degrees of freedom of the arm, (e, 3)."""
    own = set(np.flatnonzero(freedoms["joint"] >= 0).tolist())
    entries = [
        (row, int(model.M_colind[e]), e)
        for row in own
        for e in range(model.M_rowadr[row], model.M_rowadr[row] + model.M_rownnz[row])
        if int(model.M_colind[e]) in own
    ]
    return np.array(entries, np.int64)


def _fill_history(model: mujoco.MjModel, batch: Batch) -> None:
    """Fill the history of delayed actuators with their first controls."""
    delayed = [i for i in range(model.nactuator) if model.actuator_history[i, 0] > 0]
    if not delayed:
        return
    data, history, ctrl = mujoco.MjData(model), batch.bind("history"), batch.bind("ctrl")
    for w in range(len(history)):
        for i in delayed:
            value = ctrl[w, model.actuator_ctrladr[i]]
            count = int(model.actuator_history[i, 0])
            mujoco.mj_initCtrlHistory(model, data, i, None, np.full((count, 1), value))
        history[w] = data.history
