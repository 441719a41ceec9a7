"""Every arm of the textbooks in models/ (tests/robots has the others): it compiles, moves without a warning, and is what its sources describe.

The oracle of the kinematics is rmrc.textbook, which does not know MuJoCo; that of the masses is the
sources' numbers, in the sources' frames.
"""

import functools
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from rmrc.support.spatial import shift_twist
from rmrc.textbook.chains import DHChain
from rmrc.textbook.planar import embed_planar_jacobian, planar_jacobian, planar_rp_chain, planar_rp_jacobian
from rmrc.textbook.six_joint import puma_chain, puma_gravity_torques, stanford_chain, stanford_jacobian
from rmrc.textbook.spatial import (
    anthropomorphic_chain,
    anthropomorphic_jacobian,
    helical_jacobian,
    spherical_wrist_chain,
    spherical_wrist_jacobian,
    three_roll_jacobian,
    torus_chain,
    torus_jacobian,
)
from twins import TWINS

MODELS = Path(__file__).parent.parent / "models"

# Products of six transforms with lengths of about 1 m.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Described:
    """What the sources say of one arm: its table, where its sites are, and its closed-form J.

    An arm with a helical joint has more joints in MuJoCo than it can move on its own: `coupling` gives
    those of the model, and of the table, from q, whose rates J is for.
    """

    chain: DHChain
    sites: dict  # name -> (frame, point in that frame)
    closed_form: dict  # site name -> J(q), six rows
    task: tuple = (0, 1, 2, 3, 4, 5)
    base: tuple = (0.0, 0.0, 0.0)
    coupling: tuple | None = None
    home_sigma: float = 0.3

    @property
    def coupled(self):
        """Positions (and rates) of the model's joints from q, as a matrix."""
        return np.eye(len(self.chain.kinds)) if self.coupling is None else np.array(self.coupling)


def planar(*lengths):
    a = (0.0, *lengths[:-1])
    return DHChain(tuple((0.0, x, 0.0, 0.0) for x in a), ("revolute",) * len(lengths))


def six_rows(*lengths):
    return lambda q: embed_planar_jacobian(planar_jacobian(lengths, q))


def torus(*lengths):
    sites, closed_form = {"tip": (3, (lengths[-1], 0, 0))}, {"tip": lambda q: torus_jacobian(lengths, q)}
    return Described(torus_chain(lengths), sites, closed_form, (0, 1, 2), base=(0, 0, 1.2))


def wrist_rows(q, reach=0.0, jacobian=spherical_wrist_jacobian):
    """Six rows of a wrist whose axes meet, at a point on the third axis."""
    axes = jacobian(q)
    return shift_twist(np.vstack([np.zeros((3, 3)), axes]).T, -reach * axes[:, 2]).T


SQUARE, ORIGIN = np.pi / 2, (0.0, 0.0, 0.0)
RISE = 0.5 / (2 * np.pi)  # of the screw, in a radian


