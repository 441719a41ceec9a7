"""The amount of work between two checks for a stop: as much as takes a moment, learned during the work."""

import math

# Seconds between two checks: a stop takes effect within half a second, with time to close open files.
LOOK = 0.05
# Largest number of steps of worlds between two checks, however fast they seem: as long for a small arm.
MOST = 10_000
# A measured speed may be too high by chance, or from a slow start: the number grows at most by this factor.
_GROWTH = 8


class Pace:
    """The number of steps of some worlds between two checks for a stop; one at first.

    It only decides the times of the checks: results do not depend on it.

    Attributes:
        steps: Number of steps before the next check, at least 1.
    """

    def __init__(self, worlds: int) -> None:
        """Begin with one step.

        Args:
            worlds: Number of worlds that are stepped together.
        """
        self._most = max(1, MOST // worlds)
        self.steps = 1

    def took(self, seconds: float, steps: int) -> None:
        """Learn the duration of some steps.

        Args:
            seconds: Time since the last check.
            steps: Number of steps since then, 0 or more.
        """
        fitting = steps * LOOK / seconds if seconds > 0.0 else math.inf
        self.steps = max(1, int(min(fitting, _GROWTH * max(steps, 1), self._most)))
