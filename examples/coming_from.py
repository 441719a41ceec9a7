"""Coming from mink, pink or Robotics Toolbox: their loop as a comment, and the same loop with rmrc.

Their frame task is `pose` here. Damping is λ, and mink and pink use its square. Limits are part of the law,
not an argument of each call.
"""

import mujoco
import numpy as np

import rmrc

CONTROL = {"feedback": 5.0, "inverse": {"damping": {"maximum": 0.03, "below": 0.06}}, "limits": {"rate": 1.5}}

# mink ---------------------------------------------------------------------------------------------
#   configuration = mink.Configuration(model)
#   task = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0)
#   limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, {name: 1.5 for name in joints})]
#   configuration.update(q)
#   task.set_target_from_configuration(configuration)  # or a mink.SE3
#   velocity = mink.solve_ik(configuration, [task], dt, "daqp", damping=1e-3, limits=limits)
#   configuration.integrate_inplace(velocity, dt)
model = mujoco.MjModel.from_xml_path(str(rmrc.Controller("ur5e").arm.path))
controller = rmrc.Controller(model, "tool", CONTROL, period=0.002)
q = np.array(model.key("home").qpos)
goal = controller.arm.pose(q) + np.array([-0.05, 0.1, -0.1, 0, 0, 0, 0])
for _ in range(1500):
    q = q + controller.period * controller.step(q, pose=goal).qdot_cmd
print(f"as with mink: {1e3 * np.linalg.norm(controller.command.pose_error[:3]):.2f} mm from the goal")

# pink ---------------------------------------------------------------------------------------------
#   configuration = pink.Configuration(robot.model, robot.data, q)
#   task = pink.FrameTask("tool0", position_cost=1.0, orientation_cost=1.0)
#   task.set_target(pin.SE3(R, p))
#   velocity = pink.solve_ik(configuration, [task], dt, solver="quadprog", damping=1e-3)
#   q = pin.integrate(robot.model, q, velocity * dt)
# A URDF is as good as MJCF. Poses are matrices as well: SE3.homogeneous there.
T = np.eye(4)
mujoco.mju_quat2Mat(turn := np.empty(9), goal[3:])
T[:3, :3], T[:3, 3] = turn.reshape(3, 3), goal[:3]
same = controller.step(q, pose=T).pose_error
print(f"as with pink, the goal as a matrix: {1e3 * np.linalg.norm(same[:3]):.2f} mm")

# Robotics Toolbox ---------------------------------------------------------------------------------
#   v, arrived = rtb.p_servo(robot.fkine(q), Tep, gain=5, threshold=0.01)
#   robot.qd = np.linalg.pinv(robot.jacobe(q)) @ v
# Any Jacobian will do, in any frame: that of the twist. No model, and no MuJoCo, is loaded for this.
law = rmrc.Law(6, 6, CONTROL, period=0.002)
J, v = controller.arm.jacobian(q), np.array([0.05, 0.0, -0.02, 0.0, 0.1, 0.0])
rates = law.step(J, v).qdot_cmd
print(f"as with Robotics Toolbox: v is met within {np.abs(J @ rates - v).max():.1e}; {law.command.status!r}")