DESCRIBED = {
    "planar_2link": Described(planar(1.0, 1.0), {"tip": (2, (1.0, 0, 0))}, {"tip": six_rows(1.0, 1.0)}, (0, 1)),
    "planar_3link": Described(
        planar(1.0, 0.8, 0.6), {"tip": (3, (0.6, 0, 0)), "wrist": (3, ORIGIN)},
        {"tip": six_rows(1.0, 0.8, 0.6), "wrist": six_rows(1.0, 0.8, 0.0)}, (0, 1, 5),
    ),
    "selig_211": Described(
        planar(2.0, 1.0, 1.0), {"tip": (3, (1.0, 0, 0))}, {"tip": six_rows(2.0, 1.0, 1.0)}, (0, 1, 5),
        home_sigma=0.19,  # fig. 6.1 of the source, which the worked example starts from
    ),
    "planar_6_3": Described(planar(6.0, 3.0), {"tip": (2, (3.0, 0, 0))}, {"tip": six_rows(6.0, 3.0)}, (0, 1)),
    "stanford": Described(
        stanford_chain(), {"wrist": (6, ORIGIN), "tool": (6, (0, 0, 0.263))}, {"wrist": stanford_jacobian},
        base=(0, 0, 0.412),
    ),
    "anthropomorphic": Described(
        anthropomorphic_chain([0.8, 0.6]), {"tip": (3, ORIGIN)},
        {"tip": lambda q: anthropomorphic_jacobian([0.8, 0.6], q)}, (0, 1, 2), base=(0, 0, 1.0),
    ),
    "torus_3r": torus(1.2, 0.6, 0.5),
    "torus_3r_short": torus(0.4, 0.6, 0.5),
    "spherical_wrist": Described(
        spherical_wrist_chain(), {"center": (3, ORIGIN), "tool": (3, (0, 0, 0.2))},
        {"center": wrist_rows, "tool": lambda q: wrist_rows(q, 0.2)}, (3, 4, 5), base=(0, 0, 0.5),
    ),
    "three_roll": Described(
        DHChain(  # a tilt about j is one about i between quarter turns about k
            ((0, 0, 0, SQUARE), (np.pi / 3, 0, 0, 0), (-np.pi / 3, 0, 0, -SQUARE)), ("revolute",) * 3,
        ),
        {"center": (3, ORIGIN), "tool": (3, (0, 0, 0.2))},
        {
            "center": lambda q: wrist_rows(q, 0.0, three_roll_jacobian),
            "tool": lambda q: wrist_rows(q, 0.2, three_roll_jacobian),
        },
        (3, 4, 5), base=(0, 0, 0.5),
    ),
    "planar_rp": Described(
        planar_rp_chain(), {"tip": (2, (0, 0, 1.0))}, {"tip": lambda q: embed_planar_jacobian(planar_rp_jacobian(q))},
        (0, 1),
    ),
    "helical": Described(
        DHChain(
            ((0, 0, 0, 0), (0, 0, 0, SQUARE), (SQUARE, 0, 0, 0), (0, 0, 0, 0)),
            ("revolute", "prismatic", "prismatic", "revolute"),
        ),
        {"tip": (4, (0.5, 0, 0))}, {"tip": lambda q: helical_jacobian(RISE, 0.5, q)}, (0, 1, 2), base=(0, 0, 1.1),
        coupling=((1, 0, 0), (RISE, 0, 0), (0, 1, 0), (0, 0, 1)),
    ),
    "puma560": Described(
        puma_chain(), {"wrist": (6, ORIGIN), "tool": (6, (0, 0, 0.1))}, {}, base=(0, 0, 0.672),
        # No posture has more than 0.27: its links are 0.43 m long and J mixes meters with radians.
        home_sigma=0.2,
    ),
}  # fmt: skip

every_model = pytest.mark.parametrize("name", sorted(DESCRIBED))


def spec_of(name):
    return mujoco.MjSpec.from_file(str(MODELS / f"{name}.xml"))


def load(name):
    return spec_of(name).compile()


# Shared by the many examples of a property; a test that changes the model loads its own.
loaded = functools.cache(load)


def fresh(model, qpos):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data


def driven(model):
    """Ids of the joints that are not the follower of another."""
    followers = model.eq_obj1id[model.eq_type == mujoco.mjtEq.mjEQ_JOINT]
    return np.setdiff1d(np.arange(model.njnt), followers)


def positions(model, unit):
    """Positions q of the driven joints between their limits, from numbers between 0 and 1."""
    low, high = model.jnt_range[driven(model)].T
    return low + (high - low) * np.array(unit[: len(low)])


def site_jacobian(model, data, site):
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], model.site(site).id)
    return J


def moving(model):
    """Ids of the bodies that a joint moves."""
    return [b for b in range(model.nbody) if model.body_weldid[b] != 0]


def check_kinematics(model, described, q):
    coupled = described.coupled
    data = fresh(model, coupled @ q)
    frames = described.chain.frames(coupled @ q)
    for site, (frame, point) in described.sites.items():
        pose = frames[frame]
        expected = np.add(described.base, pose[:3, :3] @ point + pose[:3, 3])
        assert_allclose(data.site(site).xpos, expected, atol=ROUNDING)
        assert_allclose(data.site(site).xmat.reshape(3, 3), pose[:3, :3], atol=ROUNDING)
        J = site_jacobian(model, data, site) @ coupled
        assert_allclose(J, described.chain.jacobian(coupled @ q, frame, point) @ coupled, atol=ROUNDING)
        if site in described.closed_form:
            assert_allclose(J, described.closed_form[site](q), atol=ROUNDING)


