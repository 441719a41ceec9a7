"""What people write in their loops: each class calls a library as its own documentation does.

`step` takes what is measured, the pose and the twist that are wanted now, and the pose at the end of the
period. It returns joint rates; kinematics are part of it. `gain` is the feedback K [1/s], `damping` λ in the
units of σ, where the library has no other measure. Without either a class has the values of its
documentation.
"""

import mujoco
import numpy as np
from peer_cases import PERIOD, Arm, Pose


class Numpy:
    """Damped least squares in numpy, with feed-forward; rates beyond a limit are scaled."""

    package = "numpy"

    def __init__(self, arm: Arm, q: np.ndarray, gain: float = 10.0, damping: float = 0.05) -> None:
        self.model, self.rate, self.gain, self.weight = arm.model, arm.rate, gain, damping**2 * np.eye(6)
        self.data, self.site = mujoco.MjData(arm.model), arm.model.site(arm.site).id
        self.J, self.e, self.quat = np.zeros((6, len(q))), np.zeros(6), np.zeros(4)

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_jacSite(self.model, self.data, self.J[:3], self.J[3:], self.site)
        self.e[:3] = pose.p - self.data.site_xpos[self.site]
        mujoco.mju_mat2Quat(self.quat, self.data.site_xmat[self.site])
        self.quat[1:] *= -1
        mujoco.mju_mulQuat(self.quat, pose.quat, self.quat)
        mujoco.mju_quat2Vel(self.e[3:], self.quat, 1.0)
        rates = self.resolve(self.J, twist + self.gain * self.e)
        return rates / max(1.0, (np.abs(rates) / self.rate).max())

    def resolve(self, J: np.ndarray, v: np.ndarray) -> np.ndarray:
        return J.T @ np.linalg.solve(J @ J.T + self.weight, v)


class Mjctrl:
    """mjctrl's diffik_nullspace.py: no feed-forward, a posture in the null space, one limit for all."""

    package = "numpy"

    def __init__(self, arm: Arm, q: np.ndarray, gain: float = 9.5, damping: float = 1e-2) -> None:
        self.model, self.gain, self.home, self.limit = arm.model, gain, q.copy(), arm.rate.min()
        self.data, self.site = mujoco.MjData(arm.model), arm.model.site(arm.site).id
        self.jac, self.twist, self.eye = np.zeros((6, len(q))), np.zeros(6), np.eye(len(q))
        self.diag, self.quat, self.conj = damping**2 * self.eye, np.zeros(4), np.zeros(4)

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        self.twist[:3] = self.gain * (after.p - self.data.site_xpos[self.site])
        mujoco.mju_mat2Quat(self.quat, self.data.site_xmat[self.site])
        mujoco.mju_negQuat(self.conj, self.quat)
        mujoco.mju_mulQuat(self.quat, after.quat, self.conj)
        mujoco.mju_quat2Vel(self.twist[3:], self.quat, 1.0)
        self.twist[3:] *= self.gain
        jac = self.jac
        mujoco.mj_jacSite(self.model, self.data, jac[:3], jac[3:], self.site)
        dq = np.linalg.solve(jac.T @ jac + self.diag, jac.T @ self.twist)
        dq += (self.eye - np.linalg.pinv(jac) @ jac) @ (10.0 * (self.home - q))
        largest = np.abs(dq).max()
        return dq * (self.limit / largest) if largest > self.limit else dq


