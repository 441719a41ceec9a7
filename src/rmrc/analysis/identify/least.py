"""Least squares of long columns, without threads, which cost more than they save here."""

from collections.abc import Callable
from typing import Any

import numpy as np

from rmrc.analysis.identify.response import Array

# Most steps of a fit, and the share of a period for its differences.
STEPS, SMALL = 30, 1e-6


def least(residual: Callable[[Array], Array], values: Array, lower: Array) -> tuple[Array, Array, Array]:
    """Return the values, (p,), with the least sum of squares, the residual, and its derivatives, (N, p).

    It is the method of Levenberg and Marquardt, with differences in place of derivatives.
    """
    here, damping = residual(values), 1e-4
    for _ in range(STEPS):
        slopes = np.column_stack(
            [(residual(values + SMALL * axis) - here) / SMALL for axis in np.eye(len(values))]
        )
        gram, gain, before = dot(slopes, slopes), dot(slopes, here), dot(here, here)
        while damping < 1e6:
            step = -np.linalg.lstsq(gram + damping * np.diag(np.diag(gram)), gain, rcond=1e-15)[0]
            if (low := values + step < lower).any():  # the others' best steps, with these at their bounds
                step[low], free = (lower - values)[low], ~low
                step[free] = -np.linalg.lstsq(
                    gram[np.ix_(free, free)], (gain + gram @ np.where(low, step, 0.0))[free], rcond=1e-15
                )[0]
            there = residual(values + step)
            if (after := dot(there, there)) < before:
                break
            damping *= 10.0
        else:
            break
        values, here, damping = values + step, there, 0.1 * damping
        if before - after < 1e-9 * before:
            break
    return values, here, slopes


def dot(a: Array, b: Array) -> Any:
    """Return the product of columns, (N,) or (N, k): without threads, which cost more than they save here."""
    letters = ["i" if each.ndim == 1 else f"i{letter}" for each, letter in ((a, "j"), (b, "k"))]
    return np.einsum(",".join(letters), a, b)


def times(columns: Array, weights: Array) -> Array:
    """Return the weighted sum of columns, (N,), as `dot` does."""
    return np.asarray(np.einsum("ij,j->i", columns, weights))


def solved(columns: Array, values: Array) -> Array:
    """Return the least-squares weights of columns, by scaled normal equations."""
    gram = dot(columns, columns)
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    gram = gram / scale / scale[:, None]
    return np.asarray(np.linalg.lstsq(gram, dot(columns, values) / scale, rcond=1e-13)[0] / scale)


def without(values: Array, columns: Array) -> Array:
    """Return values without what columns explain."""
    return np.asarray(values - times(columns, solved(columns, values)))
