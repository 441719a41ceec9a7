"""det J as a product: against MuJoCo's J, the textbook's factors, and geometry that nobody has built."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import arm as arms
from rmrc import textbook
from rmrc.analysis.factors import factors
from rmrc.analysis.inspect.inspection import inspect
from rmrc.law.task import choose
from rmrc.textbook.puma import UPPER_ARM

TERMS = {
    "planar_2link": "elbow", "planar_6_3": "elbow", "planar_3link": "elbow", "selig_211": "elbow",
    "planar_rp": "pivot", "anthropomorphic": "shoulder elbow", "torus_3r": "shoulder elbow",
    "torus_3r_short": "shoulder elbow", "spherical_wrist": "wrist", "three_roll": "wrist",
    "stanford": "shoulder boom² wrist", "puma560": "shoulder elbow wrist",
    "ur5e": "shoulder elbow wrist", "helical": "", "fr3": "", "xarm7": "", "so101": "",
}  # fmt: skip


def determinant(task, q):
    """Return det of the task's rows of mj_jacSite, which are along world axes here."""
    return np.linalg.det(task.arm.jacobian(q)[task.rows])


def multiplied(found):
    return np.prod([one.value**one.power for one in found])


def test_every_arm_is_listed():
    assert {path.stem for path in (ROOT / "models").glob("*.xml")} == set(TERMS)


@pytest.mark.parametrize("name", TERMS)
def test_the_product_is_the_determinant_of_every_arm(name):
    arm = arms.load(ROOT / f"models/{name}.xml")
    for site in arm.sites[:2]:
        task = choose(arms.load(ROOT / f"models/{name}.xml", site))
        if name == "planar_3link" and site == "wrist":
            continue  # whose third column is 0 in x and y; seen below
        for q in arm.sampled(8, seed=7):
            found = factors(task, task.arm.jacobian(q))
            assert " ".join(one.term for one in found) == TERMS[name]
            if found:
                # a product of a dozen numbers of order 1, of lengths up to 9 m
                assert_allclose(multiplied(found), determinant(task, q), rtol=1e-9, atol=1e-10)


def test_factors_are_those_that_the_textbook_has():
    stanford, puma = (arms.load(ROOT / f"models/{name}.xml", "wrist") for name in ("stanford", "puma560"))
    for q in stanford.sampled(10, seed=8):
        shoulder, boom, wrist = factors(choose(stanford), stanford.jacobian(q))
        assert_allclose(
            np.abs([shoulder.value, boom.value, wrist.value]),
            np.abs([np.sin(q[1]), q[2], np.sin(q[4])]),
            atol=1e-12,
        )
        assert boom.value > 0.0
    for q in puma.sampled(10, seed=8):
        shoulder, elbow, wrist = factors(choose(puma), puma.jacobian(q))
        found = [shoulder.value, elbow.value / UPPER_ARM, wrist.value]
        assert_allclose(np.abs(found), np.abs(textbook.puma_factors(q)), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "site", "q", "gone"),
    [
        ("planar_2link", None, [0.4, 0.0], ["elbow"]),
        ("planar_3link", "wrist", [0.4, np.pi, 0.3], ["elbow"]),
        ("planar_rp", None, [0.3, -1.0], ["pivot"]),
        ("anthropomorphic", None, [0.3, 0.5, 0.0], ["elbow"]),
        # 0.8 c₂ = −0.6 c₂₃
        ("anthropomorphic", None, [0.3, np.pi / 3, np.arccos(-2 / 3) - np.pi / 3], ["shoulder"]),
        ("stanford", "wrist", [0.3, 0.0, 0.6, 0.7, 0.4, 0.2], ["shoulder"]),
        ("stanford", "tool", [0.3, 1.0, 0.6, 0.7, 0.0, 0.2], ["wrist"]),
        ("puma560", "tool", [0.3, -0.8, 2.0, 0.7, 0.0, 0.2], ["wrist"]),
        ("puma560", "wrist", [0.3, -0.8, np.arctan2(0.4331, -0.0203), 0.7, 0.6, 0.2], ["elbow"]),
        ("spherical_wrist", None, [0.3, 0.0, 0.2], ["wrist"]),
        ("three_roll", None, [0.3, 0.0, 0.2], ["wrist"]),
    ],
)
def test_the_factor_that_vanishes_is_the_family_of_the_singularity(name, site, q, gone):
    found = inspect(ROOT / f"models/{name}.xml", q, site=site)
    assert [one.name for one in found.factors if one.vanishes] == gone
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
# away from each other by at least 17 deg: (1, x, y) and its neighbors in turn
axis = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))


def axes_of(drawn):
    """Return axes near x, y and z in turn, so that no two neighbors are parallel."""
    return [tuple(np.roll([1.0, *one], i).tolist()) for i, one in enumerate(drawn)]


