"""All postures are found, counted as closed forms count them, and a continuum is not listed."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from project import ROOT, examples, mostly_long
from rmrc import arm as arms
from rmrc.analysis.ik.postures import find_postures
from rmrc.analysis.ik.solve import goal_pose
from rmrc.law.task import choose
from rmrc.simulation import inverse_kinematics
from rmrc.support.spatial import pose_error
from rmrc.textbook.torus import torus_postures


def load(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


def sorted_rows(q):
    q = np.asarray(q)
    return q[np.lexsort(q.round(6).T[::-1])]


def assert_postures(task, goal, found):
    """Each is a posture by MuJoCo, and no two are the same."""
    for q in found.q:
        error = pose_error(goal, task.arm.pose(q))[task.rows]
        assert np.abs(error).max() < 1e-9
    gaps = np.abs(np.exp(1j * found.q[:, None]) - np.exp(1j * found.q[None])).max(axis=2)
    assert (gaps[~np.eye(len(found.q), dtype=bool)] > 1e-4).all()
    assert found.nearest is None and found.hits.sum() <= found.starts


def two_links(reach, x, y):
    """The textbook's two postures: cosine law [Craig05, §4.4]."""
    elbow = np.arccos((x * x + y * y - 2 * reach**2) / (2 * reach**2))
    return [
        (np.arctan2(y, x) - np.arctan2(np.sin(e), 1 + np.cos(e)), e) for e in (-elbow, elbow)
    ]  # equal links


def test_two_links_have_two_postures():
    task = choose(load("planar_2link"))
    found = find_postures(task, goal_pose(task, [0.9, 0.8]))
    # 1e-13 is what the search goes down to, over the smallest singular value.
    assert_allclose(found.q, sorted_rows(two_links(1.0, 0.9, 0.8)), atol=1e-12)
    assert_array_equal(found.freedom, [0, 0])
    assert not found.is_continuum


def test_three_links_with_the_angle_have_two_postures():
    task = choose(load("planar_3link"))
    q = np.array([0.4, 0.9, -0.7])
    goal = task.arm.pose(q)
    found = find_postures(task, goal)
    assert len(found.q) == 2
    assert_postures(task, goal, found)
    assert_allclose(found.q[found.q[:, 1] > 0], [q], atol=1e-12)
    assert_allclose(found.q[found.q[:, 1] < 0][:, 1], -0.9, atol=1e-12)


@pytest.mark.parametrize("seed", mostly_long(range(3), 3))
def test_the_puma_has_eight_postures(seed):
    task = choose(load("puma560"))
    q = task.arm.sampled(1, 30 + seed)
    goal = task.arm.pose(q[0])
    found = find_postures(task, goal, limits=False)
    assert len(found.q) == 8 and not found.is_continuum
    assert_postures(task, goal, found)
    # Shoulder left or right, elbow up or down, wrist flipped or not: each once.
    arms_ = {tuple(row) for row in np.exp(1j * found.q[:, :3]).round(6)}
    assert len(arms_) == 4
    wrists = found.q[:, 4].round(9)
    assert all(-wrist in wrists for wrist in wrists)
    # Within limits there are fewer, all of them among the eight.
    kept = find_postures(task, goal)
    assert 0 < len(kept.q) <= 8
    lower, upper = task.arm.position_limit.T
    for one in kept.q:
        assert (one >= lower).all() and (one <= upper).all()
        assert np.abs(np.exp(1j * found.q) - np.exp(1j * one)).max(axis=1).min() < 1e-9


