"""What a path is made of, tick by tick."""

import numpy as np


def pieces(reference):
    """Return the index of the piece at each tick, (T,); the rest at the end belongs to the last one."""
    return np.searchsorted(reference.starts[:-1], reference.time, "right") - 1


def acceleration(reference):
    """Return the time derivative of the twist at each tick, (T, 6)."""
    number = np.searchsorted(reference.starts, reference.time, "right") - 1
    ages = reference.time - reference.starts[number]
    return np.array(
        [reference.pieces[i].at(np.array([age]))[0, 13:] for i, age in zip(number, ages, strict=True)]
    )
