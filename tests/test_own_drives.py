"""The plant `model`: an arm under its author's own actuators, kind by kind.

The oracle is a plain loop over MuJoCo, of the file as it is, with `rmrc.Controller`; what each actuator is told is
written by hand for each model, from the meaning of MJCF's elements.
"""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from loops import controller_of
from project import ROOT
from rmrc.scenario import Scenario
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from wording import says

MODELS = ROOT / "tests/models/drives"
PERIOD = 0.004
# A thousand steps of numbers near 1, each rounded to 1e-16 and carried on by stiff servos, are off by 1e-12.
EXACT = 1e-9


def scenario(name, start="home", by=(0.05, 0.0, 0.05), seconds=0.3, period=PERIOD, limits=None, **plant):
    """Return a short move, and a pause."""
    path = MODELS / f"{name}.xml" if isinstance(name, str) else name
    return Scenario.model_validate({
        "name": "drives", "arm": {"model": path, "site": "hand", "start": start}, "task": {"axes": ("x", "z")},
        "control": {"period": period, "feedback": 5.0, "limits": limits or {},
                    "inverse": {"damping": {"maximum": 0.1, "below": 0.3}}},
        "target": {"path": ({"line": {"by": by}}, {"hold": {"for": seconds}})},
        "plant": {"kind": "model", "bandwidth": 100.0, **plant},
    })  # fmt: skip


def run(*about, **options):
    """Return the world and what it did."""
    prepared = prepare(scenario(*about, **options))
    (done,) = Simulation([prepared]).run()
    assert done.divergence is None
    return prepared, done


class Loop:
    """A plain loop over MuJoCo.

    Attributes:
        qdot: Rates of the last tick.
    """

    def __init__(self, prepared, timestep=None):
        self.model = mujoco.MjModel.from_xml_path(str(prepared.arm.path))
        self.model.opt.timestep = timestep or self.model.opt.timestep
        self.prepared, self.period = prepared, prepared.scenario.control.period
        self.data = data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, data, 0)
        data.qpos[:] = prepared.qpos
        self.controller = controller_of(prepared)
        self.before = np.zeros(2)

    def run(self, start, tell):
        """Return qpos and joint torques at each tick.

        Args:
            start: Called once with this loop.
            tell: Called each tick with this loop and the rates, to set the controls.
        """
        model, data, found = self.model, self.data, []
        mujoco.mj_forward(model, data)
        start(self)
        data.qfrc_actuator[:] = 0.0
        for pose, twist in zip(self.prepared.reference.pose, self.prepared.reference.twist, strict=True):
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            found.append((data.qpos.copy(), data.qfrc_actuator.copy()))
            rates = self.controller.step_data(data, pose=pose, twist=twist).qdot_cmd.copy()
            tell(self, rates)
            self.before = rates
            mujoco.mj_step(model, data, round(self.period / model.opt.timestep))
        return tuple(map(np.array, zip(*found, strict=True)))

    def load(self):
        """Return what the drives bear at rest: bias − passive, less what they compensate themselves, (n,)."""
        data, own = self.data, self.model.jnt_actgravcomp
        return data.qfrc_bias - data.qfrc_passive - own * data.qfrc_gravcomp

    def torque(self, rates):
        """Return computed torque [Luh80]."""
        M = np.zeros((2, 2))
        mujoco.mj_fullM(self.model, self.data, M)
        qddot = (rates - self.before) / self.period + self.prepared.plant.bandwidth * (rates - self.data.qvel)
        return M @ qddot + self.load()

    def stretch(self, *sites):
        """Return how fast a straight cable between two sites lengthens, (n,), by their Jacobians."""
        first, last = (self.model.site(name).id for name in sites)
        J = np.zeros((2, 3, 2))
        for site, jacobian in zip((first, last), J, strict=True):
            mujoco.mj_jacSite(self.model, self.data, jacobian, None, site)
        along = self.data.site_xpos[last] - self.data.site_xpos[first]
        return along / np.linalg.norm(along) @ (J[1] - J[0])


def moved(*scale):
    """Return what integrates rates, each by a factor, into controls."""

    def tell(loop, rates):
        loop.data.ctrl[:] += np.array(scale) * rates * loop.period

    return tell


def nothing(loop):
    """Leave what the keyframe has."""


def start_velocity(loop):
    loop.data.ctrl[:] = 0.0


def tell_velocity(loop, rates):
    # b: 4 ctrl + 0.5 − 2 length-rate = 0 at length-rate = −3 rate
    loop.data.ctrl[:] = np.clip(rates[0], -1, 1), (-0.5 + 2 * -3 * rates[1]) / 4