def test_every_model_is_described():
    assert {path.stem for path in MODELS.glob("*.xml")} == set(DESCRIBED) | set(TWINS)


@every_model
def test_conventions_of_a_model_hold(name):
    model = load(name)
    joints = [model.joint(i).name for i in driven(model)]
    assert [model.joint(i).name for i in model.actuator_trnid[:, 0]] == joints
    assert all(model.jnt_limited) and all(model.actuator_ctrllimited) and all(model.actuator_forcelimited)
    assert set(DESCRIBED[name].sites) == {model.site(i).name for i in range(model.nsite)}
    # A velocity servo: force = kv (ctrl − rate), no position term.
    kv = model.actuator_gainprm[:, 0]
    assert np.all(kv > 0)
    assert_allclose(model.actuator_biasprm[:, :3], np.outer(kv, [0, 0, -1]), atol=0)
    # Geometry is seen only: what an arm weighs is its <inertial>.
    assert not np.any(model.geom_contype | model.geom_conaffinity)


@every_model
def test_home_lies_within_limits_and_away_from_singularities(name):
    model = load(name)
    home = model.key("home")
    low, high = model.jnt_range.T
    assert np.all((low < home.qpos) & (home.qpos < high))
    assert np.all(home.qvel == 0)
    assert np.all(home.ctrl == 0)
    coupled = DESCRIBED[name].coupled
    assert_allclose(coupled @ home.qpos[driven(model)], home.qpos, atol=ROUNDING)
    data = fresh(model, home.qpos)
    for site in DESCRIBED[name].sites:
        J = (site_jacobian(model, data, site) @ coupled)[list(DESCRIBED[name].task)]
        # 0.3 is where the default damping schedule of a scenario begins: at home nothing is damped.
        assert np.linalg.svd(J, compute_uv=False)[-1] > DESCRIBED[name].home_sigma
    floor = data.geom("floor").xpos[2]
    assert np.all(data.xipos[moving(model), 2] > floor)
    assert np.all(data.site_xpos[:, 2] > floor)


@every_model
@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_pose_and_jacobian_are_those_of_the_textbook(name, unit):
    model = loaded(name)
    check_kinematics(model, DESCRIBED[name], positions(model, unit))


@pytest.mark.parametrize(
    ("name", "body", "position"),
    [
        ("planar_2link", "link_2", (1.001, 0, 0)),
        ("stanford", "link_2", (0, -0.154, 0)),
        ("helical", "crank", (0.001, 0, 0)),
        ("puma560", "link_4", (0.0203, -0.4331, 0)),
    ],
)
def test_a_misplaced_body_is_seen(name, body, position):
    """Negative control: d2 with the wrong sign, or 1 mm, must not pass the kinematics' check."""
    spec = spec_of(name)
    spec.body(body).pos = position
    model = spec.compile()
    with pytest.raises(AssertionError):
        check_kinematics(model, DESCRIBED[name], positions(model, [0.6] * 6))


@every_model
def test_a_second_of_random_control_gives_no_warning(name, tmp_path, monkeypatch):
    """A new control every 20 ms, drawn between its limits."""
    monkeypatch.chdir(tmp_path)
    model, rng = load(name), np.random.default_rng(0)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    for _ in range(50):
        data.ctrl[:] = rng.uniform(*model.actuator_ctrlrange.T)
        mujoco.mj_step(model, data, 20)
    assert np.all(np.isfinite(data.qpos))
    assert not any(warning.number for warning in data.warning)
    assert not list(tmp_path.iterdir())


@every_model
@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_torque_limits_hold_the_arm_against_gravity_twice_over(name, unit):
    model, coupled = loaded(name), DESCRIBED[name].coupled
    data = fresh(model, coupled @ positions(model, unit))
    # By virtual work what a follower bears is borne by its leader.
    assert np.all(2 * np.abs(coupled.T @ data.qfrc_bias) < model.actuator_forcerange[:, 1])


