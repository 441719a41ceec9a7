"""Of every function: leading axes are cases, and what has no answer is refused by its name."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.support.errors import ModelError
from rmrc.textbook import (
    ellipsoid,
    euler,
    motion,
    parallel,
    propagation,
    redundancy,
    reference_frame,
    screws,
    singularity,
    spherical_wrist,
    statics,
    torus,
)
from rmrc.textbook import two_link as two
from rmrc.textbook import two_link_workspace as workspace
from rmrc.textbook.dh import DHChain

CHAIN = DHChain(
    ((0.1, 0.2, 0.3, 0.4), (0.5, 0.6, 0.7, 0.8), (0.2, 0.1, 0, 0)), ("revolute", "prismatic", "revolute")
)
PITCH, SCREWS, LINK = [0.0, 0.2, np.inf], np.random.default_rng(8).normal(size=(3, 6)), np.eye(4)
HINGES = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 5.0]])
# A function, and the shapes of its arguments for one case.
CASES = {
    "frames": (CHAIN.frames, [(3,)]),
    "jacobian": (lambda q: CHAIN.jacobian(q, 2, (0.1, 0.2, 0.3)), [(3,)]),
    "velocity ellipsoid": (lambda J: ellipsoid.velocity_ellipsoid(J).half_axes, [(2, 3)]),
    "manipulability": (ellipsoid.manipulability, [(2, 3)]),
    "ranks": (lambda J: singularity.rank_by_minors(J) + singularity.rank_by_singular_values(J), [(2, 3)]),
    "Euler": (lambda angles: euler.zyz_angles(euler.zyz_matrix(angles)), [(3,)]),
    "analytic": (euler.analytic_jacobian, [(6, 3), (3,)]),
    "point velocity": (motion.point_velocity, [(3,), (3, 3), (3,), (3,), (3,)]),
    "platform": (lambda pose: parallel.platform_inverse_jacobian(HINGES, HINGES / 4, pose), [(3,)]),
    "propagation": (lambda links, tip: propagation.jacobian_by_propagation(links, PITCH, tip), [(3, 4, 4), (4, 4)]),
    "outward": (lambda links, rates: propagation.outward_velocities(links, PITCH, rates, LINK), [(3, 4, 4), (3,)]),
    "inward": (lambda links, wrench: propagation.inward_wrenches(links, wrench, LINK), [(3, 4, 4), (6,)]),
    "right inverse": (redundancy.weighted_right_inverse, [(2, 3)]),
    "resolved": (redundancy.resolved_rates, [(2, 3), (2,), (3,)]),
    "shifted": (lambda J, p: reference_frame.shift_jacobian(J + 0 * p[..., None, :], p), [(6, 3), (3,)]),
    "exponentials": (lambda q: screws.product_of_exponentials(SCREWS, q, LINK), [(3,)]),
    "geometric": (screws.geometric_from_screws, [(6, 3), (3,)]),
    "torques": (statics.joint_torques, [(6, 3), (6,)]),
    "three rolls": (spherical_wrist.three_roll_jacobian, [(3,)]),
    "tube": (torus.torus_tube, [(3,), (3,)]),
    "in 1": (two.two_link_jacobian_in_frame_1, [(2,), (2,)]),
    "postures": (two.two_link_postures, [(2,), (2,)]),
    "inverse": (two.two_link_jacobian_inverse, [(2,), (2,)]),
    "rates": (two.two_link_rates, [(2,), (2,)]),
    "velocity in 0": (two.two_link_velocity_in_frame_0, [(2,), (2,), (2,)]),
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
ONES = np.ones((2, 6))


@pytest.mark.parametrize(
    ("call", "error", "piece"),
    [
        (lambda: DHChain(ROW, ("revolute", "revolute")), ModelError, "1 rows .* 2 joint kinds"),
        (lambda: DHChain(ROW, ("hinge",)), ModelError, '"hinge"'),
        (lambda: propagation.jacobian_by_propagation([LINK] * 2, [0, 0, 0]), ModelError, "2 joints but pitches"),
        (lambda: propagation.actuator_torques(ONES, [0]), ModelError, "2 joints but pitches"),
        (lambda: singularity.minors(np.ones((2, 4)), 3), ModelError, "1 to 2 .* got 3"),
        (lambda: ellipsoid.ellipsoid_points(ellipsoid.velocity_ellipsoid(np.ones((4, 5)))), ModelError, "2 or 3"),
        (lambda: redundancy.weighted_right_inverse([[1, 2]], np.diag([1, 0])), ModelError, "positive definite"),
        (lambda: redundancy.weighted_left_inverse(np.ones((3, 2))), np.linalg.LinAlgError, "dependent columns"),
        (lambda: redundancy.null_space_projector(np.zeros((1, 2))), np.linalg.LinAlgError, "dependent rows"),
        (lambda: euler.analytic_jacobian(np.eye(6), [0.1, np.pi, 0.2]), np.linalg.LinAlgError, "not the arm"),
        (lambda: motion.instantaneous_axis([0.0, 0.0, 0.0]), ValueError, "zero"),
        (lambda: parallel.platform_inverse_jacobian(HINGES, HINGES, [0, 0, 0]), np.linalg.LinAlgError, "length 0"),
        (lambda: two.two_link_rates([1, 1], [[0.3, 1.0], [0.3, 0.0]]), np.linalg.LinAlgError, "unbounded"),
        (lambda: workspace.two_link_boundary([1, 0]), ModelError, "> 0, got 1 and 0"),
        (lambda: workspace.two_link_boundary([1, 1], [[0, 1], [2, 1]]), ModelError, "q2 must be rising"),
    ],
)  # fmt: skip
def test_what_has_no_answer_is_refused(call, error, piece):
    with pytest.raises(error, match=piece):
        call()
