"""The model plant: the actuators in the model, each with the kind of command that it takes."""

import math
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import DriveKind, Wiring
from rmrc.arm.actuators import terms_of
from rmrc.law.compiling import Array, Method, Record, at, carray, compiled, pointer
from rmrc.law.metric import backward, factor, forward
from rmrc.law.svd import dot
from rmrc.plants.engine import ctrl_of
from rmrc.plants.physics import Physical
from rmrc.plants.plant import Assumed
from rmrc.plants.servo import Servo
from rmrc.plants.torque import FREEDOM, choose_acceleration, find_torques, write_dynamics
from rmrc.scenario.choices import Status
from rmrc.support.text import listed

POSITION, INTEGRATED, RATE, MOTOR = map(int, DriveKind)
RATE_LIMITED, POSITION_LIMITED = int(Status.RATE_LIMITED), int(Status.POSITION_LIMITED)

# Smaller shares of an actuator's largest moment are rounding.
_NO_MOMENT = 1e-12

# An actuator in compiled code: its kind, index among actuator outputs, its control, and its activation or -1;
# its control is scale · (length, speed or force) + offset; the ranges of its control and activation.
_DRIVE = np.dtype([
    ("kind", np.int64), ("output", np.int64), ("ctrl", np.int64), ("act", np.int64),
    ("scale", float), ("offset", float), ("stiffness", float), ("lower", float), ("upper", float),
    ("act_lower", float), ("act_upper", float),
])  # fmt: skip


@compiled
def dense(world: Record, output: int, freedoms: Record, row: Array) -> None:
    """Write the moments of an actuator at the arm's joints, (n,)."""
    engine, n = world.engine, world.n
    firsts = carray(pointer(engine.moment_rowadr), (output + 1,), np.int32)
    counts = carray(pointer(engine.moment_rownnz), (output + 1,), np.int32)
    end, largest = firsts[output] + counts[output], 0.0
    moment, dofs = at(engine.actuator_moment, end), carray(pointer(engine.moment_colind), (end,), np.int32)
    for j in range(n):
        row[j] = 0.0
    for e in range(firsts[output], end):
        freedom = freedoms[dofs[e]]
        if freedom.joint >= 0:
            row[freedom.joint] += moment[e] * freedom.ratio
    for j in range(n):
        largest = max(largest, abs(row[j]))
    for j in range(n):
        if abs(row[j]) <= _NO_MOMENT * largest:
            row[j] = 0.0


@compiled
def within(world: Record, drive: Record, control: float, limited: int) -> float:
    """Return a control within its range, and note the status bit if it was outside."""
    if drive.lower <= control <= drive.upper:
        return control
    world.plant.clamped |= limited
    return float(min(max(control, drive.lower), drive.upper))


@Method
def drive_actuators(world: Record) -> None:
    """Set the controls of the model's actuators. The status is of the last controls.

    A position servo gets the integral of the rates, which stops at the end of its range; other servos get the
    rates. The forces of motors give the torques of the torque plant.
    """
    engine, plant, n, count = world.engine, world.plant, world.n, world.engine.drive_count
    choose_acceleration(world)
    world.tick.status |= plant.clamped
    plant.clamped = 0
    drives = carray(pointer(engine.drives), (count,), _DRIVE)
    freedoms = carray(pointer(engine.freedoms), (engine.nv,), FREEDOM)
    R = carray(pointer(engine.room), (count, n + 1), np.float64)
    motors = 0
    for d in range(count):
        if drives[d].kind == MOTOR:
            dense(world, drives[d].output, freedoms, R[motors])
            motors += 1
        else:
            tell_servo(world, drives[d], freedoms, R[motors])
    if motors > 0:
        tell_motors(world, drives, R, motors)


