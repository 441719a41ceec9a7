"""Our models in pinocchio: another parser and another library of dynamics read the same arm; `.ci/run peers` installs it."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT

pin = pytest.importorskip("pinocchio", reason="pinocchio is not installed; `.ci/run peers` installs it")

MODELS = sorted(path.stem for path in (ROOT / "models").glob("*.xml"))

# Two routes through at most nine joints, of lengths of a few meters, masses of tens of kg.
AGREE = 1e-9


def both(name):
    path = str(ROOT / f"models/{name}.xml")
    model = mujoco.MjModel.from_xml_path(path)
    return model, mujoco.MjData(model), pin.buildModelFromMJCF(path)


def at(model, data, seed):
    """Let MuJoCo go to random positions, within 1 rad or m of zero, whatever the limits."""
    data.qpos[:] = model.qpos0 + np.random.default_rng(seed).uniform(-1, 1, model.nq)
    mujoco.mj_forward(model, data)
    return data.qpos - model.qpos0


def jacobian(model, data, site):
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
    return J


@pytest.mark.parametrize("name", MODELS)
def test_sites_have_the_same_jacobian(name):
    model, data, theirs = both(name)
    state = theirs.createData()
    for seed in range(5):
        pin.computeJointJacobians(theirs, state, at(model, data, seed))
        pin.updateFramePlacements(theirs, state)
        for site in range(model.nsite):
            frame = theirs.getFrameId(model.site(site).name, pin.FrameType.OP_FRAME)
            J = pin.getFrameJacobian(theirs, state, frame, pin.LOCAL_WORLD_ALIGNED)
            assert_allclose(J, jacobian(model, data, site), atol=AGREE)
            assert_allclose(state.oMf[frame].rotation.ravel(), data.site_xmat[site], atol=AGREE)


@pytest.mark.parametrize("name", MODELS)
def test_arms_weigh_the_same(name):
    model, data, theirs = both(name)
    state, rest, M = theirs.createData(), np.zeros(model.nv), np.zeros((model.nv, model.nv))
    theirs.gravity.linear = model.opt.gravity
    for seed in range(5):
        q = at(model, data, seed)
        mujoco.mj_fullM(model, data, M)
        upper = np.triu(pin.crba(theirs, state, q))
        assert_allclose(upper, np.triu(M), atol=AGREE * np.abs(M).max())
        torques = pin.rnea(theirs, state, q, rest, rest)
        assert_allclose(torques, data.qfrc_bias, atol=AGREE * (1 + np.abs(data.qfrc_bias).max()))


def test_a_link_of_another_mass_is_seen():
    model, data, theirs = both("ur5e")
    theirs.gravity.linear = model.opt.gravity
    theirs.inertias[3].mass *= 1.001
    torques = pin.rnea(theirs, theirs.createData(), at(model, data, 0), np.zeros(6), np.zeros(6))
    assert np.abs(torques - data.qfrc_bias).max() > 1e-3
