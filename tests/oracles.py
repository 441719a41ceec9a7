"""Independent implementations that the tests hold rmrc against: plain numpy and scipy, one world, no records.

Nothing here shares code with the compiled law: rotations are scipy's, the Jacobian is `mj_jacSite`, gradients are
differences, and the physics is stepped on one `MjData`; the inverses are in `oracle_inverse`, the limits and the
pace in `oracle_limits`. Bounded jerk and the solvers of `optimal`, `sns` and `reverse_priority` have tests of their own.
"""

import copy
import math

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from oracle_inverse import (
    AXES,
    ROUNDING,
    damping,
    generalized_inverse,
    projector,
    scaled_jacobian,
    scaling,
    second_inverse,
)
from oracle_limits import (
    bounds,
    fastest_pace,
    held_at_stops,
    held_off,
    kept_out,
    next_pace,
    redistributed,
    slowed_change,
)
from oracle_sensing import Sensing, true_model
from oracle_way import Way
from rmrc.scenario.choices import Status


def known_model(prepared):
    """Return the model that a plant steps, with the gains of its servos, as the law knows it."""
    model = copy.copy(prepared.plant.model())
    if prepared.scenario.plant.kind == "servo":
        actuator = prepared.arm.wire(model).actuator
        model.actuator_gainprm[actuator, 0], model.actuator_biasprm[actuator, 2] = (
            prepared.plant.kv,
            -prepared.plant.kv,
        )
    return model


class Kinematics:
    """Poses and Jacobians of sites at any positions of the arm's joints, without touching the simulation."""

    def __init__(self, model, qpos, joints):
        self.model, self.data = model, mujoco.MjData(model)
        self.data.qpos[:] = qpos
        self.first = joints[0]
        self.dof = [int(model.joint(name).dofadr[0]) for name in joints]
        self.qpos = [int(model.joint(name).qposadr[0]) for name in joints]
        self.is_slide = np.array(
            [model.joint(name).type[0] == mujoco.mjtJoint.mjJNT_SLIDE for name in joints]
        )

    def axes(self, frame, turn):
        """Return the axes of a frame as columns: of the world, the first joint's parent, or a site that is turned."""
        first = self.model.body_parentid[self.model.jnt_bodyid[self.model.joint(self.first).id]]
        base = self.data.xmat[first].reshape(3, 3).copy()
        return {"world": np.eye(3), "base": base, "site": turn}[frame]

    def at(self, q, site, frame="world"):
        """Return position, rotation matrix and Jacobian (6, n), along the axes of a frame, of a site."""
        self.data.qpos[self.qpos] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        full = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, full[:3], full[3:], site)
        turn = self.data.site_xmat[site].reshape(3, 3).copy()
        return self.data.site_xpos[site].copy(), turn, along(self.axes(frame, turn), full[:, self.dof])

    def structural_rank(self, site, rows, frame="world", samples=20):
        """Return the rank of a task almost everywhere: the largest that is found at random."""
        rng = np.random.default_rng(0)
        ranks = []
        for _ in range(samples):
            q = np.where(
                self.is_slide, rng.uniform(-1, 1, len(self.qpos)), rng.uniform(-3, 3, len(self.qpos))
            )
            J = self.at(q, site, frame)[2][rows]
            ranks.append(np.linalg.matrix_rank(J, tol=1e-9 * np.linalg.norm(J)))
        return max(ranks)

    def gradient(self, f, q, site, frame, size=None):
        """Return the derivatives of f(Jacobians of a site, along a frame) with respect to q, by differences of sixth order.

        Of several values, `size` of them, a column each.

        With this step rounding gives 1e-13, and what is left out less.
        """
        step, factors = 2e-3, {-3: -1, -2: 9, -1: -45, 1: 45, 2: -9, 3: 1}
        moved = [q + i * step * joint for joint in np.eye(len(q)) for i in factors]
        values = f(np.array([self.at(one, site, frame)[2] for one in moved]))
        values = values.reshape(len(q), len(factors), -1)
        slopes = np.tensordot(values, list(factors.values()), (1, 0)) / (60 * step)
        return slopes if size else slopes[:, 0]


def along(axes, rows):
    """Return rows [v; ω], (6, …), that are along the world's axes, along others, given as columns."""
    return np.concatenate([axes.T @ rows[:3], axes.T @ rows[3:]])


