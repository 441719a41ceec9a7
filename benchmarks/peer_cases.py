"""The arms, paths and measures of benchmarks/peers.py: what is the same for everyone.

An arm is our model without fingers, its base at the origin, without weight and friction, and with a rate
servo on each joint. A path is one screw, there and back, with a rest at both ends. Everyone is told the same
pose and twist at each tick, and is judged by where the tool is.
"""

import functools
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

ROOT = Path(__file__).parent.parent
PERIOD = 0.002  # s, as in the examples of mink
REST = 0.4  # s, after each leg
# rad/s² or m/s²: smaller accelerations whose sign changes are no chatter.
CHATTER_FLOOR = 1.0
# rad: the turn that is asked for at a joint limit, and how much of it is beyond the limit.
ASKED, BEYOND = 0.7, 0.083


class Pose(NamedTuple):
    """A pose in the forms that libraries want."""

    p: np.ndarray
    quat: np.ndarray
    T: np.ndarray
    vector: np.ndarray


@dataclass(frozen=True)
class Arm:
    """An arm that all libraries can load.

    Attributes:
        path: Its MJCF file, without drives.
        model: The same with rate servos.
        site: The tool.
        rate: Rate limits [rad/s or m/s].
        joints: Names of the joints, in the order of q.
    """

    path: str
    model: mujoco.MjModel
    site: str
    rate: np.ndarray
    joints: tuple[str, ...]

    def at(self, q: np.ndarray) -> mujoco.MjData:
        """Return fresh kinematics at q."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = q
        mujoco.mj_forward(self.model, data)
        return data

    def solve(self, q: np.ndarray, p: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Return joint positions near q for a pose, by Newton's method."""
        for _ in range(100):
            data = self.at(q)
            error = pose_error(p, R, data.site(self.site).xpos, data.site(self.site).xmat.reshape(3, 3))
            q = q + 0.5 * np.linalg.pinv(jacobian(self, data)) @ error
        if np.abs(error).max() > 1e-9:
            raise ValueError(f"no posture near {q} has its tool at {p}")
        return q


@functools.cache
def arm(name: str, rate: tuple[float, ...], site: str = "tool") -> Arm:
    """Return one of our models for this purpose."""
    spec = mujoco.MjSpec.from_file(str(ROOT / f"models/{name}.xml"))
    surplus = (spec.actuators, spec.keys, spec.equalities, spec.tendons, spec.geoms, spec.lights)
    for one in [one for group in surplus for one in group] + [*spec.materials, *spec.textures]:
        spec.delete(one)
    for joint in list(spec.joints):
        if "finger" in joint.name:
            spec.delete(joint)
        joint.frictionloss, joint.damping = 0.0, np.zeros(3)
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    spec.worldbody.first_body().pos = np.zeros(3)
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    spec.option.timestep = PERIOD
    spec.compile()
    file = Path(tempfile.mkdtemp()) / f"{name}.xml"
    # Six digits are written, by which a moment of inertia may be larger than the sum of the others.
    file.write_text(spec.to_xml().replace("<compiler ", '<compiler balanceinertia="true" ', 1))
    spec = mujoco.MjSpec.from_file(str(file))
    bare = spec.compile()
    for joint, gain in zip(spec.joints, 2 * bare.dof_M0 / PERIOD, strict=True):
        servo = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
        servo.set_to_velocity(kv=gain)
    names = tuple(joint.name for joint in spec.joints)
    return Arm(str(file), spec.compile(), site, np.array(rate), names)


def jacobian(one: Arm, data: mujoco.MjData) -> np.ndarray:
    """Return J of the tool, (6, n), rows [v; ω], along world axes."""
    J = np.zeros((6, one.model.nv))
    mujoco.mj_jacSite(one.model, data, J[:3], J[3:], one.model.site(one.site).id)
    return J


