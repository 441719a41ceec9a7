"""All postures are found, counted as closed forms count them, and a continuum is not listed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.ik import find_postures, goal_pose
from rmrc.law.task import choose
from rmrc.support.spatial import pose_error
from rmrc.textbook.spatial import torus_postures


def load(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


def find(task, goal, start=None, **more):
    home = task.arm.configuration("home")[task.arm.wiring.qpos]
    return find_postures(task, goal, home if start is None else start, tolerance=1e-9, **more)


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
    assert found.hits.sum() <= found.starts


def two_links(reach, x, y):
    """The textbook's two postures: cosine law [Craig05, §4.4]."""
    elbow = np.arccos((x * x + y * y - 2 * reach**2) / (2 * reach**2))
    return [
        (np.arctan2(y, x) - np.arctan2(np.sin(e), 1 + np.cos(e)), e) for e in (-elbow, elbow)
    ]  # equal links


def test_two_links_have_two_postures():
    task = choose(load("planar_2link"))
    found = find(task, goal_pose(task, [0.9, 0.8]))
    # 1e-13 is what the search goes down to, over the smallest singular value.
    assert_allclose(found.q, sorted_rows(two_links(1.0, 0.9, 0.8)), atol=1e-12)
    assert_array_equal(found.freedom, [0, 0])
    assert not found.is_continuum


def test_a_posture_where_the_circle_closes_is_listed_once():
    """Starts lead to q_1 = π and to −π, each by rounding: the same posture."""
    task = choose(load("planar_2link"))
    q = np.array([np.pi, 0.8])
    found = find(task, task.arm.pose(q), limits=False)
    assert len(found.q) == 2
    assert np.abs(np.exp(1j * found.q) - np.exp(1j * q)).max(axis=1).min() < 1e-12


def test_the_puma_has_eight_postures():
    task = choose(load("puma560"))
    q = task.arm.sampled(1, 30)
    goal = task.arm.pose(q[0])
    found = find(task, goal, limits=False)
    assert len(found.q) == 8 and not found.is_continuum
    assert_postures(task, goal, found)
    # Shoulder left or right, elbow up or down, wrist flipped or not: each once.
    arms_ = {tuple(row) for row in np.exp(1j * found.q[:, :3]).round(6)}
    assert len(arms_) == 4
    wrists = found.q[:, 4].round(9)
    assert all(-wrist in wrists for wrist in wrists)
    # Within limits there are fewer, all of them among the eight.
    kept = find(task, goal)
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
    found = find(task, goal, limits=False)
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
    found = find(task, goal_pose(task, point), limits=False)
    assert len(found.q) == len(expected) > 0
    assert_allclose(found.q, sorted_rows(expected), atol=1e-11)


# Continua ---------------------------------------------------------------------------------------


def test_on_the_waist_axis_there_is_a_continuum():
    task = choose(load("torus_3r_short"))
    start = [0.7, 0.5, 0.5]
    found = find(task, goal_pose(task, [0.0, 0.0, 0.7]), start)
    assert found.is_continuum and found.freedom.tolist() == [1]
    # Any waist angle will do; of all that were met, the start's is nearest, to the spacing of the starts.
    assert abs(found.q[0, 0] - 0.7) < 0.2
    # Negative control: beside the axis they are isolated.
    beside = find(task, goal_pose(task, [0.01, 0.0, 0.7]), start, limits=False)
    assert not beside.is_continuum and len(beside.q) == 4


def test_an_arm_with_joints_to_spare_has_a_continuum():
    task = choose(load("planar_3link"), ["x", "y"])
    found = find(task, goal_pose(task, [0.6, 0.3]), starts=24, limits=False)
    assert found.freedom.tolist() == [1] and found.hits.tolist() == [found.starts]


@pytest.mark.parametrize(("limits", "isolated"), [(True, 2), (False, 4)])
def test_a_wrist_that_is_straight_leaves_a_continuum_beside_isolated_postures(limits, isolated):
    # θ_5 = 0: θ_4 and θ_6 turn about one axis. The other shoulder's wrist is bent, and its postures isolated.
    task = choose(load("stanford"))
    goal = task.arm.pose([0.3, 1.1, 0.6, 0.5, 0.0, -0.4])
    found = find(task, goal, [0.3, 1.1, 0.6, 0.5, 0.0, -0.4], limits=limits)
    assert sorted(found.freedom.tolist()) == [0] * isolated + [1]
    loose = found.q[found.freedom > 0]
    assert_allclose(loose[0, [0, 1, 2, 4]], [0.3, 1.1, 0.6, 0.0], atol=1e-6)
    assert_allclose(np.exp(1j * (loose[0, 3] + loose[0, 5])), np.exp(0.1j), atol=1e-6)


def test_a_singular_posture_with_none_beside_it_is_isolated():
    # A is singular where two links are stretched, but they cannot move.
    task = choose(load("planar_2link"))
    found = find(task, goal_pose(task, [2.0 * np.cos(0.3), 2.0 * np.sin(0.3)]))
    assert not found.is_continuum
    # The two postures are one there, to the root of rounding.
    assert_allclose(found.q, [[0.3, 0.0]], atol=1e-6)


# Denavit-Hartenberg rows a, α [deg], d, and a pose that six hinges of these dimensions reach in sixteen ways.
MANSEUR_DOTY = ((0.3, 90, 0.0), (1.0, 1, 0.0), (0.0, 90, 0.2), (1.5, 1, 0.0), (0.0, 90, 0.0), (0.0, 1, 0.0))
REACHED_BY = [1.081, -1.888, 2.778, -0.848, -2.479, 0.811]


def test_six_hinges_have_all_their_sixteen_postures(tmp_path):
    """Six hinges have sixteen at most: none is missing, and none is counted twice."""
    bodies, before = "", (0.0, 0, 0.0)
    for row in MANSEUR_DOTY:
        bodies += f'<body pos="{before[0]} 0 0" euler="{before[1]} 0 0"><body pos="0 0 {row[2]}">'
        bodies += '<joint axis="0 0 1"/><geom size="0.1" contype="0" conaffinity="0"/>'
        before = row
    tip = f'<site name="tip" pos="{before[0]} 0 0" euler="{before[1]} 0 0"/>'
    (tmp_path / "arm.xml").write_text(
        f"<mujoco><worldbody>{bodies}{tip}{'</body></body>' * 6}</worldbody></mujoco>"
    )
    task = choose(arms.load(tmp_path / "arm.xml"))
    goal = task.arm.pose(REACHED_BY)
    found = find(task, goal, limits=False)
    assert len(found.q) == 16 and not found.is_continuum
    assert_postures(task, goal, found)
    assert np.abs(np.exp(1j * found.q) - np.exp(1j * np.array(REACHED_BY))).max(axis=1).min() < 1e-9