ALUMINUM = 2700.0
# Links along x with their joints at one end: length and outer radius.
STRAIGHT = {
    "planar_2link": ((1.0, 0.030), (1.0, 0.030)), "planar_6_3": ((6.0, 0.150), (3.0, 0.100)),
    "planar_3link": ((1.0, 0.030), (0.8, 0.025), (0.6, 0.020)),
    "torus_3r": ((1.2, 0.035), (0.6, 0.030), (0.5, 0.025)), "torus_3r_short": ((0.4, 0.035), (0.6, 0.030), (0.5, 0.025)),
    "selig_211": ((2.0, 0.030), (1.0, 0.025), (1.0, 0.020)),
}  # fmt: skip
WRIST = (("link_1", 0.12, 0.040, -0.1), ("link_2", 0.10, 0.030, 0), ("link_3", 0.12, 0.025, 0.1))
TUBES = [  # arm, link, length, outer radius, wall (0: solid), along which axis, center
    *((name, f"link_{i}", length, outer, 0.003, 0, (length / 2, 0, 0))
      for name, links in STRAIGHT.items() for i, (length, outer) in enumerate(links, 1)),
    *((name, link, length, outer, 0, 2, (0, 0, z))
      for name in ("three_roll", "spherical_wrist") for link, length, outer, z in WRIST),
    ("anthropomorphic", "link_1", 0.3, 0.050, 0.003, 2, (0, 0, -0.15)),
    ("anthropomorphic", "link_2", 0.8, 0.030, 0.003, 0, (0.4, 0, 0)),
    ("anthropomorphic", "link_3", 0.6, 0.025, 0.003, 0, (0.3, 0, 0)),
    ("planar_rp", "link_1", 0.3, 0.045, 0.003, 1, (0, 0, 0)),
    ("planar_rp", "link_2", 2.0, 0.020, 0.003, 2, (0, 0, 0)),
    ("helical", "nut", 0.2, 0.060, 0, 2, (0, 0, 0)),
    ("helical", "boom", 1.0, 0.025, 0.003, 2, (0.065, 0, -0.5)),
    ("helical", "crank", 0.5, 0.020, 0.003, 0, (0.25, 0, 0)),
]  # fmt: skip


@pytest.mark.parametrize(("name", "link", "length", "outer", "wall", "axis", "center"), TUBES)
def test_links_of_our_own_weigh_as_aluminum_tubes(name, link, length, outer, wall, axis, center):
    """A full cylinder less its bore."""
    inner = outer - wall if wall else 0.0
    full, bore = (ALUMINUM * np.pi * r**2 * length for r in (outer, inner))
    along = (full * outer**2 - bore * inner**2) / 2
    moments = np.full(3, along / 2 + (full - bore) * length**2 / 12)
    moments[axis] = along
    body = loaded(name).body(link)
    # The file gives seven digits.
    assert_allclose(body.mass, full - bore, rtol=1e-6)
    assert_allclose(body.ipos, center, atol=ROUNDING)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, body.iquat)
    inertia = R.reshape(3, 3) @ np.diag(body.inertia) @ R.reshape(3, 3).T
    assert_allclose(inertia, np.diag(moments), rtol=1e-6, atol=ROUNDING)


# [Bejczy74], [Paul81, tables 6.4-6.6], in Paul's standard link frames: kg, m, kg m² about the
# frame's origin.
PAUL = {
    "mass": [9.29, 5.01, 4.25, 1.08, 0.63, 0.51],
    "center": [
        [0, 0.0175, -0.1105], [0, -0.1054, 0], [0, 0, -0.6447], [0, 0.0092, -0.0054], [0, 0, 0.0566], [0, 0, 0.1554],
    ],
    "inertia": [
        [0.276, 0.255, 0.071], [0.108, 0.018, 0.100], [2.51, 2.51, 0.006], [0.002, 0.001, 0.001],
        [0.003, 0.003, 0.0004], [0.013, 0.013, 0.0003],
    ],
    "armature": [0.953, 2.193, 0.782, 0.106, 0.097, 0.020],
}  # fmt: skip