def rotation(vector: np.ndarray) -> np.ndarray:
    """Return the matrix of a rotation vector."""
    angle = np.linalg.norm(vector)
    quat, matrix = np.zeros(4), np.zeros(9)
    mujoco.mju_axisAngle2Quat(quat, vector / (angle or 1.0), angle)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def pose_error(p: np.ndarray, R: np.ndarray, p_now: np.ndarray, R_now: np.ndarray) -> np.ndarray:
    """Return [Δp; rotation vector] from now to where it is wanted, along world axes."""
    quat, vector = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quat, (R @ R_now.T).ravel())
    mujoco.mju_quat2Vel(vector, quat, 1.0)
    return np.concatenate([p - p_now, vector])


@dataclass(frozen=True)
class Case:
    """A path of one arm, which takes its tool along a screw and back.

    Attributes:
        name: What it is about.
        what: What happens, in a sentence.
        arm: Which arm.
        start: Joint positions at the start.
        screw: [v at the origin; ω], by its norm: all of the way.
        duration: Of the way there [s].
    """

    name: str
    what: str
    arm: Arm
    start: np.ndarray
    screw: np.ndarray
    duration: float

    @property
    def ticks(self) -> int:
        """Number of control ticks."""
        return len(self.twists)

    @functools.cached_property
    def shares(self) -> np.ndarray:
        """Share of the screw at each tick, and at the end of the last, (T + 1,)."""
        leg, rest = round(self.duration / PERIOD), round(REST / PERIOD)
        x = np.arange(leg + 1) / leg
        out = x**3 * (10 - 15 * x + 6 * x**2)
        return np.concatenate([out[:-1], np.ones(rest), 1 - out, np.zeros(rest)])

    @functools.cached_property
    def poses(self) -> tuple[Pose, ...]:
        """Where the tool is wanted at each tick, and at the end of the last."""
        data, site = self.arm.at(self.start), self.arm.site
        p0, R0 = data.site(site).xpos.copy(), data.site(site).xmat.reshape(3, 3).copy()
        v, w = self.screw[:3], self.screw[3:]
        # A screw is a turn about a line, or a translation: no case here is both.
        center, way = (np.cross(w, v) / (w @ w), np.zeros(3)) if w.any() else (np.zeros(3), v)
        poses = []
        for part in self.shares:
            R = rotation(part * w)
            p = center + R @ (p0 - center) + part * way
            T, quat = np.eye(4), np.zeros(4)
            T[:3, :3], T[:3, 3] = R @ R0, p
            mujoco.mju_mat2Quat(quat, T[:3, :3].ravel())
            poses.append(Pose(p, quat, T, np.concatenate([p, quat])))
        return tuple(poses)

    @functools.cached_property
    def twists(self) -> np.ndarray:
        """At which velocity in the mean until the next tick, (T, 6) [m/s, rad/s]."""
        v, w = self.screw[:3], self.screw[3:]
        here = [pose.p for pose in self.poses[:-1]]
        velocities = np.hstack([v + np.cross(w, here), np.tile(w, (len(here), 1))])
        return np.diff(self.shares)[:, None] / PERIOD * velocities


