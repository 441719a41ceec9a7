"""What an actuator is, and one that is added to a model without what its defaults say of actuators."""

from functools import cache

import mujoco
import numpy as np

# What an actuator is and acts on: its own, whatever the defaults.
_OWN = {"classname", "compiler", "id", "info", "name", "plugin", "signature", "target", "trntype", "userdata"}


def reset(actuator: mujoco.MjsActuator) -> None:
    """Give an actuator the values that MuJoCo has by itself, in all fields but its name and transmission."""
    for name, value in _pristine().items():
        setattr(actuator, name, value)
    actuator.userdata = []
    actuator.plugin.active = False


def kind(model: mujoco.MjModel, i: int) -> str:
    """Return what drives a joint: `motor`, `velocity`, `position`, or `general` for all others.

    It is what a constant gain and an affine bias make of the control, whatever element wrote them.
    """
    gain, bias = int(model.actuator_gaintype[i]), int(model.actuator_biastype[i])
    if gain != mujoco.mjtGain.mjGAIN_FIXED or model.actuator_dyntype[i] != mujoco.mjtDyn.mjDYN_NONE:
        return "general"
    if bias == mujoco.mjtBias.mjBIAS_NONE:
        return "motor"
    offset, stiffness, damping = model.actuator_biasprm[i, :3]
    if bias != mujoco.mjtBias.mjBIAS_AFFINE or offset:
        return "general"
    strength = model.actuator_gainprm[i, 0]
    if stiffness == 0.0 and damping == -strength:
        return "velocity"
    return "position" if stiffness == -strength else "general"


@cache
def _pristine() -> dict[str, object]:
    """Return the fields of an actuator that is added to an empty model, by name."""
    actuator = mujoco.MjSpec().add_actuator()
    fields = {name: getattr(actuator, name) for name in dir(actuator) if not name.startswith(("_", "set_"))}
    return {
        name: np.array(value) if isinstance(value, np.ndarray) else value
        for name, value in fields.items()
        if name not in _OWN and not callable(value)
    }