def paul_frames(q):
    """Frames 1 to 6 of Paul's standard table, in the world."""
    alphas, d2 = (-SQUARE, SQUARE, 0, -SQUARE, SQUARE, 0), (0, 0.154, 0, 0, 0, 0)
    table = tuple((alpha, 0, d, 0) for alpha, d in zip(alphas, d2, strict=True))
    frames = DHChain(table, stanford_chain().kinds, "standard").frames(q)[1:]
    frames[:, 2, 3] += 0.412
    return frames


def mass_in_frame(model, data, name, frame):
    """A body's mass, its center in a frame, and its moments about the center along the frame's axes."""
    body = model.body(name).id
    center = frame[:3, :3].T @ (data.xipos[body] - frame[:3, 3])
    R = frame[:3, :3].T @ data.ximat[body].reshape(3, 3)
    return model.body_mass[body], center, R @ np.diag(model.body_inertia[body]) @ R.T


def check_stanford_masses(model, q):
    """Mass, center and moments in Paul's frames, found through the poses of the running model."""
    data = fresh(model, q)
    for i, frame in enumerate(paul_frames(q)):
        mass, center, about_center = mass_in_frame(model, data, f"link_{i + 1}", frame)
        assert mass == PAUL["mass"][i]
        assert_allclose(center, PAUL["center"][i], atol=ROUNDING)
        about_origin = about_center + mass * (center @ center * np.eye(3) - np.outer(center, center))
        # MuJoCo finds the principal axes of a full tensor to about 1e-9 of it.
        assert_allclose(about_origin, np.diag(PAUL["inertia"][i]), atol=1e-9)


@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_stanford_masses_are_the_tables_numbers_in_the_tables_frames(unit):
    model = loaded("stanford")
    check_stanford_masses(model, positions(model, unit))


@pytest.mark.parametrize("link", ["link_2", "link_5"])
def test_a_center_of_mass_ten_times_too_far_is_seen(link):
    """Negative control: the fault of a well-known toolbox, link by link."""
    model = load("stanford")
    model.body(link).ipos *= 10
    with pytest.raises(AssertionError):
        check_stanford_masses(model, positions(model, [0.6] * 6))


# [Armstrong86], in the frames of its modified table, moments about the centers: kg, m, kg m².
# Only the moment about its axis is published of link 1.
ARMSTRONG = {
    "mass": [17.40, 4.80, 0.82, 0.34, 0.09],
    "center": [[0.068, 0.006, -0.016], [0, -0.070, 0.014], [0, 0, -0.019], [0, 0, 0], [0, 0, 0.032]],
    "inertia": [
        [0.130, 0.524, 0.539], [0.066, 0.0125, 0.086], [0.0018, 0.0018, 0.0013], [0.0003, 0.0003, 0.0004],
        [0.00015, 0.00015, 0.00004],
    ],
    "axis_1": 0.35,
    "armature": [1.14, 4.71, 0.827, 0.200, 0.179, 0.193],
    "torque": [97.6, 186.4, 89.4, 24.2, 20.1, 21.3],
    "gravity": [-37.2, -8.44, 1.02, 0.249, -0.0282],
}  # fmt: skip
# What the file adds to the moments of link 3, which no body can have as they were measured.
MADE_POSSIBLE = np.array([0.00375, 0.00375, 0.0])


def check_puma_masses(model, q):
    """Mass, center and moments in the table's frames, found through the poses of the running model."""
    data = fresh(model, q)
    frames = puma_chain().frames(q)[1:]
    frames[:, 2, 3] += 0.672
    _, center, about_center = mass_in_frame(model, data, "link_1", frames[0])
    assert_allclose(center, 0.0, atol=ROUNDING)
    assert_allclose(about_center[2, 2], ARMSTRONG["axis_1"], atol=ROUNDING)
    for i, frame in enumerate(frames[1:]):
        mass, center, about_center = mass_in_frame(model, data, f"link_{i + 2}", frame)
        assert mass == ARMSTRONG["mass"][i]
        assert_allclose(center, ARMSTRONG["center"][i], atol=ROUNDING)
        moments = np.add(ARMSTRONG["inertia"][i], MADE_POSSIBLE if i == 1 else 0.0)
        assert_allclose(about_center, np.diag(moments), atol=ROUNDING)


@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_puma_masses_are_the_tables_numbers_in_the_tables_frames(unit):
    model = loaded("puma560")
    check_puma_masses(model, positions(model, unit))


