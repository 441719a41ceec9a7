"""Every arm in models/: it compiles, moves without a warning, and is what its sources describe.

The oracle of the kinematics is rmrc.textbook, which does not know MuJoCo; that of the masses is the
sources' numbers, in the sources' frames.
"""

import functools
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from rmrc.textbook.dh import DHChain
from rmrc.textbook.planar import embed_planar_jacobian, planar_jacobian
from rmrc.textbook.stanford import stanford_chain, stanford_jacobian

MODELS = Path(__file__).parent.parent / "models"

# Products of six transforms with lengths of about 1 m.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Described:
    """What the sources say of one arm: its table, where its sites are, and its closed-form J."""

    chain: DHChain
    sites: dict  # name -> (frame, point in that frame)
    closed_form: dict  # site name -> J(q), six rows
    task: tuple = (0, 1, 2, 3, 4, 5)
    base: tuple = (0.0, 0.0, 0.0)


def planar(*lengths):
    a = (0.0, *lengths[:-1])
    return DHChain(tuple((0.0, x, 0.0, 0.0) for x in a), ("revolute",) * len(lengths))


def six_rows(*lengths):
    return lambda q: embed_planar_jacobian(planar_jacobian(lengths, q))


DESCRIBED = {
    "planar_2link": Described(
        chain=planar(1.0, 1.0),
        sites={"tip": (2, (1.0, 0.0, 0.0))},
        closed_form={"tip": six_rows(1.0, 1.0)},
        task=(0, 1),
    ),
    "planar_3link": Described(
        chain=planar(1.0, 0.8, 0.6),
        sites={"tip": (3, (0.6, 0.0, 0.0)), "wrist": (3, (0.0, 0.0, 0.0))},
        closed_form={"tip": six_rows(1.0, 0.8, 0.6), "wrist": six_rows(1.0, 0.8, 0.0)},
        task=(0, 1, 5),
    ),
    "planar_6_3": Described(
        chain=planar(6.0, 3.0),
        sites={"tip": (2, (3.0, 0.0, 0.0))},
        closed_form={"tip": six_rows(6.0, 3.0)},
        task=(0, 1),
    ),
    "stanford": Described(
        chain=stanford_chain(),
        sites={"wrist": (6, (0.0, 0.0, 0.0)), "tool": (6, (0.0, 0.0, 0.263))},
        closed_form={"wrist": stanford_jacobian},
        base=(0.0, 0.0, 0.412),
    ),
}

every_model = pytest.mark.parametrize("name", sorted(path.stem for path in MODELS.glob("*.xml")))


@pytest.fixture(autouse=True, scope="module")
def _no_log_file():
    before, config = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    config.logto_file = False
    config.set()
    yield
    before.set()


def spec_of(name):
    return mujoco.MjSpec.from_file(str(MODELS / f"{name}.xml"))


def load(name):
    return spec_of(name).compile()


# Shared by the many examples of a property; a test that changes the model loads its own.
loaded = functools.cache(load)


def fresh(model, q):
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return data


def positions(model, unit):
    """Joint positions between the limits, from numbers between 0 and 1."""
    low, high = model.jnt_range.T
    return low + (high - low) * np.array(unit[: model.nq])


def site_jacobian(model, data, site):
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], model.site(site).id)
    return J


def moving(model):
    """Ids of the bodies that a joint moves."""
    return [b for b in range(model.nbody) if model.body_weldid[b] != 0]


def check_kinematics(model, described, q):
    data = fresh(model, q)
    frames = described.chain.frames(q)
    for site, (frame, point) in described.sites.items():
        pose = frames[frame]
        expected = np.add(described.base, pose[:3, :3] @ point + pose[:3, 3])
        assert_allclose(data.site(site).xpos, expected, atol=ROUNDING)
        assert_allclose(data.site(site).xmat.reshape(3, 3), pose[:3, :3], atol=ROUNDING)
        J = site_jacobian(model, data, site)
        assert_allclose(J, described.chain.jacobian(q, frame, point), atol=ROUNDING)
        if site in described.closed_form:
            assert_allclose(J, described.closed_form[site](q), atol=ROUNDING)


def check_centers_of_mass(model):
    """Each lies within the arm's reach, and within the box around what is drawn of its body."""
    links = np.linalg.norm(model.body_pos, axis=1)[moving(model)]
    slides = model.jnt_range[model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE, 1]
    reach = links.sum() + slides.sum() + np.linalg.norm(model.site_pos, axis=1).max()
    for body in moving(model):
        com = model.body_ipos[body]
        assert np.linalg.norm(com) <= reach
        corners = []
        for geom in np.flatnonzero(model.geom_bodyid == body):
            R = np.zeros(9)
            mujoco.mju_quat2Mat(R, model.geom_quat[geom])
            center, half = np.split(model.geom_aabb[geom], 2)
            spread = np.abs(R.reshape(3, 3)) @ half
            middle = model.geom_pos[geom] + R.reshape(3, 3) @ center
            corners += [middle - spread, middle + spread]
        assert np.all(np.min(corners, axis=0) <= com), model.body(body).name
        assert np.all(com <= np.max(corners, axis=0)), model.body(body).name


