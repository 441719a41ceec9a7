"""The plant `model`: an arm under its author's own actuators, kind by kind.

The oracle is a plain loop over MuJoCo, of the file as it is, with `rmrc.Controller`; what each actuator is told is
written by hand for each model, from the meaning of MJCF's elements.
"""

import math

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from project import ROOT
from rmrc import arm as arms
from rmrc.law.controller import Controller
from rmrc.scenario import Scenario
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from rmrc.support.notices import heard_by
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
        "control": {"period": period, "feedback": 5.0, "limits": limits or {}},
        "target": {"path": ({"line": {"by": by}}, {"hold": {"for": seconds}})},
        "plant": {"kind": "model", **plant},
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
        self.controller = Controller(prepared.law, data)
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
            rates = self.controller.step(data.qpos, data.qvel, pose, twist).qdot.copy()
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
        qddot = (rates - self.before) / self.period + 500.0 * (rates - self.data.qvel)
        return M @ qddot + self.load()

    def moment(self):
        """Return how fast actuators lengthen, (actuators, joints), by difference quotients of their lengths."""
        h, lengths = 1e-6, []
        other = mujoco.MjData(self.model)
        for step in (*(h * np.eye(2)), *(-h * np.eye(2))):
            other.qpos[:] = self.data.qpos + step
            mujoco.mj_fwdPosition(self.model, other)
            lengths.append(other.actuator_length.copy())
        return (np.array(lengths[:2]) - np.array(lengths[2:])).T / (2 * h)


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
    loop.data.ctrl[:] = np.clip(rates[0], -3, 3), (-0.5 + 2 * -3 * rates[1]) / 4


def tell_intvelocity(loop, rates):
    loop.data.ctrl[:] = rates * [1.0, 0.5]


def start_general(loop):
    # a: 40 u + 3 − 200 q = load; b: −60 u − 60 q = load
    q, load = loop.data.qpos, loop.load()
    loop.data.ctrl[:] = (load[0] - 3 + 200 * q[0]) / 40, -(load[1] + 60 * q[1]) / 60
    loop.data.act[:] = loop.data.ctrl[0]


def tell_motor(loop, rates):
    # the least controls times gears: shares as the gears are, 5 and 3
    first, second = loop.torque(rates)
    loop.data.ctrl[:] = np.clip(first * 5 / 34, -20, 20), first * 3 / 34, -(second - 0.4) / 2


def start_compensated(loop):
    q, load = loop.data.qpos, loop.load()
    loop.data.ctrl[1] = q[1] + load[1] / 90


def tell_compensated(loop, rates):
    loop.data.ctrl[:] = loop.torque(rates)[0], loop.data.ctrl[1] + rates[1] * loop.period


def start_tendon(loop):
    q, load = loop.data.qpos, loop.load()
    # shoulder: a; elbow: a − b/2
    a, b = load[0], 2 * (load[0] - load[1])
    loop.data.ctrl[:] = q.sum() + a / 200, np.clip(-q[1] / 2 + b / 400, -1, 1)


def tell_tendon(loop, rates):
    loop.data.ctrl[:] += np.array([rates.sum(), -rates[1] / 2]) * loop.period
    loop.data.ctrl[1] = np.clip(loop.data.ctrl[1], -1, 1)


def tell_tendon_motor(loop, rates):
    first, second = loop.torque(rates)
    loop.data.ctrl[:] = (first + second) / 10, first - second


def start_cable(loop):
    moment, load = loop.moment(), loop.load()
    assert_allclose(moment[0, 1], 0.0, atol=1e-9)
    assert_allclose(moment[1, 0], 0.0, atol=1e-9)
    loop.data.ctrl[0] = loop.data.actuator_length[0] + load[0] / moment[0, 0] / 9000


def tell_cable(loop, rates):
    moment = loop.moment()
    loop.data.ctrl[0] += moment[0, 0] * rates[0] * loop.period
    loop.data.ctrl[1] = loop.torque(rates)[1] / moment[1, 1]


def start_late(loop):
    q, load = loop.data.qpos, loop.load()
    loop.data.ctrl[:] = q + load / [300.0, 90.0]
    loop.data.act[:] = loop.data.ctrl[1]
    mujoco.mj_initCtrlHistory(loop.model, loop.data, 0, None, np.full((7, 1), loop.data.ctrl[0]))


def tell_pair(loop, rates):
    loop.data.ctrl[[0, 3]] += rates * loop.period
    loop.data.ctrl[[1, 4]] = rates


# Moments by difference quotients are off by their rounding, 1e-16/1e-6 of a length of 0.3, and the rest follows.
LOOPS = {
    "position": (nothing, moved(2.0, 1.0), EXACT),
    "velocity": (start_velocity, tell_velocity, EXACT),
    "intvelocity": (nothing, tell_intvelocity, EXACT),
    "general": (start_general, moved(5.0, -1.0), EXACT),
    "motor": (nothing, tell_motor, EXACT),
    "compensated": (start_compensated, tell_compensated, EXACT),
    "tendon": (start_tendon, tell_tendon, EXACT),
    "tendon_motor": (nothing, tell_tendon_motor, EXACT),
    "cable": (start_cable, tell_cable, 1e-7),
    "late": (start_late, moved(1.0, 1.0), EXACT),
    "pair": (nothing, tell_pair, EXACT),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_an_arm_does_what_a_plain_loop_over_its_file_does(name):
    start, tell, tolerance = LOOPS[name]
    prepared, done = run(name)
    qpos, torque = Loop(prepared).run(start, tell)
    assert_allclose(done["qpos"], qpos, atol=tolerance)
    assert_allclose(done["tau"], torque, atol=1e3 * tolerance)  # up to 1e3 N·m for a radian
    assert np.abs(done["qpos"][-1] - done["qpos"][0]).max() > 0.05
    # a loop that tells the drives a thousandth more is seen
    other, _ = Loop(prepared).run(start, lambda loop, rates: tell(loop, 1.001 * rates))
    assert np.abs(other - qpos).max() > 10 * tolerance