def turning(point: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the screw of a turn about a line."""
    return angle * np.concatenate([np.cross(point, axis), axis])


def reach(
    name: str, what: str, one: Arm, stretched: np.ndarray, bend: np.ndarray, wrist: int, beyond: float
) -> Case:
    """Return the path straight out from the shoulder, from 0.25 m before full reach to so much beyond it."""
    data = one.at(stretched)
    axis, out = data.xaxis[1], data.xanchor[wrist] - data.xanchor[1]
    out = out - axis * (axis @ out)
    out /= np.linalg.norm(out)
    p, R = data.site(one.site).xpos, data.site(one.site).xmat.reshape(3, 3)
    start = one.solve(stretched + bend, p - 0.25 * out, R)
    return Case(name, what, one, start, line((0.25 + beyond) * out), 2.0)


def crossing(name: str, what: str, one: Arm, q: np.ndarray, joint: int, offset: float) -> Case:
    """Return the path that turns the hand about a joint's axis of the start, past where others align."""
    data = one.at(q)
    axis, after = data.xaxis[joint].copy(), data.xaxis[joint + 1].copy()
    tilt, point = rotation(offset * np.cross(axis, after)), data.xanchor[joint].copy()
    p, R = data.site(one.site).xpos, data.site(one.site).xmat.reshape(3, 3)
    start = one.solve(q, point + tilt @ (p - point), tilt @ R)
    return Case(name, what, one, start, turning(point, axis, -2 * q[joint]), 2.0)


def at_limit(name: str, one: Arm, q: np.ndarray, joint: int) -> Case:
    """Return the path that turns the hand about a joint's axis, the last of it beyond the joint's limit."""
    q = q.copy()
    q[joint] = one.model.jnt_range[joint, 1] - (ASKED - BEYOND)
    data = one.at(q)
    what = f"A turn of 40° about axis {joint + 1}, the last 83 mrad of it beyond the limit."
    return Case(name, what, one, q, turning(data.xanchor[joint], data.xaxis[joint], ASKED), 2.0)


def boom(name: str, what: str, one: Arm, beyond: float) -> Case:
    """Return the path along the Stanford arm's boom, from 0.17 m before its stop to so much beyond it."""
    q = np.array([0, 1.2, 1.1, 0, 1.2, 0])
    way = one.model.jnt_range[2, 1] - q[2] + beyond
    return Case(name, what, one, q, line(way * one.at(q).xaxis[2]), 2.0)


RATES = {
    "UR5e": (3.1416,) * 6,
    "FR3": (2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26),
    "PUMA 560": (1.5, 1.5, 1.5, 4, 4, 4),
    "Stanford arm": (1.5, 1.5, 0.75, 4, 4, 4),
}
FILES = {"UR5e": "ur5e", "FR3": "fr3", "PUMA 560": "puma560", "Stanford arm": "stanford"}
HOMES = {
    "UR5e": np.radians([0, -60, 120, -150, -90, 0]),
    "FR3": np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785]),
    "PUMA 560": np.radians([-30, -45, 180, 0, 45, 0]),
    "Stanford arm": np.array([0, 1.2, 0.8, 0, 1.0, 0]),
}
# Stretched; how the joints bend; which joint carries the wrist. The FR3's elbow is set off by 82.5 mm.
REACHES = {
    "UR5e": (np.radians([0, -30, 0, -60, -90, 0]), np.radians([0, -40, 80, -40, 0, 0]), 3),
    "FR3": (np.radians([0, 60, 0, -26.76, 0, 120, 45]), np.radians([0, -30, 0, -60, 0, -30, 0]), 5),
    "PUMA 560": (np.radians([0, -30, 92.7, 0, 60, 0]), np.radians([0, -35, 70, 0, -35, 0]), 3),
}
# What is passed, by which joint. The fifth turns the hand past where axes 4 and 6 align. The FR3's wrist has
# no such place; with its third joint at 90° it is singular where its second aligns axes 1 and 3.
CROSSINGS = {
    "UR5e": ("wrist", np.radians([0, -90, 90, 0, 40, 0]), 4),
    "FR3": ("shoulder", np.radians([0, 20, 90, -90, 0, 120, 0]), 1),
    "PUMA 560": ("wrist", np.radians([0, -60, 140, 0, 40, 0]), 4),
    "Stanford arm": ("wrist", np.array([0, 1.2, 0.7, 0, 0.698, 0]), 4),
}
# Joints that are led to their limits; those of the UR5e's fifth, twice around, are singular.
HANDS = {"UR5e": 5, "FR3": 5, "PUMA 560": 4, "Stanford arm": 4}


