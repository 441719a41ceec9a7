"""Central differences, the derivative that knows no formula, and numbers at which it is a number."""

import numpy as np
from hypothesis import strategies as st

STEP = 1e-5

# Truncation: (1e-5)²/6 times a third derivative of at most some 10 m; rounding: 1e-16 m / 1e-5.
DIFFERENCE = 1e-8


def rounded(low, high):
    """Floats to nine digits: none so small that LAPACK divides by it and finds it to be 0."""
    return st.floats(low, high).map(lambda x: round(x, 9))


def slopes(f, q):
    """Return the derivative of f at q, (m, n), for an f that takes rows of joint positions."""
    steps = STEP * np.eye(len(q))
    return ((f(q + steps) - f(q - steps)) / (2 * STEP)).T
