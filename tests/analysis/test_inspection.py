"""What an inspection says is so: against closed forms, defining equations and other answers of the program."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import rmrc
from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.scenario import loads
from rmrc.support.spatial import AXES
from wording import says

# Sums of some dozen products of the size of meters.
ROUNDING = 1e-12
# A null vector of a matrix of rank r is as exact as rounding over the gap, σ_r/σ_1; chains with a smaller gap
# than 1e-3 are left out.
NULL = 1e-11


def model(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


def chain_of(folder, seed):
    path = folder.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed))
    return arms.load(path)


# Known values ------------------------------------------------------------------------------------


@pytest.mark.parametrize("site", ["wrist", "tool"])
def test_determinant_of_the_stanford_arm_is_the_notes_at_both_sites_and_in_all_frames(site):
    arm = model("stanford", site)
    for q in arm.sampled(5):
        closed = q[2] ** 2 * np.sin(q[1]) * np.sin(q[4])
        for frame in ("world", "site", "base"):
            found = rmrc.inspect(arm, q, frame=frame)
            assert found.determinant == pytest.approx(closed, abs=ROUNDING)
            assert np.linalg.det(found.jacobian) == pytest.approx(closed, abs=ROUNDING)


def test_the_wrist_of_the_notes():
    s1, c1, s2, c2 = np.sin(0.4), np.cos(0.4), np.sin(0.9), np.cos(0.9)
    found = rmrc.inspect(model("spherical_wrist", "center"), [0.4, 0.9, -0.3])
    assert found.task.axes == ("rx", "ry", "rz")
    assert_allclose(found.jacobian[3:].T, [(0, 0, 1), (-s1, c1, 0), (c1 * s2, s1 * s2, c2)], atol=ROUNDING)
    assert found.determinant == pytest.approx(-s2, abs=ROUNDING)
    # Its joints are the Z-Y-Z angles, whose rates grow as the axes of the first and the last come together.
    assert_allclose(found.angles, [0.4, 0.9, -0.3], atol=ROUNDING)
    fastest = 1.0 / np.linalg.svd(found.jacobian[3:])[1][-1]
    assert (
        found.angles_in_words == f"they change at up to {fastest:.3g} rad/s while the site turns at 1 rad/s"
    )
    singular = rmrc.inspect(model("spherical_wrist", "center"), [0.4, 0.0, -0.3]).angles_in_words
    assert singular.startswith("the angles are singular here: no rates of theirs turn the site about x")


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_independent_errors_of_joints_add_in_squares(tmp_path_factory, seed):
    arm = chain_of(tmp_path_factory, seed)
    q, errors = arm.sampled(1, seed)[0], np.random.default_rng(seed).uniform(-0.01, 0.01, arm.n)
    found, columns = rmrc.inspect(arm, q, joint_error=errors).tip_error, arm.jacobian(q) * errors
    assert_allclose(found["deviation"] ** 2, (columns**2).sum(axis=1), atol=1e-15)
    assert_allclose(found["displacement"], columns.sum(axis=1), atol=1e-15)


# Lost directions ---------------------------------------------------------------------------------

WORDS = {
    "3-link, at its tip": (
        ("planar_3link", "tip", [0, 0, np.pi / 2]),
        [
            "cannot turn about z in place, nor move along x without turning; a force along x with a moment "
            "about z, 0.86 N to 0.51 N m, needs no torque"
        ],
        ["shoulder, elbow and wrist turn together, 1 : -2.25 : 1.25, without moving the site"],
    ),
    "anthropomorphic, upright": (
        ("anthropomorphic", "tip", [0, np.pi / 2, 0]),
        [
            "cannot move along x; a force along x needs no torque",
            "cannot move along z; a force along z needs no torque",
        ],
        [
            "waist turns alone, and the site turns about z",
            "shoulder and elbow turn against each other, 1 : -2.33, and the site turns about -x",
        ],
    ),
}  # fmt: skip


def check_spaces(found, J):
    """Hold lost directions and self-motions against their defining equations, and count them."""
    task, arm = found.task, found.arm
    others = np.delete(np.arange(6), task.rows)
    gap = found.sigma[0] / found.sigma[max(found.rank - 1, 0)] if found.rank else 1.0
    slack = NULL * max(1.0, np.abs(J).max()) * gap
    for lost in found.lost:
        assert_allclose(J.T @ lost.wrench, 0.0, atol=slack)
        assert np.all(lost.wrench[others] == 0.0) and np.all(lost.twist[others] == 0.0)
        # of the scaled rows, one direction of length 1
        assert lost.wrench @ lost.twist == pytest.approx(1.0, abs=ROUNDING)
    for still in found.self_motions:
        assert_allclose(J[task.rows] @ still.joint_motion, 0.0, atol=slack)
        assert_allclose(still.twist, J @ still.joint_motion, atol=ROUNDING * max(1.0, np.abs(J).max()))
        assert np.linalg.norm(still.joint_motion / task.joint_scale) == pytest.approx(1.0, abs=ROUNDING)
    assert len(found.lost) == len(task.rows) - found.rank
    assert len(found.self_motions) == arm.n - found.rank
    assert (found.condition == np.inf) == (found.rank < len(found.sigma))
    for vectors in ([one.wrench for one in found.lost], [one.joint_motion for one in found.self_motions]):
        assert not vectors or np.linalg.matrix_rank(np.array(vectors), 1e-6) == len(vectors)


@pytest.mark.parametrize("case", WORDS)
def test_what_is_lost_at_singularities(case):
    (name, site, q), lost, still = WORDS[case]
    arm = model(name, site)
    for length in (0.5, 1.0):
        found = rmrc.inspect(arm, q, length=length)
        check_spaces(found, arm.jacobian(found.q))
        assert found.rank_by_minors == found.rank
    assert [one.words for one in found.lost] == lost
    assert [one.words for one in found.self_motions] == still


def test_a_fault_in_the_lost_direction_would_be_seen():
    found = rmrc.inspect(model("stanford", "wrist"), [0.3, 1.0, 0.6, 0.7, 0.0, 0.2])
    J = found.arm.jacobian(found.q)
    J[:, 4] += 1e-6
    with pytest.raises(AssertionError):
        check_spaces(found, J)


@given(seeds, st.sampled_from([0.4, 1.0]), st.sampled_from([None, AXES, ("y", "rx"), ("rz",)]))
def test_what_is_lost_and_what_stands_still_for_any_chain(tmp_path_factory, seed, length, axes):
    arm = chain_of(tmp_path_factory, seed)
    found = rmrc.inspect(arm, arm.sampled(1, seed)[0], axes=axes, length=length)
    J = arm.jacobian(found.q)
    check_spaces(found, J)
    assert found.rank_by_minors == found.rank == np.linalg.matrix_rank(found.task.matrix(J), 1e-9)


# Frames, scales, ellipsoids ----------------------------------------------------------------------

TILTED = """<mujoco><worldbody><body quat="0.8 0.1 0.5 0.3" pos="0.1 0.2 0.3">
<body><joint name="a" axis="0 0 1"/><geom size="0.1"/><body pos="1 0 0"><joint name="b" axis="0 0 1"/><geom size="0.1"/>
<site name="tip" pos="1 0 0"/></body></body></body></worldbody></mujoco>"""


def test_the_frame_of_the_base_is_that_of_the_body_which_carries_the_arm(tmp_path):
    path = tmp_path / "tilted.xml"
    path.write_text(TILTED)
    arm = arms.load(path)
    base, site, world = (
        rmrc.inspect(arm, [0.4, 0.7], frame=one).jacobian for one in ("base", "site", "world")
    )
    s1, c1, s12, c12 = np.sin(0.4), np.cos(0.4), np.sin(1.1), np.cos(1.1)
    assert_allclose(base.T, [[-s1 - s12, c1 + c12, 0, 0, 0, 1], [-s12, c12, 0, 0, 0, 1]], atol=ROUNDING)
    # In the site's frame, which is {2} of the notes; and in the world it is another.
    assert_allclose(site.T[:, :2], [[np.sin(0.7), 1 + np.cos(0.7)], [0, 1]], atol=ROUNDING)
    assert_allclose(world, arm.jacobian([0.4, 0.7]), atol=0.0)
    assert np.abs(world[2]).max() > 0.1
    # Half a turn to the left, the site's x is the world's -x, and the direction of the arm.
    (lost,) = rmrc.inspect(model("planar_2link"), [np.pi / 3, 0], frame="site").lost
    assert lost.words == "cannot move along x; a force along x needs no torque"


@pytest.mark.parametrize("name", ["puma560", "so101"])
def test_inspect_check_and_a_run_scale_sigma_alike(name):
    arm = model(name)
    found = rmrc.inspect(arm)
    text = f"""