class Mink:
    """mink, as in its arm_ur5e.py: a frame task, limits of configuration and velocity."""

    package = "mink"

    def __init__(
        self,
        arm: Arm,
        q: np.ndarray,
        gain: float = 1 / PERIOD,
        damping: float = 1e-3**0.5,
        lm_damping: float = 0.0,
    ) -> None:
        import mink

        self.mink, self.configuration = mink, mink.Configuration(arm.model, q)
        self.task = mink.FrameTask(arm.site, "site", 1.0, 1.0, gain=gain * PERIOD, lm_damping=lm_damping)
        rates = dict(zip(arm.joints, arm.rate, strict=True))
        self.limits = [mink.ConfigurationLimit(arm.model), mink.VelocityLimit(arm.model, rates)]
        self.damping = damping**2

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        self.configuration.update(q)
        self.task.set_target(self.mink.SE3(np.concatenate([after.quat, after.p])))
        tasks, limits = [self.task], self.limits
        return self.mink.solve_ik(
            self.configuration, tasks, PERIOD, "daqp", damping=self.damping, limits=limits
        )


class MinkExample(Mink):
    """mink with all numbers of its example."""

    def __init__(self, arm: Arm, q: np.ndarray) -> None:
        super().__init__(arm, q, lm_damping=1.0)


class Pink:
    """pink on pinocchio: a frame task, limits of configuration and velocity, which are the default."""

    package = "pin-pink"

    def __init__(
        self,
        arm: Arm,
        q: np.ndarray,
        gain: float = 1 / PERIOD,
        damping: float = 1e-6,
        lm_damping: float = 0.0,
    ) -> None:
        import pink
        import pinocchio

        self.pink, self.pin = pink, pinocchio
        model = pinocchio.buildModelFromMJCF(arm.path)
        model.velocityLimit = arm.rate
        self.configuration = pink.Configuration(model, model.createData(), q)
        self.task = pink.FrameTask(arm.site, 1.0, 1.0, lm_damping=lm_damping, gain=gain * PERIOD)
        self.tasks, self.damping, self.limits = [self.task], damping**2, None

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        self.configuration.update(q)
        self.task.set_target(self.pin.SE3(after.T))
        return self.pink.solve_ik(
            self.configuration,
            self.tasks,
            PERIOD,
            "daqp",
            damping=self.damping,
            limits=self.limits,
            safety_break=False,
        )


class PinkExample(Pink):
    """pink with all numbers of its arm_ur5.py, and its posture task."""

    def __init__(self, arm: Arm, q: np.ndarray) -> None:
        super().__init__(arm, q, lm_damping=1.0)
        posture = self.pink.PostureTask(cost=1e-3)
        posture.set_target_from_configuration(self.configuration)
        self.tasks.append(posture)


class PinkAccelerating(Pink):
    """pink with its limit of acceleration, by which joints brake before their position limits, too."""

    def __init__(self, arm: Arm, q: np.ndarray, acceleration: float = 30.0, **settings: float) -> None:
        super().__init__(arm, q, **settings)
        model = self.configuration.model
        self.limit = self.pink.limits.AccelerationLimit(model, np.full(model.nv, acceleration))
        self.limits = [model.configuration_limit, model.velocity_limit, self.limit]

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        rates = super().step(q, qdot, pose, twist, after)
        self.limit.set_last_integration(rates, PERIOD)
        return rates


class Jparse(Numpy):
    """J-PARSE by its authors, `damping` its γ; with MuJoCo's Jacobian, rates beyond a limit scaled."""

    package = "jparse-robotics"

    def __init__(self, arm: Arm, q: np.ndarray, gain: float = 2.0, damping: float = 0.1) -> None:
        import jparse_robotics

        super().__init__(arm, q, gain)
        self.solver = jparse_robotics.JParseCore(gamma=damping)

    def resolve(self, J: np.ndarray, v: np.ndarray) -> np.ndarray:
        return self.solver.compute(J) @ v


class Toolbox:
    """The Robotics Toolbox as in its README: p_servo and the pseudoinverse; rates are scaled."""

    package = "roboticstoolbox-python"

    def __init__(self, arm: Arm, q: np.ndarray, gain: float = 1.0, feedforward: float = 0.0) -> None:
        import roboticstoolbox

        self.rtb, self.robot, self.rate = roboticstoolbox, toolbox_robot(arm), arm.rate
        self.gain, self.feedforward = gain, feedforward

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        v, _ = self.rtb.p_servo(self.robot.fkine(q), pose.T, self.gain, method="angle-axis")
        rates = np.linalg.pinv(self.robot.jacob0(q)) @ (v + self.feedforward * twist)
        return rates / max(1.0, (np.abs(rates) / self.rate).max())


