"""Plants by name: each declared plant has a class, whose compiled functions the tick calls."""

from rmrc.law.jit import apart_by_code
from rmrc.plants.ideal import Ideal
from rmrc.plants.model import Model
from rmrc.plants.plant import Plant
from rmrc.plants.servo import Servo
from rmrc.plants.torque import Torque
from rmrc.scenario.choices import PLANTS

CLASSES: tuple[type[Plant], ...] = (Ideal, Servo, Torque, Model)

KINDS = {kind.name: kind for kind in CLASSES}
if KINDS.keys() != set(PLANTS.names):
    raise ImportError(f"plants are declared as {PLANTS.names}, and implemented as {tuple(KINDS)}")

_KINDS = tuple(KINDS[name] for name in PLANTS.names)
sense = apart_by_code("call_sense", "plant", {code: kind.sense for code, kind in enumerate(_KINDS)})
obey = apart_by_code("call_obey", "plant", {code: kind.obey for code, kind in enumerate(_KINDS)})
