"""An actuator that is added to a model, without the model's defaults for actuators."""

from functools import cache

import mujoco
import numpy as np

# The identity and target of an actuator: its own, whatever the defaults.
_OWN = {"classname", "compiler", "id", "info", "name", "plugin", "signature", "target", "trntype", "userdata"}


def reset(actuator: mujoco.MjsActuator) -> None:
    """Give an actuator MuJoCo's own default values in all fields except its name and transmission."""
    for name, value in _pristine().items():
        setattr(actuator, name, value)
    actuator.userdata = []
    actuator.plugin.active = False


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
