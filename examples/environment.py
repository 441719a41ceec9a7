"""An environment in the form of Gymnasium, whose actions are velocities of the hand: `reset` and `step`.

Give it `gymnasium.Env` for a base, and spaces, if you have that package. The law keeps the limits of the
joints and passes singularities, so that a policy learns in Cartesian space, and the commands stay within the
limits of the arm.
"""

from typing import Any

import mujoco
import numpy as np

import rmrc


class Reach:
    """The hand of a UR5e moves to a point; an action is its velocity [m/s], along world axes."""

    def __init__(self, period: float = 0.02) -> None:
        """Load model and law once."""
        law = {"feedback": 0.0, "limits": {"rate": 1.5, "acceleration": 10.0}}
        self.law = rmrc.Controller("ur5e", control=law, period=period, task={"axes": ["x", "y", "z"]})
        self.model = mujoco.MjModel.from_xml_path(str(self.law.arm.path))  # with its own position servos
        self.data = mujoco.MjData(self.model)
        self.steps = round(period / self.model.opt.timestep)
        self.home = self.law.arm.configuration("home")

    def reset(self, seed: int = 0) -> tuple[np.ndarray, dict[str, Any]]:
        """Start near `home`, with a goal nearby; return an observation and nothing else."""
        chance = np.random.default_rng(seed)
        mujoco.mj_resetData(self.model, self.data)
        q = self.home + chance.uniform(-0.1, 0.1, self.home.size)
        self.data.qpos[:] = self.data.ctrl[self.law.actuators] = q
        mujoco.mj_forward(self.model, self.data)
        self.law.reset(q)
        self.goal = self.law.arm.pose(q)[:3] + chance.uniform(-0.15, 0.15, 3)
        return self._seen(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the hand for a period; return observation, reward, ended, cut off, and the law's report."""
        out = self.law.step_data(self.data, twist=np.array([*action, 0.0, 0.0, 0.0]))
        self.data.ctrl[self.law.actuators] = self.law.controls()  # positions for its servos
        mujoco.mj_step(self.model, self.data, self.steps)
        mujoco.mj_fwdPosition(self.model, self.data)
        seen = self._seen()
        distance = float(np.linalg.norm(seen[-3:]))
        return seen, -distance, distance < 0.01, False, {"status": out.status, "limited_by": out.limited_by}

    def _seen(self) -> np.ndarray:
        """Return joint positions and the vector to the goal, (n + 3,)."""
        hand = self.data.site("tool").xpos
        return np.concatenate([self.data.qpos, self.goal - hand])


environment = Reach()
for seed in range(3):
    seen, says = environment.reset(seed)
    first, ended, steps = np.linalg.norm(seen[-3:]), False, 0
    while not ended and steps < 200:  # a policy that goes straight to the goal
        seen, _, ended, _, says = environment.step(np.clip(4.0 * seen[-3:], -0.2, 0.2))
        steps += 1
    print(f"goal {seed}: {1e3 * first:.0f} mm away, reached: {ended}, after {steps} steps; {says}")