@compiled
def tell_servo(world: Record, drive: Record, freedoms: Record, moments: Array) -> None:
    """Set the control of a servo."""
    engine, plant, ctrl = world.engine, world.plant, ctrl_of(world)
    dense(world, drive.output, freedoms, moments)
    control, limited = drive.scale * dot(moments, plant.qdot_sent, world.n), RATE_LIMITED
    if drive.kind == POSITION:
        control, limited = ctrl[drive.ctrl] + control * world.period, POSITION_LIMITED
    elif drive.kind == RATE:
        control += drive.offset
    else:
        activation = at(engine.act, drive.act + 1)[drive.act]
        is_full = activation >= drive.act_upper and control > 0.0
        if is_full or (activation <= drive.act_lower and control < 0.0):
            plant.clamped |= POSITION_LIMITED
    ctrl[drive.ctrl] = within(world, drive, control, limited)


@compiled
def tell_motors(world: Record, drives: Record, R: Array, motors: int) -> None:
    """Set the controls of motors, whose moments are the rows of R, (motors, n + 1)."""
    n, ctrl, first = world.n, ctrl_of(world), 8 * R.size
    find_torques(world)
    N = carray(pointer(world.engine.room + first), (n, n), np.float64)
    share_out(world.plant.torque, R, motors, n, N)
    chosen = 0
    for d in range(world.engine.drive_count):
        if drives[d].kind == MOTOR:
            control = drives[d].scale * R[chosen, n] + drives[d].offset
            ctrl[drives[d].ctrl] = within(world, drives[d], control, 0)
            chosen += 1


@compiled
def share_out(tau: Array, R: Array, count: int, n: int, N: Array) -> None:
    """Write the smallest forces f that give the joints torques τ: Rᵀ f = τ, so f = R (Rᵀ R)⁻¹ τ.

    Joints without an actuator get none.

    Args:
        tau: Torques, (n,); overwritten.
        R: Moments, and the forces, written, (d, n + 1).
        count: Number of actuators.
        n: Number of joints.
        N: Scratch, (n, n).
    """
    for i in range(n):
        for j in range(i + 1):
            N[i, j] = 0.0
            for d in range(count):
                N[i, j] += R[d, i] * R[d, j]
    factor(N, n)
    forward(N, tau, n)
    backward(N, tau, n)
    for d in range(count):
        R[d, n] = dot(R[d], tau, n)