def warnings_of_random_control(model, seconds=1.0, seed=0, offset=0.0):
    """Step with a new control every 20 ms, drawn between its limits; count the warnings."""
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    steps = round(seconds / model.opt.timestep)
    for step in range(steps):
        if step % 20 == 0:
            data.ctrl[:] = rng.uniform(*model.actuator_ctrlrange.T) + offset
        mujoco.mj_step(model, data)
    assert np.all(np.isfinite(data.qpos))
    return np.array([warning.number for warning in data.warning])


def test_every_model_is_described():
    assert {path.stem for path in MODELS.glob("*.xml")} == set(DESCRIBED)


@every_model
def test_conventions_of_a_model_hold(name):
    model = load(name)
    joints = [model.joint(i).name for i in range(model.njnt)]
    assert [model.actuator(i).name for i in range(model.nu)] == joints
    assert [model.joint(i).name for i in model.actuator_trnid[:, 0]] == joints
    assert all(model.jnt_limited)
    assert all(model.actuator_ctrllimited)
    assert all(model.actuator_forcelimited)
    assert set(DESCRIBED[name].sites) == {model.site(i).name for i in range(model.nsite)}
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.timestep == 0.001
    # A velocity servo: force = kv (ctrl − rate), no position term.
    kv = model.actuator_gainprm[:, 0]
    assert np.all(kv > 0)
    assert_allclose(model.actuator_biasprm[:, :3], np.outer(kv, [0, 0, -1]), atol=0)
    # Geometry is seen only: what an arm weighs is its <inertial>.
    assert not np.any(model.geom_contype | model.geom_conaffinity)
    assert all(model.body_mass[moving(model)] > 0)


@every_model
def test_home_lies_within_limits_and_away_from_singularities(name):
    model = load(name)
    home = model.key("home")
    low, high = model.jnt_range.T
    assert np.all((low < home.qpos) & (home.qpos < high))
    assert np.all(home.qvel == 0)
    assert np.all(home.ctrl == 0)
    data = fresh(model, home.qpos)
    for site in DESCRIBED[name].sites:
        J = site_jacobian(model, data, site)[list(DESCRIBED[name].task)]
        # 0.3 is where the default damping schedule of a scenario begins: at home nothing is damped.
        assert np.linalg.svd(J, compute_uv=False)[-1] > 0.3
    floor = data.geom("floor").xpos[2]
    assert np.all(data.xipos[moving(model), 2] > floor)
    assert np.all(data.site_xpos[:, 2] > floor)


@every_model
@settings(max_examples=50, deadline=None)
@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_pose_and_jacobian_are_those_of_the_textbook(name, unit):
    model = loaded(name)
    check_kinematics(model, DESCRIBED[name], positions(model, unit))


