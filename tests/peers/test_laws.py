"""Our law beside those of other libraries, on the same J: equal where the equations are; `.ci/run peers` installs them."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import resolve_rates

UR5E = str(ROOT / "models/ur5e.xml")
HOME = np.radians([0, -90, 90, -90, -90, 0])
CONSTANT = {"method": "damped", "schedule": "constant"}


def needs(name):
    return pytest.importorskip(name, reason=f"{name} is not installed; `.ci/run peers` installs it")


@pytest.mark.filterwarnings("ignore:the matrix subclass:PendingDeprecationWarning")  # J-PARSE's
@pytest.mark.parametrize("gamma", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("shape", [(2, 2), (3, 6), (6, 6), (6, 7)])
def test_jparse_is_that_of_its_authors(shape, gamma):
    """Its σ are at least γ σ_1 and pinv is taken twice: 1/γ² of rounding."""
    solver = needs("jparse_robotics").JParseCore(gamma=gamma)
    rng, fading = np.random.default_rng(1), 0
    for _ in range(50):
        u, _ = np.linalg.qr(rng.normal(size=(shape[0],) * 2))
        v, _ = np.linalg.qr(rng.normal(size=(shape[1],) * 2))
        sigma = np.sort(10 ** rng.uniform(-2.5, 0, shape[0]))[::-1]
        if (np.abs(sigma / sigma[0] - gamma) < 1e-3).any():
            continue
        J, twist = (u * sigma) @ v[: shape[0]], rng.normal(size=shape[0])
        theirs = solver.compute(J) @ twist
        assert_allclose(
            resolve_rates(J, twist, "jparse", gamma=gamma),
            theirs,
            rtol=0,
            atol=1e-12 * np.abs(theirs).max() / gamma**2,
        )
        fading += sigma[-1] < gamma * sigma[0]
    assert fading > 5


def mink_task(mink, configuration, target):
    task = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0)
    task.set_target(configuration.get_transform_frame_to_world("tool", "site") @ target)
    return task


@pytest.mark.parametrize("damping", [1e-3, 0.03, 0.3])
def test_mink_s_damping_is_the_square_of_ours(damping):
    """Far from limits its program has a closed form: that of damped least squares, its error over the period the twist."""
    mink = needs("mink")
    model, period = mujoco.MjModel.from_xml_path(UR5E), 0.002
    for seed in range(5):
        rng = np.random.default_rng(seed)
        configuration = mink.Configuration(model, HOME + rng.uniform(-0.5, 0.5, 6))
        target = mink.SE3.exp(rng.uniform(-0.01, 0.01, 6))
        task = mink_task(mink, configuration, target)
        theirs = mink.solve_ik(configuration, [task], period, "daqp", damping=damping**2, limits=[])
        # Of a task whose error is e and whose J is that of e, it solves J Δq = −e.
        J, error = task.compute_jacobian(configuration), task.compute_error(configuration)
        ours = resolve_rates(J, -error / period, damping_maximum=damping, **CONSTANT)
        # daqp ends at 1e-6 of its constraints, of which there are none: what is left is rounding, over λ²
        assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max() / damping)
        assert (
            np.abs(resolve_rates(J, -error / period, damping_maximum=damping**2, **CONSTANT) - theirs).max()
            > 1e-6
        )


@pytest.mark.parametrize("damping", [1e-3, 0.03, 0.3])
def test_pink_s_damping_is_the_square_of_ours(damping):
    pin, pink = needs("pinocchio"), needs("pink")
    model, period = pin.buildModelFromMJCF(UR5E), 0.002
    for seed in range(5):
        rng = np.random.default_rng(seed)
        configuration = pink.Configuration(model, model.createData(), HOME + rng.uniform(-0.5, 0.5, 6))
        task = pink.FrameTask("tool", position_cost=1.0, orientation_cost=1.0)
        task.set_target(
            configuration.get_transform_frame_to_world("tool") * pin.exp6(rng.uniform(-0.01, 0.01, 6))
        )
        theirs = pink.solve_ik(configuration, [task], period, "daqp", damping=damping**2, limits=[])
        J, error = task.compute_jacobian(configuration), task.compute_error(configuration)
        ours = resolve_rates(J, -error / period, damping_maximum=damping, **CONSTANT)
        assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max() / damping)
