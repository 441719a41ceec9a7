"""What an inspection says is so: against closed forms, defining equations, finite differences and MuJoCo."""

import re

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import rmrc
from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect import directions as singular_directions
from rmrc.analysis.inspect import inspection
from rmrc.analysis.inspect.inspection import inspect
from rmrc.law.law import SINGULAR_BELOW
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import AXES, quat_to_matrix
from rmrc.textbook.euler import zyz_angles
from wording import says

# Sums of some dozen products of the size of meters.
ROUNDING = 1e-12
# A null vector of a matrix of rank r is as exact as rounding over the gap, σ_r/σ_1; chains with a smaller gap
# than 1e-3 are left out.
NULL = 1e-11

WRENCH = np.array([3.0, -2.0, 7.0, 0.4, -0.6, 0.9])


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
            found = inspect(arm, q, frame=frame)
            assert found.determinant == pytest.approx(closed, abs=ROUNDING)
            assert np.linalg.det(found.jacobian) == pytest.approx(closed, abs=ROUNDING)


def test_the_wrist_of_the_notes():
    s1, c1, s2, c2 = np.sin(0.4), np.cos(0.4), np.sin(0.9), np.cos(0.9)
    found = inspect(model("spherical_wrist", "center"), [0.4, 0.9, -0.3])
    assert found.task.axes == ("rx", "ry", "rz")
    assert_allclose(found.jacobian[3:].T, [(0, 0, 1), (-s1, c1, 0), (c1 * s2, s1 * s2, c2)], atol=ROUNDING)
    assert found.determinant == pytest.approx(-s2, abs=ROUNDING)
    # Its joints are the Z-Y-Z angles, so that E is its Jacobian.
    assert_allclose(found.E, found.jacobian[3:], atol=ROUNDING)
    assert_allclose(found.analytic_jacobian[3:], np.eye(3), atol=ROUNDING)


def test_errors_of_the_notes_planar_arm():
    # l = (1, 0.8, 0.6): at home no error along x, and 0.1 rad at the second joint gives 0.1 (l2 + l3) along y.
    found = inspect(model("planar_3link"), [0, 0, 0], joint_error=[0, 0.1, 0])
    assert_allclose(found.tip_error.deviation, [0, 0.14, 0, 0, 0, 0.1], atol=ROUNDING)
    assert_allclose(found.tip_error.displacement, [0, 0.14, 0, 0, 0, 0.1], atol=ROUNDING)
    # Bent by 90 degrees it moves back along x, and -0.1 rad moves it forth.
    found = inspect(model("planar_3link"), [0, np.pi / 2, 0], joint_error=[0, -0.1, 0])
    assert_allclose(found.tip_error.displacement, [0.14, 0, 0, 0, 0, -0.1], atol=ROUNDING)
    assert_allclose(found.tip_error.deviation, [0.14, 0, 0, 0, 0, 0.1], atol=ROUNDING)
    found = inspect(model("planar_3link"), [0, np.pi / 2, 0], joint_error=[0, 0.1, 0])
    assert_allclose(found.tip_error.deviation, [0.14, 0, 0, 0, 0, 0.1], atol=ROUNDING)
    assert_allclose(found.tip_error.displacement, [-0.14, 0, 0, 0, 0, 0.1], atol=ROUNDING)
    assert_allclose(found.tip_error.worst_translation, [0.14, 0, 0], atol=ROUNDING)
    assert_allclose(found.tip_error.worst_rotation, [0, 0, 0.1], atol=ROUNDING)


# Lost directions ---------------------------------------------------------------------------------