class Model(Physical):
    """The actuators of the model as they are, with its timestep, gravity compensation and integrator.

    The integrator of an arm with followers is another: see `Arm.adapted`.

    It has the knowledge of the torque plant. Where the arm has more, a second model computes the known
    dynamics for motors from the same states.
    """

    name, drives = "model", ("actuators", "")
    obey, drive = drive_actuators, "own"

    @property
    def usual_timestep(self) -> float:
        """The model's own step [s]."""
        return float(self.arm.model.opt.timestep)

    @property
    def carries_springs(self) -> NDArray[np.bool_]:
        """Joints that no servo moves: the forces of motors include springs, (n,)."""
        kinds, others = self.arm.drives.kinds, self.arm.others
        served = frozenset().union(*(others.pulled[i] for i, kind in kinds.items() if kind != MOTOR))
        return ~np.isin(self.arm.wiring.joint, list(served))

    def assumed_drives(self) -> Iterator[Assumed]:
        """Yield idle actuators."""
        drives = self.arm.drives
        if drives.idle:
            yield Assumed(f"actuators of the arm keep their controls: {drives.named(drives.idle)}", True)

    def wire(self, world: np.void, model: mujoco.MjModel, wiring: Wiring, data: mujoco.MjData) -> list[Any]:
        """Write the tables of actuators and dynamics too, and let the actuators hold the arm at the start."""
        engine, drives, n = world["engine"], self.arm.drives, self.arm.n
        table = _drives(model, drives.kinds)
        room = np.zeros(len(table) * (n + 1) + n * n)
        engine["drives"], engine["room"], engine["drive_count"] = (
            table.ctypes.data, room.ctypes.data, len(table)
        )  # fmt: skip
        freedoms, masses = write_dynamics(engine, model, self.arm, [])
        _settle(model, data, table, freedoms, drives.moments(data))
        return [*super().wire(world, model, wiring, data), table, room, freedoms, masses]

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield joints that no actuator of the model moves, and features that such plants lack."""
        yield from super().misfits()
        arm = self.arm
        if undriven := arm.drives.undriven(arm.data_at(arm.configuration("home"))):
            idle = arm.drives.idle
            others = f"; it cannot command {arm.drives.named(idle)}" if idle else ""
            ways = "add position, velocity or motor actuators, leave them out of arm.joints, or "
            ways = "a URDF cannot have any: " if arm.is_urdf else ways
            yield (
                "plant.kind",
                f'"{self.name}" drives by the actuators of {arm.path}, none of which moves '
                f'{listed(arm.joints[j] for j in undriven)} alone{others}; {ways}take "{Servo.name}"',
            )


def _drives(model: mujoco.MjModel, kinds: dict[int, DriveKind]) -> NDArray[np.void]:
    """Return the actuators of a model for compiled code, (d,)."""
    table = np.zeros(len(kinds), _DRIVE)
    for row, (i, kind) in zip(table, kinds.items(), strict=True):
        terms, count = terms_of(model, i, kind), int(model.actuator_actnum[i])
        row["kind"], row["output"] = kind, model.actuator_outadr[i]
        row["ctrl"] = model.actuator_ctrladr[i]
        row["act"] = model.actuator_actadr[i] + count - 1 if count else -1
        row["scale"], row["offset"], row["stiffness"] = terms.scale, terms.offset, terms.stiffness
        (row["lower"], row["upper"]), (row["act_lower"], row["act_upper"]) = terms.control, terms.state
    return table


def _settle(
    model: mujoco.MjModel, data: mujoco.MjData, drives: NDArray[np.void], freedoms: NDArray[np.void], R: Array
) -> None:
    """Replace controls and activations that are NaN by values that hold the arm, within their ranges.

    The forces are the smallest that balance the load of the joints at rest. A rate servo gives no force at
    rest. The history of delayed actuators begins with their controls.
    """
    of_arm, tau = freedoms["joint"] >= 0, np.zeros(R.shape[1])
    load = data.qfrc_bias - data.qfrc_passive - np.where(freedoms["is_balanced"], data.qfrc_gravcomp, 0.0)
    np.add.at(tau, freedoms["joint"][of_arm], (freedoms["ratio"] * load)[of_arm])
    R[np.abs(R) <= _NO_MOMENT * np.abs(R).max(axis=1, initial=0.0, keepdims=True)] = 0.0
    R[drives["kind"] == RATE] = 0.0
    R = np.column_stack([R, np.zeros(len(R))])
    share_out(tau, R, len(drives), len(tau), np.zeros((len(tau), len(tau))))
    for drive, pull in zip(drives, R[:, -1], strict=True):
        kind, length = drive["kind"], data.actuator_length[drive["output"]]
        control = drive["offset"]
        if kind == MOTOR:
            control += drive["scale"] * pull
        elif kind != RATE:
            control += drive["scale"] * (length + pull / drive["stiffness"])
        place = drive["act"]
        if place >= 0 and math.isnan(data.act[place]):
            activation = control if kind == INTEGRATED else np.clip(control, drive["lower"], drive["upper"])
            data.act[place] = np.clip(activation, drive["act_lower"], drive["act_upper"])
        if math.isnan(data.ctrl[drive["ctrl"]]):
            control = 0.0 if kind == INTEGRATED else control
            data.ctrl[drive["ctrl"]] = np.clip(control, drive["lower"], drive["upper"])
    for i in range(model.nactuator):
        if model.actuator_history[i, 0] > 0:
            value, count = data.ctrl[model.actuator_ctrladr[i]], int(model.actuator_history[i, 0])
            mujoco.mj_initCtrlHistory(model, data, i, None, np.full((count, 1), value))
