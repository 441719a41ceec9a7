"""The advice survives: what is recommended for loops keeps every limit in them, and is near the best of a grid.

The grid is brute force: every setting of it on every delay, run to the end. The last test has a loop of its own, of
plain MuJoCo and numpy: its delay, lag, encoders and friction are none of the plant that the advice was found on.
"""

import functools
from collections import deque

import mujoco
import numpy as np
import pytest

from loops import controller_of
from project import ROOT
from rmrc.scenario import changes_of, load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.margins.margins import bears
from rmrc.study.study import Study
from rmrc.tuning.options import GAIN_MARGIN
from rmrc.tuning.trials import CHATTER, SATURATED
from rmrc.tuning.tune import Tuning

SCENARIOS = ("approach_singularity", "stanford_wrist", "ur5e_wrist", "ur5e_elbow")
# Where κ along the path reaches this, and those that then ask for rates without bound; few runs are enough.
KAPPA, PLAIN, RUNS = 100.0, ("inverse", "pseudoinverse"), 150
SINGULAR = (
    *SCENARIOS, "beyond_reach", "blow_up", "fr3_elbow", "slow_wrist", "stanford_wrist_close", "ur5e_wrist_close", "xarm7_wrist"
)  # fmt: skip
DELAYS = (0.006, 0.008, 0.010, 0.012)
# None of these is a loop that the search ran.
OTHER_DELAYS = (0.0064, 0.0075, 0.0087, 0.0096, 0.0113)
DAMPED = {"control.inverse.method": "damped", "control.inverse.damping.schedule": "smallest_singular_value"}


def grid():
    """36 settings, as wide as anybody has them: λ, which sets in at three times λ, and K."""
    return [
        {**DAMPED, "control.inverse.damping.maximum": float(most), "control.inverse.damping.below": 3.0 * float(most),
         "control.feedback": float(feedback)}
        for most in np.geomspace(0.005, 0.1, 6) for feedback in np.geomspace(5.0, 110.0, 6)
    ]  # fmt: skip


def cards_of(name, settings, delays=DELAYS):
    """Return figures of settings on each delay: by delay, then by setting."""
    study = Study(load(ROOT / f"scenarios/{name}.yaml"))
    worlds = [
        study.prepare(changes_of({**one, "plant.delay": delay})) for delay in delays for one in settings
    ]
    simulation = Simulation(worlds, 2, keep_columns=False)
    simulation.step()
    cards = simulation.scorecards()
    return worlds, [cards[i : i + len(settings)] for i in range(0, len(cards), len(settings))]


def keeps(world, card):
    """Say whether a run keeps its limits, by its figures."""
    limits = zip(world.arm.joints, world.law.rate_limit, strict=True)
    return (
        card["completed"].value == 1.0
        and card["chatter"].value <= CHATTER
        and card["torque_limited.time"].value <= SATURATED * card["duration"].value
        and all(card[f"joint_rate.{joint}.peak"].value <= 1.01 * limit for joint, limit in limits)
    )


def error_of(world, card):
    turn = card["orientation_error.max"].value if "orientation_error.max" in card else 0.0
    return max(card["position_error.max"].value, world.scenario.task.length * turn)


@pytest.mark.long
@pytest.mark.parametrize("margin", [GAIN_MARGIN, 1.0])
@pytest.mark.parametrize("name", SCENARIOS)
def test_what_is_recommended_keeps_every_limit_on_each_delay_and_is_near_the_best_of_a_grid(name, margin):
    path, late = ROOT / f"scenarios/{name}.yaml", {"plant.delay": max(DELAYS)}
    found = Tuning(path, delay="6ms..12ms", gain_margin=margin, runs=600).run()
    best, settings, study = found.verdict.recommended, grid(), Study(load(path))
    bearing = np.ones(len(settings) + 1, bool)
    if margin > 1.0:
        every = [changes_of(one | late) for one in (best.setting.values, *settings)]
        bearing = np.array(bears(study, every, margin, threads=2), bool)
        assert bearing[0] and not bearing.all()  # negative control: the margin does ask for something
    worlds, cards = cards_of(name, [best.setting.values, *settings])
    errors = np.array([[error_of(worlds[0], card) for card in some] for some in cards])
    kept = np.array([[keeps(worlds[0], card) for card in some] for some in cards])
    assert kept[:, 0].all()
    _, others = cards_of(name, [best.setting.values], OTHER_DELAYS)
    assert all(keeps(worlds[0], card) for (card,) in others)
    assert not kept[:, 1:].all()  # negative control: limits do act
    # on each delay, against the best of those that bear the margin and keep their limits on that delay, which may
    # break them on others
    least = np.where((kept & bearing)[:, 1:], errors[:, 1:], np.inf).min(axis=1)
    assert (errors[:, 0] <= 1.1 * least).all()


