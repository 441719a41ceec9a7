"""Actuator torques and link loads of an arm at rest under a wrench, by statics and by the physics."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.statics.balance import Balance, Costs, Elsewhere, balance, elsewhere, wrench_costs
from rmrc.analysis.statics.hold import HoldResult, hold_wrench
from rmrc.analysis.subject import Model, Packages, numbers, subject
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import rotate

FRAMES = ("world", "site")
WRENCH = ("fx", "fy", "fz", "nx", "ny", "nz")


@brief
@dataclass(frozen=True, eq=False)
class Statics:
    """The result of `statics`.

    Attributes:
        balance: Actuator torques and link loads.
        costs: Costs of wrenches, forces alone and moments alone for the actuators.
        length: Characteristic length, which makes meters and radians comparable in `costs` [m].
        elsewhere: The wrench at another site; None if no other was named.
        held: The result of holding the wrench in the physics; None if that was not requested.
    """

    balance: Balance
    costs: tuple[Costs, ...]
    length: float
    elsewhere: Elsewhere | None
    held: HoldResult | None


def statics(
    model: Model,
    wrench: ArrayLike,
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    frame: str = "world",
    at: str | None = None,
    gravity: bool = False,
    hold: float | None = None,
    length: float | None = None,
    on_ticks: Callable[[int], None] | None = None,
) -> Statics:
    """Return actuator torques and link loads under a wrench on an arm; the function behind `rmrc statics`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        wrench: The wrench on the arm at the site: force and moment [f; n], (6,) [N, N·m], or a force alone,
            (3,) [N].
        q: Joint positions, (n,) [rad or m]; None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        frame: Frame of the wrench: `world` or `site`.
        at: Another site of the same body, at which to report the wrench as well.
        gravity: Whether the actuators support the arm's weight; otherwise it is compensated.
        hold: Longest duration of holding the wrench in the physics, until all is at rest [s]; None: no
            holding.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        on_ticks: Called with the number of ticks of each block that was held.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: Any of the others does not fit the arm, or it cannot be held.
        DivergenceError: The physics broke in its first step.

    Example:
        >>> found = statics("models/planar_2link.xml", [0, -1, 0], [0, np.pi / 3])
        >>> found.balance.equilibrium.round(9).tolist(), found.balance.exceeded
        ([1.5, 0.5], ())
        >>> found.costs[1].directions[0].cost.value  # a force along z
        'nothing, anywhere'
    """
    asked = subject(model, q, keyframe, site, length=length, body=body, packages=packages)
    asked.arm.require_open()
    force_alone = np.shape(wrench) == (3,)
    acts = numbers("wrench", np.append(wrench, np.zeros(3)) if force_alone else wrench, WRENCH)
    if frame not in FRAMES:
        raise QuestionError(f'frame: no frame "{frame}"; choose from {" ".join(FRAMES)}')
    if frame == "site":
        acts = rotate(asked.arm.pose(asked.q)[3:], acts.reshape(2, 3)).ravel()
    balanced = balance(asked.arm, asked.q, acts, gravity)
    return Statics(
        balance=balanced,
        costs=wrench_costs(asked.arm, asked.q, asked.length),
        length=asked.arm.proportions.length(range(6)) if asked.length is None else asked.length,
        elsewhere=None if at is None else elsewhere(asked.arm, asked.q, acts, at),
        held=None if hold is None else hold_wrench(balanced, hold, on_ticks),
    )
