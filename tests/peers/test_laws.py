"""Our laws beside those of other libraries, on the same J: equal where the equations are; `.ci/run peers` installs them."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import Controller, resolve_rates

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


UR5E, FR3 = (str(ROOT / f"models/{name}.xml") for name in ("ur5e", "fr3"))
FREE = {"rate": 1e6, "position": False}
PERIOD = 0.002


@pytest.mark.parametrize("damping", [0.03, 0.3])
def test_mink_s_kinetic_energy_is_our_metric_of_inertia(damping):
    """Its task adds cost/dt² M to the program of a frame task: λ² M of ours, which is 1 in the mean at home.

    mink 1.3, tasks/kinetic_energy_regularization_task.py. M is of MuJoCo's mj_fullM there, of the arm's own links here.
    """
    mink = needs("mink")
    model = mujoco.MjModel.from_xml_path(UR5E)
    inverse = {
        "metric": "inertia",
        "method": "damped",
        "damping": {"schedule": "constant", "maximum": damping},
    }
    ours = Controller(UR5E, "tool", {"inverse": inverse, "limits": FREE}, period=PERIOD, task={"length": 1.0})
    joints = {"inverse": inverse | {"metric": "joints"}, "limits": FREE}
    other = Controller(UR5E, "tool", joints, period=PERIOD, task={"length": 1.0})
    mean = np.mean(ours.arm.inertia)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        configuration = mink.Configuration(model, HOME + rng.uniform(-0.5, 0.5, 6))
        task = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0)
        wanted = mink.SE3.exp(rng.uniform(-1e-5, 1e-5, 6))
        task.set_target(configuration.get_transform_frame_to_world("tool", "site") @ wanted)
        energy = mink.KineticEnergyRegularizationTask(cost=(damping * PERIOD) ** 2 / mean)
        energy.set_dt(PERIOD)
        theirs = mink.solve_ik(configuration, [task, energy], PERIOD, "daqp", damping=0.0, limits=[])
        # Of a task whose error is e and whose J is that of e, it solves J Δq = −e.
        J, error = task.compute_jacobian(configuration), task.compute_error(configuration)
        J_site = configuration.get_frame_jacobian("tool", "site")
        twist = J_site @ np.linalg.solve(J, -error / PERIOD)
        ours.reset(configuration.q)
        got = ours.step(configuration.q, twist=twist, frame="site").qdot_cmd
        # The J of its error is that of the site but for the error, 20 µm and µrad, and 1 m or rad is large for this arm.
        assert_allclose(got, theirs, rtol=0, atol=5e-5 * np.abs(theirs).max())
        without = other.step(configuration.q, twist=twist, frame="site").qdot_cmd
        assert np.abs(without - theirs).max() > 2e-3 * np.abs(theirs).max()


def test_pink_s_gradient_of_manipulability_is_what_our_objective_follows():
    """pink 4.4, tasks/manipulability_task.py: ∂w/∂q by the kinematic Hessian; ours, projected into the null space."""
    pin, pink = needs("pinocchio"), needs("pink")
    model = pin.buildModelFromMJCF(FR3)
    revolute = pin.buildReducedModel(model, list(range(8, model.njoints)), pin.neutral(model))
    task = pink.tasks.ManipulabilityTask("tool", revolute)
    control = {"nullspace": {"objective": "manipulability", "gain": 1.0}, "limits": FREE}
    ours = Controller(FR3, "tool", control, task={"length": 1.0})
    for seed in range(5):
        q = ours.arm.configuration("home")[ours.arm.wiring.qpos] + np.random.default_rng(seed).uniform(
            -0.3, 0.3, 7
        )
        configuration = pink.Configuration(revolute, revolute.createData(), q)
        J = configuration.get_frame_jacobian("tool")
        N = np.eye(7) - np.linalg.pinv(J) @ J
        wanted = N @ task.compute_jacobian(configuration).ravel()
        ours.reset(q)
        assert np.abs(wanted).max() > 1e-4
        assert_allclose(ours.step(q, twist=np.zeros(6)).qdot_cmd, wanted, rtol=0, atol=1e-9)


def test_joints_brake_no_later_than_pink_s():
    """pink 4.4, limits/acceleration_limit.py: qdot ≤ √(2 a d) before a limit at a distance d; ours counts the period, too."""
    pin, pink = needs("pinocchio"), needs("pink")
    model, braking = pin.buildModelFromMJCF(UR5E), 14.0
    limit = pink.limits.AccelerationLimit(model, np.full(6, braking))
    inverse = {"method": "damped", "damping": {"schedule": "constant", "maximum": 1e-3}}
    control = {"inverse": inverse, "limits": {"rate": np.pi, "braking": braking}}
    ours = Controller(UR5E, "tool", control, period=PERIOD)
    for distance in (0.3, 0.1, 0.03, 0.01, 0.001):
        q = HOME.copy()
        q[5] = model.upperPositionLimit[5] - distance
        limit.set_last_integration(np.full(6, 10.0), PERIOD)  # so fast that only the way to the limit counts
        bounds = limit.compute_qp_inequalities(pink.Configuration(model, model.createData(), q), PERIOD)[1]
        theirs = min(bounds[5] / PERIOD, np.pi)
        ours.reset(q)
        # The sixth axis is the tool's: turning about it asks for the sixth joint alone.
        got = abs(ours.step(q, twist=[0, 0, 0, 0, 0, np.pi], frame="site").qdot_cmd[5])
        assert theirs - braking * PERIOD <= got <= theirs * (1 + 1e-9)