def test_the_puma_s_third_link_is_changed_as_little_as_makes_it_possible():
    x, y, z = ARMSTRONG["inertia"][1]
    assert x + y < z  # as published
    x, y, z = ARMSTRONG["inertia"][1] + MADE_POSSIBLE
    assert x + y == pytest.approx(z, abs=ROUNDING)


INCH = 0.0254
RANGES = {
    "stanford": [
        *np.radians([[-170, 170], [-170, 170]]), [12 * INCH, 50 * INCH],
        *np.radians([[-170, 170], [-90, 90], [-170, 170]]),
    ],
    "puma560": np.radians([[-160, 160], [-225, 45], [-45, 225], [-110, 170], [-100, 100], [-266, 266]]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "source"), [("stanford", PAUL), ("puma560", ARMSTRONG)])
def test_armature_limits_and_torques_are_the_tables_numbers(name, source):
    model = load(name)
    assert_allclose(model.dof_armature, source["armature"], atol=0)
    # The file gives eight digits of the angles.
    assert_allclose(model.jnt_range, RANGES[name], atol=1e-7)
    if "torque" in source:
        assert_allclose(model.actuator_forcerange, np.outer(source["torque"], [-1, 1]), atol=0)


@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_puma_has_the_published_gravity_torques(unit):
    model = loaded("puma560")
    q = positions(model, unit)
    # Three digits of g₁, and 9.80 or 9.81 m/s²: 0.05 N·m each of up to 46.
    held = puma_gravity_torques(ARMSTRONG["gravity"], q)
    assert_allclose(fresh(model, q).qfrc_bias, held, atol=0.06)


def mass_matrix(model, q):
    M = np.zeros((6, 6))
    mujoco.mj_fullM(model, fresh(model, q), M)
    return M


def waist_inertia(I1, I3, q):
    """The first entry of the mass matrix, motor included, with the published constants but for two."""
    c2, s2, c23, s23 = np.cos(q[1]), np.sin(q[1]), np.cos(q[1] + q[2]), np.sin(q[1] + q[2])
    others = 0.298 * s23**2 - 0.0213 * s23 * c23 - 0.0142 * s2 * c2
    return 1.14 + I1 + I3 * c2**2 + others + 2 * (0.372 * c2 * s23 - 0.011 * c2 * c23)


@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_two_published_constants_of_the_puma_do_not_follow_from_its_published_masses(unit):
    q = positions(loaded("puma560"), unit)
    inertia = mass_matrix(loaded("puma560"), q)[0, 0]
    # What the hand adds is below 0.01 kg m².
    assert inertia == pytest.approx(waist_inertia(1.557, 1.602, q), abs=0.01)
    assert inertia - waist_inertia(1.43, 1.38, q) > 0.1


def test_slips_of_transcriptions_of_the_puma_are_seen():
    """Link 3's third moment of 0.066: I₆ = 0.333 of [Armstrong86] says what the elbow feels, beside its motor."""
    q, model = np.radians([10, -50, 100, 20, 30, 40]), load("puma560")
    elbow = 0.827 + 0.333 + 2 * 0.00125 * np.cos(q[4])
    assert mass_matrix(model, q)[2, 2] == pytest.approx(elbow, abs=0.005)
    model.body("link_3").inertia[2] = 0.066
    assert mass_matrix(model, q)[2, 2] < elbow - 0.01


def largest_slip(model, seconds=2.0):
    """How far hinge and slide of the screw come apart under random control at full rates [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    rng = np.random.default_rng(2)
    slip = 0.0
    for step in range(round(seconds / model.opt.timestep)):
        if step % 100 == 0:
            data.ctrl[:] = rng.choice([-1, 1], 3) * model.actuator_ctrlrange[:, 1]
        mujoco.mj_step(model, data)
        slip = max(slip, abs(data.joint("screw_travel").qpos[0] - RISE * data.joint("screw").qpos[0]))
    assert np.ptp(data.qpos) > 0.1
    return slip


def test_the_physics_keeps_the_screw_on_its_helix():
    # Measured 4e-6 m; the constraint is soft, and grows with force and time step.
    assert largest_slip(load("helical")) < 1e-5
