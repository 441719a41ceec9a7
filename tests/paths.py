"""What a path is made of, tick by tick."""

import numpy as np


def pieces(reference):
    """Return the index of the piece at each tick, (T,); the rest at the end belongs to the last one."""
    return np.searchsorted(reference.starts[:-1], reference.time, "right") - 1


def acceleration(reference):
    """Return the time derivative of the twist at each tick, (T, 6)."""
    number = np.searchsorted(reference.starts, reference.time, "right") - 1
    ages, rows = reference.time - reference.starts[number], np.zeros((len(number), 6))
    for i in np.unique(number):
        rows[number == i] = reference.pieces[i].at(ages[number == i])[:, 13:]
    return rows