WORDS = {
    "2-link, straight": (
        ("planar_2link", "tip", [0, 0]),
        ["… move along x; … force along x … no torque"],
        ["shoulder and elbow … 1 : -2 … without … x and y of the site … about -z"],
    ),
    "2-link, turned": (
        ("planar_2link", "tip", [np.pi / 4, 0]),
        ["… move along (0.71, 0.71, 0); … force along (0.71, 0.71, 0) … no torque"],
        ["shoulder and elbow … 1 : -2 … without … x and y of the site … about -z"],
    ),
    "3-link, at its wrist point": (
        ("planar_3link", "wrist", [np.pi / 2, 0, 1]),
        ["… move along y; … force along y … no torque"],
        ["shoulder, elbow and wrist … 1 : -2.25 : 1.25 … without … the site"],
    ),
    "3-link, at its tip": (
        ("planar_3link", "tip", [0, 0, np.pi / 2]),
        ["… turn about z … along x … turning; … force along x … moment about z … 0.86 N to 0.51 N m …"],
        ["shoulder, elbow and wrist … 1 : -2.25 : 1.25 … without … the site"],
    ),
    "anthropomorphic, straight": (
        ("anthropomorphic", "tip", [0, 0, 0]),
        ["… move along y; … force along y … no torque"],
        ["shoulder and elbow … 1 : -2.33 … without … x, y and z of the site … about -x"],
    ),
    "anthropomorphic, upright": (
        ("anthropomorphic", "tip", [0, np.pi / 2, 0]),
        ["… move along x; … force along x … no torque", "… move along z; … force along z … no torque"],
        [
            "waist … alone without … x, y and z of the site … about z",
            "shoulder and elbow … 1 : -2.33 … without … x, y and z of the site … about -x",
        ],
    ),
    "wrist": (
        ("spherical_wrist", "center", [0.0, 0.0, 0.7]),
        ["… turn about x; … moment about x … no torque"],
        ["theta_1 and theta_3 … 1 : -1 … without … the site"],
    ),
    "stanford, its wrist": (
        ("stanford", "wrist", [0.0, np.pi / 2, 0.6, 0.0, 0.0, 0.2]),
        # The boom points along x: a force of 1 N across it has no moment about the first axis with one of -0.6 N m.
        ["… turn about z … along y … turning; … force along y … moment about -z … 0.86 N to 0.51 N m …"],
        ["theta_4 and theta_6 … 1 : -1 … without … the site"],
    ),
    "stanford, its boom": (
        ("stanford", "wrist", [0.0, 0.0, 0.6, 0.0, np.pi / 2, 0.2]),
        ["… move along y; … force along y … no torque"],
        ["theta_1, theta_2, theta_4 and theta_5 … 1 : 0.257 : -1 : -0.257 … without … the site"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WORDS)
def test_words_at_singularities(case):
    (name, site, q), lost, standing = WORDS[case]
    found = inspect(model(name, site), q, length=1.0)
    assert [one.words for one in found.lost] == list(map(says, lost))
    assert [one.words for one in found.standing] == list(map(says, standing))


def test_words_are_along_the_axes_of_the_frame():
    # Half a turn to the left, the site's x is the world's -x, and the arm's direction.
    found = inspect(model("planar_2link"), [np.pi / 3, 0], frame="site")
    assert found.lost[0].words == says("… move along x; … force along x … (axes of the site)")
    assert found.standing[0].words == says("… about -z (axes of the site)")


@given(seeds, st.sampled_from([0.4, 1.0]), st.sampled_from([None, AXES, ("y", "rx"), ("rz",)]))
def test_what_is_lost_and_what_stands_still_for_any_chain(tmp_path_factory, seed, length, axes):
    arm = chain_of(tmp_path_factory, seed)
    found = inspect(arm, arm.sampled(1, seed)[0], axes=axes, length=length)
    check_spaces(found, arm.jacobian(found.q))
    assert (
        found.rank_by_minors
        == found.rank
        == np.linalg.matrix_rank(found.task.matrix(arm.jacobian(found.q)), 1e-9)
    )


@given(seeds)
def test_the_words_name_the_directions_that_are_found(tmp_path_factory, seed):
    arm = chain_of(tmp_path_factory, seed)
    found = inspect(arm, arm.sampled(1, seed)[0], axes=AXES, frame="site")
    R = found.R_world_frame
    for one in found.lost:
        said = directions(one.words.partition("; ")[2])
        # In the order in which they are said: the force, then the moment. Two decimals are 0.005 each way.
        parts = [
            part for part in (R.T @ one.wrench[:3], R.T @ one.wrench[3:]) if np.linalg.norm(part) > 0.005
        ]
        for words, part in zip(said, parts, strict=True):
            assert_allclose(words, part / np.linalg.norm(part), atol=0.0051)
        assert one.words.endswith(" (axes of the site)")
    for one in found.standing:
        for joint, rate in zip(arm.joints, one.motion, strict=True):
            is_main = abs(rate) >= 0.1 * np.abs(one.motion).max()
            assert (re.search(rf"\b{joint}\b", one.words) is not None) == is_main


def directions(words):
    """Return the directions that a sentence names, in their order."""
    unit = {
        sign + axis: factor * np.eye(3)[i]
        for i, axis in enumerate("xyz")
        for sign, factor in (("", 1), ("-", -1))
    }
    found = re.findall(r"(?:along|about) (\([^)]*\)|-?[xyz])", words)
    return [
        unit[one] if one in unit else np.array([float(part) for part in one[1:-1].split(",")])
        for one in found
    ]


def check_spaces(found, J):
    """Hold lost directions and standing motions against their defining equations, and count them."""
    task, arm = found.task, found.arm
    others = np.delete(np.arange(6), task.rows)
    gap = found.sigma[0] / found.sigma[max(found.rank - 1, 0)] if found.rank else 1.0
    slack = NULL * max(1.0, np.abs(J).max()) * gap
    for one in found.lost:
        assert_allclose(J.T @ one.wrench, 0.0, atol=slack)
        assert np.all(one.wrench[others] == 0.0) and np.all(one.twist[others] == 0.0)
        # of the scaled rows, one direction of length 1
        assert one.wrench @ one.twist == pytest.approx(1.0, abs=ROUNDING)
    for one in found.standing:
        assert_allclose(J[task.rows] @ one.motion, 0.0, atol=slack)
        assert_allclose(one.twist, J @ one.motion, atol=ROUNDING * max(1.0, np.abs(J).max()))
        assert np.linalg.norm(one.motion / task.joint_scale) == pytest.approx(1.0, abs=ROUNDING)
    assert len(found.lost) == len(task.rows) - found.rank
    assert len(found.standing) == arm.n - found.rank
    for vectors in ([one.wrench for one in found.lost], [one.motion for one in found.standing]):
        assert not vectors or np.linalg.matrix_rank(np.array(vectors), 1e-6) == len(vectors)


@pytest.mark.parametrize("case", WORDS)
def test_what_is_lost_at_singularities(case):
    (name, site, q), *_ = WORDS[case]
    arm = model(name, site)
    for length in (0.5, 1.0):
        found = inspect(arm, q, length=length)
        assert found.lost and found.standing and found.condition == np.inf
        check_spaces(found, arm.jacobian(found.q))
        assert found.rank_by_minors == found.rank


def test_a_fault_in_the_lost_direction_would_be_seen():
    found = inspect(model("stanford", "wrist"), [0.3, 1.0, 0.6, 0.7, 0.0, 0.2])
    J = found.arm.jacobian(found.q)
    J[:, 4] += 1e-6
    with pytest.raises(AssertionError):
        check_spaces(found, J)


def test_nothing_is_lost_at_home():
    for path in sorted((ROOT / "models").glob("planar*.xml")):
        arm = arms.load(path)
        found = inspect(arm, arm.configuration("home")[arm.wiring.qpos])
        assert (found.lost, found.slow) == ((), ())
        assert found.rank == len(found.task.rows)


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_nearly_lost_begins_where_the_law_says_singular(factor):
    # Two links of 1 m: w = s2 and sigma_1² + sigma_2² = 3 + 2 c2 fix the elbow of a condition.
    ratio = SINGULAR_BELOW * factor
    elbow = np.linspace(0.01, 0.1, 100_001)
    share = np.sin(elbow) / (3 + 2 * np.cos(elbow))  # = ratio/(1 + ratio²)
    q = [0.3, np.interp(ratio / (1 + ratio**2), share, elbow)]
    found = inspect(model("planar_2link"), q)
    assert 1.0 / found.condition == pytest.approx(ratio, rel=1e-6)
    assert len(found.slow) == (factor < 1.0) and not found.lost


@pytest.mark.parametrize(
    ("name", "q", "words"),
    [
        (
            "planar_2link",
            [0, 0.002],
            ["moves by only 0.00089 m along x for shoulder 0.45 rad and elbow -0.89 rad; 1 m/s of it takes 1000 rad/s of elbow"],
        ),
        (
            "spherical_wrist",
            [0, 0.002, 0],
            ["turns by only 0.0014 rad about x for theta_1 -0.71 rad and theta_3 0.71 rad; 1 rad/s of it takes 500 rad/s of theta_1"],
        ),
    ],
)  # fmt: skip
def test_words_near_singularities(name, q, words):
    found = inspect(model(name, "center" if name == "spherical_wrist" else None), q)
    assert [one.words for one in found.slow] == words


def test_a_slow_motion_is_what_its_joints_give():
    for name, q in (("planar_2link", [0.4, 0.002]), ("stanford", [0.3, 1.0, 0.6, 0.7, 1e-3, 0.2]),
                    ("helical", [0.5, 0.7, 1.682])):  # fmt: skip
        arm = model(name)
        (one,) = (found := inspect(arm, q, length=0.7)).slow
        task = found.task
        assert_allclose(one.twist[task.rows], arm.jacobian(q)[task.rows] @ one.motion, atol=ROUNDING)
        assert np.linalg.norm(task.row_scale * one.twist[task.rows]) == pytest.approx(one.sigma, abs=ROUNDING)
        assert np.linalg.norm(one.motion / task.joint_scale) == pytest.approx(1.0, abs=ROUNDING)
        assert one.sigma == found.sigma[-1] < SINGULAR_BELOW * found.sigma[0]
    assert "while turning by" in inspect(model("stanford"), [0.3, 1.0, 0.6, 0.7, 1e-3, 0.2]).slow[0].words


def test_joints_that_hardly_move_are_left_out_and_that_is_said():
    # 4 of the 6 joints make nearly all of the motion, the others less than a tenth of the largest.
    found = inspect(model("stanford"), [0.3, 1.5, 0.6, 1.5, 1e-3, 0.2])
    (one,) = found.slow
    left_out = np.abs(one.motion) < 0.1 * np.abs(one.motion).max()
    said = one.words.partition(" for ")[2]
    assert left_out.any() and said.startswith("mainly ")
    for joint, out in zip(found.arm.joints, left_out, strict=True):
        assert (joint in said) != out


def test_no_row_moves_at_all():
    found = inspect(model("planar_2link"), [0.3, 0.5], axes=["z"])
    assert (found.rank, found.rank_by_minors, found.condition) == (0, 0, np.inf)
    assert found.lost[0].words == "cannot move along z; a force along z needs no torque"
    assert [one.words for one in found.standing] == [
        "shoulder turns alone without moving z of the site, which moves along (-0.52, 0.85, 0) and turns about z",
        "elbow turns alone without moving z of the site, which moves along (-0.72, 0.7, 0) and turns about z",
    ]


# Frames, rows, ranks -----------------------------------------------------------------------------

TILTED = """<mujoco><worldbody><body quat="0.8 0.1 0.5 0.3" pos="0.1 0.2 0.3">
<body><joint name="a" axis="0 0 1"/><geom size="0.1"/><body pos="1 0 0"><joint name="b" axis="0 0 1"/><geom size="0.1"/>
<site name="tip" pos="1 0 0"/></body></body></body></worldbody></mujoco>"""


def test_the_frame_of_the_base_is_that_of_the_body_which_carries_the_arm(tmp_path):
    path = tmp_path / "tilted.xml"
    path.write_text(TILTED)
    arm = arms.load(path)
    found = inspect(arm, [0.4, 0.7], frame="base")
    s1, c1, s12, c12 = np.sin(0.4), np.cos(0.4), np.sin(1.1), np.cos(1.1)
    closed = [[-s1 - s12, c1 + c12, 0, 0, 0, 1], [-s12, c12, 0, 0, 0, 1]]
    assert_allclose(found.jacobian.T, closed, atol=ROUNDING)
    # In the site's frame, which is {2} of the notes; and in the world it is another.
    site = inspect(arm, [0.4, 0.7], frame="site").jacobian
    assert_allclose(site.T[:, :2], [[np.sin(0.7), 1 + np.cos(0.7)], [0, 1]], atol=ROUNDING)
    world = inspect(arm, [0.4, 0.7]).jacobian
    assert_allclose(world, arm.jacobian([0.4, 0.7]), atol=0.0)
    assert np.abs(world[2]).max() > 0.1


@pytest.mark.parametrize(
    ("name", "why"),
    [
        (
            "planar_2link",
            "those that the arm can move independently; z, rx and ry stay as they are, rz follows from these",
        ),
        ("planar_3link", "those that the arm can move independently; z, rx and ry stay as they are"),
        ("stanford", "the arm can move all six independently"),
        (
            "anthropomorphic",
            "those that the arm can move independently; rx, ry and rz follow from these",
        ),
    ],
)
def test_why_these_rows(name, why):
    arm = model(name)
    q = arm.sampled(1)[0]
    assert inspect(arm, q).why == why
    assert inspect(arm, q, axes=["x"]).why == "as requested"


def test_too_many_minors_are_not_counted(monkeypatch):
    monkeypatch.setattr(inspection, "MOST_MINORS", 4)
    assert inspect(model("planar_2link"), [0, 1]).rank_by_minors is None


# Ellipsoids, angles, errors, statics -------------------------------------------------------------


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_ellipsoids_hold_what_unit_rates_and_torques_can(tmp_path_factory, seed):
    arm = chain_of(tmp_path_factory, seed)
    found, rng = inspect(arm, arm.sampled(1, seed)[0], axes=AXES, length=0.6), np.random.default_rng(seed)
    J = arm.jacobian(found.q)
    assert [one.rows for one in found.ellipsoids] == [("x", "y", "z"), ("rx", "ry", "rz")]
    for one, rows in zip(found.ellipsoids, (slice(3), slice(3, 6)), strict=True):
        rates = rng.normal(size=(100, arm.n))
        rates /= np.linalg.norm(rates, axis=1, keepdims=True)
        along = (rates * found.task.joint_scale) @ J[rows].T @ one.velocity.axes
        live = one.velocity.half_axes > 1e-6
        inside = np.sum((along[:, live] / one.velocity.half_axes[live]) ** 2, axis=1)
        assert inside.max() <= 1.0 + 1e-9  # rounding over the least half axis
        for axis, half in zip(one.force.axes.T[live], one.force.half_axes[live], strict=True):
            assert np.linalg.norm(found.task.joint_scale * (J[rows].T @ (half * axis))) == pytest.approx(
                1.0, rel=1e-9
            )


def test_analytic_jacobian_is_the_derivative_of_position_and_angles():
    arm, q, step = model("stanford"), np.array([0.3, 1.0, 0.6, 0.7, 0.5, 0.2]), 1e-6
    found = inspect(arm, q)

    def coordinates(q):
        pose = arm.pose(q)
        return np.concatenate([pose[:3], zyz_angles(quat_to_matrix(pose[3:]))])

    columns = [(coordinates(q + e) - coordinates(q - e)) / (2 * step) for e in step * np.eye(6)]
    assert_allclose(found.analytic_jacobian, np.array(columns).T, atol=1e-8)  # central differences
    assert_allclose(found.E @ found.analytic_jacobian[3:], found.jacobian[3:], atol=ROUNDING)


@pytest.mark.parametrize(
    ("beta", "words"),
    [
        (0.9, "the angles are regular here: the analytic Jacobian is singular where J is, and nowhere else"),
        (
            0.005,
            "the angles are nearly singular here: to turn about (0.92, 0.39, 0) at 1 rad/s they change at up to 283 rad/s; "
            "the singularity belongs to the angles, not to the arm",
        ),
        (
            0.0,
            "the angles are singular here: no rates of theirs turn the site about x, and the analytic Jacobian has no value; "
            "the singularity belongs to the angles, not to the arm",
        ),
    ],
)
def test_the_angles_singularity_in_words(beta, words):
    found = inspect(model("spherical_wrist", "center"), [0.4, beta, 0.3])
    assert found.angles_in_words == words
    assert (found.analytic_jacobian is None) == (beta == 0.0)


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_errors_of_single_joints_add_in_squares_and_none_is_worse_than_the_worst(tmp_path_factory, seed):
    arm = chain_of(tmp_path_factory, seed)
    q, rng = arm.sampled(1, seed)[0], np.random.default_rng(seed)
    deviations = rng.uniform(0.0, 0.01, arm.n)
    error = inspect(arm, q, joint_error=deviations).tip_error
    assert_allclose(error.deviation**2, (arm.jacobian(q) * deviations) ** 2 @ np.ones(arm.n), atol=1e-15)
    for worst, part in ((error.worst_translation, slice(3)), (error.worst_rotation, slice(3, 6))):
        some = rng.normal(size=(200, 3))
        some /= np.linalg.norm(some, axis=1, keepdims=True)
        along = np.sqrt(np.einsum("ki,ij,kj->k", some, error.covariance[part, part], some))
        assert along.max() <= np.linalg.norm(worst) + 1e-15


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_a_wrench_is_held_by_what_mujoco_and_the_equilibrium_of_links_say(tmp_path_factory, seed):
    arm = chain_of(tmp_path_factory, seed)
    q = arm.sampled(1, seed)[0]
    held = inspect(arm, q, wrench=WRENCH).balance
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_forward(arm.model, data)
    torques = np.zeros(arm.model.nv)
    p = data.site_xpos[arm.wiring.site]
    mujoco.mj_applyFT(arm.model, data, WRENCH[:3], WRENCH[3:], p, arm.wiring.body, torques)
    assert_allclose(held.equivalent, torques[arm.wiring.dof], atol=1e-11)
    assert_allclose(held.equilibrium, -held.equivalent, atol=0.0)
    # All links beyond a joint are at rest: reaction and wrench cancel at any point.
    for reaction, point in zip(held.reaction_world, held.frames[:, :3, 3], strict=True):
        assert_allclose(reaction[:3], -WRENCH[:3], atol=1e-11)
        assert_allclose(reaction[3:], -WRENCH[3:] - np.cross(p - point, WRENCH[:3]), atol=1e-11)
    assert held.disagreement < 1e-11


def test_torques_of_the_notes():
    # l = 1 m, theta = (0, 60 deg): pressing down with 1 N is what (-3/2, -1/2) N m do.
    held = inspect(model("planar_2link"), np.radians([0, 60]), wrench=[0, -1, 0, 0, 0, 0]).balance
    assert_allclose(held.equivalent, [-1.5, -0.5], atol=ROUNDING)
    held = inspect(model("planar_2link"), np.radians([90, 0]), wrench=[0, -1000, 0, 0, 0, 0]).balance
    assert_allclose(held.equilibrium, [0, 0], atol=1e-9)  # rounding of 1000 N


# Questions ---------------------------------------------------------------------------------------


def test_it_is_public():
    assert rmrc.inspect is inspect


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ({"q": [0]}, "q … 2 … shoulder, elbow … (1,)"),
        ({"q": [0, np.nan]}, "q … finite … [0.0, nan]"),
        ({"axes": ["x", "q"]}, 'axes: … "q" … x y z rx ry rz'),
        ({"axes": []}, "axes … one … x y z rx ry rz"),
        ({"length": 0.0}, "length … 0 … 0"),
        ({"frame": "sight"}, 'frame: … "sight" … "site"… world base site'),
        ({"joint_error": [0.1]}, "joint error … 2 … shoulder, elbow … (1,)"),
        ({"wrench": [1, 2]}, "wrench … 6 … fx, fy, fz, nx, ny, nz … (2,)"),
        ({"wrench": [1, 2, 3, 4, 5, np.inf]}, "wrench … finite … [1.0, 2.0, 3.0, 4.0, 5.0, inf]"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(question, message):
    with pytest.raises(QuestionError) as caught:
        inspect(model("planar_2link"), **{"q": [0, 1], **question})
    assert str(caught.value) == says(message)


def test_outside_of_limits_is_a_warning():
    found = inspect(model("planar_2link"), [-3.1, 3.0])
    assert found.warnings == (
        says("shoulder = -3.1 … limits: … lower … -2.967"), says("elbow = 3 … limits: … upper … 2.793")
    )  # fmt: skip
    assert_allclose(found.room, [2.9670597 - 3.1, 2.7925268 - 3.0], atol=ROUNDING)
    assert inspect(model("planar_2link"), np.radians([170, -160])).warnings == ()
    # A limit of eight digits is not passed by its ninth, but by a thousandth of a degree.
    (warning,) = inspect(model("planar_2link"), np.radians([170.001, -160])).warnings
    assert warning == says("shoulder = 2.967 … limits: … upper … 2.967")


def test_thresholds_are_those_of_the_law_and_of_the_task():
    assert singular_directions.SLOW == SINGULAR_BELOW
    assert singular_directions.rank_of(np.array([1.0, 2e-9, 0.5e-9])) == 2
