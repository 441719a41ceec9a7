"""Encoders that are off: what the law sees, what is recorded, and how far the tip comes to lie beside its target."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import chdtri

from project import ROOT, mostly_long
from rmrc.arm import load
from rmrc.results.columns import COLUMNS
from rmrc.scenario import loads
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from rmrc.support.spatial import AXES, pose_error
from rmrc.textbook.displacement import tip_covariance
from screws import screw_chain
from wording import says

PLANAR = ("arm.model=models/planar_3link.xml", "arm.start=home", "task={axes: [x, y, rz], length: 1}")
STANFORD = (
    "arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]",
)  # fmt: skip
# Whitney's arm: at rest, the law sees no error but rounding.
EXACT = (
    "plant.kind=ideal", "control.inverse.method=inverse", "control.period=0.02", "control.feedback=50",
    "control.limits.on_excess=none", "target.limits={velocity: 1, acceleration: 10, jerk: 100}",
    "target.path=[{line: {by: [0.05, 0.05]}}, {hold: {for: 0.2}}]",
)  # fmt: skip
OFF = np.array([0.02, -0.03, 0.01])
OFFSET = f"arm.encoder.offset={OFF.tolist()}"


def test_what_is_recorded_is_the_truth_and_what_the_law_used(simulate):
    prepared, run = simulate(*PLANAR, "control.inverse.method=inverse", OFFSET)
    for t in range(0, len(run), 50):
        q, arm = run["q"][t], prepared.arm
        assert_allclose(run["pose"][t], arm.pose(q), atol=1e-12)
        assert_allclose(run["pose_error"][t], pose_error(run["pose_ref"][t], arm.pose(q)), atol=1e-12)
        believed = arm.jacobian(q + OFF)[[0, 1, 5]]
        assert_allclose(run["sigma"][t], np.linalg.svd(believed, compute_uv=False), atol=1e-12)
        seen = pose_error(run["pose_ref"][t], arm.pose(q + OFF))
        assert_allclose(
            run["qdot_cmd"][t],
            np.linalg.solve(believed, (run["twist_ref"][t] + 20 * seen)[[0, 1, 5]]),
            atol=1e-9,
        )
    assert np.abs(run["pose_error"][-1, :2]).max() > 0.01  # and the two differ


def test_a_screw_that_is_off_is_followed_along_its_pitch(scenario, tmp_path):
    path = tmp_path / "screw.xml"
    path.write_text(screw_chain())
    off = np.array([0.02, -0.1, 0.03])
    shared = (
        f"arm.model={path}",
        "arm.start=home",
        "task.axes=[x, y, z]",
        f"arm.encoder.offset={off.tolist()}",
    )
    (run,) = Simulation([prepare(scenario(*shared, *EXACT[:-1], "target.path=[{hold: {for: 0.2}}]"))]).run()
    arm = load(path)
    # at rest the law sees the site where it is wanted; that is where q + offset puts it
    assert_allclose(arm.pose(run["q"][-1] + off)[:3], run["pose_ref"][-1, :3], atol=1e-12)
    assert_allclose(run["pose"][-1], arm.pose(run["q"][-1]), atol=1e-9)
    assert np.linalg.norm(run["pose_error"][-1, :3]) > 0.005


def test_offsets_are_drawn_as_documented_and_again_the_same(scenario):
    overrides = (
        *STANFORD,
        "arm.encoder={offset: 0.1, deviation: [1 deg, 2 deg, 0.003, 0, 1 deg, 1 deg], seed: 5}",
    )
    first, again = prepare(scenario(*overrides)), prepare(scenario(*overrides))
    assert_array_equal(first.hardware.encoders.offset, again.hardware.encoders.offset)
    deviation = np.array([np.pi / 180, np.pi / 90, 0.003, 0, np.pi / 180, np.pi / 180])
    assert_allclose(
        first.hardware.encoders.offset, np.random.default_rng(5).normal(0.1, deviation), rtol=1e-15
    )
    other = prepare(first.scenario.set({"arm.encoder.seed": 6}))
    assert_allclose(
        other.hardware.encoders.offset, np.random.default_rng(6).normal(0.1, deviation), rtol=1e-15
    )


def test_without_an_offset_a_seed_changes_no_bit(simulate):
    _, run = simulate(*PLANAR)
    _, same = simulate(*PLANAR, "arm.encoder.seed=3")
    for name in COLUMNS:
        assert_array_equal(run[name], same[name])


# Monte Carlo -------------------------------------------------------------------------------------

COUNT = 1000
BASE = "{name: test, arm: {model: '', site: tip}, target: {path: []}}"
CASES = {
    "Stanford, x y z rx ry rz": (STANFORD, np.array([1e-3, 0.5e-3, 0.4e-3, 1e-3, 2e-3, 1e-3])),
    "planar, x y rz": (PLANAR, np.array([1e-3, 0.5e-3, 2e-3])),
}


@pytest.fixture(params=mostly_long(CASES, 2), scope="module")
def sampled(request):
    """Return true errors of 1,000 seeded runs at their end, (1000, m), their offsets, deviations and J there."""
    overrides, deviation = CASES[request.param]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        right, prepared = (
            prepare(loads(BASE, overrides=[*overrides, *EXACT, *off]))
            for off in ((), (f"arm.encoder.deviation={deviation.tolist()}",))
        )
    cache = Cache()
    worlds = [prepare(prepared.scenario.set({"arm.encoder.seed": seed}), cache) for seed in range(COUNT)]
    runs = Simulation(worlds).run()
    (alone,) = Simulation([worlds[700]]).run()
    assert_array_equal(alone["q"], runs[700]["q"])
    (exact,) = Simulation([right]).run()
    rows = [AXES.index(axis) for axis in exact.axes]
    errors = np.array([run["pose_error"][-1, rows] for run in runs])
    offsets = np.array([world.hardware.encoders.offset for world in worlds])
    return errors, offsets, deviation, right.arm.jacobian(exact["q"][-1])[rows]


def test_each_tip_ends_beside_its_target_by_its_jacobian_times_its_offsets(sampled):
    errors, offsets, _, J = sampled
    # The law brings q + δ to where q is wanted, so the error is k(q) − k(q − δ) = J δ up to half the second
    # derivatives, none of which is longer than the arm: at most 2.4 m, or 1 for the rotation.
    bound = 0.5 * 2.4 * np.abs(offsets).sum(axis=1) ** 2
    assert (np.abs(errors - offsets @ J.T).max(axis=1) <= bound).all()
    assert bound.max() < 0.05 * np.abs(errors).max()  # which says something


def unlikelihood(errors, covariance):
    """Return −2 log of the likelihood ratio of a covariance over the sample's own: χ² of p(p + 1)/2 if it holds.

    The determinant of a covariance, and every variance in it, is only known to √(2/999) = 4.5 %; this is the
    one number that weighs all of them, whatever their units.
    """
    ratio = np.linalg.solve(covariance, np.cov(errors.T))
    _, log_determinant = np.linalg.slogdet(ratio)
    return (len(errors) - 1) * (np.trace(ratio) - log_determinant - len(ratio))


def test_covariance_of_the_tip_is_that_of_the_encoders_through_the_jacobian(sampled):
    errors, _, deviation, J = sampled
    p = len(J)
    # 1e-3: a right program fails one of a thousand choices of the seeds, and these are fixed
    bound = chdtri(p * (p + 1) / 2, 1e-3)
    assert unlikelihood(errors, tip_covariance(J, np.diag(deviation**2))) < bound
    mean = errors.mean(axis=0)
    assert COUNT * mean @ np.linalg.solve(np.cov(errors.T), mean) < chdtri(p, 1e-3)
    for j in range(len(deviation)):  # negative control
        halved = np.where(np.arange(len(deviation)) == j, deviation / 2, deviation)
        assert unlikelihood(errors, tip_covariance(J, np.diag(halved**2))) > 10 * bound


# What cannot be ----------------------------------------------------------------------------------


def refusal(scenario, *overrides):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(*overrides))
    return str(caught.value)


def test_joints_that_are_not_actuated_are_refused(scenario):
    two = ("task.axes=[x, y]", "arm.encoder.deviation=0.1")
    problem = refusal(scenario, *PLANAR, *two, "arm.joints=[shoulder, wrist]")
    wanted = '--set arm.encoder.deviation: arm.encoder: joint "elbow" … planar_3link.xml … actuated … arm.encoder …'
    assert problem == says(wanted)


def test_a_value_each_joint(scenario):
    assert refusal(scenario, "arm.encoder={offset: [1], deviation: [0.1, 0.2, 0.3]}").splitlines() == [
        says(f"--set arm.encoder: arm.encoder.{key}: … 2 … (shoulder, elbow) … {count}")
        for key, count in (("offset", 1), ("deviation", 3))
    ]
