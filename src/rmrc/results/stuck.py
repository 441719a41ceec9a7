"""The standstill of an arm that should have moved, in a line."""

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.support.invocation import command

# A joint this near to its limit counts as being there [rad, m]: servos come to rest within a tenth of it.
AT_LIMIT = 1e-3


def longest_stretch(run: Run) -> tuple[int, int] | None:
    """Return the first tick and one past the last of the longest time that a run was stuck, or None."""
    is_stuck = (run["status"].astype(np.int64) & Status.STUCK) != 0
    edges = np.flatnonzero(np.diff(is_stuck, prepend=False, append=False)).reshape(-1, 2)
    if not len(edges):
        return None
    first, end = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    return int(first), int(end)


def told(run: Run, arm: Arm) -> str | None:
    """Return when an arm was stuck longest, the cause and a remedy, in one line; or None.

    Args:
        run: The run so far.
        arm: The arm that ran.
    """
    stretch = longest_stretch(run)
    if stretch is None:
        return None
    first, end = stretch
    total = np.count_nonzero(run["status"].astype(np.int64) & Status.STUCK)
    q, status = run["q"][end - 1], Status(int(run["status"][end - 1]))
    at = _at_limits(q, arm)
    others = ", ".join(one.name or "" for one in status if one != Status.STUCK)
    if at:
        why = f"with {' and '.join(at)}"
        cure = "start in another posture (arm.start) or move the path"
    else:
        why = f"with {others or 'no other status'} and no joint at a limit"
        cure = (
            "move the path into reach, start in another posture (arm.start), or change control.inverse.method"
        )
    positions = ",".join(f"{position:.4g}" for position in q)
    return (
        f"{run.name} was STUCK for {(end - first) * run.period:.3g} s from {run['time'][first]:.3g} s on, "
        f"of {total * run.period:.3g} s in all, {why}; {cure}: "
        f"`{command('inspect', arm.path, f'--q={positions}')}` shows the lost directions there"
    )


def _at_limits(q: NDArray[np.float64], arm: Arm) -> list[str]:
    words = []
    for j, (lower, upper) in enumerate(arm.position_limit):
        for side, bound, room in (("lower", lower, q[j] - lower), ("upper", upper, upper - q[j])):
            if room <= AT_LIMIT:
                words.append(f'joint "{arm.joints[j]}" at its {side} limit of {bound:.4g} {arm.units[j]}')
    return words
