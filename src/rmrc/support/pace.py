"""How much is done between two looks at whether to stop: as much as takes a moment, learned as it goes."""

import math

# Seconds between two looks: a stop is answered within half a second, with time to close what is open.
LOOK = 0.05
# Steps of worlds between two looks at most, however fast they seem to be: about as long for a small arm.
MOST = 10_000
# What was quick may be so by chance, or because it had not begun: it grows by this factor at most.
_GROWTH = 8


class Pace:
    """How many steps of some worlds fit between two looks; one at first.

    It decides when one looks, and nothing else: results do not depend on it.

    Attributes:
        steps: So many may be done before the next look, 1 at least.
    """

    def __init__(self, worlds: int) -> None:
        """Begin with one step.

        Args:
            worlds: That are stepped together.
        """
        self._most = max(1, MOST // worlds)
        self.steps = 1

    def took(self, seconds: float, steps: int) -> None:
        """Learn how long some steps took.

        Args:
            seconds: Since the last look.
            steps: That were done since, 0 or more.
        """
        fitting = steps * LOOK / seconds if seconds > 0.0 else math.inf
        self.steps = max(1, int(min(fitting, _GROWTH * max(steps, 1), self._most)))
