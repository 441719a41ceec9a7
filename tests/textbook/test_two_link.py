"""Two links: velocities in moving frames, postures, and the boundary of the workspace against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from rmrc.textbook import two_link
from rmrc.textbook.chains import DHChain
from rmrc.textbook.two_link import Arc, two_link_boundary, two_link_free_area, two_link_position

# Sums of a few products of order one.
ROUNDING = 1e-12

angles = arrays(float, 2, elements=st.floats(-3.0, 3.0))
arms = st.tuples(arrays(float, 2, elements=st.floats(0.1, 2.0)), angles)


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@given(arms, angles)
def test_the_velocities_of_example_5_3_are_one_vector_and_the_derivative_of_the_position(arm, qdot):
    lengths, q = arm
    in_0 = two_link.two_link_velocity_in_frame_0(lengths, q, qdot)
    in_2 = two_link.two_link_velocity_in_frame_2(lengths, q, qdot)
    h = 1e-5  # central differences: (1e-5)² · |third derivative| <= 100 m, and 1e-16/1e-5
    ahead, behind = (two_link.two_link_position(lengths, q + t * qdot) for t in (h, -h))
    assert_allclose(in_0, (ahead - behind) / (2 * h), atol=1e-6)
    assert_allclose(rotation(q.sum()) @ in_2, in_0, atol=ROUNDING * (1 + np.abs(qdot).sum()))


@given(arms)
def test_the_jacobians_of_all_frames_are_the_dh_chain_s_along_their_axes(arm):
    lengths, q = arm
    chain = DHChain(((0, 0, 0, 0), (0, lengths[0], 0, 0)), ("revolute", "revolute"))
    J = chain.jacobian(q, point=(lengths[1], 0, 0))[:3]
    frames = chain.frames(q)[:, :3, :3]
    for frame, printed in (
        (0, two_link.two_link_jacobian),
        (1, two_link.two_link_jacobian_in_frame_1),
        (2, two_link.two_link_jacobian_in_frame_2),
    ):
        assert_allclose(printed(lengths, q), (frames[frame].T @ J)[:2], atol=ROUNDING)
        # which moreover does not change the determinant
        determinant = two_link.two_link_determinant(lengths, q)
        assert_allclose(np.linalg.det(printed(lengths, q)), determinant, atol=ROUNDING)


@given(arms)
def test_both_postures_reach_the_point_and_one_is_the_arm_s_own(arm):
    lengths, q = arm
    tip = two_link.two_link_position(lengths, q)
    postures = two_link.two_link_postures(lengths, tip)
    # Folded onto its base with equal links, r² is rounding: √1e-16.
    assert_allclose(two_link.two_link_position(lengths, postures), [tip, tip], atol=1e-7)
    assert postures[0, 1] >= 0 >= postures[1, 1]
    assert np.all(np.abs(postures) <= np.pi)
    if np.linalg.norm(tip) > 0.01 and abs(np.sin(q[1])) > 0.01:
        # Away from the singularities r² determines the elbow to 1e-15 / 0.01².
        own = postures[0 if q[1] > 0 else 1]
        assert_allclose(np.exp(1j * own), np.exp(1j * q), atol=1e-9)


def test_out_of_reach_is_not_a_number_and_its_neighbors_are():
    postures = two_link.two_link_postures([6, 3], [[9.001, 0], [5, 0], [0, 2.999]])
    assert np.isnan(postures[[0, 2]]).all()
    assert np.isfinite(postures[1]).all()
    # Beyond reach by more than rounding is beyond reach.
    barely = two_link.two_link_postures([6, 3], [[9 * (1 + 1e-12), 0], [0, 3 * (1 - 1e-11)]])
    assert np.isnan(barely).all()


@given(arms.filter(lambda case: abs(np.sin(case[1][1])) > 1e-3), st.floats(-2.0, 2.0))
def test_rates_of_example_5_5_move_the_tip_along_x(case, speed):
    lengths, q = case
    rates = two_link.two_link_rates(lengths, q, speed)
    J = two_link.two_link_jacobian(lengths, q)
    # Terms of size |J||rates| cancel in y.
    tolerance = ROUNDING * (1.0 + np.linalg.norm(J) * np.linalg.norm(rates))
    assert_allclose(J @ rates, [speed, 0.0], atol=tolerance)


NOTES = np.radians([[0, 135], [0, 120]])


def enclosed(arcs):
    """Return the area within arcs that form one closed curve, by Green's theorem; they are chained here."""
    rest = [arc.points for arc in arcs]
    chain = rest.pop(0)
    while rest:
        gaps = [[np.linalg.norm(piece[end] - chain[-1]) for end in (0, -1)] for piece in rest]
        i, end = np.unravel_index(np.argmin(gaps), (len(rest), 2))
        assert gaps[i][end] < 1e-5  # the margin around limits, 1e-6 rad at 9 m
        piece = rest.pop(i)
        chain = np.vstack([chain, piece if end == 0 else piece[::-1]])
    assert np.linalg.norm(chain[0] - chain[-1]) < 1e-5
    x, y = chain.T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_the_free_arm_is_bounded_by_the_circles_of_its_singularities():
    outer, inner = two_link_boundary([6, 3])
    assert (outer.kind, inner.kind) == ("outer", "inner")
    for arc, radius, elbow in ((outer, 9.0, 0.0), (inner, 3.0, np.pi)):
        assert_allclose(np.linalg.norm(arc.points, axis=1), radius, atol=1e-12)
        assert_allclose(np.abs(arc.q[:, 1]), elbow, atol=1e-12)
        assert_allclose(arc.points[0], arc.points[-1], atol=1e-12)  # closed
    assert two_link_free_area([6, 3]) == pytest.approx(np.pi * (81 - 9))
    assert [arc.kind for arc in two_link_boundary([1, 1])] == ["outer"]  # equal links have no inner circle
    # chords of 1° enclose (1°)²/6 less
    assert enclosed([outer]) - enclosed([inner]) == pytest.approx(two_link_free_area([6, 3]), rel=1e-4)


