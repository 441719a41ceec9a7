"""A loop of one's own about a scenario that is prepared: the law alone, stepped by a test."""

import numpy as np

from rmrc.law.controller import Controller


def controller_of(prepared, **updates):
    """Return the law of a scenario, with other values of its section `control`, where its arm starts."""
    control = prepared.scenario.control.model_copy(update=updates)
    found = Controller(prepared.arm, control=control, task=prepared.task, actuators=False)
    found.reset(prepared.qpos[prepared.arm.wiring.qpos] - np.asarray(prepared.scenario.plant.joint_offset))
    return found
