"""An MJCF or URDF file as an arm: a chain of joints to a site, every name resolved once.

Any model works: the frame of its hand is found if none is named, the chain is found from the frame, and the
limits are read from joints and actuators. `Arm.adapted` gives each joint of the chain the one actuator that a
plant needs. Nothing here steps the physics.
"""

from rmrc.arm.actuators import DriveKind
from rmrc.arm.arm import Arm, Positions
from rmrc.arm.loading import files, is_model, load, load_asked, load_model
from rmrc.arm.wiring import Wiring

__all__ = [
    "Arm", "DriveKind", "Positions", "Wiring", "files", "is_model", "load", "load_asked", "load_model",
]  # fmt: skip
