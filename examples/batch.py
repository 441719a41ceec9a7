"""Step 64 arms with one call per period and arrays of all of them, for any loop around the arms."""

import numpy as np

import rmrc

WORLDS, PERIOD = 64, 0.002
controller = rmrc.Controller("fr3", control={"limits": {"rate": 1.0, "acceleration": 5.0}}, period=PERIOD)
arm, chance = controller.arm, np.random.default_rng(0)

# Each has its own start and its own goal: poses are (64, 7), [p, quat w x y z].
home = arm.configuration("home")[arm.wiring.qpos]
q = home + chance.uniform(-0.2, 0.2, (WORLDS, arm.n))
goals = np.array([arm.pose(one) for one in q + chance.uniform(-0.15, 0.15, q.shape)])
controller.reset(q)
for _ in range(2500):
    out = controller.step(q, pose=goals)
    q = q + PERIOD * out.qdot_cmd  # the arms follow their commands exactly

error = np.linalg.norm(out.pose_error, axis=1)
limited = sum("rate" in one for one in out.limited_by)
print(f"{len(q)} arms of {arm.n} joints; rates {out.qdot_cmd.shape}, status {out.status.shape}")
print(f"largest error {error.max():.1e}; {limited} limited by rate at the end")