@pytest.mark.long
@pytest.mark.parametrize("name", SINGULAR)
def test_near_a_singularity_what_is_recommended_keeps_every_limit_and_is_plain_only_if_nothing_else_does(
    name,
):
    path = ROOT / f"scenarios/{name}.yaml"
    best = Tuning(path, delay="8ms", perturbed=1, runs=RUNS).run().verdict.recommended
    worlds, ((card, *others),) = cards_of(name, [best.setting.values, *grid()], (0.008,))
    assert keeps(worlds[0], card)
    late = changes_of({**best.setting.values, "plant.delay": 0.008})
    assert bears(Study(load(path)), [late], GAIN_MARGIN, threads=2) == [True]
    if best.setting.structure.method in PLAIN and card["condition.max"].value >= KAPPA:
        assert not any(map(keeps, worlds[1:], others))


# The loop of the last test: 125 Hz, a dead time, drives with a lag, encoders of 17 bits a turn with noise, friction.
PERIOD, STEP, LATE, LAG = 0.008, 0.001, 0.008, 0.010
RESOLUTION, NOISE, FRICTION = 2.0 * np.pi / 2**17, 1e-4, 2.0


def drives_of(arm):
    """Return the model of an arm with friction, whose joints have stiff rate drives and weigh nothing."""
    spec = mujoco.MjSpec.from_file(str(arm.path))
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    inertia = np.zeros((arm.model.nv, arm.model.nv))
    data = mujoco.MjData(arm.model)
    mujoco.mj_resetDataKeyframe(arm.model, data, 0)
    mujoco.mj_forward(arm.model, data)
    mujoco.mj_fullM(arm.model, data, inertia)
    for name, own in zip(arm.joints, np.diag(inertia)[arm.wiring.dof], strict=True):
        spec.joint(name).frictionloss = FRICTION
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_velocity(kv=max(own, 0.1) / STEP)
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec.compile()


def driven(prepared, rest=1.5, seed=3):
    """Run a scenario's law in this loop; return errors, rates, and commands while it rests at the end, by ticks."""
    arm, reference = prepared.arm, prepared.reference
    model = drives_of(arm)
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    joints = [model.joint(name) for name in arm.joints]
    at = np.array([joint.qposadr[0] for joint in joints])
    dofs = np.array([joint.dofadr[0] for joint in joints])
    site = model.site(prepared.scenario.arm.site).id
    data.qpos[:] = prepared.qpos
    mujoco.mj_forward(model, data)
    scale = np.where(arm.is_slide, prepared.scenario.task.length, 1.0)
    law, steps = controller_of(prepared), round(PERIOD / STEP)
    queue = deque([np.zeros(arm.n)] * round(LATE / STEP))
    followed, share = np.zeros(arm.n), -np.expm1(-STEP / LAG)
    errors, rates, commands = [], [], []
    axes = [axis in prepared.scenario.task.axes for axis in ("x", "y", "z")]
    for tick in range(reference.ticks + round(rest / PERIOD)):
        now = min(tick, reference.ticks - 1)
        is_over = tick >= reference.ticks
        noisy = data.qpos[at] / scale + NOISE * random.standard_normal(arm.n)
        seen = scale * RESOLUTION * np.round(noisy / RESOLUTION)
        command = law.step(
            seen,
            data.qvel[dofs],
            pose=reference.pose[now],
            twist=np.zeros(6) if is_over else reference.twist[now],
        )
        errors.append(np.linalg.norm((reference.pose[now, :3] - data.site_xpos[site])[axes]))
        rates.append(np.abs(data.qvel[dofs] / scale).max())
        commands.append(command.qdot_cmd / scale)
        for _ in range(steps):
            queue.append(command.qdot_cmd.copy())
            followed += share * (queue.popleft() - followed)
            data.ctrl[:] = followed
            mujoco.mj_step(model, data)
    return np.array(errors), np.array(rates), np.array(commands[reference.ticks :])


@functools.cache
def assumed(name):
    """Return a scenario at 125 Hz with what is recommended where nothing is told of the robot, and its outcome."""
    scenario = load(ROOT / f"scenarios/{name}.yaml", [f"control.period={PERIOD}"])
    found = Tuning(scenario, runs=400).run()
    return scenario.set(found.verdict.recommended.setting.values), found.verdict.recommended.worst


def rings(commands):
    """Say whether an arm that rests is still told to move: in the last half second, beyond what noise asks."""
    return bool(np.abs(commands[-round(0.5 / PERIOD) :]).max() > 0.2)


@pytest.mark.long
@pytest.mark.parametrize("name", SCENARIOS)
def test_what_is_recommended_for_an_assumed_robot_survives_another_loop(name):
    scenario, worst = assumed(name)
    prepared = prepare(scenario)
    errors, rates, commands = driven(prepared)
    assert not rings(commands)
    limit = np.max(prepared.law.rate_limit / np.where(prepared.arm.is_slide, scenario.task.length, 1.0))
    assert rates.max() <= 1.05 * limit
    assert errors.max() <= 2.0 * worst.error + 0.002
    # negative control: a feedback that is good without delay, four times the rule's 1/(delay + T/2 + lag) here
    loud = prepare(scenario.set({"control.feedback": 200.0}))
    assert rings(driven(loud)[2])
