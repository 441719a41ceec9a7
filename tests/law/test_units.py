"""Measures, gains and rates do not depend on the unit of length that arm, task and L are drawn in."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from worlds import NAMES, VARIANT, chain_text

from codes import Method, Objective, OnExcess
from project import mostly_long
from records import Flat, put, resolve
from rmrc.law.record import new_worlds
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare

MILLIMETERS = 1000.0
CHAINS = [(0, 2, 2), (1, 4, 2), (2, 6, 6), (3, 7, 6), (4, 8, 3), (5, 3, 5)]

# What a unit of length does to a σ of a model that is drawn in it: rounding of every length, times some.
ROUNDING = 1e-12


class World(NamedTuple):
    """What one unit gives: records, and the factor by which joint positions and rates are larger than in meters."""

    world: Flat
    tick: Flat
    factor: np.ndarray
    arm: object


def drawn(folder, chain, *how, **options):
    """Return a world of a chain whose lengths are multiplied by a scale, with the same motion asked of it."""
    key = (chain, how, *options.items())
    if key not in DRAWN:
        DRAWN[key] = draw(folder, chain, *how, **options)
    found = DRAWN[key]
    world = found.world.copy()
    return found._replace(world=world, tick=world.tick)


# Each is drawn once for all methods.
DRAWN = {}


def draw(folder, chain, scale, objective=Objective.NONE, length=True):
    seed, n, rows = chain
    rng = np.random.default_rng(seed)
    path = folder / f"{scale:g}.xml"
    path.write_text(chain_text(seed, n, scale))
    axes = [("x", "y", "z", "rx", "ry", "rz")[i] for i in np.sort(rng.permutation(6)[:rows])]
    scenario = loads(
        "{name: test, arm: {site: tip}, target: {path: [{hold: {for: 0.01}}]}, plant: {kind: ideal}}",
        overrides=[
            f"arm.model={path}",
            f"task.axes=[{', '.join(axes)}]",
            f"task.length={0.37 * (scale if length else 1.0)}",
            f"task.weights={rng.uniform(0.2, 5, rows).tolist()}",
            f"control.joint_weights={rng.uniform(0.2, 5, n).tolist()}",
        ],
    )
    prepared = prepare(scenario)
    arm = prepared.arm
    world = Flat(new_worlds(1, n))
    prepared.law.write(world.records[0])
    tick = world.tick
    factor = np.where(arm.is_slide, scale, 1.0)
    lengths = np.repeat([scale, 1.0], 3)
    low, high = arm.model.jnt_range[arm.wiring.joint].T
    q = low + (high - low) * rng.uniform(size=n)
    pose, pose_ref = np.array([*rng.normal(size=3), 1, 0, 0, 0]), np.array([*rng.normal(size=3), 1, 0, 0, 0])
    for p in (pose, pose_ref):
        p[:3] *= scale
    J = arm.jacobian(q)
    put(
        world, on_excess=OnExcess.NONE, J=J, q=q, twist_cmd=lengths * rng.normal(size=6), objective=objective,
        nullspace_gain=0.8, posture=factor * rng.normal(size=n), nullspace_rates=factor * rng.normal(size=n), error=0.2,
        m_2=2, row_2=np.arange(6), row_scale_2=np.ones(2) / (0.37 * scale), moves_2=np.ones(n, int), J_2=lengths[:, None] * rng.normal(size=(6, n)) / factor,
        pose_2=pose, pose_ref_2=pose_ref, feedback_2=2.0, nullspace_secondary_damping=0.05,
    )  # fmt: skip
    return World(world, tick, factor, arm)


def compare(meters, other, rtol=ROUNDING):
    """Resolve both, and hold measures and rates of the one against those of the other."""
    resolve(meters.world, meters.tick)
    resolve(other.world, other.tick)
    one, two = meters.tick[0], other.tick[0]
    n = len(meters.factor)
    condition = one["sigma"][0] / one["sigma"][meters.world[0]["k"] - 1]
    assert_allclose(two["sigma"], one["sigma"], rtol=0, atol=rtol * one["sigma"][0])
    assert two["condition"] == pytest.approx(one["condition"], rel=rtol * condition)
    assert two["manipulability"] == pytest.approx(one["manipulability"], rel=rtol * condition)
    assert two["damping"] == pytest.approx(one["damping"], rel=1e-9, abs=1e-12)
    assert_allclose(two["gain"], one["gain"], rtol=rtol * condition**2, atol=0)
    rates = one["qdot_cmd"][:n]
    size = np.abs(rates / meters.world[0]["joint_scale"][:n]).max() * meters.world[0]["joint_scale"][:n]
    # 1/σ doubles what κ does to rounding
    assert np.all(np.abs(two["qdot_cmd"][:n] / other.factor - rates) <= rtol * max(10, condition**2) * size)
    assert one["status"] == two["status"]


def test_the_chains_have_hinges_and_slides(tmp_path):
    kinds = np.concatenate([drawn(tmp_path, chain, 1.0).arm.is_slide for chain in CHAINS])
    assert 5 < kinds.sum() < len(kinds) - 5


@pytest.mark.parametrize("name", mostly_long(NAMES, 2))
def test_measures_and_rates_of_every_method_are_the_same_in_millimeters(tmp_path, name):
    variant = VARIANT[name]
    for chain in CHAINS:
        if variant.method == Method.INVERSE and chain[1] != chain[2]:
            continue
        worlds = [drawn(tmp_path, chain, scale) for scale in (1.0, MILLIMETERS)]
        for each in worlds:
            # thresholds and bounds so that they act at some of the chains
            put(
                each.world, method=variant.method, schedule=variant.schedule, damping_maximum=0.1, damping_below=0.3,
                manipulability_below=0.3, error_gain=0.5, tolerance=0.05, cutoff=0.2, gamma=0.2, rate_bound=1.0,
            )  # fmt: skip
        compare(*worlds)


@pytest.mark.parametrize(
    "objective", mostly_long(list(Objective), 2), ids=lambda objective: objective.name.lower()
)
def test_rates_of_every_objective_are_the_same_in_millimeters(tmp_path, objective):
    parts = []
    for chain in CHAINS:
        worlds = [drawn(tmp_path, chain, scale, objective) for scale in (1.0, MILLIMETERS)]
        compare(*worlds)
        moved = worlds[0].tick[0]["qdot_cmd"].copy()
        worlds[0].world["nullspace_objective"] = Objective.NONE
        resolve(worlds[0].world, worlds[0].tick)
        parts.append(np.abs(moved - worlds[0].tick[0]["qdot_cmd"]).max())
    assert objective == Objective.NONE or max(parts) > 1e-3  # it had a part in what was compared


def test_the_check_finds_a_characteristic_length_that_is_left_in_meters(tmp_path):
    for chain in CHAINS:
        with pytest.raises(AssertionError):
            compare(drawn(tmp_path, chain, 1.0), drawn(tmp_path, chain, MILLIMETERS, length=False))
