"""Stages between law and plant, in order: a tick applies those that its world uses."""

from collections.abc import Callable

from rmrc.law.jit import chain
from rmrc.plants.backlash import Backlash
from rmrc.plants.encoders import Encoders
from rmrc.plants.integral import Integral
from rmrc.plants.response import Lag, Resonance
from rmrc.plants.stage import Stage
from rmrc.plants.transport import Transport

# In the order of their application.
STAGES: tuple[type[Stage], ...] = (Encoders, Integral, Transport, Lag, Resonance, Backlash)


def _chain(slot: str) -> Callable[..., bool]:
    used = {f"world.{stage.uses}": stage.change for stage in STAGES if stage.slot == slot}
    return chain(slot, "world, out, ticks, w, t", used, "world, out, ticks[w], t")


sensed, sent = _chain("sensed"), _chain("sent")
