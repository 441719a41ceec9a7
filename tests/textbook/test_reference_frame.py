"""One Jacobian at other points and in other frames: against DH at the new point, and invariants."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.support.spatial import exp_rotation, quat_to_matrix, skew
from rmrc.textbook.reference_frame import rotate_jacobian, shift_jacobian
from rmrc.textbook.stanford import stanford_chain, stanford_jacobian

# A dozen products of order one.
ROUNDING = 1e-12

numbers = st.floats(-2.0, 2.0)
vectors = arrays(float, 3, elements=numbers)
six = arrays(float, 6, elements=numbers)


@given(six, vectors)
def test_the_stanford_arm_s_wrist_gives_its_tool(q, tool):
    """The tool is known in frame {6}; J_W is the printed one, J_E that of the DH table."""
    R = stanford_chain().frames(q)[6, :3, :3]
    at_tool = shift_jacobian(stanford_jacobian(q), R @ tool)
    assert_allclose(at_tool, stanford_chain().jacobian(q, point=tool), atol=ROUNDING)
    # and as it is printed, with ⁰P̂ = R ⁿP̂ Rᵀ
    block = np.block([[np.eye(3), -R @ skew(tool) @ R.T], [np.zeros((3, 3)), np.eye(3)]])
    assert_allclose(block @ stanford_jacobian(q), at_tool, atol=ROUNDING)


def test_an_offset_that_is_not_rotated_is_seen():
    """Negative control of the test above."""
    q, tool = np.array([0.3, 1.0, 0.6, 0.7, 0.9, 0.2]), np.array([0.0, 0.1, 0.3])
    wrong = shift_jacobian(stanford_jacobian(q), tool)
    with pytest.raises(AssertionError):
        assert_allclose(wrong, stanford_chain().jacobian(q, point=tool), atol=1e-3)


@example(np.array([1e-310, -2.0, 1e-310, 1e-310, 5e-324, 5e-324]), np.ones(3), np.ones(3))
@given(six, vectors, vectors)
def test_neither_frame_nor_point_change_the_determinant_and_frames_not_even_sigma(q, turn, p):
    J, R = stanford_jacobian(q), quat_to_matrix(exp_rotation(turn))
    turned = rotate_jacobian(J, R)
    determinant = np.linalg.det(J)
    assert_allclose(np.linalg.det(turned), determinant, atol=1e-10)  # of entries up to 2: 2⁶ products
    assert_allclose(np.linalg.det(shift_jacobian(turned, p)), determinant, atol=1e-8)  # and up to 6
    sigma = np.linalg.svd(J, compute_uv=False)
    assert_allclose(np.linalg.svd(turned, compute_uv=False), sigma, atol=ROUNDING)
    assert_allclose(rotate_jacobian(J[3:], R), turned[3:], atol=ROUNDING)