@pytest.mark.parametrize("site", ["wrist", "tool"])
def test_the_stanford_arm_has_eight_postures_half_of_them_with_the_boom_behind(site):
    arm = load("stanford", site)
    task = choose(arm)
    q = np.array([0.3, 1.1, 0.6, 0.5, 0.8, -0.4])
    goal = arm.pose(q)
    found = find_postures(task, goal, limits=False)
    assert_postures(task, goal, found)
    # Closed form: the wrist point (x, y, z) leaves 2 waist angles, d_3 sin θ_2 = ±√(x² + y² − d_2²), and for
    # each of them d_3 > 0, or the boom turned round with d_3 < 0; then the wrist can be flipped.
    x, y, z = load("stanford", "wrist").pose(q)[:3] - [0, 0, 0.412]
    side = np.sqrt(x * x + y * y - 0.154**2)
    expected = []
    for s in (side, -side):
        waist = np.arctan2(y, x) - np.arctan2(0.154, s)
        for d in (np.hypot(s, z), -np.hypot(s, z)):
            expected += [(waist, np.arctan2(s / d, z / d), d)] * 2
    expected = np.array(expected)
    expected[:, :2] = np.angle(np.exp(1j * expected[:, :2]))
    assert_allclose(found.q[:, :3], sorted_rows(expected), atol=1e-11)
    assert (found.q[:, 2] < 0).sum() == 4


@pytest.mark.parametrize(
    ("name", "point"),
    [
        ("torus_3r", [1.0, 0.5, 1.5]),
        ("torus_3r", [0.7, -0.9, 1.0]),
        ("torus_3r_short", [0.2, 0.0, 1.8]),
        ("torus_3r_short", [0.75, 0.3, 1.1]),
    ],
)
def test_the_torus_arm_has_the_postures_of_its_closed_form(name, point):
    arm = load(name)
    task = choose(arm)
    # Lengths, and the height of the first link, are read off the model at 0 and at a right angle.
    straight = arm.pose([0.0, 0.0, 0.0])
    bent = arm.pose([0.0, 0.0, np.pi / 2]) - straight
    up = arm.pose([0.0, np.pi / 2, 0.0]) - straight
    outer, height = up[2], straight[2]
    lengths = [straight[0] - outer, outer - bent[2], bent[2]]
    expected = torus_postures(lengths, np.array(point) - [0, 0, height])
    found = find_postures(task, goal_pose(task, point), limits=False)
    assert len(found.q) == len(expected) > 0
    assert_allclose(found.q, sorted_rows(expected), atol=1e-11)


def test_a_spherical_wrist_has_two_postures():
    task = choose(load("spherical_wrist"))
    q = np.array([0.4, 0.9, -0.7])
    found = find_postures(task, task.arm.pose(q), limits=False)
    assert task.axes == ("rx", "ry", "rz")
    # The other is flipped: (q_1 ± π, −q_2, q_3 ± π).
    expected = [q, np.angle(np.exp(1j * (q * [1, -1, 1] + [np.pi, 0, np.pi])))]
    assert_allclose(found.q, sorted_rows(expected), atol=1e-11)


def test_a_long_torus_arm_has_two_postures_at_most_and_a_short_one_four():
    counts = {}
    for name in ("torus_3r", "torus_3r_short"):
        task = choose(load(name))
        goals = [task.arm.pose(q) for q in task.arm.sampled(6, 40)]
        counts[name] = {len(find_postures(task, goal, limits=False, starts=500).q) for goal in goals}
    assert counts["torus_3r"] == {2}
    assert counts["torus_3r_short"] == {2, 4}


# Continua ---------------------------------------------------------------------------------------


def test_on_the_waist_axis_there_is_a_continuum():
    task = choose(load("torus_3r_short"))
    start = [0.7, 0.5, 0.5]
    found = find_postures(task, goal_pose(task, [0.0, 0.0, 0.7]), start)
    assert found.is_continuum and found.freedom.tolist() == [1] and len(found.q) == 1
    # Any waist angle will do; of all that were met, the start's is nearest, to the spacing of the starts.
    assert abs(found.q[0, 0] - 0.7) < 0.2
    # Negative control: beside the axis they are isolated.
    beside = find_postures(task, goal_pose(task, [0.01, 0.0, 0.7]), start, limits=False)
    assert not beside.is_continuum and len(beside.q) == 4


def test_an_arm_with_joints_to_spare_has_a_continuum():
    task = choose(load("planar_3link"), ["x", "y"])
    found = find_postures(task, goal_pose(task, [0.6, 0.3]), starts=24, limits=False)
    assert found.is_continuum and found.freedom.tolist() == [1]
    assert found.hits.tolist() == [found.starts]
    # Its limits cut the loop into two pieces.
    kept = find_postures(task, goal_pose(task, [0.6, 0.3]), starts=24)
    assert kept.freedom.tolist() == [1, 1] and kept.hits.sum() > found.starts / 2