class NumpyLoop:
    """The closed loop of one scenario, written as one would in a notebook.

    `data` is the arm where it is; `kinematics` is also asked where the law takes it to be.
    """

    def __init__(self, prepared):
        self.scenario, self.arm, self.reference = prepared.scenario, prepared.arm, prepared.reference
        self.known = known_model(prepared)
        self.known_data = mujoco.MjData(self.known)
        dofs = [int(self.known.joint(name).dofadr[0]) for name in self.arm.joints]
        self.model = true_model(self.known, self.scenario.plant, dofs)
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = prepared.qpos
        self.substeps = round(self.scenario.control.period / self.model.opt.timestep)
        self.kinematics = Kinematics(self.known, prepared.qpos, self.arm.joints)
        self.truth = Kinematics(self.model, prepared.qpos, self.arm.joints)
        self.dof, self.qpos = self.kinematics.dof, self.kinematics.qpos
        driven = [self.model.joint(name).id for name in self.arm.joints]
        self.ctrl = [i for joint in driven for i in np.flatnonzero(self.model.actuator_trnid[:, 0] == joint)]
        n = self.arm.n
        task, control = self.scenario.task, self.scenario.control
        self.wx, self.wq = scaling(
            task.weights or np.ones(len(task.axes)), task.axes, task.length,
            control.joint_weights or np.ones(n), self.arm.is_slide,
        )  # fmt: skip
        self.rows = [AXES.index(axis) for axis in task.axes]
        self.turns = Rotation.from_quat(self.reference.pose[:, 3:], scalar_first=True).as_matrix()
        self.site, self.frame = self.model.site(self.arm.site).id, task.frame
        self.rank = self.kinematics.structural_rank(self.site, self.rows, task.frame)
        limits = control.limits
        self.rate = np.broadcast_to(self.arm.rate_limit if limits.rate is None else limits.rate, n)
        self.acceleration = np.broadcast_to(np.inf if limits.acceleration is None else limits.acceleration, n)
        anywhere = np.tile([-np.inf, np.inf], (n, 1))
        self.position = self.arm.position_limit if limits.position else anywhere
        self.deceleration = np.minimum(limits.braking, self.acceleration)
        self.start = prepared.qpos[self.qpos] - np.array(self.scenario.plant.joint_offset)
        self.sensing = Sensing(self.scenario, n)
        if control.nullspace.objective == "secondary":
            self.start_second(control.nullspace.secondary)
        self.way = Way(self.scenario.plant, control.period, n)
        self.last, self.told = np.zeros((2, n))
        self.path_tick, self.pace, self.share = 0.0, 1.0, 1.0
        self.fastest, self.falling, self.advance, self.waited, self.still = None, 0.0, 0.0, 0.0, 0.0

    def start_second(self, second):
        """Find the second task's site and the pose that it shall have."""
        self.site_2 = self.model.site(second.site or self.arm.site).id
        self.rows_2 = [AXES.index(axis) for axis in second.axes]
        # the same scales as the task's, all its weights 1
        self.wx_2, _ = scaling(np.ones(len(self.rows_2)), second.axes, self.scenario.task.length, [], [])
        point, turn, _ = self.kinematics.at(self.start, self.site_2)
        data, axes = self.kinematics.data, self.kinematics.axes(second.frame, turn)
        body = self.model.body_parentid[self.model.jnt_bodyid[self.model.joint(self.arm.joints[0]).id]]
        origin = {"world": np.zeros(3), "base": data.xpos[body].copy(), "site": point}[second.frame]
        wanted = np.concatenate([axes.T @ (point - origin), np.zeros(3)])
        if second.to is not None:
            wanted[self.rows_2] = second.to
        turned = Rotation.from_rotvec(axes @ wanted[3:]).as_matrix() @ turn
        self.wanted_2 = origin + axes @ wanted[:3], turned

    def run(self):
        """Return the columns of the whole run as a dict of arrays."""
        planned, control = len(self.reference.time), self.scenario.control
        slows = control.at_singularity in ("slow", "singularity_consistent")
        rows = []
        for _ in range(math.ceil(control.slow.longest * planned) if slows else planned):
            is_last = self.path_tick >= planned - 1
            rows.append(self.tick())
            if is_last:
                break
            tick = min(self.path_tick + self.pace, planned - 1.0)
            self.advance, self.path_tick = tick - self.path_tick, tick
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    def tick(self):
        model, data, plant = self.model, self.data, self.scenario.plant
        tau = np.array(
            data.qfrc_actuator[self.dof] if plant.kind == "model" else data.actuator_force[self.ctrl]
        )
        if plant.kind == "ideal":
            mujoco.mj_forward(model, data)
            qdot, tau = self.told, np.zeros(self.arm.n)
        else:
            mujoco.mj_step1(model, data)
            qdot = data.qvel[self.dof].copy()
        q = data.qpos[self.qpos].copy()
        self.kinematics.data.qpos[:] = data.qpos  # joints beside the arm move as well
        believed, rate = self.sensing(q, qdot, self.last)
        row = self.law(believed)
        row |= {"q": q, "q_believed": believed, "qdot": qdot, "tau": tau}
        self.truth.data.qpos[:] = data.qpos
        row["pose_error"] = self.error(*self.truth.at(q, self.site)[:2])
        if self.scenario.control.nullspace.objective == "secondary":
            row["secondary_error"] = np.linalg.norm(self.second_error(self.truth, q))
        cmd = row["qdot_arrived"] = self.way.tell(row["qdot_cmd"])
        if plant.kind == "ideal":
            data.qpos[self.qpos] += self.scenario.control.period * cmd
        else:
            self.push()
            if plant.kind == "model":  # MuJoCo cuts what is beyond the range of a control
                others = model.actuator_biasprm[self.ctrl, 1].any()
                assert not others, "no oracle but for rate servos: write it here"
                data.ctrl[self.ctrl] = cmd
            else:
                data.ctrl[self.ctrl] = cmd if plant.kind == "servo" else self.torque(cmd, rate)
            mujoco.mj_step2(model, data)
            for _ in range(self.substeps - 1):
                mujoco.mj_step(model, data)
        self.last, self.told = row["qdot_cmd"], cmd
        return row

    def push(self):
        body = int(self.model.site_bodyid[self.site])
        wrench = np.array(self.scenario.plant.wrench)
        if not wrench.any():
            return
        arm = self.data.site_xpos[self.site] - self.data.xipos[body]
        self.data.xfrc_applied[body] = [*wrench[:3], *(wrench[3:] + np.cross(arm, wrench[:3]))]

    def torque(self, cmd, qdot):
        known = self.known_data
        known.qpos[:], known.qvel[:] = self.data.qpos, self.data.qvel
        mujoco.mj_forward(self.known, known)
        M = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.known, known, M)
        fastest = min(500.0, 1.0 / self.scenario.control.period)
        qddot = (cmd - self.told) / self.scenario.control.period
        qddot = qddot + (self.scenario.plant.bandwidth or fastest) * (cmd - qdot)
        return M[np.ix_(self.dof, self.dof)] @ qddot + (known.qfrc_bias - known.qfrc_passive)[self.dof]

    def law(self, q):
        """Return the row of a tick: (3), inverse, null space, pace, stop, limits."""
        control = self.scenario.control
        point, turn, full = self.kinematics.at(q, self.site, self.frame)
        J, error = full[self.rows], self.error(point, turn)
        pose_ref, recorded_twist, _ = self.wanted()
        twist_ref = along(self.kinematics.axes(self.frame, turn), recorded_twist)
        u, sigma, vt = np.linalg.svd(scaled_jacobian(J, self.wx, self.wq), full_matrices=False)
        forward = control.feedforward * twist_ref[self.rows]
        v = self.pace * forward + control.feedback * error[self.rows]
        lam = self.damping(J, v, error, sigma)
        G = self.inverse(J, v, lam)
        drift, row = self.drift(q, J, G @ v)
        row["qdot_plain"] = self.plain(J) @ v
        rates = G @ v + drift
        known = ("damp", "slow", "stop", "singularity_consistent", "keep_out")
        assert control.at_singularity in known, "no oracle for this policy: write it here"
        beside, barrier = np.zeros(len(q)), None  # rates that limits take for a wish and a part of the task
        if control.at_singularity == "singularity_consistent":
            rates, change, beside = self.go_along_kernel(q, J, rates, G @ forward, forward)
            v = v + change * forward
        if control.at_singularity == "keep_out":
            barrier = self.barrier(q, J)
            A, scale = scaled_jacobian(J, self.wx, self.wq), 1 / np.sqrt(self.wq)
            beside, slack = kept_out(*barrier, rates, scale, A, control.keep_out.sigma)
            rates, lowest = rates + beside, np.where(barrier[1] <= 0, barrier[1] - slack, -np.inf)
        if control.at_singularity == "slow":
            change = self.choose_pace(rates, G @ forward)
            rates, v = rates + change * (G @ forward), v + change * forward
        if control.at_singularity == "stop":
            self.hold(q, sigma, rates)
            rates, v, drift = self.share * rates, self.share * v, self.share * drift
        status = Status.SLOWED * (self.pace < 1) | Status.STOPPED * (self.share < 1)
        status |= Status.SINGULAR * bool(sigma[-1] <= sigma[0] / 100)
        v, drift, self.beside = v + J @ beside, drift + beside, bool(beside.any())
        cmd, limited = self.limit(q, J, v, lam, drift, rates)
        if barrier:
            held = held_off(barrier[0], lowest, cmd, self.last, self.acceleration * control.period)
            status |= Status.KEPT_OUT * bool(beside.any() or np.any(held != cmd))
            cmd = held
        status |= Status.STUCK * self.stands(self.pace * twist_ref[self.rows], v, J @ cmd, status)
        if control.inverse.method != "transpose":  # at rest its α is rounding over rounding
            row["gain"] = self.gains(u, vt, G)
        return row | {
            "qdot_cmd": cmd, "pose_ref": pose_ref, "pose_error": error, "twist_ref": self.pace * recorded_twist,
            "sigma": sigma, "damping": lam, "path_time": self.path_tick * control.period, "path_rate": self.pace,
            "status": status, "limited": limited,
        }  # fmt: skip

    def error(self, point, turn):
        """Return the error (2) of an arm whose site is there."""
        wanted, _, turn_ref = self.wanted()
        return framed_error(
            pose_error(wanted[:3], turn_ref, point, turn), self.kinematics.axes(self.frame, turn), turn.T @ turn_ref,
            self.rows if self.frame == "site" else [],
        )  # fmt: skip

    def wanted(self):
        """Return pose, twist and rotation matrix of the reference at the path time, between its ticks if need be."""
        i = int(self.path_tick)
        pose, twist, f = self.reference.pose[i], self.reference.twist[i], self.path_tick - i
        if f == 0:
            return pose, twist, self.turns[i]
        other, quat = self.reference.pose[i + 1], self.reference.pose[i + 1, 3:]
        quat = (1 - f) * pose[3:] + f * (quat if quat @ pose[3:] >= 0 else -quat)
        point = (1 - f) * pose[:3] + f * other[:3]
        twist = (1 - f) * twist + f * self.reference.twist[i + 1]
        turn = Rotation.from_quat(quat, scalar_first=True).as_matrix()
        return np.concatenate([point, quat / np.linalg.norm(quat)]), twist, turn

    def sigma(self, J):
        """Return the singular values of A, of one Jacobian or of each of several."""
        return np.linalg.svd(scaled_jacobian(J, self.wx, self.wq), compute_uv=False)

    def gains(self, u, vt, G):
        """Return how much a generalized inverse gives of each direction of A."""
        return np.sum(vt.T * (np.sqrt(self.wq)[:, None] * G / np.sqrt(self.wx) @ u), axis=0)

    def damping(self, J, v, error, sigma):
        """Return λ of the tick (12)."""
        inverse, d = self.scenario.control.inverse, self.scenario.control.inverse.damping
        if inverse.method not in ("damped", "filtered"):
            return 0.0
        is_filter = inverse.method == "filtered"
        return damping(
            "smallest_singular_value" if is_filter else d.schedule, d.maximum, d.below, sigma[-1],
            w=np.prod(sigma), w_below=d.manipulability_below,
            error=np.linalg.norm(np.sqrt(self.wx) * error[self.rows]), error_gain=d.error_gain,
            A=scaled_jacobian(J, self.wx, self.wq), t=np.sqrt(self.wx) * v, bound=inverse.rate_bound,
        )  # fmt: skip

    def inverse(self, J, v, lam):
        """Return the matrix that makes rates of v (8)."""
        inverse, d = self.scenario.control.inverse, self.scenario.control.inverse.damping
        return generalized_inverse(
            J, v, self.wx, self.wq, inverse.method, inverse.tolerance, lam, cutoff=inverse.cutoff,
            gamma=inverse.gamma, bound=inverse.rate_bound, maximum=d.maximum, below=d.below,
        )  # fmt: skip

    def plain(self, J):
        """Return the inverse of J, or its pseudoinverse in the metric of the task, with no tolerance but rounding."""
        A = scaled_jacobian(J, self.wx, self.wq)
        return np.linalg.pinv(A, rcond=ROUNDING) / np.sqrt(self.wq)[:, None] * np.sqrt(self.wx)

    def drift(self, q, J, resolved):
        """Return N qdot0 (16), (17), and the columns of a second task."""
        nullspace = self.scenario.control.nullspace
        row = {"secondary_error": np.nan, "secondary_sigma": np.nan}
        if nullspace.objective == "none":
            return np.zeros(len(q)), row
        N = projector(np.sqrt(self.wx)[:, None] * J, self.wq, self.rank)
        if nullspace.objective == "posture":
            posture = self.start if nullspace.posture is None else np.array(nullspace.posture)
            wished = nullspace.gain * (posture - q)
        elif nullspace.objective == "joint_limits":
            lower, upper = self.arm.position_limit.T
            limited = np.isfinite(upper - lower)
            slope = np.zeros(len(q))
            low, high = lower[limited], upper[limited]
            slope[limited] = (q[limited] - (low + high) / 2) / (high - low) ** 2 / len(q)
            wished = -nullspace.gain * slope / self.wq
        elif nullspace.objective == "manipulability":
            w = lambda full: np.prod(self.sigma(full[:, self.rows]), axis=-1)  # noqa: E731
            wished = nullspace.gain * self.kinematics.gradient(w, q, self.site, self.frame) / self.wq
        elif nullspace.objective == "rates":
            wished = np.array(nullspace.rates)
        else:
            assert nullspace.objective == "secondary", f"no oracle for {nullspace.objective}: write it here"
            wished, row = self.second_task(q, N, resolved)
        return N @ wished, row

    def second_task(self, q, N, resolved):
        """Return S_q y_2 (18) and the columns of the second task."""
        second, S_q = self.scenario.control.nullspace.secondary, 1 / np.sqrt(self.wq)
        full, error = (
            self.kinematics.at(q, self.site_2, second.frame)[2],
            self.second_error(self.kinematics, q),
        )
        A, t = (
            scaled_jacobian(full[self.rows_2], self.wx_2, self.wq),
            np.sqrt(self.wx_2) * second.feedback * error,
        )
        AP = A @ (N / S_q[:, None] * S_q)
        if second.priority == "classical":
            y = second_inverse(AP, np.linalg.norm(A), second.damping) @ (t - A @ (resolved / S_q))
        else:
            assert second.priority == "robust", f"no oracle for {second.priority}: write it here"
            y = second_inverse(A, np.linalg.norm(A), second.damping) @ t
        left = np.linalg.svd(AP, compute_uv=False)[-1]
        return S_q * y, {"secondary_error": np.linalg.norm(error), "secondary_sigma": left}

    def second_error(self, kinematics, q):
        """Return the error of the second task's rows."""
        frame = self.scenario.control.nullspace.secondary.frame
        point, turn, _ = kinematics.at(q, self.site_2, frame)
        axes, rows = kinematics.axes(frame, turn), self.rows_2 if frame == "site" else []
        own = framed_error(pose_error(*self.wanted_2, point, turn), axes, turn.T @ self.wanted_2[1], rows)
        return own[self.rows_2]

    def choose_pace(self, rates, forward):
        """Choose ṡ by (19) and (20), and return how much it changes."""
        control, last = self.scenario.control, self.pace
        fastest = fastest_pace(rates - last * forward, forward, self.rate)
        self.waited = max(0.0, self.waited + (control.period if fastest == 0 else -control.period))
        if self.waited > control.slow.patience:
            fastest = 1.0
        if self.advance > 1e-3:  # of a tick: less says nothing about how the fastest pace changes
            self.falling = (self.fastest - fastest) / (self.advance * control.period)
        self.fastest = fastest
        self.pace = next_pace(last, fastest, self.falling, control.slow.change, control.period)
        return self.pace - last

    def slopes(self, q, J):
        """Return ∇σ_i of the first singular values, (r, n), from differences of A alone."""
        u, _, vt = np.linalg.svd(scaled_jacobian(J, self.wx, self.wq), full_matrices=False)
        A = lambda full: scaled_jacobian(full[:, self.rows], self.wx, self.wq)  # noqa: E731
        along = lambda full: np.einsum("ri,krj,ij->ki", u, A(full), vt)  # noqa: E731
        return self.kinematics.gradient(along, q, self.site, self.frame, len(vt)).T[: self.rank]

    def barrier(self, q, J):
        """Return ∇σ_i, (r, n), and the least rate of each σ_i."""
        section, slopes = self.scenario.control.keep_out, self.slopes(q, J)
        least = section.approach * (section.sigma - self.sigma(J)[: self.rank])
        square = np.sum(slopes**2 / self.wq, axis=1)
        slopes[square < 1e-18] = 0
        return slopes, np.where(least > 0, np.minimum(least, 0.2 * section.approach * square), least)

    def go_along_kernel(self, q, J, rates, along, forward):
        """Choose ṡ by the kernel of [Σ | −c], and return the rates, how much ṡ changes, and what is beside G."""
        slow, period = self.scenario.control.slow, self.scenario.control.period
        last, r = self.pace, self.rank - 1
        u, sigma, vt = np.linalg.svd(scaled_jacobian(J, self.wx, self.wq), full_matrices=False)
        c = (u.T @ (np.sqrt(self.wx) * forward))[: r + 1]
        # the null vector of (r + 1) equations for r + 2 unknowns, by elimination from the last, smallest, σ
        kernel = (vt[: r + 1].T @ (c * sigma[r] / sigma[: r + 1])) / np.sqrt(self.wq)
        a, full = rates - last * along, min(1.0, last + slow.change * period)
        falls = -period * (self.slopes(q, J)[r] @ kernel)
        # below, a rate is the rounding of a matrix product
        moving = np.abs(kernel) > 1e-12 * np.abs(kernel).max()
        room = np.maximum(0.0, 0.95 * self.rate - np.sign(kernel) * a)[moving] / np.abs(kernel)[moving]
        most = min(np.min(room, initial=np.inf), 0.5 * sigma[r] / falls if falls > 0 else np.inf)
        times = min(most, full / sigma[r])
        self.pace = full if most * sigma[r] >= full else most * sigma[r]
        self.waited = max(0.0, self.waited + (period if self.pace < 1e-3 else -period))
        if self.waited > slow.patience:
            self.pace = full
            return a + full * along, full - last, np.zeros(len(q))
        return a + times * kernel, self.pace - last, times * kernel - self.pace * along

    def hold(self, q, sigma, rates):
        """Move β towards 0 near a singularity, unless the rates lead out of it, and towards 1 elsewhere."""
        stop = self.scenario.control.stop
        last = self.rank - 1
        near = sigma[last] <= stop.sigma
        if stop.condition is not None:
            near = near or sigma[0] >= stop.condition * sigma[last]
        if near:
            moved = (self.kinematics.at(q + h * rates, self.site, self.frame)[2] for h in (1e-6, -1e-6))
            ahead, behind = (self.sigma(full[self.rows])[last] for full in moved)
            near = ahead - behind <= 1e-14 * sigma[0]  # as far as the differences of two roundings go
        step = stop.change * self.scenario.control.period
        self.share = max(0.0, self.share - step) if near else min(1.0, self.share + step)

    def stands(self, wanted, asked, done, status):
        """Return whether the site has stood still for more than 0.2 s while its reference moved."""
        wanted, asked, done = (np.linalg.norm(np.sqrt(self.wx) * x) for x in (wanted, asked, done))
        wished = wanted if wanted > 1e-3 else asked
        if status & (Status.STOPPED | Status.KEPT_OUT) or wished <= 1e-3 or done > max(0.02 * wished, 1e-4):
            self.still = 0.0
        elif wanted > 1e-3:
            self.still += self.scenario.control.period
        return self.still > 0.2

    def limit(self, q, J, v, lam, drift, rates):
        """Return rates within the limits (21) to (24), and which limits can have changed them."""
        limits, period = self.scenario.control.limits, self.scenario.control.period
        how = limits.on_excess
        if how == "none":
            return rates, Status.OK
        assert how in ("scale", "clamp", "redistribute") and limits.jerk is None, "no oracle for this limit"
        about = self.last, self.rate, self.acceleration, self.deceleration
        rest_lo, rest_up, lower, upper = bounds(q, *about, self.position, period)
        near_stop = bool(np.any(np.minimum(rest_up, -rest_lo) < self.rate))
        # what a joint at its stop leaves to the others may be too fast for them
        excess = how == "redistribute" or near_stop or np.any(np.abs(rates) > (1 - 1e-9) * self.rate)
        limited = Status.RATE_LIMITED * bool(excess and np.isfinite(self.rate).any())
        limited |= Status.ACCELERATION_LIMITED * bool(np.isfinite(self.acceleration).any())
        limited |= Status.POSITION_LIMITED * near_stop
        if how == "clamp":
            return np.clip(rates, lower, upper), limited
        cmd, share, wish = None, 1.0, drift
        if how == "redistribute":
            wide = bounds(0.0 * q, *about, np.tile([-np.inf, np.inf], (len(q), 1)), period)[2:]
            within = (lower, upper) if self.beside else wide
            if np.all((within[0] <= rates) & (rates <= within[1])):
                cmd = rates  # qdot(1), with the gains from before pace and stop changed the command
            else:
                scaled = lambda J: scaled_jacobian(J, self.wx, self.wq)  # noqa: E731
                cmd, share = redistributed(J, v, drift, *wide, scaled, lambda J: self.inverse(J, v, lam))
        redistributes, low, up = cmd is not None, lower, upper
        if not redistributes:
            share = min(1.0, np.min(self.rate[rates != 0] / np.abs(rates[rates != 0]), initial=1.0))
            cmd, wish, low, up = share * rates, share * drift, rest_lo, rest_up
        beyond = np.abs(cmd - np.clip(cmd, low, up))
        if np.any(beyond > 1e-12 * np.abs(cmd)):
            fast = np.minimum(self.rate, np.max(np.abs(cmd) * np.sqrt(self.wq)) / np.sqrt(self.wq))
            back = share + (1 - share) * min(1.0, np.max(beyond / fast))
            wish = wish if redistributes else back * drift
            cmd = self.give_way(J, back * v, lam, wish, cmd, low, up)
        if redistributes:
            return np.clip(cmd, lower, upper), limited
        return slowed_change(cmd, self.last, self.acceleration * period, lower, upper), limited

    def give_way(self, J, v, lam, drift, start, lower, upper):
        """Return rates within bounds that do what they can of a task."""

        def pull(rates, lam):
            S_q = 1 / np.sqrt(self.wq)
            return S_q * (J.T @ (self.wx * (v - J @ rates))) - lam**2 * (rates - drift) / S_q

        return held_at_stops(start, drift, lower, upper, self.resolver(J, v, lam), pull)

    def resolver(self, J, v, lam):
        """Return a function: who is held, rates of all, share of its wish that is left to each -> rates, λ."""
        inverse, (m, n), error = self.scenario.control.inverse, J.shape, np.zeros(6)
        schedule = inverse.damping.schedule if inverse.method == "damped" else ""
        known = [lam if inverse.method == "damped" else 0.0]

        def resolve(held, given, fade):
            if schedule in ("smallest_singular_value", "manipulability") and m <= n - held.sum() < n:
                known.append(self.damping(J * fade, v, error, self.sigma(J * fade)))
            J_free, left = np.where(held, 0.0, J), v - J @ given
            if schedule == "rate_bound":
                known.append(self.damping(J_free, left, error, self.sigma(J_free)))
            return given + self.inverse(J_free, left, max(known)) @ left, max(known)

        return resolve


