"""det J as a product: against MuJoCo's J, the textbook's factors, and geometry that nobody has built."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import arm as arms
from rmrc import textbook
from rmrc.analysis.inspection import inspect
from rmrc.analysis.singularities import factors
from rmrc.law.task import choose
from rmrc.textbook.six_joint import UPPER_ARM

TERMS = {
    "planar_2link": "elbow", "planar_6_3": "elbow", "planar_3link": "elbow", "selig_211": "elbow",
    "planar_rp": "pivot", "anthropomorphic": "shoulder elbow", "torus_3r": "shoulder elbow",
    "torus_3r_short": "shoulder elbow", "spherical_wrist": "wrist", "three_roll": "wrist",
    "stanford": "shoulder boom wrist", "puma560": "shoulder elbow wrist",
    "ur5e": "shoulder elbow wrist", "helical": "", "fr3": "", "xarm7": "", "so101": "",
}  # fmt: skip


def determinant(task, q):
    """Return det of the task's rows of mj_jacSite, which are along world axes here."""
    return np.linalg.det(task.arm.jacobian(q)[task.rows])


def examined(task, q):
    """Return the names of the factors at joint positions, their values, and their product."""
    found = factors(task, task.arm.jacobian(q))
    names, values = " ".join(one["name"] for one in found), [one["value"] for one in found]
    return names, values, np.prod([one["value"] ** one["power"] for one in found])


def test_every_arm_is_listed():
    assert {path.stem for path in (ROOT / "models").glob("*.xml")} == set(TERMS)


@pytest.mark.parametrize("name", TERMS)
def test_the_product_is_the_determinant_of_every_arm(name):
    path = ROOT / f"models/{name}.xml"
    for site in arms.load(path).sites[:2]:
        task = choose(arms.load(path, site))
        for q in task.arm.sampled(8, seed=7):
            names, _, product = examined(task, q)
            # the third column of the wrist of three links is 0 in x and y, which are the rows without it
            assert names == TERMS[name] or (name, site) == ("planar_3link", "wrist")
            if names:
                # a product of a dozen numbers of order 1, of lengths up to 9 m
                assert_allclose(product, determinant(task, q), rtol=1e-9, atol=1e-10)


def closed_forms(name, q):
    """Return the factors that the textbook and the lengths of an arm give, without signs."""
    if name == "stanford":
        return [np.sin(q[1]), q[2], np.sin(q[4])]
    if name == "puma560":
        shoulder, elbow, wrist = textbook.puma_factors(q)
        return [shoulder, UPPER_ARM * elbow, wrist]
    a, b = q[1] + q[2], q[1] + q[2] + q[3]
    reach = 0.425 * np.cos(q[1]) + 0.392 * np.cos(a) - 0.1 * np.sin(b)
    return [reach, 0.425 * 0.392 * np.sin(q[2]), np.sin(q[4])]


@pytest.mark.parametrize(("name", "site"), [("stanford", "wrist"), ("puma560", "wrist"), ("ur5e", None)])
def test_factors_are_those_that_the_textbook_has(name, site):
    task = choose(arms.load(ROOT / f"models/{name}.xml", site))
    for q in task.arm.sampled(10, seed=8):
        _, values, _ = examined(task, q)
        assert_allclose(np.abs(values), np.abs(closed_forms(name, q)), atol=1e-9)
        assert name != "stanford" or values[1] > 0.0  # the length of the boom


@pytest.mark.parametrize(
    ("name", "site", "q", "gone"),
    [
        ("planar_3link", "wrist", [0.4, np.pi, 0.3], ["elbow"]),
        ("planar_rp", None, [0.3, -1.0], ["pivot"]),
        ("anthropomorphic", None, [0.3, 0.5, 0.0], ["elbow"]),
        # 0.8 c₂ = −0.6 c₂₃
        ("anthropomorphic", None, [0.3, np.pi / 3, np.arccos(-2 / 3) - np.pi / 3], ["shoulder"]),
        ("stanford", "wrist", [0.3, 0.0, 0.6, 0.7, 0.4, 0.2], ["shoulder"]),
        ("puma560", "tool", [0.3, -0.8, 2.0, 0.7, 0.0, 0.2], ["wrist"]),
        ("puma560", "wrist", [0.3, -0.8, np.arctan2(0.4331, -0.0203), 0.7, 0.6, 0.2], ["elbow"]),
        ("three_roll", None, [0.3, 0.0, 0.2], ["wrist"]),
        ("three_roll", None, [0.3, 0.1, 0.2], []),
    ],
)
def test_the_factor_that_vanishes_is_the_family_of_the_singularity(name, site, q, gone):
    found = inspect(ROOT / f"models/{name}.xml", q, site=site)
    assert [one["name"] for one in found.factors if one["vanishes"]] == gone
    assert (found.rank < len(found.sigma)) == bool(gone)


