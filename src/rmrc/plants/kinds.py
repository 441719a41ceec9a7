"""Plants by name: each that is declared has a class, of which the tick takes the compiled functions."""

from rmrc.law.jit import chain
from rmrc.plants.ideal import Ideal
from rmrc.plants.model import Model
from rmrc.plants.plant import Plant
from rmrc.plants.servo import Servo
from rmrc.plants.torque import Torque
from rmrc.scenario.choices import PLANTS

CLASSES: tuple[type[Plant], ...] = (Ideal, Servo, Torque, Model)

KINDS = {kind.name: kind for kind in CLASSES}
if KINDS.keys() != set(PLANTS.names):
    raise ImportError(f"plants are declared as {PLANTS.names}, and done as {tuple(KINDS)}")

_CODES = {f"world.plant == {code}": KINDS[name] for code, name in enumerate(PLANTS.names)}
sense = chain("sense", "world, out, state, force", {is_its: kind.sense for is_its, kind in _CODES.items()})
obey = chain("obey", "world, out, state", {is_its: kind.obey for is_its, kind in _CODES.items()})
