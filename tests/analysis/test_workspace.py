"""A workspace is what closed forms, MuJoCo and numpy say: areas, boundaries, singular sets, postures."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from spaces import arm_of, found

from chains import random_chain, seeds
from project import ROOT, examples
from rmrc import arm as arms
from rmrc.analysis.survey import jacobians
from rmrc.analysis.workspace import files as workspace_files
from rmrc.analysis.workspace.folds import covering, zero_curves
from rmrc.analysis.workspace.joint_map import joint_map
from rmrc.analysis.workspace.report import report
from rmrc.analysis.workspace.singular_set import curvature, nearest_singular
from rmrc.analysis.workspace.slices import choose_slice
from rmrc.analysis.workspace.workspace import workspace
from rmrc.law.task import Task
from rmrc.support.errors import QuestionError
from rmrc.textbook.torus import torus_postures, torus_tube
from rmrc.textbook.two_link_workspace import two_link_boundary, two_link_free_area

SIX_THREE = (6.0, 3.0)
LIMITS = np.radians([[0, 135], [0, 120]])
TORI = {"torus_3r": (1.2, 0.6, 0.5), "torus_3r_short": (0.4, 0.6, 0.5)}
BASE = 1.2  # height of frame {0} of both

# Newton's method ends where σ_min is below 1e-9 of the largest entry of J_v, of about 1 m to 9 m.
SINGULAR = 1e-8


def middles(space):
    return np.stack(
        np.meshgrid(*(0.5 * (edges[1:] + edges[:-1]) for edges in (space.a, space.b)), indexing="ij"), axis=-1
    )


def distance(points, curves):
    """From each point to the nearest point of some curves."""
    every = np.concatenate([curve.points for curve in curves])
    return np.linalg.norm(points[:, None] - every, axis=-1).min(axis=1)


# The arm of 6 and 3 --------------------------------------------------------------------------------


def test_singular_set_of_the_arm_of_6_and_3_is_the_circles_of_radius_9_and_3():
    curves = found("planar_6_3").singular
    radii = [np.linalg.norm(curve.points, axis=1) for curve in curves]
    assert sorted(round(radius.mean()) for radius in radii) == [3, 9]
    for radius in radii:
        # The radius changes with the square of the distance from the singularity, so to rounding.
        assert_allclose(radius, round(radius.mean()), rtol=1e-12)
    for curve in curves:  # whole circles, without a gap of more than a step
        turns = np.sort(np.arctan2(*curve.points.T[::-1]))
        assert np.diff(turns, append=turns[0] + 2 * np.pi).max() < np.radians(1.5)


@pytest.mark.parametrize(
    ("most", "rounding"), [(100, 5e-3), pytest.param(200, 2.5e-3, marks=pytest.mark.long)]
)
def test_area_of_the_annulus_is_measured_to_the_accuracy_that_is_stated(most, rounding):
    exact = two_link_free_area(SIX_THREE)
    assert_allclose(exact, np.pi * (9**2 - 3**2), rtol=1e-15)
    for cells in (50, most):
        free = found("planar_6_3", cells=cells).free
        assert abs(free.area - exact) < free.accuracy < 10.0 * exact / cells
    # A cell at the border is in or out by its middle, and that averages out.
    assert_allclose(free.area, exact, rtol=rounding)
    # With limits each point has one posture: the area is ∫∫ |det J| = 18 ∫∫ sin q2.
    limited = found("planar_6_3", cells=most).limited
    assert_allclose(limited.area, 18.0 * (1.0 - np.cos(LIMITS[1, 1])) * LIMITS[0, 1], rtol=2 * rounding)
    # Negative control: other limits, by two degrees of 135.
    assert (
        abs(limited.area / (18.0 * (1.0 - np.cos(LIMITS[1, 1])) * (LIMITS[0, 1] + 0.035)) - 1.0)
        > 2 * rounding
    )


def test_boundary_with_limits_is_that_of_the_textbook():
    space = found("planar_6_3")
    ours = [*space.limits, *(replace(c, points=c.points[c.within]) for c in space.singular)]
    step = 9.0 * np.radians(1.0)  # of the grid for 100 cells
    arcs = two_link_boundary(SIX_THREE, LIMITS)
    assert {arc.kind for arc in arcs} == {"q1 lower", "q1 upper", "outer", "q2 upper"}
    for arc in arcs:
        assert distance(arc.points, ours).max() < step
        of_this = [c for c in ours if c.label == arc.kind.replace("outer", "singular")]
        assert distance(arc.points, of_this).max() < step
    assert distance(arcs[0].points + 0.3, ours).max() > step  # negative control
    for curve, joint, end in zip(space.limits, (0, 0, 1, 1), (0, 1, 0, 1), strict=True):
        assert_allclose(curve.q[:, joint], LIMITS[joint, end], rtol=1e-15)


def test_two_links_have_two_postures_everywhere_in_the_annulus():
    space = found("planar_6_3")
    radius = np.linalg.norm(middles(space), axis=-1)
    # The image of the grid leaves the circles by 4e-5 of their radius.
    inside, outside = (radius > 3.001) & (radius < 8.999), (radius < 2.999) | (radius > 9.001)
    assert (space.free.postures[inside] == 2).all() and (space.free.postures[outside] == 0).all()
    assert (space.limited.postures[space.limited.reached] == 1).all()


# The torus ---------------------------------------------------------------------------------------


def tubes(name, points):
    """Distance of points of the half-plane from the circle of the second joint."""
    return torus_tube(TORI[name], np.stack([points[:, 0], 0 * points[:, 0], points[:, 1] - BASE], axis=1))


@pytest.mark.parametrize("name", TORI)
def test_singular_set_of_the_torus_arm_is_a_hollow_torus_and_the_axis(name):
    l1, l2, l3 = TORI[name]
    points = np.concatenate([curve.points for curve in found(name).singular])
    # With a short first link the tubes reach over the axis: their far side is seen from behind, at −r.
    behind = np.hypot(-points[:, 0] - l1, points[:, 1] - BASE)
    kinds = [np.abs(tube - radius) for tube in (tubes(name, points), behind) for radius in (l2 + l3, l2 - l3)]
    kinds.append(np.abs(points[:, 0]))
    assert np.min(kinds, axis=0).max() < SINGULAR
    outer, hollow, *_, axis = kinds
    assert (outer < SINGULAR).sum() > 200 and (hollow < SINGULAR).sum() > 200
    assert ((axis < SINGULAR).sum() > 100) == (l1 < l2 + l3)
    # Negative control: with l₂ and l₃ a millimeter longer the surfaces are others.
    assert np.abs(tubes(name, points) - (l2 + l3 + 1e-3)).min() > SINGULAR


@pytest.mark.parametrize("name", TORI)
def test_postures_of_the_torus_arm_are_those_of_the_closed_form(name):
    space, limits = found(name), arm_of(name).position_limit
    most = 2 if name == "torus_3r" else 4
    assert set(np.unique(space.free.postures)) == {0, 2, most}
    at = middles(space)[3::7, 3::7].reshape(-1, 2)
    free, limited = (reach.postures[3::7, 3::7].ravel() for reach in (space.free, space.limited))
    # Beside a fold or a limit a middle may be on either side of its image.
    clear = distance(at, [*space.singular, *space.limits]) > 0.25 * space.free.size
    assert clear.sum() > 100
    for (r, z), count, within in zip(at[clear], free[clear], limited[clear], strict=True):
        postures = torus_postures(TORI[name], [r, 0.0, z - BASE])
        assert count == len(postures)
        allowed = (postures[:, 1:] >= limits[1:, 0]) & (postures[:, 1:] <= limits[1:, 1])
        assert within == allowed.all(axis=1).sum()


def test_area_and_volume_of_the_torus_are_those_of_pappus():
    l1, l2, l3 = TORI["torus_3r"]
    space = found("torus_3r")
    area = np.pi * ((l2 + l3) ** 2 - (l2 - l3) ** 2)
    assert abs(space.free.area - area) < space.free.accuracy
    assert_allclose(space.volume(space.free), area * 2.0 * np.pi * l1, rtol=2e-3)
    assert found("planar_6_3").volume(found("planar_6_3").free) is None


# Any arm --------------------------------------------------------------------------------------------

EVERY = [
    pytest.param("planar_2link", None, None, None, marks=pytest.mark.long),  # as planar_6_3, above
    pytest.param("planar_3link", None, None, None, marks=pytest.mark.long),
    pytest.param("planar_rp", None, None, None, marks=pytest.mark.long),
    ("anthropomorphic", None, None, None),
    pytest.param("helical", None, "xz", (0.0, 0.4, 0.0), marks=pytest.mark.long),
    pytest.param("helical", None, "xy", (0.0, 0.0, 1.2), marks=pytest.mark.long),
    ("torus_3r", None, "xz", (0.0, 0.5, 0.0)),
    ("stanford", "wrist", None, None),
    pytest.param("stanford", "tool", None, None, marks=pytest.mark.long),
]
every_arm = pytest.mark.parametrize(("name", "site", "plane", "through"), EVERY)


def sigma_min(space, q):
    """By MuJoCo and numpy, of the linear velocities that the arm has at all."""
    linear = np.array([space.part.basis @ space.task.arm.jacobian(one)[:3] for one in q])
    return np.linalg.svd(linear, compute_uv=False)[:, -1]


@every_arm
def test_every_singular_configuration_is_singular_by_mujoco_and_in_the_slice(name, site, plane, through):
    space = found(name, site, plane, through, cells=30)
    arm, part = space.task.arm, space.part
    for curve in space.singular:
        some = slice(None, None, max(1, len(curve.q) // 40))
        q, points = curve.q[some], curve.points[some]
        assert sigma_min(space, q).max() < SINGULAR * 10.0
        position = np.array([arm.pose(one)[:3] for one in q])
        assert_allclose(part.coordinates(position), points, atol=1e-9)
        assert np.abs(part.offset(position)).max() < SINGULAR * 10.0
        low, high = arm.position_limit[part.joints].T
        beyond = (
            (q[:, part.joints] - low) % (2.0 * np.pi) if not arm.is_slide.any() else q[:, part.joints] - low
        )
        if not arm.is_slide.any():
            inside = (beyond < high - low + 1e-6) | (beyond > 2.0 * np.pi - 1e-6)
            assert (curve.within[some] <= inside.all(axis=1)).all()
    if space.singular and len(space.singular[0].q):
        q = space.singular[0].q[:20] + np.random.default_rng(0).uniform(0.02, 0.1, (20, arm.n))
        assert sigma_min(space, q).max() > SINGULAR * 10.0  # negative control


def near(reached):
    """Cells that are reached, or a neighbor of which is."""
    padded = np.pad(reached, 1)
    n, m = reached.shape
    return np.any([padded[i : i + n, j : j + m] for i in range(3) for j in range(3)], axis=0)


@every_arm
def test_every_tip_within_the_limits_lies_in_the_reachable_set(name, site, plane, through):
    space = found(name, site, plane, through, cells=30)
    arm, part = space.task.arm, space.part
    # Those in the plane are rare: of a slice that cuts, points within a hundredth of a cell.
    q = arm.sampled(1000 if not part.cuts else 60_000, seed=7)
    in_plane = np.abs(part.offset(jacobians(space.task, q)[0])) < 0.1 * space.free.size
    position = np.array([arm.pose(one)[:3] for one in q[in_plane][:1000]])
    assert len(position) > 30
    cell = np.floor((part.coordinates(position) - [space.a[0], space.b[0]]) / space.free.size).astype(int)
    assert near(space.limited.reached)[tuple(cell.T)].all()
    assert near(space.free.reached)[tuple(cell.T)].all()
    around = near(space.free.reached) if part.is_surface else space.free.reached
    assert (space.limited.reached <= around).all()
    smaller = space.limited.reached & (
        middles(space)[..., 0] < np.median(middles(space)[space.limited.reached][:, 0])
    )
    assert not near(smaller)[tuple(cell.T)].all()  # negative control


@every_arm
def test_the_value_of_a_cell_is_that_of_a_posture_that_reaches_it(name, site, plane, through):
    space = found(name, site, plane, through, cells=30)
    arm, part = space.task.arm, space.part
    for reach in (space.free, space.limited):
        cells = np.argwhere(reach.reached)[:: max(1, reach.reached.sum() // 50)]
        for i, j in cells:
            q = reach.q[i, j]
            position = arm.pose(q)[:3]
            assert abs(part.offset(position)) < 1e-9
            middle = middles(space)[i, j]
            # On a surface it is the middle but for a chord of a degree, else anywhere in the cell.
            assert np.abs(part.coordinates(position) - middle).max() < 0.51 * reach.size
            A = space.task.matrix(arm.jacobian(q))
            assert_allclose(reach.values["sigma_min"][i, j], np.linalg.svd(A)[1][-1], atol=1e-12)
        assert np.isnan(reach.values["sigma_min"][~reach.reached]).all()
    low, high = arm.position_limit[part.joints].T
    kept = space.limited.q[space.limited.reached][:, part.joints]
    assert (kept >= low - 1e-9).all() and (kept <= high + 1e-9).all()


def test_the_worst_posture_is_worse_than_the_best():
    best, worst = found("torus_3r_short"), found("torus_3r_short", worst=True)
    reached = best.free.reached
    for measure, sign in (("sigma_min", 1.0), ("manipulability", 1.0), ("condition", -1.0)):
        gap = sign * (best.free.values[measure] - worst.free.values[measure])[reached]
        assert gap.min() >= 0.0 and gap.max() > 0.05
    assert found("planar_6_3").free.values["condition"][50, 90] == pytest.approx(
        np.linalg.cond(
            found("planar_6_3").task.matrix(arm_of("planar_6_3").jacobian(found("planar_6_3").free.q[50, 90]))
        ),
        rel=1e-9,
    )


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
    q, known = nearest_singular(task, part, arm.sampled(20, seed), part.movers)
    for one in q[known]:
        linear = arm.jacobian(one)[:3]
        assert np.linalg.svd(linear, compute_uv=False)[-1] < 1e-8 * max(1.0, np.abs(linear).max())
        assert abs(part.offset(arm.pose(one)[:3])) < 1e-8 * max(1.0, np.abs(linear).max())
    if arm.n == 3 and not arm.is_slide.any():
        assert known.any()


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


# The surface ----------------------------------------------------------------------------------------


def test_middles_on_borders_of_triangles_count_once():
    steps = np.linspace(0.0, 1.0, 9)
    at = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
    cells, where = covering(at, np.array([0.0, 0.0]), 0.25, (4, 4))  # middles are nodes of the grid
    assert sorted(cells) == list(range(16))
    assert_allclose(where / 8.0, np.stack(np.divmod(cells, 4), axis=1) * 0.25 + 0.125, atol=1e-15)
    turned = at @ [[0.0, 1.0], [-1.0, 0.0]] + [1.0, 0.0]
    assert sorted(covering(turned[::-1], np.array([0.0, 0.0]), 0.25, (4, 4))[0]) == list(range(16))


@given(seeds)
def test_a_distorted_grid_covers_its_inside_once_and_folded_thrice_or_once(seed):
    rng = np.random.default_rng(seed)
    steps = np.linspace(0.0, 1.0, 12)
    at = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
    at[1:-1, 1:-1] += rng.uniform(-0.02, 0.02, (10, 10, 2))
    cells, _ = covering(at, np.array([-0.5, -0.5]), 0.02, (100, 100))
    count = np.bincount(cells, minlength=10_000).reshape(100, 100)
    assert (count[25:75, 25:75] == 1).all() and count.sum() == 2500
    at[1:-1, 1:-1] += rng.uniform(-0.3, 0.3, (10, 10, 2))
    folded = np.bincount(covering(at, np.array([-0.5, -0.5]), 0.02, (100, 100))[0], minlength=10_000)
    # The border is where it was: each point is covered once more one way round than the other.
    assert (folded.reshape(100, 100)[25:75, 25:75] % 2 == 1).all()


def test_zero_curves_of_circles_are_closed_and_on_them():
    x, y = np.meshgrid(np.linspace(-2, 2, 81), np.linspace(-2, 2, 81), indexing="ij")
    curves = zero_curves((np.hypot(x, y) - 0.5) * (np.hypot(x, y) - 1.5))
    assert len(curves) == 2
    for curve in curves:
        assert_allclose(curve[0], curve[-1], atol=0)
        radius = np.hypot(*(curve.T / 20.0 - 2.0))
        assert np.abs(radius - np.round(radius * 2) / 2).max() < 0.01
    assert zero_curves(np.ones((4, 4))) == []


# Two joints -----------------------------------------------------------------------------------------


def test_map_over_two_joints_is_mujocos_and_singular_where_the_determinant_is():
    arm = arm_of("stanford")
    q = arm.configuration("home")[arm.wiring.qpos]
    space = joint_map(arm, ("theta_2", "theta_5"), q, length=1.0, cells=40)
    for i, j in ((0, 0), (3, 30), (40, 17)):
        one = q.copy()
        one[1], one[4] = space.first[i], space.second[j]
        sigma = np.linalg.svd(arm.jacobian(one), compute_uv=False)
        assert_allclose(space.values["sigma_min"][i, j], sigma[-1], atol=1e-12)
        assert_allclose(space.values["condition"][i, j], sigma[0] / sigma[-1], rtol=1e-9)
    # det J = d₃² s₂ s₅: the lines θ₂ = 0 and θ₅ = 0, in pieces that meet where both cross.
    points = np.concatenate(space.singular)
    assert np.abs(points).min(axis=1).max() < 1e-12
    assert (np.abs(points[:, 0]) < 1e-12).sum() > 30 and (np.abs(points[:, 1]) < 1e-12).sum() > 30
    assert joint_map(arm, ("theta_1", "theta_2"), q, axes=["x", "y"], cells=10).singular == ()


def test_map_goes_through_the_range_of_a_joint_or_through_a_turn(tmp_path):
    path = tmp_path / "free.xml"
    text = (
        (ROOT / "models/planar_2link.xml")
        .read_text("utf-8")
        .replace('file="common', f'file="{ROOT}/models/common')
    )
    path.write_text(re.sub(r'(<joint name="elbow"[^>]*?) range="[^"]*"', r"\1", text))
    for arm, ends in ((arm_of("planar_2link"), np.radians([-160, 160])), (arms.load(path), [-np.pi, np.pi])):
        space = joint_map(arm, ("shoulder", "elbow"), np.zeros(2), cells=4)
        assert_allclose(
            space.first, np.radians(np.linspace(-170, 170, 5)), atol=1e-7
        )  # eight digits of a file
        assert_allclose(space.second, np.linspace(*ends, 5), atol=1e-7)


# Families ------------------------------------------------------------------------------------------


def families(curves, names):
    """Configurations of singular curves by the family that each is said to be of."""
    q, which = (np.concatenate([getattr(c, key) for c in curves]) for key in ("q", "family"))
    return {name: q[which == i] for i, name in enumerate(names)}


def test_singular_curves_are_of_the_family_whose_closed_form_is_zero():
    space = found("anthropomorphic", cells=50)
    by = families(space.singular, [rule.name for rule in space.families])
    # shoulder: the tip is on the waist's axis, r = 0; elbow: sin θ₃ = 0
    r = np.linalg.norm([space.task.arm.pose(q)[:2] for q in by["shoulder"]], axis=1)
    assert len(r) > 100 and r.max() < 1e-8
    assert len(by["elbow"]) > 100 and np.abs(np.sin(by["elbow"][:, 2])).max() < 1e-8
    # and no singular curve is of both but where they cross
    assert (np.abs(np.sin(by["shoulder"][:, 2])) < 1e-3).sum() <= 8
    shown = report(space).json["singular"]["families"]
    assert [(one["name"], one["configurations"]) for one in shown] == [(k, len(v)) for k, v in by.items()]


def test_a_map_over_two_joints_has_a_double_zero_of_the_determinant_too(tmp_path):
    """det J = d₃² s₂ s₅ does not change its sign at d₃ = 0."""
    text = (ROOT / "models/stanford.xml").read_text("utf-8")
    path = tmp_path / "stanford.xml"
    text = text.replace('file="common', f'file="{ROOT}/models/common')
    path.write_text(
        text.replace('class="stanford_boom" armature', 'class="stanford_boom" range="-0.5 0.6" armature')
    )
    arm = arms.load(path, "wrist")
    q = np.array([0.0, 1.2, 0.0, 0.0, 1.2, 0.0])
    space = joint_map(arm, ("d_3", "theta_5"), q, cells=40)
    names = [space.families[i].name for i in space.family]
    assert "boom" in names and "wrist" in names and "shoulder" not in names
    for name, curve in zip(names, space.singular, strict=True):
        gap = curve[:, 0] if name == "boom" else np.sin(curve[:, 1])
        assert np.abs(gap).max() < 1e-12
    # where a family is singular all over the map, it is no curve inside it
    everywhere = joint_map(arm, ("theta_1", "d_3"), q * [1, 1, 1, 1, 0, 1], cells=10)
    on_edges = [c for i, c in zip(everywhere.family, everywhere.singular, strict=True) if i == 2]
    assert len(on_edges) == 4


def test_an_arm_without_known_factors_has_no_families():
    space = found("planar_3link", cells=12, samples=5000)
    assert space.families == () and all(curve.family is None for curve in space.singular)


# Files and messages ---------------------------------------------------------------------------------


def test_a_file_has_every_array_with_its_meaning(tmp_path):
    space = found("torus_3r")
    workspace_files.save(space, tmp_path / "new/torus.npz")
    with np.load(tmp_path / "new/torus.npz") as file:
        meaning, about = json.loads(str(file["meaning"])), json.loads(str(file["about"]))
        assert set(file.files) == {*meaning, "meaning", "about"}
        np.testing.assert_array_equal(file["free_reached"], space.free.reached)
        np.testing.assert_array_equal(file["limited_q"], space.limited.q)
        assert len(file["singular_q"]) == len(file["singular_curve"]) == len(file["singular_within"])
        assert set(file["singular_family"]) == {"elbow"} and len(file["singular_family"]) == len(
            file["singular_q"]
        )
        assert len(file["limit_points"]) == len(file["limit_label"])
        assert set(file["limit_label"]) == {f"theta_{j} {end}" for j in (2, 3) for end in ("lower", "upper")}
        assert about["slice"] == "rz" and about["joints"] == ["theta_1", "theta_2", "theta_3"]
    assert [path.name for path in tmp_path.glob("new/*")] == ["torus.npz"]


def test_the_summary_has_the_numbers_of_the_workspace():
    values = report(found("planar_6_3")).json
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values["without_limits"]["area"] == found("planar_6_3").free.area
    assert values["without_limits"]["postures"] == [2] and values["with_limits"]["postures"] == [1]
    assert_allclose(values["without_limits"]["x"], [-9.0, 9.0], atol=values["cell"])
    assert values["singular"]["curves"] == 2 and values["method"] == "sheet"
    assert values["limit_curves"] == ["q1 lower", "q1 upper", "q2 lower", "q2 upper"]


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
    with pytest.raises(QuestionError) as caught:
        workspace(wrist)
    assert str(caught.value) == (
        f'{wrist.path}: site "tool" moves on a curved surface; a workspace needs a site that moves in a plane or in space'
    )
    with pytest.raises(QuestionError) as caught:
        workspace(boom, "rz")
    assert str(caught.value) == (
        f'{boom.path}: --plane rz needs a first joint that turns, and "{boom.joints[0]}" does not; give xy, xz or yz'
    )
    with pytest.raises(QuestionError) as caught:
        workspace(boom, "zx")
    assert str(caught.value) == "--plane must be one of xy, xz, yz, rz, got 'zx'"


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
def test_a_tilted_plane_is_seen_from_above_with_its_upward_side_up(tmp_path, axis):
    part = choose_slice(chain_about(tmp_path, axis, axis), None, np.zeros(2))
    tilt = np.sign(float(axis.split()[1]) * float(axis.split()[2]))
    assert part.name == "uv"
    assert_allclose(np.cross(*part.axes), [0, 0.6 * tilt, 0.8], atol=1e-12)
    assert_allclose(np.abs(part.axes[0]), [1, 0, 0], atol=1e-12)
    assert part.axes[1, 2] == pytest.approx(0.6)


@pytest.mark.parametrize("axis", ["0 0 1", "0 0 -1"])
def test_heights_about_an_axis_that_points_down_are_the_worlds(tmp_path, axis):
    part = choose_slice(chain_about(tmp_path, axis, "0 1 0", "0 1 0"), None, np.array([0.0, 0.3, 0.4]))
    assert part.labels == ("r", "z")
    assert_allclose(part.coordinates(np.array([3.0, 4.0, 0.7])), [5.0, 0.7], atol=1e-12)


def test_more_than_a_turn_reaches_what_a_turn_does(tmp_path):
    text = (ROOT / "models/planar_2link.xml").read_text("utf-8").replace("common/", f"{ROOT}/models/common/")
    wide = re.sub(r'(name="(?:shoulder|elbow)") range="[^"]*"', r'\1 range="-3.2 6.5"', text)
    (tmp_path / "wide.xml").write_text(wide)
    space = workspace(arms.load(tmp_path / "wide.xml"), cells=50)
    assert space.limits == ()
    np.testing.assert_array_equal(space.limited.postures, space.free.postures)
    assert space.limited.postures.max() == 2  # a turn more is no posture more


def test_kept_postures_are_within_limits_that_do_not_lie_around_zero(tmp_path):
    text = (
        (ROOT / "models/planar_3link.xml")
        .read_text()
        .replace("common/world.xml", str(ROOT / "models/common/world.xml"))
    )
    path = tmp_path / "arm.xml"
    path.write_text(text.replace('name="elbow" range="-2.7925268 2.7925268"', 'name="elbow" range="1.0 5.0"'))
    arm = arms.load(path)
    assert arm.position_limit[1].tolist() == [1.0, 5.0]
    space = workspace(arm, q=np.array([0.0, 2.0, 0.0]), cells=12, samples=1000)
    kept = space.limited.q[space.limited.reached]
    low, high = arm.position_limit.T
    assert (kept >= low - 1e-8).all() and (kept <= high + 1e-8).all()
    assert kept[:, 1].max() > np.pi + 1.0


def test_the_area_of_a_gantry_is_known_to_its_accuracy(tmp_path):
    """Its outermost points lie on a border of the workspace, but not of cells, which would count as well."""
    path = tmp_path / "gantry.xml"
    path.write_text(
        '<mujoco><worldbody><body><joint name="X" type="slide" axis="1 0 0" range="0 2"/><geom size="0.1"/>'
        '<body><joint name="Y" type="slide" axis="0 1 0" range="0 1"/><geom size="0.1"/><body><geom size="0.1"/>'
        '<joint name="Z" type="slide" axis="0 0 1" range="-0.5 0"/><site name="tool"/></body></body></body>'
        "</worldbody></mujoco>"
    )
    space = workspace(arms.load(path), "xz", cells=60, samples=2000)
    assert abs(space.limited.area - 1.0) < space.limited.accuracy < 0.2
    # a half of a cell sticks out at both ends, where a whole one did
    x = space.a[np.flatnonzero(space.limited.reached.any(axis=1))]
    assert -0.6 < x[0] / space.limited.size < -0.4 and len(x) == 60