@functools.cache
def cases() -> tuple[Case, ...]:
    """Return all cases."""
    arms = {name: arm(FILES[name], rate) for name, rate in RATES.items()}
    far = "0.2 m sideways, far from any singularity."
    found = [
        Case(f"far, {name}", far, one, HOMES[name], line([0, 0.2, 0.05]), 2.0) for name, one in arms.items()
    ]
    for title, where, beyond in (("-5 mm", "5 mm before", -0.005), ("+1 mm", "1 mm beyond", 0.001)):
        what = f"Straight out to {where} full reach, and back."
        for name, posture in REACHES.items():
            found.append(reach(f"reach {title}, {name}", what, arms[name], *posture, beyond))
        # At its full reach the boom is at its stop, and the arm is not singular.
        what += " The boom has its stop there; the arm is not singular."
        found.append(boom(f"reach {title}, Stanford arm", what, arms["Stanford arm"], beyond))
    for angle in ("1°", "0.1°"):
        for name, (place, q, joint) in CROSSINGS.items():
            turn = f"A turn of {np.degrees(2 * q[joint]):.0f}° about axis {joint + 1}, there and back"
            what = f"{turn}, that passes the singularity of the {place} at {angle}."
            offset = np.radians(float(angle[:-1]))
            found.append(crossing(f"{place} {angle}, {name}", what, arms[name], q, joint, offset))
    found += [at_limit(f"joint limit, {name}", one, HOMES[name], HANDS[name]) for name, one in arms.items()]
    what = "Along the boom, the last 15 mm of it beyond the limit."
    return (*found, boom("boom limit, Stanford arm", what, arms["Stanford arm"], 0.015))


def line(v: ArrayLike) -> np.ndarray:
    """Return the screw of a translation."""
    return np.concatenate([np.asarray(v, float), np.zeros(3)])


@dataclass(frozen=True)
class Track:
    """What came of a run, a row a tick."""

    q: np.ndarray
    qdot: np.ndarray
    command: np.ndarray
    error: np.ndarray


def drive(one: Case, step: Callable[..., np.ndarray]) -> Track:
    """Return what a loop does with an arm: its commands go to the servos, physics follow."""
    model, ticks, n = one.arm.model, one.ticks, len(one.start)
    data, site = one.arm.at(one.start), model.site(one.arm.site).id
    q, qdot, command, error = (np.zeros((ticks, width)) for width in (n, n, n, 6))
    for k in range(ticks):
        pose, R_now = one.poses[k], data.site_xmat[site].reshape(3, 3)
        error[k] = pose_error(pose.p, pose.T[:3, :3], data.site_xpos[site], R_now)
        q[k], qdot[k] = data.qpos, data.qvel
        command[k] = step(q[k], qdot[k], pose, one.twists[k], one.poses[k + 1])
        data.ctrl[:] = command[k]
        mujoco.mj_step(model, data)
        mujoco.mj_fwdPosition(model, data)
    return Track(q, qdot, command, error)


def measure(one: Case, track: Track) -> dict[str, float]:
    """Return the figures of a run, by the names of the columns."""
    rate, n = track.command, len(one.start)
    acceleration = np.diff(rate, axis=0, prepend=np.zeros((1, n))) / PERIOD
    turns = (acceleration[1:] * acceleration[:-1] < 0) & (
        np.minimum(np.abs(acceleration[1:]), np.abs(acceleration[:-1])) > CHATTER_FLOOR
    )
    lower, upper = one.arm.model.jnt_range.T
    outside = np.maximum(track.q - upper, lower - track.q)
    p, R = (np.linalg.norm(track.error[:, part], axis=1) for part in (slice(0, 3), slice(3, 6)))
    return {
        "peak rate": np.abs(rate).max(),
        "rms rate": np.sqrt((rate**2).sum(axis=1).mean()),
        "mm": 1e3 * p.max(), "mrad": 1e3 * R.max(),
        "end mm": 1e3 * p[-1], "end mrad": 1e3 * R[-1],
        "peak acc": np.abs(acceleration).max(), "rms acc": np.sqrt((acceleration**2).sum(axis=1).mean()),
        "chatter": turns.sum(axis=0).max() / (one.ticks * PERIOD),
        "rate over": (np.abs(rate) / one.arm.rate).max() - 1, "over": 1e3 * max(outside.max(), 0.0),
    }  # fmt: skip