def pose_error(point_ref, turn_ref, point, turn):
    """Return [p_ref − p; log(R_ref Rᵀ)] (2)."""
    w, *xyz = quat_of(turn_ref @ turn.T)
    return np.concatenate([point_ref - point, Rotation.from_quat([*xyz, w]).as_rotvec()])


def framed_error(error, axes, left, rows):
    """Return an error along some axes; of what is left to turn about one free axis of the site, the tilt of that axis.

    Args:
        error: In the world, (6,).
        axes: As columns.
        left: Rotation matrix that is left, as the site sees it.
        rows: Of a task along the site's axes, else none.
    """
    own = along(axes, error)
    free = {3, 4, 5} - set(rows)
    if len(free) == 1:
        k = np.eye(3)[free.pop() - 3]
        square = np.cross(k, left @ k)
        sine = np.linalg.norm(square)
        tilt = square * (np.arctan2(sine, k @ left @ k) / sine if sine > 0 else 1.0)
        about = Rotation.from_rotvec(-tilt) * Rotation.from_matrix(left)
        own[3:] = tilt + about.as_rotvec()
    return own


def quat_of(matrix):
    """Return MuJoCo's quaternion of a rotation matrix; scipy's looks first whether it is one, which takes longer."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, matrix.ravel())
    return quat
