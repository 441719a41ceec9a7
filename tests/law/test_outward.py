"""Kinematics of a chain in vector registers: it is the product of the joints' own matrices, for any number of axes."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.law.jit import Array, entry
from rmrc.law.kinematics import pose_error
from rmrc.law.outward import HERE, LANES, contribute, follow_first, follow_on, follow_short
from rmrc.law.record import ADVANCE, ALONG, AXIS, HALF, ROWS_OF_CHAIN, STEP, TURNS, capacity
from rmrc.support.spatial import quat_to_matrix


@entry
def follow(chain: Array, leader: Array, q: Array, outward: Array, axes: int, place: Array, J: Array) -> None:
    found = follow_first(chain, leader, q, outward, 0, axes, HERE)
    for first in range(LANES, axes, LANES):
        found = follow_on(chain, leader, q, outward, first, axes - first, found)
    for i in range(7):
        place[i] = found[i]
    for first in range(0, axes, LANES):
        contribute(chain, outward, place[4:], J, first)


@entry
def follow_few(chain: Array, leader: Array, q: Array, outward: Array, place: Array) -> None:
    found = follow_short(chain, leader, q, outward)
    for i in range(7):
        place[i] = found[i]


@entry
def error_of(pose: Array, pose_ref: Array, error: Array) -> None:
    pose_error(pose, pose_ref, error)


def chain_of(axes, rng):
    """A chain of hinges, slides and screws, as a record has it, and as lists: axes, steps, pitches (inf: slides)."""
    z = rng.normal(size=(axes, 3))
    z /= np.linalg.norm(z, axis=1)[:, None]
    steps, pitch = rng.normal(size=(axes, 3)), rng.choice([0.0, 0.1, math.inf], axes, p=[0.6, 0.2, 0.2])
    slides = np.isinf(pitch)
    chain = np.zeros((ROWS_OF_CHAIN, capacity(axes)))
    chain[HALF, :axes], chain[ALONG, :axes] = 0.5 * ~slides, np.where(slides, 1.0, pitch)
    chain[AXIS : AXIS + 3, :axes], chain[STEP : STEP + 3, :axes] = z.T, steps.T
    chain[TURNS, :axes], chain[ADVANCE, :axes] = ~slides, np.where(slides, 1.0, pitch)
    return chain, z, steps, pitch


def turn_about(axis, angle):
    """Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K


def one_by_one(z, steps, pitch, q):
    """Axes, anchors, rotation and end, one joint after the other, with matrices."""
    R, p, axes, anchors = np.eye(3), np.zeros(3), [], []
    for axis, step, h, moved in zip(z, steps, pitch, q, strict=True):
        p = p + R @ step
        axes.append(R @ axis)
        anchors.append(p)
        p = p + (moved if np.isinf(h) else h * moved) * axes[-1]
        R = R if np.isinf(h) else R @ turn_about(axis, moved)
    return np.array(axes), np.array(anchors), R, p


def followed(chain, q):
    width = chain.shape[1]
    given, outward, place, J = (
        np.zeros(width),
        np.full((6, width), np.nan),
        np.zeros(7),
        np.full((6, width), np.nan),
    )
    given[: len(q)] = q
    leader = np.zeros(width, np.int64)
    leader[: len(q)] = np.arange(len(q))
    follow(chain, leader, given, outward, len(q), place, J)
    return outward[:, : len(q)], place, J[:, : len(q)]


@pytest.mark.parametrize("axes", [1, 2, 3, 4])
def test_a_short_chain_has_the_bits_of_the_first_group_of_eight(axes):
    rng = np.random.default_rng(axes)
    chain, *_ = chain_of(axes, rng)
    q = rng.uniform(-3.0, 3.0, axes)
    outward, place, _ = followed(chain, q)
    given, few, end = np.zeros(chain.shape[1]), np.full((6, chain.shape[1]), np.nan), np.zeros(7)
    given[:axes] = q
    leader = np.arange(chain.shape[1]) % axes
    follow_few(chain, leader, given, few, end)
    assert few[:, :axes].tobytes() == outward.tobytes() and end.tobytes() == place.tobytes()
    follow_few(chain, leader, given + 1e-12, few, end)
    assert end.tobytes() != place.tobytes()  # negative control


