"""Both ellipsoids against their definitions: unit rates and torques, and the quadratic forms."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from rmrc.textbook.ellipsoid import (
    Ellipsoid,
    ellipsoid_points,
    force_ellipsoid,
    manipulability,
    velocity_ellipsoid,
)
from rmrc.textbook.stanford import stanford_jacobian
from rmrc.textbook.two_link import two_link_jacobian

# Conditions are at most 1e2: J Jᵀ squares it, 1e4 · 1e-16, some dozen terms.
ROUNDING = 1e-10


@st.composite
def regular(draw):
    m = draw(st.integers(2, 3))
    J = draw(arrays(float, (m, draw(st.integers(m, 6))), elements=st.floats(-2.0, 2.0)))
    sigma = np.linalg.svd(J, compute_uv=False)
    assume(sigma[-1] > 1e-2 * sigma[0] and sigma[0] > 0.1)
    return J


def form(ellipsoid, points):
    """Σ (x·e_i/a_i)²: 1 on the ellipsoid, less than 1 in it."""
    return np.sum((points @ ellipsoid.axes / ellipsoid.half_axes) ** 2, axis=-1)


def directions(n, seed=1):
    d = np.random.default_rng(seed).normal(size=(50, n))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@given(regular())
def test_unit_rates_give_velocities_on_it_or_in_it_and_the_printed_form_is_its_own(J):
    m, n = J.shape
    ellipsoid = velocity_ellipsoid(J)
    velocities = directions(n) @ J.T
    value = form(ellipsoid, velocities)
    printed = np.einsum("ki,ij,kj->k", velocities, np.linalg.inv(J @ J.T), velocities)
    assert_allclose(value, printed, atol=ROUNDING)
    assert np.all(value <= 1 + ROUNDING)
    if m == n:
        assert_allclose(value, 1.0, atol=ROUNDING)
    # rates without internal motion, from the rows of J alone, reach it
    rates = directions(m) @ J
    rates /= np.linalg.norm(rates, axis=1, keepdims=True)
    assert_allclose(form(ellipsoid, rates @ J.T), 1.0, atol=ROUNDING)


@given(regular())
def test_unit_torques_hold_forces_on_the_force_ellipsoid(J):
    forces = directions(len(J))
    forces /= np.linalg.norm(forces @ J, axis=1, keepdims=True)  # so that ‖Jᵀ F‖ = 1
    assert_allclose(form(force_ellipsoid(J), forces), 1.0, atol=ROUNDING)


@given(regular())
def test_the_two_are_reciprocal_along_the_same_axes(J):
    velocity, force = velocity_ellipsoid(J), force_ellipsoid(J)
    assert_allclose(velocity.half_axes * force.half_axes, 1.0, atol=ROUNDING)
    assert_allclose(force.axes, velocity.axes, atol=0)
    assert_allclose(velocity.axes.T @ velocity.axes, np.eye(len(J)), atol=ROUNDING)
    assert np.all(np.diff(velocity.half_axes) <= 0)
    # as it is printed; the determinant of a square of condition 1e4 in three rows: 1e-16 · 1e8
    assert_allclose(manipulability(J), np.sqrt(np.linalg.det(J @ J.T)), rtol=1e-7)


def test_swapped_radii_are_seen():
    """Negative control of all three tests above."""
    J = two_link_jacobian([1.0, 0.7], [0.3, 0.9])
    swapped = Ellipsoid(velocity_ellipsoid(J).axes, velocity_ellipsoid(J).half_axes[::-1])
    assert np.abs(form(swapped, directions(2) @ J.T) - 1).max() > 0.5
    as_forces = velocity_ellipsoid(J)
    forces = directions(2) / np.linalg.norm(directions(2) @ J, axis=1, keepdims=True)
    assert np.abs(form(as_forces, forces) - 1).max() > 0.5


@pytest.mark.parametrize("elbow", [0.0, np.pi])
def test_a_lost_direction_is_flat_for_velocities_and_endless_for_forces(elbow):
    """Also where sin π is not exactly 0."""
    J = two_link_jacobian([1.0, 0.7], [0.3, elbow])
    velocity, force = velocity_ellipsoid(J), force_ellipsoid(J)
    assert velocity.half_axes[1] == 0.0
    assert force.half_axes[1] == np.inf
    along_the_arm = np.array([np.cos(0.3), np.sin(0.3)])
    assert_allclose(np.abs(velocity.axes[:, 1] @ along_the_arm), 1.0, atol=1e-12)
    assert manipulability(J) == pytest.approx(0.0, abs=1e-15)


def test_points_lie_on_the_ellipse_and_on_the_ellipsoid_all_around():
    flat = velocity_ellipsoid(two_link_jacobian([1.0, 0.7], [0.3, 0.9]))
    points = ellipsoid_points(flat, 40)
    assert points.shape == (40, 2)
    assert_allclose(points[0], points[-1], atol=1e-12)
    assert_allclose(form(flat, points), 1.0, atol=ROUNDING)
    solid = velocity_ellipsoid(stanford_jacobian([0.3, 1.0, 0.6, 0.7, 0.9, 0.2])[:3])
    points = ellipsoid_points(solid, 20)
    assert points.shape == (20, 20, 3)
    assert_allclose(form(solid, points), 1.0, atol=ROUNDING)
    # It reaches its ends: the pole is the third half axis, and the first is met around the equator.
    assert_allclose(points[0, 0], solid.axes[:, 2] * solid.half_axes[2], atol=1e-12)
    equator = ellipsoid_points(solid, 21)[0, 10]
    assert_allclose(equator, solid.axes[:, 0] * solid.half_axes[0], atol=1e-12)
