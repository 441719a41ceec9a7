"""A workspace is what closed forms, MuJoCo and numpy say: areas, extents, boundaries, singular sets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from spaces import found, gantry

from project import examples
from rmrc import arm as arms
from rmrc.analysis.workspace import workspace
from rmrc.support.errors import QuestionError
from rmrc.textbook.spatial import torus_tube
from rmrc.textbook.two_link import two_link_boundary, two_link_free_area, two_link_position, two_link_postures

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


@pytest.mark.parametrize("cells", [50, 100])
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


def test_area_of_a_slice_of_the_torus_is_that_of_the_ring_of_its_tube():
    _, l2, l3 = TORI["torus_3r"]
    assert_area(found("torus_3r").free, np.pi * ((l2 + l3) ** 2 - (l2 - l3) ** 2))


def test_areas_of_a_gantry_are_the_sides_of_its_box(tmp_path):
    space = gantry(tmp_path)
    slices = {each.part.name: each for each in (space, *space.others)}
    assert [*slices] == ["xz", "xy", "yz"]  # each of which one slide leaves alone
    for plane, area in (("xz", 1.0), ("xy", 2.0), ("yz", 0.5)):
        assert_area(slices[plane].limited, area, 2e-3)  # of a corner a quarter is reached, and not a half
    alone = workspace(space.task.arm, "xy", cells=20, samples=1000)
    assert alone.others == ()
    assert alone.limited.reached.shape == (20, 11)  # of a box of 2 m by 1 m, the outermost reached by half


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
    curves = found("planar_6_3").free.singular
    radii = [np.linalg.norm(curve.points, axis=1) for curve in curves]
    assert sorted(round(radius.mean()) for radius in radii) == [3, 9]
    for radius in radii:
        assert_allclose(radius, round(radius.mean()), rtol=INTERPOLATED)
    for curve in curves:  # whole circles, without a gap of more than a step
        turns = np.sort(np.arctan2(*curve.points.T[::-1]))
        assert np.diff(turns, append=turns[0] + 2 * np.pi).max() < np.radians(2.5)


def test_boundary_with_limits_is_that_of_the_textbook():
    space = found("planar_6_3")
    ours = np.concatenate([curve.points for curve in (*space.limited.limits, *space.limited.singular)])
    step = 9.0 * np.radians(2.0)
    arcs = two_link_boundary(SIX_THREE, LIMITS)
    assert {arc.kind for arc in arcs} == {"q1 lower", "q1 upper", "outer", "q2 upper"}
    assert {curve.name for curve in space.limited.limits} > {"q1 lower", "q1 upper", "q2 upper"}

    def gap(points):
        return np.linalg.norm(points[:, None] - ours, axis=-1).min(axis=1).max()

    for arc in arcs:
        assert gap(arc.points) < step
    assert gap(arcs[0].points + 0.5) > step  # negative control


@pytest.mark.parametrize("name", TORI)
def test_singular_set_of_the_torus_arm_is_a_hollow_torus_and_the_axis(name):
    l1, l2, l3 = TORI[name]
    points = np.concatenate([curve.points for curve in found(name).free.singular])
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
        rule.name: np.concatenate([c.q for c in space.free.singular if c.name == rule.name])
        for rule in space.families
    }
    # shoulder: the tip is on the waist's axis, r = 0; elbow: sin θ₃ = 0
    r = np.linalg.norm([space.task.arm.pose(q)[:2] for q in by["shoulder"]], axis=1)
    assert len(r) > 100 and r.max() < 1e-3
    assert len(by["elbow"]) > 100 and np.abs(np.sin(by["elbow"][:, 2])).max() < INTERPOLATED


@pytest.mark.parametrize(
    ("name", "site", "plane"),
    [("planar_rp", None, None), ("torus_3r", None, "xz"), ("stanford", "wrist", None)],
)
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
    for curve in (*space.free.singular, *reach.singular):
        some = curve.q[:: max(1, len(curve.q) // 40)]
        linear = np.array([arm.jacobian(q)[part.rows] for q in some])
        least = np.linalg.svd(linear, compute_uv=False)[:, -1]
        assert least.max() < 1e-3 * np.abs(linear).max()
    for curve in (*reach.singular, *reach.limits):
        assert (curve.q[:, part.joints] >= low - 1e-8).all() and (
            curve.q[:, part.joints] <= high + 1e-8
        ).all()


# Answers and messages -------------------------------------------------------------------------------


SLIDES = (
    '<mujoco><worldbody><body><joint name="a" type="slide" axis="1 0 0"/><geom size="1"/>'
    '<body><joint name="b" type="{kind}" axis="0 1 0"{more}/><geom size="1"/><site name="tip" pos="0 0 1"/>'
    "</body></body></worldbody></mujoco>"
)


@pytest.mark.parametrize(
    ("kind", "more", "plane", "message"),
    [
        ("slide", "", None, 'joint "a" slides without limits, so that the site can be anywhere; give it a range in the model'),
        ("slide", "", "xz", 'site "tip" has no slice xz; choose from xy'),
        ("hinge", ' pos="0 0 1"', None, 'site "tip" moves on a curve or a curved surface, not in a plane or in space'),
    ],
)  # fmt: skip
def test_what_has_no_workspace_is_said_in_a_line(tmp_path, kind, more, plane, message):
    path = tmp_path / "arm.xml"
    path.write_text(SLIDES.format(kind=kind, more=more))
    with pytest.raises(QuestionError) as caught:
        workspace(arms.load(path), plane)
    assert str(caught.value) == f"{path}: {message}"


def test_cells_that_fit_into_no_memory_are_refused():
    with pytest.raises(QuestionError, match=r"--cells: 1000000 need .*; ask for fewer"):
        found("planar_6_3", cells=10**6)