@pytest.mark.parametrize(
    ("name", "body", "position"),
    [
        ("planar_2link", "link_2", (1.001, 0, 0)),
        ("planar_3link", "link_3", (0.8, 0, 0.001)),
        ("stanford", "link_2", (0, -0.154, 0)),
        ("stanford", "base", (0, 0, 0.411)),
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
    monkeypatch.chdir(tmp_path)
    assert not np.any(warnings_of_random_control(load(name)))
    assert not list(tmp_path.iterdir())


def test_a_control_that_is_no_number_gives_a_warning():
    """Negative control: the counters that the test above reads do count."""
    counters = warnings_of_random_control(load("planar_2link"), seconds=0.01, offset=np.nan)
    assert counters[mujoco.mjtWarning.mjWARN_BADCTRL] > 0


@every_model
def test_centers_of_mass_lie_within_the_links(name):
    check_centers_of_mass(load(name))


@pytest.mark.parametrize("link", ["link_2", "link_3", "link_4", "link_5", "link_6"])
def test_a_center_of_mass_ten_times_too_far_is_seen(link):
    """Negative control: the fault of a well-known toolbox, link by link."""
    model = load("stanford")
    model.body(link).ipos *= 10
    with pytest.raises(AssertionError):
        check_centers_of_mass(model)


@every_model
@settings(max_examples=30, deadline=None)
@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_torque_limits_hold_the_arm_against_gravity_twice_over(name, unit):
    model = loaded(name)
    data = fresh(model, positions(model, unit))
    assert np.all(2 * np.abs(data.qfrc_bias) < model.actuator_forcerange[:, 1])


@pytest.mark.parametrize(
    ("name", "link", "length", "outer"),
    [
        ("planar_2link", "link_1", 1.0, 0.030),
        ("planar_2link", "link_2", 1.0, 0.030),
        ("planar_6_3", "link_1", 6.0, 0.150),
        ("planar_6_3", "link_2", 3.0, 0.100),
        ("planar_3link", "link_1", 1.0, 0.030),
        ("planar_3link", "link_2", 0.8, 0.025),
        ("planar_3link", "link_3", 0.6, 0.020),
    ],
)
def test_planar_links_weigh_as_aluminum_tubes(name, link, length, outer):
    """A full cylinder less its bore, 3 mm of wall, 2700 kg/m³."""
    full, bore = (2700 * np.pi * r**2 * length for r in (outer, outer - 0.003))
    along = (full * outer**2 - bore * (outer - 0.003) ** 2) / 2
    across = along / 2 + (full - bore) * length**2 / 12
    body = load(name).body(link)
    # The file gives seven digits.
    assert_allclose(body.mass, full - bore, rtol=1e-6)
    assert_allclose(body.ipos, [length / 2, 0, 0], atol=ROUNDING)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, body.iquat)
    inertia = R.reshape(3, 3) @ np.diag(body.inertia) @ R.reshape(3, 3).T
    assert_allclose(inertia, np.diag([along, across, across]), rtol=1e-6, atol=ROUNDING)


# [Bejczy74], [Paul81, tables 6.4-6.6], in Paul's standard link frames: kg, m, kg m² about the
# frame's origin.
PAUL = {
    "mass": [9.29, 5.01, 4.25, 1.08, 0.63, 0.51],
    "center": [
        [0, 0.0175, -0.1105],
        [0, -0.1054, 0],
        [0, 0, -0.6447],
        [0, 0.0092, -0.0054],
        [0, 0, 0.0566],
        [0, 0, 0.1554],
    ],
    "inertia": [
        [0.276, 0.255, 0.071],
        [0.108, 0.018, 0.100],
        [2.51, 2.51, 0.006],
        [0.002, 0.001, 0.001],
        [0.003, 0.003, 0.0004],
        [0.013, 0.013, 0.0003],
    ],
    "armature": [0.953, 2.193, 0.782, 0.106, 0.097, 0.020],
}


def paul_frames(q):
    """Frames 1 to 6 of Paul's standard table, in the world."""
    right = np.pi / 2
    table = (
        (-right, 0, 0, 0),
        (right, 0, 0.154, 0),
        (0, 0, 0, 0),
        (-right, 0, 0, 0),
        (right, 0, 0, 0),
        (0, 0, 0, 0),
    )
    frames = DHChain(table, stanford_chain().kinds, "standard").frames(q)[1:]
    frames[:, 2, 3] += 0.412
    return frames


def check_stanford_masses(model, q):
    """Mass, center and moments in Paul's frames, found through the poses of the running model."""
    data = fresh(model, q)
    for i, frame in enumerate(paul_frames(q)):
        body = model.body(f"link_{i + 1}").id
        mass = model.body_mass[body]
        assert mass == PAUL["mass"][i]
        center = frame[:3, :3].T @ (data.xipos[body] - frame[:3, 3])
        assert_allclose(center, PAUL["center"][i], atol=ROUNDING)
        R = frame[:3, :3].T @ data.ximat[body].reshape(3, 3)
        about_center = R @ np.diag(model.body_inertia[body]) @ R.T
        about_origin = about_center + mass * (center @ center * np.eye(3) - np.outer(center, center))
        # MuJoCo finds the principal axes of a full tensor to about 1e-9 of it.
        assert_allclose(about_origin, np.diag(PAUL["inertia"][i]), atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(unit=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_stanford_masses_are_the_tables_numbers_in_the_tables_frames(unit):
    model = loaded("stanford")
    check_stanford_masses(model, positions(model, unit))


@pytest.mark.parametrize("link", [f"link_{i}" for i in range(1, 7)])
def test_moments_left_at_the_frame_origin_are_seen(link):
    """Negative control: across the line to the origin, a moment about it is m c² larger."""
    model = load("stanford")
    body = model.body(link)
    body.inertia += body.mass * np.linalg.norm(body.ipos) ** 2
    with pytest.raises(AssertionError):
        check_stanford_masses(model, positions(model, [0.6] * 6))


def test_stanford_moments_are_possible():
    """No principal moment exceeds the sum of the others: no body has a negative extent."""
    for inertia in load("stanford").body_inertia[2:]:
        # Link 4 is flat as the table rounds it, 0.001 + 0.001 = 0.002: equality up to rounding.
        assert 2 * inertia.max() <= inertia.sum() + 1e-12


def test_stanford_armature_and_limits_are_the_tables_numbers():
    model = load("stanford")
    assert_allclose(model.dof_armature, PAUL["armature"], atol=0)
    inch = 0.0254
    expected = [
        *np.radians([[-170, 170], [-170, 170]]),
        [12 * inch, 50 * inch],
        *np.radians([[-170, 170], [-90, 90], [-170, 170]]),
    ]
    # The file gives eight digits of the angles.
    assert_allclose(model.jnt_range, expected, atol=1e-7)