@pytest.mark.parametrize("axes", [1, 2, 4, 5, 8, 9, 13])
def test_a_chain_is_the_product_of_its_joints(axes):
    rng = np.random.default_rng(axes)
    for _ in range(20):
        chain, z, steps, pitch = chain_of(axes, rng)
        q = np.where(np.isinf(pitch), 1.0, rng.choice([1.0, 10.0, 1e-9])) * rng.uniform(-1.0, 1.0, axes)
        q[0] = rng.choice([q[0], 0.25 * math.pi, -1.5 * math.pi, math.pi, 0.0])
        outward, place, J = followed(chain, q)
        want, anchors, R, end = one_by_one(z, steps, pitch, q)
        # rounding of some ten products a joint, of lengths up to 3 a joint and ways along screws up to 1
        within = {"rtol": 0.0, "atol": 2e-15 * (4.0 * axes) ** 1.5}
        assert_allclose(outward[:3].T, want, **within)
        assert_allclose(outward[3:].T, anchors, **within)
        assert_allclose(quat_to_matrix(place[:4]), R, **within)
        assert_allclose(place[4:], end, **within)
        turns = ~np.isinf(pitch)
        moves = turns[:, None] * np.cross(want, end - anchors) + np.where(turns, pitch, 1.0)[:, None] * want
        assert_allclose(J[:3].T, np.where(turns[:, None], moves, want), rtol=0.0, atol=4.0 * within["atol"])
        assert_allclose(J[3:].T, turns[:, None] * want, **within)
    # Negative control: a step that is missing is seen.
    chain[STEP, axes - 1] += 1e-9
    assert np.abs(followed(chain, q)[1][4:] - end).max() > 1e-10


def product(a, b):
    """The product of two quaternions, in the order of the module's own sums."""
    return (
        (a[0] * b[0] - a[1] * b[1]) - (a[2] * b[2] + a[3] * b[3]),
        (a[0] * b[1] + a[1] * b[0]) + (a[2] * b[3] - a[3] * b[2]),
        (a[0] * b[2] - a[1] * b[3]) + (a[2] * b[0] + a[3] * b[1]),
        (a[0] * b[3] + a[1] * b[2]) - (a[2] * b[1] - a[3] * b[0]),
    )


@pytest.mark.parametrize("axes", [1, 3, 4, 5, 8, 9, 12, 13, 16])
def test_the_order_of_the_products_is_fixed_to_the_bit(axes):
    rng, none = np.random.default_rng(axes), (1.0, 0.0, 0.0, 0.0)
    chain, z, _, pitch = chain_of(axes, rng)
    q, last, straight = rng.uniform(-1.0, 1.0, axes), none, none
    turns = []
    for axis, moved, h in zip(z, q, pitch, strict=True):
        alone = np.zeros((ROWS_OF_CHAIN, 8))
        alone[HALF, 0], alone[AXIS, 0] = 0.5 * ~np.isinf(h), 1.0
        c, s = followed(alone, [moved])[1][:2]
        turns.append((c, *(s * axis)))
        straight = product(straight, turns[-1])
    turns += [none] * (-axes % 4)
    for first in range(0, len(turns), 4):  # pairs, pairs of pairs, and groups one after the other
        group = turns[first : first + 4]
        for count in (1, 2):
            group = [product(group[i - count] if i >= count else none, group[i]) for i in range(4)]
        last = product(last, group[3]) if first else group[3]
    found = followed(chain, q)[1][:4]
    np.testing.assert_array_equal(found, last)
    # Negative control: one after the other, the bits of long chains are different.
    assert axes < 8 or not np.array_equal(found, straight)


@pytest.mark.parametrize("turns", [0, 1, 7, 1_000, 100_000])
def test_sines_and_cosines_are_those_of_the_library(turns):
    chain = np.zeros((ROWS_OF_CHAIN, 8))
    chain[HALF, 0], chain[AXIS + 2, 0], chain[TURNS, 0] = 0.5, 1.0, 1.0
    rng, eighths = np.random.default_rng(turns), np.arange(-16, 17) * 0.25 * math.pi
    for angle in [*eighths, *np.nextafter(eighths, 9.0), *rng.uniform(-13.0, 13.0, 200)]:
        q = angle + math.copysign(turns * math.tau, angle)
        _, place, _ = followed(chain, [q])
        assert abs(place[0] - math.cos(0.5 * q)) < 2e-16 and abs(place[3] - math.sin(0.5 * q)) < 2e-16


def test_the_error_of_a_rotation_is_exact_to_its_last_digits():
    rng = np.random.default_rng(0)
    # around the largest angle of the series, whose half has the tangent 2⁻⁵, and from the smallest to nearly π
    near = 2.0 * math.atan(2.0**-5)
    angles = [*np.geomspace(1e-300, 3.1, 100), *near * (1.0 + np.linspace(-1e-3, 1e-3, 21))]
    for angle in angles:
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        pose, ref, error = np.zeros(7), np.zeros(7), np.zeros(6)
        pose[3], ref[3], ref[4:] = 1.0, math.cos(0.5 * angle), math.sin(0.5 * angle) * axis
        for scale in (1.0, -3.0):  # neither the sign nor the length of a quaternion counts
            error_of(pose, scale * ref, error)
            # 1 − cos of angles near π is rounded to 1e-16, which is a share of the angle
            assert_allclose(error[3:], angle * axis, rtol=1.5e-15 if angle < 1.0 else 1e-14, atol=0.0)
