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
        coulomb: dry friction added to the model's, one for all joints or one per joint
        viscous: viscous friction coefficient added to the model's damping, one for all joints or one per
            joint
    """

    coulomb: types.NotNegativeOrEach = key(0.0, "N·m or N")
    viscous: types.NotNegativeOrEach = key(0.0, "N·m·s/rad or N·s/m")


class ResonanceSection(Section):
    """Resonance: the rates of all joints oscillate about the received commands like a mass on a spring.

    Attributes:
        frequency: servo, torque, model: undamped natural frequency; null: no resonance
        damping: damping ratio ζ: 0 never decays, 1 does not overshoot
    """

    frequency: types.Positive | None = key(None, "Hz")
    damping: types.NotNegative = key(0.1, "1")


class PlantSection(Section):
    """The plant, which executes the commanded rates.

    Attributes:
        kind: exact integration of the rates, joint-rate servos, computed torques, or the model's own
            actuators
        kv: servo: torque or force per unit rate error, one for all joints or one per joint; null: each
            joint's inertia at home divided by the timestep, plus its damping
        bandwidth: torque, and motors of the model: acceleration per unit rate error; null: 500, or
            1/control.period if that is less, as a larger one is unstable
        timestep: servo, torque, model: MuJoCo's time step; control.period is an integer multiple of it; null:
            0.001, for model the model's step, or the next shorter one that divides control.period
        gravity_compensation: servo, torque, model: whether the arm compensates for gravity, and the actuators
            of servo for springs of joints; null: true, or for model as in the model
        friction_compensation: servo, torque: whether the actuators compensate for joint damping and dry
            friction at the commanded rates
        payload: servo, torque, model: point mass at the site, unknown to the controller and to the gravity
            compensation
        gravity: servo, torque, model: gravity along world axes; null: the model's own
        wrench: external wrench [f; n] on the site, along world axes
        delay: dead time of a command on its way to the plant
        jitter: largest additional dead time, drawn uniformly for each command; a command that arrives after a
            later one is dropped
        loss: fraction of commands that never arrive; the plant holds the last received one
        lag: time constant with which the rates follow the received commands, one for all joints or one per
            joint
        resonance: resonance of the actuators
        backlash: servo, torque, model: backlash between actuators and joints, one for all or one per joint:
            after a reversal an actuator moves no joint until it has crossed the gap
        seed: seed of the random jitter and losses
        friction: servo, torque, model: joint friction without compensation
        stretch: factor on all lengths of a body, by body name, unknown to the controller, as on an
            uncalibrated arm; multiplies `arm.stretch`, which the controller knows
        joint_offset: error of the joint zeros: true position minus the position assumed by the controller,
            one for all joints or one per joint
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
