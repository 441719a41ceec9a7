"""Independent implementations that the tests hold rmrc against: plain numpy and scipy, one world, no records.

Nothing here shares code with the compiled law: damped inverses are solved from their normal equations,
rotations are scipy's, the Jacobian is `mj_jacSite`, and the physics is stepped on one `MjData`.
"""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

AXES = ("x", "y", "z", "rx", "ry", "rz")


def scaling(task_weights, axes, length, joint_weights, is_slide):
    """Return the diagonals of W_x (rows that count) and W_q with the characteristic length in them."""
    rows = [AXES.index(axis) for axis in axes]
    wx = np.array(task_weights, float) * np.array([1 / length**2 if r < 3 else 1.0 for r in rows])
    wq = np.array(joint_weights, float) / np.where(is_slide, length**2, 1.0)
    return wx, wq


def damping(schedule, maximum, below, sigma_min):
    """Return λ by the formulas of the schedules."""
    if schedule == "constant":
        return maximum
    return np.sqrt(max(0.0, 1 - (sigma_min / below) ** 2) * maximum**2)


def resolve(J, v, wx, wq, method, tolerance=1e-6, lam=0.0):
    """Return weighted resolved rates of one task, by a route without an SVD where there is one."""
    m, n = J.shape
    if method == "inverse":
        return np.linalg.solve(J, v)
    if method == "damped" and lam > 0:
        if m <= n:  # right inverse: W_q⁻¹ Jᵀ (J W_q⁻¹ Jᵀ + λ² W_x⁻¹)⁻¹ v
            return (J.T / wq[:, None]) @ np.linalg.solve((J / wq) @ J.T + lam**2 * np.diag(1 / wx), v)
        # left inverse: (Jᵀ W_x J + λ² W_q)⁻¹ Jᵀ W_x v
        return np.linalg.solve(J.T @ (wx[:, None] * J) + lam**2 * np.diag(wq), J.T @ (wx * v))
    A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
    rcond = tolerance if method == "pseudoinverse" else 1e-14
    return np.linalg.pinv(A, rcond=rcond) @ (np.sqrt(wx) * v) / np.sqrt(wq)


def projector(J, wq):
    """Return N, the weighted projector onto the null space of J, from LAPACK's full set of right vectors.

    Not as I − J⁺J: that loses as many digits as the condition number has.
    """
    _, sigma, vt = np.linalg.svd(J / np.sqrt(wq))
    V0 = vt[np.sum(sigma > 1e-14 * sigma[0]) :].T
    return (V0 @ V0.T) / np.sqrt(wq)[:, None] * np.sqrt(wq)


class NumpyLoop:
    """The closed loop of one scenario, written as one would in a notebook."""

    def __init__(self, prepared):
        self.scenario, self.arm, self.reference = (
            prepared.scenario,
            prepared.arm,
            prepared.reference,
        )
        plant = self.scenario.plant
        self.model = self.arm.adapted(plant.kind, prepared.kv, plant.timestep, plant.gravity_compensation)
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = prepared.qpos
        self.substeps = round(self.scenario.control.period / plant.timestep)
        self.dof = [int(self.model.joint(name).dofadr[0]) for name in self.arm.joints]
        self.qpos = [int(self.model.joint(name).qposadr[0]) for name in self.arm.joints]
        self.ctrl = [
            i
            for name in self.arm.joints
            for i in range(self.model.nu)
            if self.model.actuator_trnid[i, 0] == self.model.joint(name).id
        ]
        n = self.arm.n
        task, control = self.scenario.task, self.scenario.control
        self.wx, self.wq = scaling(
            task.weights or np.ones(len(task.axes)), task.axes, task.length,
            control.joint_weights or np.ones(n), self.arm.is_slide,
        )  # fmt: skip
        self.start = prepared.qpos[self.qpos]
        self.last = np.zeros(n)

    def run(self):
        """Return the columns of the whole run as a dict of arrays."""
        rows = [self.tick(t) for t in range(len(self.reference.time))]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    def tick(self, t):
        model, data, plant = self.model, self.data, self.scenario.plant
        tau = data.actuator_force[self.ctrl].copy()
        if plant.kind == "ideal":
            mujoco.mj_forward(model, data)
            qdot, tau = self.last, np.zeros(self.arm.n)
        else:
            mujoco.mj_step1(model, data)
            qdot = data.qvel[self.dof].copy()
        row = self.law(t, qdot)
        row["tau"] = tau
        cmd = row["qdot_cmd"]
        if plant.kind == "ideal":
            data.qpos[self.qpos] += self.scenario.control.period * cmd
        else:
            self.push()
            data.ctrl[self.ctrl] = cmd if plant.kind == "servo" else self.torque(cmd, qdot)
            mujoco.mj_step2(model, data)
            for _ in range(self.substeps - 1):
                mujoco.mj_step(model, data)
        self.last = cmd
        return row

    def push(self):
        site = self.model.site(self.arm.site)
        body = int(site.bodyid[0])
        wrench = np.array(self.scenario.plant.wrench)
        arm = self.data.site_xpos[site.id] - self.data.xipos[body]
        self.data.xfrc_applied[body] = [*wrench[:3], *(wrench[3:] + np.cross(arm, wrench[:3]))]

    def torque(self, cmd, qdot):
        M = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, M)
        qddot = (cmd - self.last) / self.scenario.control.period
        qddot = qddot + self.scenario.plant.bandwidth * (cmd - qdot)
        bias = self.data.qfrc_bias - self.data.qfrc_passive
        return M[np.ix_(self.dof, self.dof)] @ qddot + bias[self.dof]

    def law(self, t, qdot):
        control, task = self.scenario.control, self.scenario.task
        data, site = self.data, self.model.site(self.arm.site).id
        q = data.qpos[self.qpos].copy()
        full = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, data, full[:3], full[3:], site)
        rows = [AXES.index(axis) for axis in task.axes]
        J = full[:, self.dof][rows]
        pose_ref, twist_ref = self.reference.pose[t], self.reference.twist[t]
        R = Rotation.from_matrix(data.site_xmat[site].reshape(3, 3))
        R_ref = Rotation.from_quat(pose_ref[3:], scalar_first=True)
        error = np.concatenate([pose_ref[:3] - data.site_xpos[site], (R_ref * R.inv()).as_rotvec()])
        v = (control.feedforward * twist_ref + control.feedback * error)[rows]
        A = np.sqrt(self.wx)[:, None] * J / np.sqrt(self.wq)
        sigma = np.linalg.svd(A, compute_uv=False)
        inverse = control.inverse
        lam = 0.0
        if inverse.method == "damped":
            lam = damping(inverse.damping.schedule, inverse.damping.maximum, inverse.damping.below, sigma[-1])
        cmd = resolve(J, v, self.wx, self.wq, inverse.method, inverse.tolerance, lam)
        if control.nullspace.objective == "posture":
            posture = self.start if control.nullspace.posture is None else control.nullspace.posture
            cmd = cmd + projector(J, self.wq) @ (control.nullspace.gain * (posture - q))
        return {
            "q": q,
            "qdot": qdot,
            "qdot_cmd": self.limit(cmd),
            "pose_error": error,
            "sigma": sigma,
            "damping": lam,
        }

    def limit(self, cmd):
        limits = self.scenario.control.limits
        bound = np.broadcast_to(
            self.arm.rate_limit if limits.rate is None else np.array(limits.rate), cmd.shape
        )
        if limits.on_excess == "scale":
            return cmd / max(1.0, np.max(np.abs(cmd) / bound))
        if limits.on_excess == "clamp":
            return np.clip(cmd, -bound, bound)
        return cmd