name: alike
arm: {{model: {arm.path}, site: {arm.site}}}
task: {{axes: [{", ".join(found.task.axes)}]}}
target: {{path: [{{hold: {{for: 0.01}}}}]}}
"""
    start = rmrc.run(loads(text))["sigma"][0]
    # LAPACK's values and those of the law, of the same matrix
    assert_allclose(rmrc.check(arm).sigma, found.sigma, rtol=0, atol=ROUNDING)
    assert_allclose(start, found.sigma, rtol=0, atol=ROUNDING)
    # Negative control: in meters they are others.
    assert np.abs(rmrc.inspect(arm, length=1.0).sigma - start).max() > 0.01


@pytest.mark.parametrize("frame", ["world", "site"])
@given(seeds)
@settings(max_examples=10, deadline=None)
def test_ellipsoids_hold_what_unit_rates_and_torques_can(tmp_path_factory, frame, seed):
    arm, rng = chain_of(tmp_path_factory, seed), np.random.default_rng(seed)
    found = rmrc.inspect(arm, arm.sampled(1, seed)[0], axes=AXES, task_frame=frame, length=0.6)
    J = arm.jacobian(found.q) * found.task.joint_scale
    assert ["".join(one["rows"]) for one in found.ellipsoids] == ["xyz", "rxryrz"]
    for one, rows in zip(found.ellipsoids, (slice(3), slice(3, 6)), strict=True):
        rates = rng.normal(size=(100, arm.n))
        rates /= np.linalg.norm(rates, axis=1, keepdims=True)
        along = rates @ J[rows].T @ one["directions"].T
        live = one["velocity"] > 1e-6
        inside = np.sum((along[:, live] / one["velocity"][live]) ** 2, axis=1)
        assert inside.max() <= 1.0 + 1e-9  # rounding over the least half axis
        for axis, half in zip(one["directions"][live], one["force"][live], strict=True):
            assert np.linalg.norm(J[rows].T @ (half * axis)) == pytest.approx(1.0, rel=1e-9)
        assert np.isinf(one["force"][one["velocity"] == 0.0]).all()


# Questions ---------------------------------------------------------------------------------------


def test_outside_of_limits_is_a_warning():
    assert rmrc.inspect(model("planar_2link"), [-3.1, 3.0]).warnings == (
        says("shoulder = -3.1 … limits [-2.967, 2.967]"), says("elbow = 3 … limits [-2.793, 2.793]")
    )  # fmt: skip
    assert rmrc.inspect(model("planar_2link"), np.radians([170, -160])).warnings == ()
    # A limit of eight digits is not passed by its ninth, but by a thousandth of a degree.
    assert len(rmrc.inspect(model("planar_2link"), np.radians([170.001, -160])).warnings) == 1