def test_a_wrist_that_is_straight_leaves_a_continuum_beside_isolated_postures():
    # θ_5 = 0: θ_4 and θ_6 turn about one axis. The other shoulder's wrist is bent, and its postures isolated.
    task = choose(load("stanford"))
    goal = task.arm.pose([0.3, 1.1, 0.6, 0.5, 0.0, -0.4])
    found = find_postures(task, goal)
    assert found.is_continuum and sorted(found.freedom)[-1] == 1
    loose = found.q[found.freedom > 0]
    assert len(loose) == 1
    assert_allclose(loose[0, [0, 1, 2, 4]], [0.3, 1.1, 0.6, 0.0], atol=1e-6)
    assert_allclose(np.exp(1j * (loose[0, 3] + loose[0, 5])), np.exp(0.1j), atol=1e-6)


def test_a_singular_posture_with_none_beside_it_is_isolated():
    # A is singular where two links are stretched, but they cannot move.
    task = choose(load("planar_2link"))
    found = find_postures(task, goal_pose(task, [2.0 * np.cos(0.3), 2.0 * np.sin(0.3)]))
    assert not found.is_continuum
    # The two postures are one there, to the root of rounding.
    assert_allclose(found.q, [[0.3, 0.0]], atol=1e-6)


# Pieces that are apart ----------------------------------------------------------------------------


def test_two_continua_of_the_torus_arm_are_two():
    """On its axis the torus arm has the postures of two links between the axis and the point, both mirrored."""
    task = choose(load("torus_3r_short"))
    found = find_postures(task, goal_pose(task, [0.0, 0.0, 1.5]), limits=False)
    # Two links of 0.6 and 0.5 from (0.4, 0) to (0, 0.3): a triangle of 3, 4 and 5 tenths, by the cosine law.
    elbow = np.arccos((0.5**2 - 0.6**2 - 0.5**2) / (2 * 0.6 * 0.5))
    towards = np.arctan2(0.3, -0.4)
    lift = [
        np.angle(np.exp(1j * (towards - np.arctan2(0.5 * np.sin(e), 0.6 + 0.5 * np.cos(e)))))
        for e in (elbow, -elbow)
    ]
    assert_allclose(np.degrees([lift[0], elbow, lift[1]]), [90.0, 126.87, -163.74], atol=5e-3)
    assert found.freedom.tolist() == [1, 1] and found.decided.all()
    # Known to the root of rounding: the arm is singular on all of it.
    assert_allclose(found.q[np.argsort(found.q[:, 1]), 1:], [[lift[1], -elbow], [lift[0], elbow]], atol=1e-6)
    assert found.hits.sum() == found.starts and (found.hits > found.starts / 4).all()


def test_the_stanford_arm_with_its_boom_behind_is_a_continuum_of_its_own():
    task = choose(load("stanford"))
    goal = task.arm.pose([0.3, np.radians(70), 0.6, 0.4, 0.0, 0.2])
    found = find_postures(task, goal, limits=False)
    loose = found.q[found.freedom == 1]
    loose = loose[np.argsort(loose[:, 2])]
    assert found.freedom.tolist().count(0) == 4 and len(loose) == 2 and found.decided.all()
    # The other has the boom turned round, and the wrist bent by half a turn.
    assert_allclose(
        loose[:, [0, 1, 2]], [[0.3, np.radians(-110), -0.6], [0.3, np.radians(70), 0.6]], atol=1e-6
    )
    assert_allclose(np.abs(loose[:, 4]), [np.pi, 0.0], atol=1e-6)
    for q, hits in zip(found.q, found.hits, strict=True):
        assert hits > 0 and np.abs(pose_error(goal, task.arm.pose(q))).max() < 1e-9
    # Each start led to the entry that counts it.
    assert_array_equal(np.bincount(found.led_to[found.led_to >= 0], minlength=6), found.hits)


