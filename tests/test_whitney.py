"""Whitney's algorithm and the textbook's closed forms, reproduced by the running simulation."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from project import ROOT
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.textbook.six_joint import stanford_chain
from rmrc.textbook.two_link import two_link_rates


def example_5_5(*overrides):
    (run,) = Simulation([prepare(load(ROOT / "scenarios/example_5_5.yaml", overrides))]).run()
    return run


def assert_rates_of_the_textbook(run):
    """θ̇₁ = v c₁₂/(l₁ s₂), θ̇₂ = −v c₁/(l₂ s₂) − v c₁₂/(l₁ s₂), v the speed of the tick: ±1 m/s, but where it turns."""
    speed = run["twist_ref"][:, :1]
    # rounding of J⁻¹, whose condition is below 100 on the way, and so is that of 1/s₂
    assert_allclose(run["qdot_cmd"], speed * two_link_rates([1, 1], run["q"]), rtol=1e-12, atol=1e-12)
    # what the ideal arm does is what it was sent, and it moves by it
    assert_array_equal(run["qdot"][1:], run["qdot_cmd"][:-1])
    assert_allclose(np.diff(run["q"], axis=0), run.period * run["qdot_cmd"][:-1], rtol=0, atol=1e-15)


def test_example_5_5_runs_at_the_rates_of_the_textbook_at_every_tick():
    run = example_5_5()
    assert_rates_of_the_textbook(run)
    steady = np.abs(np.abs(run["twist_ref"][:, 0]) - 1.0) < 1e-12
    assert steady.mean() > 0.99
    # θ̇₂ s₂ → −2 v, so that θ̇₂ grows without bound as θ₂ → 0
    q, rate, v = run["q"][steady], run["qdot_cmd"][steady], run["twist_ref"][steady, 0]
    near = np.abs(q[:, 1]) < 0.1
    assert_allclose(rate[near, 1] * np.sin(q[near, 1]), -2.0 * v[near], rtol=0.005)  # cos of angles below 0.1
    assert np.abs(rate[:, 1]).max() > 15 * np.abs(rate[0, 1])


def test_example_5_5_finds_a_law_that_is_off_by_a_millionth():
    damped = "control.inverse={method: damped, damping: {schedule: constant, maximum: 1.0e-4}}"
    with pytest.raises(AssertionError, match="Not equal to tolerance"):  # λ² = 1e-8 beside σ² > 1e-3
        assert_rates_of_the_textbook(example_5_5(damped))


def whitney_1972(q, pose_ref):
    """Return the joints of the Stanford arm at every tick: δx = x_d − x, δθ = J⁻¹ δx, θ⁺ = θ + δθ.

    A plain loop over the notes' DH table, without MuJoCo and without the law.
    """
    chain, base, tool = stanford_chain(), np.array([0, 0, 0.412]), 0.263  # as models/README.md has it
    joints = []
    for wanted in pose_ref:
        joints.append(q)
        frames = chain.frames(q)
        z, o = frames[1:, :3, 2], base + frames[1:, :3, 3]
        x, turn = o[5] + tool * z[5], Rotation.from_matrix(frames[6, :3, :3])
        turn = Rotation.from_quat(wanted[3:], scalar_first=True) * turn.inv()
        J = np.concatenate([np.cross(z, x - o), z], axis=1).T
        J[:, 2] = [*z[2], 0, 0, 0]  # the boom slides
        q = q + np.linalg.solve(J, [*(wanted[:3] - x), *turn.as_rotvec()])
    return np.array(joints)


def test_the_scenario_whitney_1972_is_his_algorithm_over_the_whole_run():
    def run(*overrides):
        return Simulation([prepare(load(ROOT / "scenarios/whitney_1972.yaml", overrides))]).run()[0]

    right, wrong = run(), run("control.feedback=49.9999")
    want = whitney_1972(right["q"][0], right["pose_ref"])
    # rounding: a tick covers all of the error that the ones before it left, so nothing adds up
    assert_allclose(right["q"], want, rtol=0, atol=1e-13)
    assert np.abs(wrong["q"] - want).max() > 1e-9