def of_text(folder, text):
    path = folder / "chain.xml"
    path.write_text(text)
    return choose(arms.load(path, "s"), ["x", "y", "z", "rx", "ry", "rz"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("chains")


@given(
    st.lists(axis, min_size=6, max_size=6), st.lists(point, min_size=4, max_size=4), point, st.integers(0, 99)
)
def test_any_arm_with_a_spherical_wrist_parts_into_arm_and_wrist(folder, drawn, offsets, tool, seed):
    spots = [*offsets, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    task = of_text(folder, chain(axes_of(drawn), spots, tool, ["hinge"] * 6))
    q = np.random.default_rng(seed).uniform(-3, 3, 6)
    found = factors(task, task.arm.jacobian(q))
    assert [one.name for one in found][-1] == "wrist"
    assert_allclose(multiplied(found), determinant(task, q), atol=1e-9)
    # a wrist whose last axis misses the point by a millimeter is none
    task = of_text(folder, chain(axes_of(drawn), [*spots[:5], (0.001, 0.0007, 0.0004)], tool, ["hinge"] * 6))
    assert factors(task, task.arm.jacobian(q)) == ()


@given(
    st.lists(axis, min_size=6, max_size=6), st.lists(point, min_size=4, max_size=4), point, st.integers(0, 99)
)
def test_parallel_axes_of_shoulder_and_elbow_part_the_arm(folder, drawn, offsets, tool, seed):
    axes = axes_of(drawn)
    axes[2] = axes[1]
    task = of_text(folder, chain(axes, [*offsets, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)], tool, ["hinge"] * 6))
    q = np.random.default_rng(seed).uniform(-3, 3, 6)
    found = factors(task, task.arm.jacobian(q))
    assert [one.name for one in found] == ["shoulder", "elbow", "wrist"]
    assert_allclose(multiplied(found), determinant(task, q), atol=1e-9)


def test_a_ur5e_has_the_families_that_its_lengths_say():
    arm = arms.load(ROOT / "models/ur5e.xml")
    for q in arm.sampled(10, seed=9):
        shoulder, elbow, wrist = factors(choose(arm), arm.jacobian(q))
        a, b = q[1] + q[2], q[1] + q[2] + q[3]
        reach = 0.425 * np.cos(q[1]) + 0.392 * np.cos(a) - 0.1 * np.sin(b)
        found, wanted = (
            [shoulder.value, elbow.value, wrist.value],
            [reach, 0.425 * 0.392 * np.sin(q[2]), np.sin(q[4])],
        )
        assert_allclose(np.abs(found), np.abs(wanted), atol=1e-9)


@given(
    st.lists(axis, min_size=6, max_size=6), st.lists(point, min_size=5, max_size=5), point, st.integers(0, 99)
)
def test_three_parallel_axes_and_two_that_meet_part_any_arm(folder, drawn, offsets, tool, seed):
    one, two, five, six, *_ = axes_of(drawn)
    axes = [one, two, two, two, five, six]
    task = of_text(folder, chain(axes, [*offsets, (0.0, 0.0, 0.0)], tool, ["hinge"] * 6))
    q = np.random.default_rng(seed).uniform(-3, 3, 6)
    found = factors(task, task.arm.jacobian(q))
    assert [one.name for one in found] == ["shoulder", "elbow", "wrist"]
    assert_allclose(multiplied(found), determinant(task, q), atol=1e-9)


def test_an_arm_whose_last_axis_slides_along_its_first_has_an_elbow_alone(tmp_path):
    """SCARA: det J = l₁ l₂ s₂ for x, y and z."""
    text = chain(
        [(0, 0, 1)] * 3, [(0, 0, 0.5), (0.4, 0, 0), (0.3, 0, 0)], (0, 0, 0), ["hinge", "hinge", "slide"]
    )
    (tmp_path / "scara.xml").write_text(text)
    task = choose(arms.load(tmp_path / "scara.xml", "s"), ["x", "y", "z"])
    (elbow,) = factors(task, task.arm.jacobian([0.3, 0.7, 0.1]))
    assert elbow.name == "elbow" and elbow.value == pytest.approx(0.4 * 0.3 * np.sin(0.7), abs=1e-12)


def test_inspect_prints_the_product_and_which_factor_vanishes(rmrc):
    code, out, _ = rmrc("inspect", "stanford", "--site", "wrist", "--q", "0,90 deg,0.6,0,0,0")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert code == 0 and "det J = shoulder · boom² · wrist" in lines
    assert any(
        line.startswith("wrist 0 vanishes interior the axes of theta_4, theta_5 and theta_6")
        for line in lines
    )
    assert any(line.startswith("boom² 0.6000 interior d_3") for line in lines)
