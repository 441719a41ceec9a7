"""A control loop of one's own in MuJoCo, with the law of rmrc for the Jacobian of each tick."""

import mujoco
import numpy as np

import rmrc

model = mujoco.MjModel.from_xml_path(str(rmrc.load("full_reach").arm.model))
data = mujoco.MjData(model)
tip = model.site("tip").id
data.qpos[:] = np.deg2rad([60, -120])
mujoco.mj_forward(model, data)

# The tip is to go out along x for 5 s, from 1 m to 1.95 m, where the arm is nearly stretched.
start, velocity, feedback = data.site_xpos[tip].copy(), np.array([0.19, 0.0]), 20.0
jacobian, fastest, worst = np.zeros((3, model.nv)), 0.0, 0.0
ticks = round(5.0 / model.opt.timestep)
for tick in range(ticks):
    mujoco.mj_jacSite(model, data, jacobian, None, tip)
    error = start[:2] + velocity * tick * model.opt.timestep - data.site_xpos[tip, :2]
    twist = velocity + feedback * error
    data.ctrl[:] = rmrc.resolve_rates(
        jacobian[:2], twist, "damped", schedule="smallest_singular_value", damping_below=0.3
    )
    mujoco.mj_step(model, data)
    fastest, worst = max(fastest, np.abs(data.qvel).max()), max(worst, float(np.hypot(*error)))

print(f"tip at {data.site_xpos[tip, 0]:.3f} m of 2 m, elbow at {np.rad2deg(data.qpos[1]):.1f} deg")
print(f"at most {fastest:.2f} rad/s and {1e3 * worst:.1f} mm beside the path")
