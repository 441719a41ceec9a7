"""What a user may ask of a search, with its defaults."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Origin, Problem

Only: TypeAlias = Sequence[str] | Mapping[str, Iterable[str | float]]
"""Values by key, or a text `KEY=V1,V2,...` for each key."""
Property: TypeAlias = str | float | Sequence[float] | None
"""A property of a robot: a number, the smallest and the largest, a text such as `6ms..12ms`, or nothing."""

# The factor on its feedback that a recommended setting must tolerate, unless the loop is ideal.
GAIN_MARGIN = 2.0


@dataclass(frozen=True)
class Options:
    """Options of `rmrc tune` and `rmrc.tune`.

    Attributes:
        only: Values to which keys are restricted, such as `{"control.inverse.method": ["damped",
            "filtered"]}`.
        perturbed: Number of perturbed scenarios; the worst of all counts.
        start: Perturbation of the joints' start, to either side [rad]; slides: times `task.length` [m].
        offset: Offset of the target along each translational task axis, to either side [m].
        payload: Largest additional payload of a perturbed scenario [kg]; None: 5 % of the mass that the
            joints move, and none with `ideal` or in an ideal plant.
        friction: Largest additional dry friction of each joint in a perturbed scenario [N·m; of slides, N];
            None: as much as accelerates the joint alone by 1 rad/s², with exceptions as for `payload`.
        delay: Dead time of the robot's commands [s]: a number, the smallest and the largest, or a text such
            as `6ms..12ms`. If neither this nor `lag` or `noise` is given, nor in the scenario, a modest robot
            is assumed.
        lag: Time constant with which its actuators follow [s].
        noise: Standard deviation of its encoders' noise [rad]; of slides, times `task.length` [m].
        calibration: Errors of its link lengths and joint zeros, to either side [1, rad].
        ideal: Whether to keep the loop of the scenario, and assume nothing.
        gain_margin: Factor on its feedback that a recommendation tolerates on the slowest of the robots; 1:
            no margin is required; None: 2, or 1 with `ideal`.
        slower: Factor on the duration with the scenario's own setting that another may take.
        runs: Largest number of runs, without the final checks.
        seed: Seed of the perturbed scenarios and of the search.
        threads: Number of threads, one world each; None: one per core.
    """

    only: Only = ()
    perturbed: int = 4
    start: float = math.radians(1.0)
    offset: float = 0.002
    payload: float | None = None
    friction: float | None = None
    delay: Property = None
    lag: Property = None
    noise: Property = None
    calibration: Property = None
    ideal: bool = False
    gain_margin: float | None = None
    slower: float = 1.1
    runs: int = 340
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ScenarioError: Lists those that are too small or not finite.
        """
        least = dict.fromkeys(("perturbed", "seed", "start", "offset", "payload", "friction"), 0)
        least |= {"gain_margin": 1, "slower": 1, "runs": 2 * (self.perturbed + 1), "threads": 1}
        problems = list[Problem]()
        for name, low in least.items():
            value = getattr(self, name)
            if value is not None and not low <= value < math.inf:
                wrong = f"must be finite and >= {low}, got {value:g}"
                problems.append(Problem((), wrong, Origin(f"--{name.replace('_', '-')}")))
        if problems:
            raise ScenarioError(problems)

    @property
    def margin(self) -> float:
        """The gain margin that a recommendation must have on the slowest loop; 1: any."""
        if self.gain_margin is not None:
            return self.gain_margin
        return 1.0 if self.ideal else GAIN_MARGIN
