"""The plant of a scenario: what turns commanded rates into motion."""

from typing import Literal

from rmrc.scenario import values as types
from rmrc.scenario.choices import PLANTS
from rmrc.scenario.values import Section, key

# MuJoCo's longest step where neither the scenario nor the plant sets another [s].
TIMESTEP = 0.001


class FrictionSection(Section):
    """Joint friction beyond the model's: no actuator compensates for it.

    Attributes:
        coulomb: dry friction added to the model's
        viscous: viscous friction added to the model's damping
    """

    coulomb: types.NotNegativeOrEach = key(0.0, "N·m or N")
    viscous: types.NotNegativeOrEach = key(0.0, "N·m·s/rad or N·s/m")


class ResonanceSection(Section):
    """Resonance: the rates of all joints oscillate about the received commands like a mass on a spring.

    Attributes:
        frequency: natural frequency, not for ideal; null: no resonance
        damping: damping ratio ζ: 0 never decays, 1 does not overshoot
    """

    frequency: types.Positive | None = key(None, "Hz")
    damping: types.NotNegative = key(0.1, "1")


class PlantSection(Section):
    """The plant, which executes the commanded rates.

    Attributes:
        kind: what turns commanded rates into motion
        kv: servo: torque or force per unit rate error; null: inertia at home over the timestep, plus damping
        bandwidth: torque, and motors of model: acceleration per unit rate error; null: 500 or, if less,
            1/control.period
        timestep: MuJoCo's step, of which control.period is a multiple; null: at most 0.001, or
            for model the model's
        gravity_compensation: whether the arm carries its weight, and servo its springs; null: true, or for
            model as in it
        friction_compensation: servo, torque: whether actuators compensate for joint damping and dry friction
        payload: point mass at the site, unknown to the controller; not for ideal
        gravity: gravity along world axes, not for ideal; null: the model's
        wrench: external wrench [f; n] on the site, along world axes
        delay: dead time of commands
        jitter: largest additional dead time, random per command; overtaken commands are dropped
        loss: fraction of commands that never arrive; the last one holds
        lag: time constant with which rates follow commands
        resonance: resonance of the actuators
        backlash: play between actuators and joints, crossed at each reversal; not for ideal
        seed: seed of jitter and losses
        friction: servo, torque, model: joint friction without compensation
        stretch: factor on all lengths of a body, unknown to the controller; multiplies `arm.stretch`
        joint_offset: error of the joint zeros: true position minus the assumed one
    """

    kind: Literal[PLANTS.names] = PLANTS.default  # type: ignore[name-defined]
    kv: types.OneOrEach | None = key(None, "N·m·s/rad or N·s/m")
    bandwidth: types.Positive | None = key(None, "1/s")
    timestep: types.Positive | None = key(None, "s")
    gravity_compensation: types.Switch | None = None
    friction_compensation: types.Switch = True
    payload: types.NotNegative = key(0.0, "kg")
    gravity: types.Point | None = key(None, "m/s²")
    wrench: types.Wrench = key((0.0,) * 6, "N, N·m")
    delay: types.NotNegative = key(0.0, "s")
    jitter: types.NotNegative = key(0.0, "s")
    loss: types.Share = key(0.0, "1")
    lag: types.NotNegativeOrEach = key(0.0, "s")
    resonance: ResonanceSection = ResonanceSection()
    backlash: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    seed: types.Seed = 0
    friction: FrictionSection = FrictionSection()
    stretch: dict[str, types.Positive] = key({}, "1")
    joint_offset: types.AngleOrEach = key(0.0, "rad or m")

    @property
    def is_compensated(self) -> bool:
        """Whether to switch on gravity compensation of the arm's bodies; if not, the model decides."""
        wanted = self.gravity_compensation
        return not PLANTS[self.kind].own if wanted is None else wanted
