"""The robots are twins of the models that people have: these come out of wheels, `.ci/run robots` installs them."""

import re
from importlib import metadata

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc.scenario import load
from twins import TWINS

# What a twin promises: m, and entries of rotations.
PROMISED = 1e-9

every_twin = pytest.mark.parametrize("name", TWINS)


def text_of(name):
    """Return the original's text and path; skip the test where its wheel is not installed."""
    twin = TWINS[name]
    try:
        path = metadata.distribution(twin.distribution).locate_file(twin.file)
    except metadata.PackageNotFoundError:
        pytest.skip(f"{twin.distribution} is not installed; `.ci/run robots` installs it")
    return path.read_text("utf-8"), path


def urdf_of_macro(text):
    """Return the URDF that the FR3's only macro makes, without shapes: it needs names and constants alone."""
    (body,) = re.findall(r'<xacro:macro name="fr3_robot".*?>(.*?)<ros2_control', text, re.DOTALL)
    for name, value in {"prefix": "", "parent_link": "world", "xyz": "0 0 0", "rpy": "0 0 0"}.items():
        body = body.replace(f"${{{name}}}", value)
    body = re.sub(r"<(visual|collision)\b.*?</\1>", "", body, flags=re.DOTALL)
    keep = '<mujoco><compiler fusestatic="false"/></mujoco>'
    return f'<robot name="fr3">{keep}<link name="world"/>{body}</robot>'


def original(name):
    """Return the original as a spec, without its shapes."""
    text, path = text_of(name)
    if path.suffix == ".xacro":
        return mujoco.MjSpec.from_string(urdf_of_macro(text))
    spec = mujoco.MjSpec.from_file(str(path))
    for one in [*spec.geoms, *spec.meshes]:
        spec.delete(one)
    return spec


def twin_of(name):
    return mujoco.MjModel.from_xml_path(str(ROOT / f"models/{name}.xml"))


def moving(model):
    return [model.body(i).name for i in range(1, model.nbody) if model.body_weldid[i]]


def at(model, positions):
    data = mujoco.MjData(model)
    for joint, position in positions.items():
        data.joint(joint).qpos[:] = position
    mujoco.mj_forward(model, data)
    return data


def drawn(model, count=50):
    rng, names = np.random.default_rng(0), [model.joint(i).name for i in range(model.njnt)]
    return [dict(zip(names, rng.uniform(*model.jnt_range.T), strict=True)) for _ in range(count)]


def check_poses(name, spec):
    """Poses of all moving bodies, and J of the tool, which is put on the original's body."""
    twin = twin_of(name)
    tool = twin.site("tool")
    body = spec.body(twin.body(twin.site_bodyid[tool.id]).name)
    body.add_site(name="rmrc_tool", pos=tool.pos, quat=tool.quat)
    model = spec.compile()
    for positions in drawn(twin):
        ours, theirs = at(twin, positions), at(model, positions)
        for link in moving(twin):
            assert_allclose(ours.body(link).xpos, theirs.body(link).xpos, rtol=0, atol=PROMISED)
            assert_allclose(ours.body(link).xmat, theirs.body(link).xmat, rtol=0, atol=PROMISED)
        J, K = (np.zeros((6, one.nv)) for one in (twin, model))
        mujoco.mj_jacSite(twin, ours, J[:3], J[3:], tool.id)
        mujoco.mj_jacSite(model, theirs, K[:3], K[3:], model.site("rmrc_tool").id)
        columns = [model.joint(joint).dofadr[0] for joint in positions]
        assert_allclose(J, K[:, columns], rtol=0, atol=PROMISED)


@every_twin
def test_a_twin_moves_as_its_original(name):
    check_poses(name, original(name))


@every_twin
def test_a_link_off_by_a_hundredth_of_a_micrometer_is_seen(name):
    spec = original(name)
    (link,) = moving(twin_of(name))[2:3]
    spec.body(link).pos = np.add(spec.body(link).pos, [0.0, 1e-8, 0.0])
    with pytest.raises(AssertionError):
        check_poses(name, spec)


@every_twin
def test_masses_and_position_limits_are_those_of_the_original(name):
    twin, theirs = twin_of(name), original(name).compile()
    for link in moving(twin):
        ours, other = twin.body(link), theirs.body(link)
        for field in ("mass", "ipos", "inertia"):
            # The inertia of a full tensor is found by iteration, alike from alike digits.
            assert_allclose(getattr(ours, field), getattr(other, field), rtol=1e-9, atol=1e-12)
    for i in range(twin.njnt):
        assert_allclose(twin.jnt_range[i], theirs.joint(twin.joint(i).name).range, rtol=0, atol=0)


def test_rate_and_torque_limits_of_the_fr3_are_the_maker_s():
    text, _ = text_of("fr3")
    limits = re.findall(
        r'fr3_joint(\d)" type="revolute">.*?effort="([\d.]+)".*?velocity="([\d.]+)"', text, re.DOTALL
    )
    assert [number for number, _, _ in limits] == list("1234567")
    twin = twin_of("fr3")
    assert_allclose(twin.jnt_actfrcrange[:7, 1], [float(effort) for _, effort, _ in limits], atol=0)
    rates = load(ROOT / "scenarios/fr3_elbow.yaml").control.limits.rate
    assert_allclose(rates, [float(rate) for _, _, rate in limits], atol=0)


def test_torque_limits_of_the_ur5e_are_those_of_the_original_s_motors():
    theirs = original("ur5e").compile()
    assert_allclose(twin_of("ur5e").actuator_forcerange, theirs.actuator_ctrlrange, atol=0)