def tell_motor(loop, rates):
    # the least controls times gears: shares as the gears are, 5 and 3
    first, second = loop.torque(rates)
    loop.data.ctrl[:] = np.clip(first * 5 / 34, -20, 20), first * 3 / 34, -(second - 0.4) / 2


def start_tendon(loop):
    q, load = loop.data.qpos, loop.load()
    # shoulder: a; elbow: a − b/2
    a, b = load[0], 2 * (load[0] - load[1])
    loop.data.ctrl[:] = q.sum() + a / 200, np.clip(-q[1] / 2 + b / 400, -1, 1)


def tell_tendon(loop, rates):
    loop.data.ctrl[:] += np.array([rates.sum(), -rates[1] / 2]) * loop.period
    loop.data.ctrl[1] = np.clip(loop.data.ctrl[1], -1, 1)


def start_cable(loop):
    loop.data.ctrl[0] = (
        loop.data.actuator_length[0] + loop.load()[0] / loop.stretch("post", "bracket")[0] / 9000
    )


def tell_cable(loop, rates):
    loop.data.ctrl[0] += loop.stretch("post", "bracket")[0] * rates[0] * loop.period
    loop.data.ctrl[1] = loop.torque(rates)[1] / loop.stretch("bracket", "pin")[1]


def start_late(loop):
    q, load = loop.data.qpos, loop.load()
    loop.data.ctrl[:] = q + load / [300.0, 90.0]
    loop.data.act[:] = loop.data.ctrl[1]
    mujoco.mj_initCtrlHistory(loop.model, loop.data, 0, None, np.full((7, 1), loop.data.ctrl[0]))


def tell_pair(loop, rates):
    loop.data.ctrl[[0, 3]] += rates * loop.period
    loop.data.ctrl[[1, 4]] = rates


LOOPS = {
    "position": (nothing, moved(2.0, 1.0)),
    "velocity": (start_velocity, tell_velocity),

    "motor": (nothing, tell_motor),
    "tendon": (start_tendon, tell_tendon),
    "cable": (start_cable, tell_cable),
    "late": (start_late, moved(1.0, 1.0)),
    "pair": (nothing, tell_pair),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_an_arm_does_what_a_plain_loop_over_its_file_does(name):
    start, tell = LOOPS[name]
    prepared, done = run(name)
    qpos, torque = Loop(prepared).run(start, tell)
    assert_allclose(done["qpos"], qpos, rtol=0, atol=EXACT)
    assert_allclose(done["tau"], torque, rtol=0, atol=1e3 * EXACT)  # up to 1e3 N·m for a radian
    assert np.abs(done["qpos"][-1] - done["qpos"][0]).max() > 0.05
    # a loop that tells the drives a thousandth more is seen
    other, _ = Loop(prepared).run(start, lambda loop, rates: tell(loop, 1.001 * rates))
    assert np.abs(other - qpos).max() > 10 * EXACT


# Start and timestep ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["position", "motor", "cable", "pair"]
)  # a rate servo bears weight only by moving
def test_beside_its_keyframe_an_arm_starts_at_rest(name):
    # nothing is asked of the site, and the law has no feedback: what moves is what the drives do not hold
    still = scenario(name, start=(0.3, -0.7), by=(0.0, 0.0, 0.0)).set({
        "control.feedback": 0.0, "target.path": [{"hold": {"for": 0.2}}],
    })  # fmt: skip
    (done,) = Simulation([prepare(still)]).run()
    assert np.abs(done["q"] - [0.3, -0.7]).max() < 1e-9
    weight = Loop(prepare(still))
    mujoco.mj_forward(weight.model, weight.data)
    assert_allclose(
        done["tau"][-1], weight.load() + weight.model.jnt_actgravcomp * weight.data.qfrc_gravcomp, atol=1e-6
    )
    # what bears the weight counts once, be it the actuators or not
    data, own = weight.data, weight.model.jnt_actgravcomp
    borne = data.qfrc_bias - data.qfrc_passive + (1 - own) * data.qfrc_gravcomp
    assert_allclose(done["tau"][-1] + done["tau_gravity"][-1], borne, atol=1e-6)
    assert np.abs(done["tau"][-1]).max() > 0.1


def test_joints_that_nothing_drives_are_named():
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(MODELS.parent / "idle_rail.xml"))
    assert str(caught.value) == says('plant.kind: "model" … idle_rail.xml … shoulder, elbow alone … "servo"')
