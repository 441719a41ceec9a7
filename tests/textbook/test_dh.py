"""DH chains against elementary motions, finite differences, and each other's convention."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from rmrc.textbook.dh import DHChain, dh_transform, modified_dh_transform

# Products of a dozen matrices of order one.
ROUNDING = 1e-12
# Central differences of step 1e-5: truncation (1e-5)^2/6 times the third derivative, which is a few
# meters; rounding 1e-16/1e-5.
DIFFERENCE = 1e-8
STEP = 1e-5

angles = st.floats(-3.0, 3.0)
lengths = st.floats(-1.0, 1.0)


def elementary(axis, angle=0.0, distance=0.0):
    """Rotate about and move along one coordinate axis; both conventions are built of this."""
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = np.cos(angle)
    T[j, i] = np.sin(angle)
    T[i, j] = -np.sin(angle)
    T["xyz".index(axis), 3] = distance
    return T


def twist_by_differences(chain, q, frame, point):
    """Columns [v; ω] from the poses at q ± step alone."""
    columns = []
    for i in range(len(chain.kinds)):
        step = np.zeros(len(chain.kinds))
        step[i] = STEP
        ahead, behind = chain.frames(q + step)[frame], chain.frames(q - step)[frame]
        derivative = (ahead - behind) / (2 * STEP)
        spin = derivative[:3, :3] @ chain.frames(q)[frame, :3, :3].T
        columns.append([*(derivative @ [*point, 1.0])[:3], spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.array(columns).T


@st.composite
def chains(draw):
    n = draw(st.integers(1, 6))
    rows = draw(st.lists(st.tuples(angles, lengths, lengths, angles), min_size=n, max_size=n))
    kinds = draw(st.lists(st.sampled_from(["revolute", "prismatic"]), min_size=n, max_size=n))
    chain = DHChain(tuple(rows), tuple(kinds), draw(st.sampled_from(["standard", "modified"])))
    q = np.array(draw(st.lists(lengths, min_size=n, max_size=n)))
    point = np.array(draw(st.lists(lengths, min_size=3, max_size=3)))
    return chain, q, draw(st.integers(0, n)), point


@given(angles, lengths, lengths, angles)
def test_both_transforms_are_their_four_elementary_motions(alpha, a, d, theta):
    about_z, about_x = elementary("z", theta, d), elementary("x", alpha, a)
    assert_allclose(dh_transform(alpha, a, d, theta), about_z @ about_x, atol=ROUNDING)
    assert_allclose(modified_dh_transform(alpha, a, d, theta), about_x @ about_z, atol=ROUNDING)


@given(chains())
def test_jacobian_is_the_derivative_of_the_pose(case):
    chain, q, frame, point = case
    expected = twist_by_differences(chain, q, frame, point)
    assert_allclose(chain.jacobian(q, frame, point), expected, atol=DIFFERENCE)


def test_a_jacobian_of_the_wrong_convention_is_no_derivative_of_the_pose():
    """Negative control: the axes of the other convention must not pass the check above."""
    table, kinds = ((0.4, 0.5, 0.1, 0.2), (-0.7, 0.3, 0.2, 0.1)), ("revolute", "revolute")
    q, point = np.array([0.3, -0.8]), np.array([0.1, 0.2, 0.3])
    expected = twist_by_differences(DHChain(table, kinds, "standard"), q, 2, point)
    wrong = DHChain(table, kinds, "modified").jacobian(q, 2, point)
    with pytest.raises(AssertionError):
        assert_allclose(wrong, expected, atol=DIFFERENCE)


@given(chains(), angles, lengths)
def test_the_conventions_describe_one_arm_by_shifted_rows(case, last_alpha, last_a):
    """Row i of the modified table is (α, a) of row i-1 and (d, θ) of row i of the standard one."""
    chain, q, _, point = case
    n = len(q)
    x_part = [(0.0, 0.0), *((row[0], row[1]) for row in chain.table[1:]), (last_alpha, last_a)]
    z_part = [row[2:] for row in chain.table]
    modified = DHChain(tuple(x_part[i] + z_part[i] for i in range(n)), chain.kinds, "modified")
    standard = DHChain(tuple(x_part[i + 1] + z_part[i] for i in range(n)), chain.kinds, "standard")
    end = elementary("x", last_alpha, last_a)
    assert_allclose(modified.frames(q)[-1] @ end, standard.frames(q)[-1], atol=ROUNDING)
    in_modified = (end @ [*point, 1.0])[:3]
    assert_allclose(modified.jacobian(q, point=in_modified), standard.jacobian(q, point=point), atol=ROUNDING)