class Neo:
    """NEO of the Robotics Toolbox as in its examples, without obstacles; `damping`² is its weight Y."""

    package = "roboticstoolbox-python"

    def __init__(
        self, arm: Arm, q: np.ndarray, gain: float = 1.0, damping: float = 0.1, feedforward: float = 0.0
    ) -> None:
        import qpsolvers
        import roboticstoolbox

        self.qp, self.rtb, self.robot = qpsolvers, roboticstoolbox, toolbox_robot(arm)
        self.n, self.Y, self.gain, self.feedforward = len(q), damping**2, gain, feedforward
        self.bound = np.concatenate([arm.rate, np.full(6, 10.0)])

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        n, Te = self.n, self.robot.fkine(q).A
        v, _ = self.rtb.p_servo(Te, pose.T, self.gain, method="angle-axis")
        e = max(np.sum(np.abs(v)) / self.gain, 1e-4)
        Q = np.diag(np.concatenate([np.full(n, self.Y), np.full(6, 1 / e)]))
        A = np.hstack([self.robot.jacob0(q), np.eye(6)])
        G, h = np.zeros((n + 6, n + 6)), np.zeros(n + 6)
        G[:n, :n], h[:n] = self.robot.joint_velocity_damper(q, 0.05, 0.9, n)
        c = np.concatenate([-self.robot.jacobm(q).ravel(), np.zeros(6)])
        b = v + self.feedforward * twist
        return self.qp.solve_qp(Q, c, G, h, A, b, lb=-self.bound, ub=self.bound, solver="daqp")[:n]


class Rmrc:
    """rmrc, with a section `control`."""

    package = "rmrc"

    def __init__(self, arm: Arm, q: np.ndarray, control: dict[str, object]) -> None:
        import rmrc

        limits = {"rate": arm.rate.tolist(), **control.get("limits", {})}
        law = {**control, "limits": limits}
        # a meter is as long as a radian, as in the loops of the others
        self.controller = rmrc.Controller(arm.path, arm.site, law, period=PERIOD, task={"length": 1})

    def step(self, q: np.ndarray, qdot: np.ndarray, pose: Pose, twist: np.ndarray, after: Pose) -> np.ndarray:
        return self.controller.step(q, qdot, pose=pose.vector, twist=twist).qdot_cmd


def toolbox_robot(arm: Arm) -> object:
    """Return an arm as the Robotics Toolbox describes one: it loads URDF, and our models are MJCF."""
    import roboticstoolbox as rtb

    chain, model = [], arm.model
    to = np.eye(4)
    for body in range(1, model.nbody):
        to = to @ transform(model.body_pos[body], model.body_quat[body])
        if model.body_jntnum[body]:
            joint = model.body_jntadr[body]
            turn = np.eye(4)
            turn[:3, :3] = from_z(model.jnt_axis[joint])
            kind = rtb.ET.tz if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE else rtb.ET.Rz
            chain += [rtb.ET.SE3(to @ turn), kind(qlim=model.jnt_range[joint])]
            to = turn.T
    site = model.site(arm.site)
    return rtb.Robot(rtb.ETS([*chain, rtb.ET.SE3(to @ transform(site.pos, site.quat))]))


def transform(p: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Return a homogeneous transform."""
    T, R = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(R, quat)
    T[:3, :3], T[:3, 3] = R.reshape(3, 3), p
    return T


def from_z(axis: np.ndarray) -> np.ndarray:
    """Return a rotation that takes z to an axis."""
    quat, R = np.zeros(4), np.zeros(9)
    mujoco.mju_quatZ2Vec(quat, axis)
    mujoco.mju_quat2Mat(R, quat)
    return R.reshape(3, 3)
