"""A control loop of your own with the rates of `rmrc run`: your MuJoCo loop, and the law once per tick."""

import mujoco
import numpy as np

import rmrc

scenario = rmrc.load("approach_singularity").set({"control.feedback": 40})
prepared = rmrc.prepare(scenario)  # its path, as a pose and a twist at each tick
model = prepared.plant.own_model()  # its arm, with servos; any model that has the arm will do

data = mujoco.MjData(model)
data.qpos[:] = prepared.qpos
mujoco.mj_forward(model, data)
controller = rmrc.Controller(model, control=scenario)
controller.reset(data.qpos)
rates = []
for pose, twist in zip(prepared.reference.pose, prepared.reference.twist, strict=True):
    out = controller.step_data(data, pose=pose, twist=twist)
    data.ctrl[controller.actuators] = out.qdot_cmd
    rates.append(out.qdot_cmd.copy())
    mujoco.mj_step(model, data)
    mujoco.mj_fwdPosition(model, data)  # fresh kinematics for the next tick

run = rmrc.run(scenario)
print(f"{len(rates)} ticks, the bits of `rmrc run`: {np.array_equal(rates, run['qdot_cmd'])}")
print(f"least singular value: {run['sigma'][:, -1].min():.4f}")
