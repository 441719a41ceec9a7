"""Directions and joint motions in words: the impossible motions of an arm, and the joints responsible."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A direction is written with two decimals; components that round to 0.00 are left out.
SAID = 0.005
# Joints that move less than this share of the one that moves most are left out, and the motion is called
# mainly that of the others.
MAIN_SHARE = 0.1
# In a unit-norm joint motion, smaller components are rounding.
STANDS_STILL = 1e-9


def direction(vector: Array) -> str:
    """Return a direction in words.

    Args:
        vector: Vector of any length but 0, (3,).

    >>> direction(np.array([0.0, -2.0, 0.0])), direction(np.array([1.0, 1.0, 0.0]))
    ('-y', '(0.71, 0.71, 0)')
    """
    unit = vector / np.linalg.norm(vector)
    largest = int(np.argmax(np.abs(unit)))
    if (np.abs(np.delete(unit, largest)) < SAID).all():
        return f"{'-' * bool(unit[largest] < 0.0)}{'xyz'[largest]}"
    return f"({', '.join(_short(component) for component in unit)})"


def listed(words: Sequence[str]) -> str:
    """Return words as in a sentence.

    >>> listed(["x"]), listed(["x", "y", "rz"])
    ('x', 'x, y and rz')
    """
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def amount(value: float) -> str:
    """Return two digits, to keep sentences short.

    >>> amount(0.01234), amount(-57.29), amount(1.0)
    ('0.012', '-57', '1')
    """
    return f"{value:.2g}" if abs(value) < 99.5 or abs(value) >= 1e5 else f"{value:.0f}"


def lost(twist: Array, wrench: Array) -> str:
    """Return the impossible motion of an arm at a singularity, and the wrench that costs it nothing there.

    Every motion has f·v + n·ω = 0. Where both f and n count, it cannot turn about n while v = 0, nor move
    along f while ω = 0.

    Args:
        twist: The lost motion, [v; ω] (6,) [m, rad].
        wrench: The wrench with Jᵀ F = 0, likewise, (6,) [N, N·m].

    >>> lost(np.eye(6)[0], np.eye(6)[0])
    'cannot move along x; a force along x needs no torque'
    """
    moves, turns = _parts(twist)
    if moves and turns:
        along, about = direction(wrench[:3]), direction(wrench[3:])
        sizes = f"{_size(wrench[:3])} N to {_size(wrench[3:])} N m"
        cannot = (
            f"turn about {_line(wrench[3:])} in place, nor move along {_line(wrench[:3])} without turning"
        )
        free = f"a force along {along} with a moment about {about}, {sizes}, needs no torque"
        return f"cannot {cannot}; {free}"
    if moves:
        along = direction(twist[:3])
        return f"cannot move along {along}; a force along {along} needs no torque"
    about = direction(twist[3:])
    return f"cannot turn about {about}; a moment about {about} needs no torque"


def nearly_lost(twist: Array, motion: Array, joints: Sequence[str], units: Sequence[str]) -> str:
    """Return the slow motion of an arm, with the joint motion for it.

    Args:
        twist: The effect of the joint motion, [v; ω] (6,) [m, rad].
        motion: Motion of the joints, of norm 1, (n,) [rad or m].
        joints: Their names.
        units: `rad` or `m` of each.
    """
    moves, turns = _parts(twist)
    main = main_joints(motion)
    takes = listed([f"{joints[i]} {amount(motion[i])} {units[i]}" for i in main])
    turning = f"{_size(twist[3:])} rad about {direction(twist[3:])}" if turns else ""
    if not moves:
        does, share = f"turns by only {turning}", np.linalg.norm(twist[3:])
    else:
        moving = f"{_size(twist[:3])} m along {direction(twist[:3])}"
        does, share = f"moves by only {moving}", np.linalg.norm(twist[:3])
        does += f" while turning by {turning}" if turns else ""
    needed = ""
    if not (moves and turns):
        fastest = int(np.argmax(np.abs(motion)))
        rate = f"{amount(float(abs(motion[fastest]) / share))} {units[fastest]}/s of {joints[fastest]}"
        needed = f"; 1 {'m' if moves else 'rad'}/s of it takes {rate}"
    return f"{does} for {_mainly(motion)}{takes}{needed}"


def standing_still(
    motion: Array, twist: Array, task: str, joints: Sequence[str], units: Sequence[str]
) -> str:
    """Return a joint motion that does not move the task, and its other effect.

    Args:
        motion: Motion of the joints, (n,) [rad or m].
        twist: Twist of the site, 0 in the rows of the task, (6,) [m, rad].
        task: The resting rows of the site, in words.
        joints: Names of the joints.
        units: `rad` or `m` of each.
    """
    main = main_joints(motion)
    names = listed([joints[i] for i in main])
    mainly = _mainly(motion)
    verb = {frozenset({"rad"}): "turn", frozenset({"m"}): "slide"}.get(
        frozenset(units[i] for i in main), "move"
    )
    if len(main) == 1:
        does = f"{names} {verb}s alone"
    else:
        how = (
            ""
            if len(main) > 2
            else " against each other"
            if motion[main[0]] * motion[main[1]] < 0
            else " together"
        )
        does = f"{names} {verb}{how}, {_proportion(motion, main, units)},"
    moves, turns = (np.linalg.norm(part) > STANDS_STILL for part in (twist[:3], twist[3:]))
    if not moves and not turns:
        return f"{mainly}{does} without moving the site"
    also = [f"turns about {direction(twist[3:])}"] if turns else []
    also = [f"moves along {direction(twist[:3])}", *also] if moves else also
    return f"{mainly}{does} without moving {task}, which {listed(also)}"


def _parts(twist: Array) -> tuple[bool, bool]:
    """Return whether a twist translates, and whether it rotates, by more than the threshold of words."""
    moves, turns = np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])
    said = SAID * np.hypot(moves, turns)
    return bool(moves > said), bool(turns > said)


def main_joints(motion: Array) -> list[int]:
    """Return the joints that contribute most to a motion."""
    return [int(i) for i in np.flatnonzero(np.abs(motion) >= MAIN_SHARE * np.abs(motion).max())]


def _mainly(motion: Array) -> str:
    """Return `mainly ` if joints that are left out move."""
    rest = np.delete(motion, main_joints(motion))
    return "mainly " if np.abs(rest).max(initial=0.0) >= STANDS_STILL else ""


def _proportion(motion: Array, main: Sequence[int], units: Sequence[str]) -> str:
    first = motion[main[0]]
    mixed = len({units[i] for i in main}) > 1
    return " : ".join(f"{motion[i] / first:.3g}" + f" {units[i]}" * mixed for i in main)


def _line(vector: Array) -> str:
    """Return a direction regardless of its sign: its first large component is positive."""
    size = np.abs(vector)
    first = np.argmax(size >= size.max() * (1.0 - SAID))
    return direction(vector * np.sign(vector[first]))


def _size(part: Array) -> str:
    return amount(float(np.linalg.norm(part)))


def _short(component: float) -> str:
    return "0" if abs(component) < SAID else f"{component:.2f}".rstrip("0").rstrip(".")
