"""Why the actuator torques differ from statics: other parts carry some of the load; remedies."""

import numpy as np

from rmrc.analysis.statics.hold import LAST, HoldResult
from rmrc.arm.inventory import contacts
from rmrc.show.sheets import number

# A joint beside the arm that is faster moves [rad/s or m/s]; slower ones creep below their friction.
MOVES = 1e-6
# A joint this near to the end of its range is at the end [rad or m]: MuJoCo's limits are soft.
NEAR = 1e-3


def borne(held: HoldResult) -> str:
    """Return the other parts that carry some of the wrench, and a remedy; "" if nothing is found."""
    arm, qpos = held.wanted.arm, held.run["qpos"]
    touching = (one.bodies for one in contacts(arm, qpos[-1:]) if one.is_moved)
    q, (lower, upper) = held.run["q"][-1], arm.position_limit.T
    near = NEAR + arm.model.jnt_margin[arm.wiring.joint]
    ended = np.flatnonzero((q < lower + near) | (q > upper - near))
    bears = [f"{arm.joints[j]} is at the end of the range" for j in ended]
    bears += [f"{one} touches {other}" for one, other in touching][:1]
    said = []
    if bears:
        said.append(
            f"{' and '.join(bears)}, which carries part of the load: give other positions by --q "
            "or --keyframe"
        )
    if not said and (moves := _moves(held)):
        said.append(f"{moves} still moves apart from the arm: hold it for longer")
    return "".join(f"; {one}" for one in said)


def _moves(held: HoldResult) -> str:
    """Return the joint beside the arm that moved most in the last tenth of a second, and how fast."""
    model, others = held.wanted.arm.model, held.wanted.arm.others.addresses
    last = held.run["qpos"][-round(LAST / held.run.period) :, others]
    rates = np.ptp(last, axis=0) / LAST
    if not len(rates) or rates.max() < MOVES:
        return ""
    joint = int(np.flatnonzero(model.jnt_qposadr <= others[np.argmax(rates)])[-1])
    return f'joint "{model.joint(joint).name or joint}" ({number(rates.max())} rad/s or m/s)'