def test_limits_split_a_continuum_in_two():
    """θ_4 + θ_6 is fixed up to whole turns, and each within 170°: intervals, which the numbers alone decide."""
    task = choose(load("stanford"))
    end = np.radians(170)
    for total, pieces in (
        (0.6, [(-end, 0.6 - 2 * np.pi + end), (0.6 - end, end)]),
        (0.2, [(0.2 - end, end)]),
    ):
        found = find_postures(task, task.arm.pose([0.3, 1.1, 0.6, total, 0.0, 0.0]))
        loose = np.sort(found.q[found.freedom == 1][:, 3])
        assert len(loose) == len(pieces) and found.decided.all()
        for theta_4, (low, high) in zip(loose, pieces, strict=True):
            assert low - 1e-6 < theta_4 < high + 1e-6


def planar(tmp_path_factory, lengths, ranges=None):
    """Return the task (x, y) of a planar arm of some links, hinges with ranges in rad or without."""
    links = len(lengths)
    bodies = "".join(
        f'<body pos="{lengths[j - 1] if j else 0:.17g} 0 0"><geom size="0.1"/><joint axis="0 0 1" name="j{j}"'
        + (f' range="{ranges[j][0]:.17g} {ranges[j][1]:.17g}"/>' if ranges and ranges[j] else "/>")
        for j in range(links)
    )
    path = tmp_path_factory.mktemp("planar") / "arm.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default>'
        f'<worldbody>{bodies}<site name="tip" pos="{lengths[-1]:.17g} 0 0"/>{"</body>" * links}</worldbody></mujoco>'
    )
    return choose(arms.load(path), ["x", "y"])


def continua(task, reach, **options):
    options = {"starts": 40, "limits": False} | options
    found = find_postures(task, goal_pose(task, [reach * np.cos(0.4), reach * np.sin(0.4)]), **options)
    assert found.is_continuum
    return found


sides = st.floats(0.3, 1.5)


@given(sides, sides, sides, sides)
@examples(2, 5)
def test_three_links_have_the_continua_of_a_four_bar_linkage(tmp_path_factory, a, b, c, reach):
    """Grashof's law: two circuits if the shortest and the longest bar are together shorter than the others."""
    shortest, *middle, longest = sorted([a, b, c, reach])
    margin = sum(middle) - shortest - longest
    # It can be closed at all; and circuits that pass each other at 0.01 m are told apart, but may be missed.
    assume(longest < 0.98 * (shortest + sum(middle)) and abs(margin) > 0.01)
    found = continua(planar(tmp_path_factory, (a, b, c)), reach)
    assert found.freedom.tolist() == [1] * (2 if margin > 0.0 else 1)
    assert found.decided.all() and found.hits.sum() == (found.led_to >= 0).sum()


@pytest.mark.parametrize(
    "bars", mostly_long([[0.5, 1.0, 1.2, 0.7], [1.0, 1.0, 1.0, 1.0], [0.6, 1.0, 0.6, 1.0]], 3)
)
def test_circuits_that_meet_are_one_continuum(tmp_path_factory, bars):
    """Where Grashof's law is an equation, the circuits cross where all bars lie on a line."""
    *lengths, reach = bars
    found = continua(planar(tmp_path_factory, lengths), reach)
    assert found.freedom.tolist() == [1] and found.decided.all()
    # Negative control: with the shortest a hundredth shorter they do not meet.
    apart = continua(planar(tmp_path_factory, (lengths[0] - 0.01, *lengths[1:])), reach)
    assert apart.freedom.tolist() == [1, 1]