def chain(axes, offsets, tool, kinds):
    """Return the MJCF of an open chain: axis and place of each joint in the frame before it."""
    opened = "".join(
        f'<body pos="{" ".join(map(repr, offset))}"><joint name="j{i}" type="{kind}" axis="{" ".join(map(repr, axis))}"/>'
        f'<geom size="0.01" mass="1"/>'
        for i, (axis, offset, kind) in enumerate(zip(axes, offsets, kinds, strict=True))
    )
    site = f'<site name="s" pos="{" ".join(map(repr, tool))}"/>'
    return f"<mujoco><worldbody>{opened}{site}{'</body>' * len(axes)}</worldbody></mujoco>"


length = st.floats(0.1, 1.0)
point = st.tuples(length, length, length)
# (1, x, y), its neighbors in turn along y and z: away from each other by at least 17 deg
tilts = st.lists(st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)), min_size=6, max_size=6)
places = st.lists(point, min_size=5, max_size=5)
MEETING = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    """Return a function that loads six hinges with the rows of a pose."""

    def load(axes, offsets, tool):
        path = tmp_path_factory.mktemp("chain") / "chain.xml"
        path.write_text(chain(axes, offsets, tool, ["hinge"] * 6))
        return choose(arms.load(path, "s"), ["x", "y", "z", "rx", "ry", "rz"])

    return load


@given(tilts, places, point, st.integers(0, 99))
def test_any_arm_with_a_spherical_wrist_parts_into_arm_and_wrist(six, drawn, offsets, tool, seed):
    axes = [tuple(np.roll([1.0, *one], i).tolist()) for i, one in enumerate(drawn)]
    q = np.random.default_rng(seed).uniform(-3, 3, 6)
    task = six(axes, [*offsets[:4], MEETING, MEETING], tool)
    names, _, product = examined(task, q)
    assert names.endswith("wrist")
    assert_allclose(product, determinant(task, q), atol=1e-9)
    # a wrist whose last axis misses the point by a millimeter is none
    assert examined(six(axes, [*offsets[:4], MEETING, (0.001, 0.0007, 0.0004)], tool), q)[0] == ""


@given(tilts, places, point, st.integers(0, 99))
def test_three_parallel_axes_and_two_that_meet_part_any_arm(six, drawn, offsets, tool, seed):
    first, second, fifth, sixth, *_ = (tuple(np.roll([1.0, *one], i).tolist()) for i, one in enumerate(drawn))
    task = six([first, second, second, second, fifth, sixth], [*offsets, MEETING], tool)
    q = np.random.default_rng(seed).uniform(-3, 3, 6)
    names, _, product = examined(task, q)
    assert names == "shoulder elbow wrist"
    assert_allclose(product, determinant(task, q), atol=1e-9)


def test_an_arm_whose_last_axis_slides_along_its_first_has_an_elbow_alone(tmp_path):
    """SCARA: det J = l₁ l₂ s₂ for x, y and z."""
    axes, places = [(0, 0, 1)] * 3, [(0, 0, 0.5), (0.4, 0, 0), (0.3, 0, 0)]
    (tmp_path / "scara.xml").write_text(chain(axes, places, MEETING, ["hinge", "hinge", "slide"]))
    task = choose(arms.load(tmp_path / "scara.xml", "s"), ["x", "y", "z"])
    names, (elbow,), _ = examined(task, np.array([0.3, 0.7, 0.1]))
    assert names == "elbow" and elbow == pytest.approx(0.4 * 0.3 * np.sin(0.7), abs=1e-12)
