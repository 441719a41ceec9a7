"""A control loop of one's own: one's own MuJoCo model and data, and the law of rmrc once a tick."""

import mujoco
import numpy as np

import rmrc

# The scenario says which arm and which law; its path gives a pose and a twist at each tick.
prepared = rmrc.prepare(rmrc.load("approach_singularity").set({"control.feedback": 40}))
arm, reference = prepared.arm, prepared.reference

model = mujoco.MjModel.from_xml_path(str(arm.path))
model.actuator_gainprm[:, 0], model.actuator_biasprm[:, 2] = (
    1000.0,
    -1000.0,
)  # stiffer servos than the model's
data = mujoco.MjData(model)
data.qpos[:] = prepared.qpos
mujoco.mj_forward(model, data)

controller = rmrc.Controller(prepared.law, data)  # reads MuJoCo's own kinematics
worst, least, statuses = 0.0, np.inf, set()
for pose, twist in zip(reference.pose, reference.twist, strict=True):
    command = controller.step(data.qpos, data.qvel, pose, twist)
    data.ctrl[:] = command.qdot
    worst, least = max(worst, float(np.hypot(*command.pose_error[:2]))), min(least, float(command.sigma[-1]))
    statuses.add(f"{command.status.name}")
    mujoco.mj_step(model, data)
    mujoco.mj_fwdPosition(model, data)  # fresh kinematics for the next tick

print(f"{reference.ticks} ticks, at most {1e3 * worst:.2f} mm beside the path")
print(f"least singular value: {least:.4f}; {', '.join(sorted(statuses))}")
