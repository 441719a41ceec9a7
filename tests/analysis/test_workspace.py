"""A workspace is what closed forms, MuJoCo and numpy say: areas, extents, boundaries, singular sets."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from spaces import arm_of, found

from chains import random_chain, seeds
from project import ROOT, examples
from rmrc import arm as arms
from rmrc.analysis.workspace.report import report, save
from rmrc.analysis.workspace.slices import choose_slice, curvature, nearest_singular
from rmrc.analysis.workspace.workspace import workspace
from rmrc.law.task import Task
from rmrc.support.errors import QuestionError
from rmrc.textbook.torus import torus_tube
from rmrc.textbook.two_link import two_link_position, two_link_postures
from rmrc.textbook.two_link_workspace import two_link_boundary, two_link_free_area

SIX_THREE = (6.0, 3.0)
LIMITS = np.radians([[0, 135], [0, 120]])
TORI = {"torus_3r": (1.2, 0.6, 0.5), "torus_3r_short": (0.4, 0.6, 0.5)}
BASE = 1.2  # height of frame {0} of both
# Curves are interpolated in a grid of two degrees: sines deviate from chords by (2°)³/16 of a radian.
INTERPOLATED = 1e-5


# Areas and volumes -----------------------------------------------------------------------------------


def assert_area(reach, exact, share=4e-3):
    """Within the stated accuracy, and without bias: were the edge counted in full, it would exceed the share."""
    assert abs(reach.area - exact) < reach.accuracy
    assert_allclose(reach.area, exact, rtol=share)
    assert reach.reached.sum() * reach.steps.prod() > (1.0 + share) * exact  # negative control


@pytest.mark.parametrize("cells", [50, 100, pytest.param(200, marks=pytest.mark.long)])
def test_areas_of_two_links_are_those_of_the_annulus_and_of_the_jacobian(cells):
    space = found("planar_6_3", cells=cells)
    assert_area(space.free, two_link_free_area(SIX_THREE))
    # With limits each point has one posture: the area is ∫∫ |det J| = 18 ∫∫ sin q2.
    assert_area(space.limited, 18.0 * (1.0 - np.cos(LIMITS[1, 1])) * LIMITS[0, 1], 1e-2)


def test_areas_of_three_links_are_those_of_the_disc_and_of_a_search_by_closed_form():
    space = found("planar_3link")
    lengths, limits = (1.0, 0.8, 0.6), space.task.arm.position_limit
    assert_allclose(sum(lengths), space.free.extents[0, 1], atol=1e-6)
    assert_area(space.free, np.pi * sum(lengths) ** 2)
    # A point is reached if for some direction of the last link the other two have a posture within all limits.
    rng = np.random.default_rng(3)
    points, ways = rng.uniform(-2.4, 2.4, (20_000, 2)), np.linspace(-np.pi, np.pi, 361)
    reached = np.zeros(len(points), bool)
    for way in ways:
        wrist = points - lengths[2] * np.array([np.cos(way), np.sin(way)])
        with np.errstate(invalid="ignore"):
            postures = two_link_postures(lengths[:2], wrist)
        last = (way - postures.sum(axis=-1) + np.pi) % (2.0 * np.pi) - np.pi
        every = np.concatenate([postures, last[..., None]], axis=-1)
        every[..., :2] = (every[..., :2] + np.pi) % (2.0 * np.pi) - np.pi
        reached |= ((every >= limits[:, 0]) & (every <= limits[:, 1])).all(axis=-1).any(axis=-1)
    share = reached.mean()
    deviation = 4.8**2 * np.sqrt(share * (1.0 - share) / len(points))
    assert abs(space.limited.area - 4.8**2 * share) < 3.0 * deviation + space.limited.accuracy * 0.2


def test_area_and_volume_of_the_torus_are_those_of_pappus():
    l1, l2, l3 = TORI["torus_3r"]
    space = found("torus_3r")
    area = np.pi * ((l2 + l3) ** 2 - (l2 - l3) ** 2)
    assert_area(space.free, area)
    assert_allclose(space.free.volume, area * 2.0 * np.pi * l1, rtol=4e-3)


def test_area_of_a_gantry_is_that_of_its_box(tmp_path):
    path = tmp_path / "gantry.xml"
    path.write_text(
        '<mujoco><worldbody><body><joint name="X" type="slide" axis="1 0 0" range="0 2"/><geom size="0.1"/>'
        '<body><joint name="Y" type="slide" axis="0 1 0" range="0 1"/><geom size="0.1"/><body><geom size="0.1"/>'
        '<joint name="Z" type="slide" axis="0 0 1" range="-0.5 0"/><site name="tool"/></body></body></body>'
        "</worldbody></mujoco>"
    )
    for plane, area in (("xz", 1.0), ("xy", 2.0), ("yz", 0.5)):
        space = workspace(arms.load(path), plane, cells=60, samples=100_000)
        assert_area(space.limited, area, 2e-3)  # of a corner a quarter is reached, and not a half


# Extents ----------------------------------------------------------------------------------------------


def assert_extents(reach, first, second):
    assert_allclose(reach.extents, [first, second], atol=1e-6)


def test_extents_are_those_of_circles_and_limits():
    six = found("planar_6_3")
    assert_extents(six.free, [-9, 9], [-9, 9])
    # q1 = 135 deg with the forearm level and backward; q1 = q2 = 0; straight along x, and along y.
    assert_extents(six.limited, [6 * np.cos(np.radians(135)) - 3, 9], [0, 9])
    three = found("planar_3link")
    # Backward the upper arm stops at 170 deg, and the others go on level.
    assert_extents(three.limited, [np.cos(np.radians(170)) - 1.4, 2.4], [-2.4, 2.4])
    for name, l1, inner in (("torus_3r", 1.2, 0.1), ("torus_3r_short", 0.4, 0.0)):
        space = found(name)
        assert_extents(space.free, [inner, l1 + 1.1], [BASE - 1.1, BASE + 1.1])
        # Within limits joint 2 stops at 170 deg, short of the axis of the hollow; the last link is level there.
        within = max(0.0, l1 + 0.6 * np.cos(np.radians(170)) - 0.5)
        assert_extents(space.limited, [within, l1 + 1.1], [BASE - 1.1, BASE + 1.1])


def two_links(folder, lengths, ranges):
    (a, b), ((c, d), (e, f)) = lengths, ranges
    path = folder.mktemp("two") / "arm.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><default><geom contype="0" conaffinity="0" size="0.1"/></default>'
        f'<worldbody><body><joint name="one" axis="0 0 1" range="{c:.17g} {d:.17g}"/><geom/>'
        f'<body pos="{a:.17g} 0 0"><joint name="two" axis="0 0 1" range="{e:.17g} {f:.17g}"/><geom/>'
        f'<site name="tip" pos="{b:.17g} 0 0"/></body></body></worldbody></mujoco>'
    )
    return arms.load(path)


lengths_of_links = st.tuples(st.floats(0.2, 2.0), st.floats(0.2, 2.0))
starts, spans = st.floats(-3.0, 2.0), st.floats(0.3, 3.0)


@given(lengths_of_links, starts, spans, starts, spans)
@examples(2, 20)
def test_extents_of_any_two_links_within_any_limits_are_those_of_a_grid(
    tmp_path_factory, lengths, c, d, e, f
):
    ranges = ((c, min(c + d, np.pi)), (e, min(e + f, np.pi)))
    arm = two_links(tmp_path_factory, lengths, ranges)
    space = workspace(arm, q=[c, e], cells=20, samples=20_000)
    grid = np.stack(np.meshgrid(*(np.linspace(*ends, 1200) for ends in ranges)), axis=-1).reshape(-1, 2)
    points = two_link_position(lengths, grid)
    # Between nodes a step h = 3/1200 apart a coordinate is within (l1 + l2) h²/2 of theirs.
    off = np.array([points.min(axis=0), points.max(axis=0)]).T - space.limited.extents
    assert np.abs(off).max() < 2e-5


# Boundaries and singular sets --------------------------------------------------------------------------


def test_singular_set_of_the_arm_of_6_and_3_is_the_circles_of_radius_9_and_3():
    curves = found("planar_6_3").singular
    radii = [np.linalg.norm(curve.points, axis=1) for curve in curves]
    assert sorted(round(radius.mean()) for radius in radii) == [3, 9]
    for radius in radii:
        assert_allclose(radius, round(radius.mean()), rtol=INTERPOLATED)
    for curve in curves:  # whole circles, without a gap of more than a step
        turns = np.sort(np.arctan2(*curve.points.T[::-1]))
        assert np.diff(turns, append=turns[0] + 2 * np.pi).max() < np.radians(2.5)


def test_boundary_with_limits_is_that_of_the_textbook():
    space = found("planar_6_3")
    ours = np.concatenate([c.points[c.within] for c in (*space.limits, *space.singular)])
    step = 9.0 * np.radians(2.0)
    arcs = two_link_boundary(SIX_THREE, LIMITS)
    assert {arc.kind for arc in arcs} == {"q1 lower", "q1 upper", "outer", "q2 upper"}
    assert {curve.name for curve in space.limits} > {"q1 lower", "q1 upper", "q2 upper"}

    def gap(points):
        return np.linalg.norm(points[:, None] - ours, axis=-1).min(axis=1).max()

    for arc in arcs:
        assert gap(arc.points) < step
    assert gap(arcs[0].points + 0.5) > step  # negative control


@pytest.mark.parametrize("name", TORI)
def test_singular_set_of_the_torus_arm_is_a_hollow_torus_and_the_axis(name):
    l1, l2, l3 = TORI[name]
    points = np.concatenate([curve.points for curve in found(name).singular])
    tubes = torus_tube(TORI[name], np.stack([points[:, 0], 0 * points[:, 0], points[:, 1] - BASE], axis=1))
    # With a short first link the tubes reach over the axis: their far side is seen from behind, at −r.
    behind = np.hypot(-points[:, 0] - l1, points[:, 1] - BASE)
    kinds = [np.abs(tube - radius) for tube in (tubes, behind) for radius in (l2 + l3, l2 - l3)]
    outer, hollow, *_, axis = [*kinds, np.abs(points[:, 0])]
    # On the axis r is not a square: an angle's error counts in full.
    assert np.min([*kinds, axis], axis=0).max() < 1e-3
    assert (outer < INTERPOLATED).sum() > 100 and (hollow < INTERPOLATED).sum() > 100
    assert ((axis < 1e-3).sum() > 50) == (l1 < l2 + l3)
    # Negative control: with l₂ and l₃ ten millimeters longer the surfaces are others.
    assert np.abs(tubes - (l2 + l3 + 1e-2)).min() > 1e-3


def test_singular_curves_are_of_the_family_whose_closed_form_is_zero():
    space = found("anthropomorphic", cells=50)
    by = {
        rule.name: np.concatenate([c.q for c in space.singular if c.name == rule.name])
        for rule in space.families
    }
    # shoulder: the tip is on the waist's axis, r = 0; elbow: sin θ₃ = 0
    r = np.linalg.norm([space.task.arm.pose(q)[:2] for q in by["shoulder"]], axis=1)
    assert len(r) > 100 and r.max() < 1e-3
    assert len(by["elbow"]) > 100 and np.abs(np.sin(by["elbow"][:, 2])).max() < INTERPOLATED


EVERY = [
    pytest.param("planar_rp", None, None, marks=pytest.mark.long),
    ("anthropomorphic", None, None),
    pytest.param("helical", None, None, marks=pytest.mark.long),
    ("torus_3r", None, "xz"),
    ("stanford", "wrist", None),
    pytest.param("puma560", None, None, marks=pytest.mark.long),
]


@pytest.mark.parametrize(("name", "site", "plane"), EVERY)
def test_samples_are_in_their_cells_and_singular_where_mujoco_says(name, site, plane):
    space = found(name, site, plane, cells=30)
    arm, part, reach = space.task.arm, space.part, space.limited
    low, high = arm.position_limit[part.joints].T
    for i, j in np.argwhere(reach.reached)[:: max(1, reach.reached.sum() // 50)]:
        q = reach.q[i, j]
        at = part.coordinates(arm.pose(q)[:3])
        assert (np.abs(at - [reach.centers[0][i], reach.centers[1][j]]) < 0.5001 * reach.steps).all()
        sigma = np.linalg.svd(space.task.matrix(arm.jacobian(q)))[1]
        assert_allclose(reach.values["sigma_min"][i, j], sigma[-1], atol=1e-12)
        assert (q[part.joints] >= low - 1e-8).all() and (q[part.joints] <= high + 1e-8).all()
    assert np.isnan(reach.values["sigma_min"][~reach.reached]).all()
    assert (space.free.reached | ~reach.reached).all()
    # every tip within the limits lies in the set, or in a cell beside it
    tips = part.coordinates(np.array([arm.pose(q)[:3] for q in arm.sampled(1000, seed=7)]))
    cell = np.floor((tips - [edges[0] for edges in reach.edges]) / reach.steps).astype(int)
    padded = np.pad(reach.reached, 1)
    near = np.lib.stride_tricks.sliding_window_view(padded, (3, 3)).any(axis=(2, 3))
    assert near[tuple(cell.T)].all()
    for curve in space.singular:
        some = curve.q[:: max(1, len(curve.q) // 40)]
        linear = np.array([arm.jacobian(q)[part.rows] for q in some])
        least = np.linalg.svd(linear, compute_uv=False)[:, -1]
        assert least.max() < 1e-3 * np.abs(linear).max()
        moved = np.array([arm.jacobian(q + 0.1 * np.cos(np.arange(arm.n)))[part.rows] for q in some])
        assert np.linalg.svd(moved, compute_uv=False)[:, -1].max() > 1e-2  # negative control


@given(seeds)
@examples(4, 40)
def test_nearest_singular_configurations_of_any_chain_are_singular(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed, 3 + seed % 4))
    arm = arms.load(path)
    task, home = Task(arm, np.arange(3)), np.zeros(arm.n)
    try:
        part = choose_slice(arm, "xz", home)
    except QuestionError:  # three slides, or two in a plane
        return
    for q in nearest_singular(task, part, arm.sampled(20, seed)):
        linear = arm.jacobian(q)[part.rows]
        assert np.linalg.svd(linear, compute_uv=False)[-1] < 1e-8 * max(
            1.0, np.abs(arm.jacobian(q)[:3]).max()
        )


@given(seeds)
@examples(6, 60)
def test_curvature_of_any_chain_is_the_derivative_of_its_linear_velocities(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed))
    arm = arms.load(path)
    (q,), u = arm.sampled(1, seed), np.random.default_rng(seed).normal(size=3)
    J, step = arm.jacobian(q), 1e-5 * np.eye(arm.n)
    along = np.array([u @ (arm.jacobian(q + s)[:3] - arm.jacobian(q - s)[:3]) / 2e-5 for s in step])
    # Central differences of numbers up to ten meters: 1e-15/1e-5, and (1e-5)²/6 of them.
    assert_allclose(curvature(u[None], J[None, :3], J[None, 3:])[0], along, atol=1e-8)


def test_the_worst_posture_is_worse_than_the_best():
    best, worst = found("torus_3r_short"), found("torus_3r_short", worst=True)
    reached = best.free.reached & worst.free.reached
    for measure, sign in (("sigma_min", 1.0), ("manipulability", 1.0), ("condition", -1.0)):
        gap = sign * (best.free.values[measure] - worst.free.values[measure])[reached]
        assert (gap >= 0.0).mean() > 0.99 and gap.max() > 0.05  # samples at the edge differ


# Two joints -----------------------------------------------------------------------------------------


def test_map_over_two_joints_is_mujocos_and_singular_where_the_determinant_is():
    arm = arm_of("stanford")
    q = arm.configuration("home")[arm.wiring.qpos]
    space = workspace(arm, q=q, over=("theta_2", "theta_5"), length=1.0, cells=40)
    for i, j in ((0, 0), (3, 30), (39, 17)):
        posture = q.copy()
        posture[[1, 4]] = space.limited.centers[0][i], space.limited.centers[1][j]
        sigma = np.linalg.svd(arm.jacobian(posture), compute_uv=False)
        assert_allclose(space.limited.values["sigma_min"][i, j], sigma[-1], atol=1e-12)
        assert_allclose(space.limited.values["condition"][i, j], sigma[0] / sigma[-1], rtol=1e-9)
    # det J = d₃² s₂ s₅: the lines θ₂ = 0 and θ₅ = 0.
    lines = {curve.name: curve.points for curve in space.singular}
    assert set(lines) == {"shoulder", "wrist"}
    assert np.abs(lines["shoulder"][:, 0]).max() < 1e-12 and np.abs(lines["wrist"][:, 1]).max() < 1e-12
    facts = report(space).json["over_joints"]
    assert facts["sigma_min"][0] == 0.0 and facts["condition"][1] is None
    assert workspace(arm, q=q, over=("theta_1", "theta_2"), axes=["x", "y"], cells=10).singular == []


def test_map_has_a_double_zero_of_the_determinant_and_one_on_its_side(tmp_path):
    """det J = d₃² s₂ s₅ does not change its sign at d₃ = 0."""
    text = (
        (ROOT / "models/stanford.xml")
        .read_text("utf-8")
        .replace('file="common', f'file="{ROOT}/models/common')
    )
    path = tmp_path / "stanford.xml"
    path.write_text(
        text.replace('class="stanford_boom" armature', 'class="stanford_boom" range="-0.5 0.6" armature')
    )
    q = np.array([0.0, 1.2, 0.0, 0.0, 1.2, 0.0])
    space = workspace(arms.load(path, "wrist"), q=q, over=("d_3", "theta_5"), cells=40)
    assert {curve.name for curve in space.singular} == {"boom", "wrist"}
    for curve in space.singular:
        gap = curve.points[:, 0] if curve.name == "boom" else np.sin(curve.points[:, 1])
        assert np.abs(gap).max() < 1e-9
    # The arm of 6 and 3 is straight on a side of its range, and nowhere else.
    side = workspace(ROOT / "models/planar_6_3.xml", over=("q1", "q2"), cells=20)
    assert len(side.singular) == 1 and np.abs(side.singular[0].points[:, 1]).max() < 1e-9


def test_map_goes_through_the_range_of_a_joint_or_through_a_turn(tmp_path):
    path = tmp_path / "free.xml"
    text = (
        (ROOT / "models/planar_2link.xml")
        .read_text("utf-8")
        .replace('file="common', f'file="{ROOT}/models/common')
    )
    path.write_text(re.sub(r'(<joint name="elbow"[^>]*?) range="[^"]*"', r"\1", text))
    for arm, ends in ((arm_of("planar_2link"), np.radians([-160, 160])), (arms.load(path), [-np.pi, np.pi])):
        space = workspace(arm, over=("shoulder", "elbow"), cells=10)
        # eight digits of a file
        assert_allclose(space.limited.edges[0], np.radians(np.linspace(-170, 170, 11)), atol=1e-7)
        assert_allclose(space.limited.edges[1], np.linspace(*ends, 11), atol=1e-7)


# Files and messages ---------------------------------------------------------------------------------


def test_the_file_and_the_summary_have_the_numbers_of_the_workspace(tmp_path):
    space = found("torus_3r")
    save(space, tmp_path / "new/torus.npz")
    values = report(space).json
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values["without_limits"]["area"] == space.free.area
    assert values["without_limits"]["singular_curves"] == {"elbow": 2}
    assert values["with_limits"]["singular_curves"] == {"elbow": 1}
    with np.load(tmp_path / "new/torus.npz") as file:
        assert json.loads(str(file["about"])) == values
        np.testing.assert_array_equal(file["with_limits_q"], space.limited.q)
        assert file["without_limits_share"].sum() * space.free.steps.prod() == pytest.approx(space.free.area)
        assert (
            len(file["curve"])
            == len(file["curve_q"])
            == len(file["curve_points"])
            == len(file["curve_within"])
        )
        limits = {f"theta_{j} {end}" for j in (2, 3) for end in ("lower", "upper")}
        assert set(file["curve"]) == {"elbow", *limits}
    assert [path.name for path in tmp_path.glob("new/*")] == ["torus.npz"]


SLIDES = (
    '<mujoco><worldbody><body><joint name="a" type="slide" axis="1 0 0"/><geom size="1"/>'
    '<body><joint name="b" type="{kind}" axis="0 1 0"{more}/><geom size="1"/><site name="tip" pos="0 0 1"/>'
    "</body></body></worldbody></mujoco>"
)


@pytest.mark.parametrize(
    ("kind", "more", "plane", "message"),
    [
        ("slide", "", None, 'joint "a" slides without limits, so that the site can be anywhere; give it a range in the model'),
        ("slide", "", "xz", 'site "tip" moves in the plane xy; leave out --plane, got xz'),
        ("hinge", ' pos="0 0 1"', None, 'site "tip" moves along a curve; a workspace needs a site that moves in a plane or in space'),
    ],
)  # fmt: skip
def test_what_has_no_workspace_is_said_in_a_line(tmp_path, kind, more, plane, message):
    path = tmp_path / "arm.xml"
    path.write_text(SLIDES.format(kind=kind, more=more))
    with pytest.raises(QuestionError) as caught:
        workspace(arms.load(path), plane)
    assert str(caught.value) == f"{path}: {message}"


def test_slices_that_an_arm_does_not_have_are_refused():
    wrist, boom = arm_of("spherical_wrist"), arm_of("helical")
    for arm, plane, message in (
        (wrist, None, f'{wrist.path}: site "tool" moves on a curved surface; a workspace needs a site that moves in a plane or in space'),
        (boom, "rz", f'{boom.path}: --plane rz needs a first joint that turns, and "{boom.joints[0]}" does not; give xy, xz or yz'),
        (boom, "zx", "--plane must be one of xy, xz, yz, rz, got 'zx'"),
    ):  # fmt: skip
        with pytest.raises(QuestionError) as caught:
            workspace(arm, plane)
        assert str(caught.value) == message


def chain_about(tmp_path, *axes):
    """An arm of links of 1 m along x, whose joints turn about axes."""
    bodies = "".join(
        f'<body pos="{1 if i else 0} 0 0"><joint name="j{i}" axis="{axis}"/><geom size="0.1"/>'
        for i, axis in enumerate(axes)
    )
    path = tmp_path / "chain.xml"
    path.write_text(
        f'<mujoco><worldbody>{bodies}<site name="tip" pos="1 0 0"/>{"</body>" * len(axes)}</worldbody></mujoco>'
    )
    return arms.load(path)


@pytest.mark.parametrize("axis", ["0 0.6 0.8", "0 -0.6 -0.8", "0 -0.6 0.8", "0 0.6 -0.8"])
def test_a_tilted_plane_has_its_own_axes_one_level_and_one_up(tmp_path, axis):
    arm = chain_about(tmp_path, axis, axis)
    part = choose_slice(arm, None, np.zeros(2))
    assert part.name == "uv"
    assert_allclose(part.axes @ np.array(axis.split(), float), 0.0, atol=1e-12)
    assert_allclose(part.axes[0], [1, 0, 0], atol=1e-12)
    assert_area(workspace(arm, cells=60, samples=100_000).free, np.pi * 4.0, 1e-2)


@pytest.mark.parametrize("axis", ["0 0 1", "0 0 -1"])
def test_heights_about_an_axis_that_points_down_are_the_worlds(tmp_path, axis):
    part = choose_slice(chain_about(tmp_path, axis, "0 1 0", "0 1 0"), None, np.array([0.0, 0.3, 0.4]))
    assert part.labels == ("r", "z")
    assert_allclose(part.coordinates(np.array([3.0, 4.0, 0.7])), [5.0, 0.7], atol=1e-12)


def test_more_than_a_turn_reaches_what_a_turn_does(tmp_path):
    text = (ROOT / "models/planar_2link.xml").read_text("utf-8").replace("common/", f"{ROOT}/models/common/")
    wide = re.sub(r'(name="(?:shoulder|elbow)") range="[^"]*"', r'\1 range="-3.2 6.5"', text)
    (tmp_path / "wide.xml").write_text(wide)
    space = workspace(arms.load(tmp_path / "wide.xml"), cells=50, samples=100_000)
    assert space.limits == []
    assert_area(space.limited, 4.0 * np.pi, 1e-2)


def test_postures_are_within_limits_that_do_not_lie_around_zero(tmp_path):
    text = (
        (ROOT / "models/planar_3link.xml")
        .read_text()
        .replace("common/world.xml", f"{ROOT}/models/common/world.xml")
    )
    path = tmp_path / "arm.xml"
    path.write_text(text.replace('name="elbow" range="-2.7925268 2.7925268"', 'name="elbow" range="1.0 5.0"'))
    arm = arms.load(path)
    space = workspace(arm, q=np.array([0.0, 2.0, 0.0]), cells=12, samples=1000)
    kept = space.limited.q[space.limited.reached]
    low, high = arm.position_limit.T
    assert (kept >= low - 1e-8).all() and (kept <= high + 1e-8).all()
    assert kept[:, 1].max() > np.pi + 1.0
