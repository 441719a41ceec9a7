"""What a law believes of an arm, and the arm that it does not know, by numpy: nothing of this is compiled.

All that the encoders ever saw is kept in lists; noise is drawn by numpy, tick by tick; true lengths and friction are
written into a copy of MuJoCo's model, by MuJoCo's documentation of its fields.
"""

import copy

import mujoco
import numpy as np


class Sensing:
    """Encoders, and the state that the law takes: called once a tick."""

    def __init__(self, scenario, n):
        self.encoder, control, plant = scenario.arm.encoder, scenario.control, scenario.plant
        self.n, self.period = n, control.period
        self.chance = np.random.default_rng([self.encoder.seed, 0])
        self.integrates, self.time_constant = control.state == "integrated", control.rate_filter
        drawn = np.random.default_rng(self.encoder.seed).normal(
            self.encoder.offset, self.encoder.deviation, n
        )
        self.offset = drawn - plant.joint_offset
        self.q, self.read, self.filtered, self.integral = [], [], np.zeros(n), None
        self.has_tachometer = not (
            np.any(self.encoder.noise) or np.any(self.encoder.resolution) or self.encoder.delay
        )

    def __call__(self, q, qdot, last):
        """Return q and rates, (n,) each, as the law takes them where the arm is at q, after the last command."""
        self.q.append(q)
        tick, age = len(self.q) - 1, self.encoder.delay / self.period
        when = max(0.0, tick - age)
        seen = np.array(
            [np.interp(when, range(len(self.q)), [one[j] for one in self.q]) for j in range(self.n)]
        )
        seen = seen if age else q
        seen = seen + self.offset
        if np.any(self.encoder.noise):
            seen = seen + self.encoder.noise * self.chance.standard_normal(self.n)
        step = np.broadcast_to(self.encoder.resolution, self.n)
        seen = np.array([s * np.floor(x / s + 0.5) if s else x for x, s in zip(seen, step, strict=True)])
        self.read.append(seen)
        rate = qdot
        if not self.has_tachometer:
            quotient = (self.read[-1] - self.read[-2]) / self.period if tick else np.zeros(self.n)
            share = 1 - np.exp(-self.period / self.time_constant) if self.time_constant else 1.0
            rate = self.filtered = self.filtered + share * (quotient - self.filtered)
        if self.integrates:
            seen = self.integral = seen if self.integral is None else self.integral + self.period * last
        return seen, rate


def true_model(model, plant, dofs):
    """Return a model with the lengths and the friction that a plant has and nobody knows."""
    true = copy.copy(model)
    for name, f in plant.stretch.items():
        body = model.body(name).id
        true.body_pos[model.body_parentid == body] *= f
        true.body_ipos[body] *= f
        true.body_inertia[body] *= f**2
        for positions, of in (
            (true.jnt_pos, model.jnt_bodyid), (true.site_pos, model.site_bodyid), (true.geom_pos, model.geom_bodyid),
        ):  # fmt: skip
            positions[of == body] *= f
    true.dof_frictionloss[dofs] += plant.friction.coulomb
    true.dof_damping[dofs] += plant.friction.viscous
    if plant.stretch:
        mujoco.mj_setConst(true, mujoco.MjData(true))
    return true