def circuits(lengths, reach, second, third, steps=3001):
    """Pieces of the linkage within limits of its second and third hinge, by their first hinge on a grid.

    Returns the number of pieces, and the shortest of pieces and gaps along the first hinge [rad].
    """
    a, b, c = lengths
    first = np.linspace(-np.pi, np.pi, steps)[:-1]
    away = reach * np.exp(0.4j) - a * np.exp(1j * first)
    cosine = (np.abs(away) ** 2 - b * b - c * c) / (2.0 * b * c)
    fits = np.abs(cosine) <= 1.0
    elbow = np.arccos(np.clip(cosine, -1.0, 1.0))
    allowed, runs = [], []
    for sign in (1.0, -1.0):
        bend = sign * elbow
        angle = np.angle(away) - np.angle(b + c * np.exp(1j * bend)) - first
        angle = np.angle(np.exp(1j * angle))
        ok = fits & (np.abs(angle) <= second) & (np.abs(bend) <= third)
        allowed.append(ok)
        edges = np.flatnonzero(ok != np.roll(ok, 1))
        runs += np.diff(np.append(edges, edges[:1] + len(ok))).tolist() if len(edges) else [len(ok)]
    # A graph: neighbors along the grid; and both bends where the second and third link come to lie on a line.
    label = np.arange(2 * len(first)).reshape(2, -1)
    label[~np.array(allowed)] = -1

    def fused(i):
        """Whether the linkage ends beside this place of the grid, and both bends meet there within limits."""
        return allowed[0][i] and allowed[1][i] and not (fits[i - 1] and fits[(i + 1) % len(first)])

    links = [
        (int(row[i - 1]), int(row[i]))
        for row in label
        for i in range(len(first))
        if row[i - 1] >= 0 <= row[i]
    ]
    links += [(int(label[0, i]), int(label[1, i])) for i in range(len(first)) if fused(i)]
    up = {int(i): int(i) for i in label.ravel() if i >= 0}

    def root(i):
        while up[i] != i:
            i = up[i]
        return i

    for i, j in links:
        up[max(root(i), root(j))] = min(root(i), root(j))
    return len({root(i) for i in up}), min(runs) * 2.0 * np.pi / len(first)


@given(sides, sides, sides, sides, st.floats(0.5, 3.0), st.floats(0.5, 3.0))
@examples(2, 5)
def test_limits_leave_the_pieces_of_a_linkage_that_a_grid_shows(
    tmp_path_factory, a, b, c, reach, second, third
):
    lengths, (shortest, *middle, longest) = (a, b, c), sorted([a, b, c, reach])
    assume(longest < 0.95 * (shortest + sum(middle)) and abs(sum(middle) - shortest - longest) > 0.02)
    count, least = circuits(lengths, reach, second, third)
    # 200 starts do not miss a piece of a tenth; the grid, of two thousandths, no gap of a tenth.
    assume(count and least > 0.1)
    task = planar(tmp_path_factory, lengths, (None, (-second, second), (-third, third)))
    found = continua(task, reach, limits=True, starts=200)
    assert found.freedom.tolist() == [1] * count
    assert found.decided.all()


def test_of_surfaces_a_connection_is_proven_and_none_is_left_open(tmp_path_factory):
    """Five bars: a surface in one piece, or in two if three bars exceed, in pairs, half of all."""
    one = continua(planar(tmp_path_factory, (1.0, 1.0, 1.0, 1.0)), 1.0, starts=300)
    assert one.freedom.tolist() == [2] and one.decided.tolist() == [True]
    two = continua(planar(tmp_path_factory, (1.0, 1.0, 1.0, 0.2)), 0.2, starts=300)
    assert two.freedom.tolist() == [2, 2] and two.decided.tolist() == [False, False]


# None, and the same -------------------------------------------------------------------------------


def test_where_there_is_no_posture_the_nearest_is_told():
    task = choose(load("planar_2link"))
    found = find_postures(task, goal_pose(task, [0.0, 2.5]))
    assert found.q.shape == (0, 2) and len(found.hits) == len(found.freedom) == 0
    assert not found.is_continuum
    assert_allclose(found.nearest.q, [np.pi / 2, 0.0], atol=1e-6)
    assert_allclose(found.nearest.position_error, 0.5, atol=1e-12)


def test_threads_change_no_bit(monkeypatch):
    task = choose(load("puma560"))
    goal = task.arm.pose(task.arm.sampled(1, 50)[0])
    alone = find_postures(task, goal, starts=300, threads=1)
    monkeypatch.setattr(inverse_kinematics, "SHARE", 7)
    shared = find_postures(task, goal, starts=300, threads=2)
    for name in ("q", "hits", "freedom", "decided", "led_to"):
        assert_array_equal(getattr(shared, name), getattr(alone, name))
