"""Of every function: leading axes are cases, and what has no answer is refused by its name."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.support.errors import ModelError
from rmrc.textbook import chains, inverse, motion, planar, singularity
from rmrc.textbook import two_link as two
from rmrc.textbook import two_link as workspace
from rmrc.textbook.chains import DHChain

CHAIN = DHChain(
    ((0.1, 0.2, 0.3, 0.4), (0.5, 0.6, 0.7, 0.8), (0.2, 0.1, 0, 0)), ("revolute", "prismatic", "revolute")
)
PITCH, LINK = [0.0, 0.2, np.inf], np.eye(4)
HINGES = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 5.0]])
# A function, and the shapes of its arguments for one case.
CASES = {
    "jacobian": (lambda q: CHAIN.jacobian(q, 2, (0.1, 0.2, 0.3)), [(3,)]),
    "velocity ellipsoid": (lambda J: singularity.velocity_ellipsoid(J).half_axes, [(2, 3)]),
    "analytic": (motion.analytic_jacobian, [(6, 3), (3,)]),
    "platform": (lambda pose: planar.platform_inverse_jacobian(HINGES, HINGES / 4, pose), [(3,)]),
    "propagation": (lambda links, tip: chains.jacobian_by_propagation(links, PITCH, tip), [(3, 4, 4), (4, 4)]),
    "right inverse": (inverse.weighted_right_inverse, [(2, 3)]),
    "resolved": (inverse.resolved_rates, [(2, 3), (2,), (3,)]),
    "torques": (chains.joint_torques, [(6, 3), (6,)]),
    "postures": (two.two_link_postures, [(2,), (2,)]),
    "rates": (two.two_link_rates, [(2,), (2,)]),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_leading_axes_are_cases(name):
    function, shapes = CASES[name]
    rng = np.random.default_rng(2)
    arguments = [
        rng.uniform(0.3, 1.2, ((5, 1) if i % 2 == 0 else (4,)) + shape) for i, shape in enumerate(shapes)
    ]
    both = function(*arguments)
    alone = function(*(each[3, 0] if i % 2 == 0 else each[2] for i, each in enumerate(arguments)))
    assert_allclose(both[3, 2 if len(shapes) > 1 else 0], alone, atol=1e-12, rtol=1e-12)


ROW = ((0, 0, 0, 0),)


@pytest.mark.parametrize(
    ("call", "error", "piece"),
    [
        (lambda: DHChain(ROW, ("hinge",)), ModelError, '"hinge"'),
        (lambda: chains.jacobian_by_propagation([LINK] * 2, [0, 0, 0]), ModelError, "2 joints but pitches"),
        (lambda: singularity.minors(np.ones((2, 4)), 3), ModelError, "1 to 2 .* got 3"),
        (lambda: singularity.ellipsoid_points(singularity.velocity_ellipsoid(np.ones((4, 5)))), ModelError, "2 or 3"),
        (lambda: inverse.weighted_right_inverse([[1, 2]], np.diag([1, 0])), ModelError, "positive definite"),
        (lambda: motion.analytic_jacobian(np.eye(6), [0.1, np.pi, 0.2]), np.linalg.LinAlgError, "not the arm"),
        (lambda: motion.instantaneous_axis([0.0, 0.0, 0.0]), ValueError, "zero"),
        (lambda: workspace.two_link_boundary([1, 1], [[0, 1], [2, 1]]), ModelError, "q2 must be rising"),
    ],
)  # fmt: skip
def test_what_has_no_answer_is_refused(call, error, piece):
    with pytest.raises(error, match=piece):
        call()