def test_the_limits_of_the_notes_leave_four_arcs_around_the_area_of_the_jacobian():
    """With one elbow the map is one-to-one: the area is ∫|det J| dq = l₁ l₂ Δq₁ (cos 0 − cos 120°)."""
    arcs = two_link_boundary([6, 3], NOTES)
    assert sorted(arc.kind for arc in arcs) == ["outer", "q1 lower", "q1 upper", "q2 upper"]
    expected = 18 * np.radians(135) * (1 - np.cos(np.radians(120)))
    # chords of 1° enclose (1°)²/6 less
    assert enclosed(arcs) == pytest.approx(expected, rel=1e-4)
    by_kind = {arc.kind: arc for arc in arcs}
    # about the base at √(6² + 3² − 18) = √27, about the elbow at 3
    assert_allclose(np.linalg.norm(by_kind["q2 upper"].points, axis=1), np.sqrt(27), atol=1e-12)
    assert_allclose(np.linalg.norm(by_kind["q1 lower"].points - [6, 0], axis=1), 3, atol=1e-12)
    # the inner circle of radius 3 is out of the elbow's reach
    assert min(np.linalg.norm(arc.points, axis=1).min() for arc in arcs) > 5


def image(limits):
    """Return where the tip gets to on a grid of joint positions, no two neighbors further than 0.018 apart."""
    low, high = np.where(np.isfinite(limits), limits, np.pi * np.sign(limits)).T
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 700).T, indexing="ij"), axis=-1)
    # a balanced tree would take longer to make than all that is asked of it
    return cKDTree(two_link_position(LENGTHS, grid.reshape(-1, 2)), balanced_tree=False, compact_nodes=False)


def sides(reached, arc):
    """Say of points beside an arc, by 0.06 along the normal to both sides, whether the arm comes near."""
    # Away from the ends, where other arcs may lie as near.
    middle = arc.points[len(arc.points) // 4 : 3 * len(arc.points) // 4]
    along = np.gradient(middle, axis=0)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=-1) / np.linalg.norm(along, axis=1)[:, None]
    return [reached.query(middle + side * 0.06 * normal)[0] < 0.02 for side in (1, -1)]


LENGTHS = np.array([1.0, 0.7])
LIMITS = [
    NOTES,
    np.radians([[0, 135], [-100, 120]]),  # both elbows, folded over each other
    np.radians([[-60, 60], [-140, 140]]),  # both limits of the elbow are one circle
    np.radians([[-170, 150], [20, 150]]),  # the shoulder nearly all around
    [[-np.inf, np.inf], [0.5, 2.0]],  # a ring that touches no singularity
    [[-np.inf, np.inf], [-2.5, 1.0]],  # one limit of the elbow is hidden by the other
    [[-1.0, 2.0], [-np.inf, np.inf]],  # the elbow all around
    np.radians([[0, 100], [90, 270]]),  # across the folded arm
]


@pytest.mark.parametrize("limits", LIMITS[1::2])
def test_the_arm_is_on_one_side_of_every_arc(limits):
    reached = image(limits)
    judged = [arc for arc in two_link_boundary(LENGTHS, limits) if len(arc.points) > 8]
    assert len(judged) >= 2
    for arc in judged:
        left, right = sides(reached, arc)
        # At curves that come close to each other a few points see the neighbor.
        assert np.mean(left != right) > 0.9, arc.kind
    # Negative control: an end of the shoulder that is not cut runs through the inside.
    q = np.linspace([1.0, limits[1][0]], [1.0, limits[1][1]], 200)
    left, right = sides(reached, Arc("q1 lower", q, two_link_position(LENGTHS, q)))
    assert np.mean(left != right) < 0.9


def widest_gap(arcs):
    """Return the largest distance of an end of an arc to the nearest other end."""
    ends = np.array([arc.points[end] for arc in arcs for end in (0, -1)])
    gaps = np.linalg.norm(ends[:, None] - ends, axis=-1) + 9 * np.eye(len(ends))
    return gaps.min(axis=1).max()


def test_whatever_the_limits_every_arc_ends_where_another_begins():
    for limits in LIMITS:
        # a margin of 1e-6 rad around limits, and curves that cross at some angle
        assert widest_gap(two_link_boundary(LENGTHS, limits)) < 1e-4
    rng = np.random.default_rng(0)
    for _ in range(2):
        middle, width = rng.uniform(-3, 3, 2), rng.uniform(0.3, 6.2, 2)
        limits = np.stack([middle - width / 2, middle + width / 2], axis=-1)
        # What may be missing: a sixteenth of 1° at a reach of 1.7 m.
        assert widest_gap(two_link_boundary(LENGTHS, limits)) < np.radians(1 / 16) * 1.7, limits
