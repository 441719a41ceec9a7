"""MuJoCo's batches that are used again: worlds have the bits of a fresh batch, whatever was in it before."""

import pytest
from numpy.testing import assert_array_equal

from rmrc import batches as module
from rmrc.batches import Batches
from rmrc.preparation import Known, prepare
from rmrc.run import COLUMNS
from rmrc.simulation import Simulation

SHORT = "target.path=[{line: {by: [0.02, 0.02]}}]"
EXPLODES = "plant.wrench=[0, 1.0e+15, 0, 0, 0, 0]"  # MuJoCo counts warnings, and calls the state bad
# In each world: the plant, and what is a number of the world's own.
PLANTS = {
    "ideal": ("plant.kind=ideal",),
    "servo": ("plant.kind=servo", "plant.kv=500"),
    "torque": ("plant.kind=torque", "plant.gravity=[0, -3, 0]"),
}


@pytest.fixture
def worlds(scenario):
    """Return a function: plant -> worlds that end badly, and worlds that come after them."""

    def pairs(plant):
        known, own = Known(), PLANTS[plant]
        before = [(*own, EXPLODES), (own[0], "arm.start=[1.0, -2.0]")]
        after = [(*own, SHORT), (own[0], SHORT, "control.feedback=5")]
        return tuple([prepare(scenario(*each), known) for each in some] for some in (before, after))

    return pairs


@pytest.fixture
def made(monkeypatch):
    """Return a list of the batches that are made."""
    found, fresh = [], module.Batch

    def noted(*arguments, **options):
        found.append(fresh(*arguments, **options))
        return found[-1]

    monkeypatch.setattr(module, "Batch", noted)
    return found


def run_after(before, after):
    batches = Batches()
    for some in (before, after):
        simulation = Simulation(some, batches=batches)
        runs = simulation.run()
        simulation.release()
    return runs


def assert_same_bits(runs, wanted):
    for run, want in zip(runs, wanted, strict=True):
        assert len(run) == len(want) and run.divergence is None
        for name in COLUMNS:
            assert_array_equal(run[name], want[name])


@pytest.mark.parametrize("plant", PLANTS)
def test_worlds_of_a_batch_that_is_used_again_have_the_bits_of_a_fresh_one(worlds, made, plant):
    before, after = worlds(plant)
    fresh = Simulation(after).run()
    made.clear()
    assert_same_bits(run_after(before, after), fresh)
    assert len(made) == 1


def test_a_batch_that_is_not_reset_is_caught(worlds, monkeypatch):
    before, after = worlds("servo")
    fresh = Simulation(after).run()
    monkeypatch.setattr(module.Batch, "reset", lambda *_, **__: None)
    with pytest.raises(AssertionError):
        assert_same_bits(run_after(before, after), fresh)


def test_a_batch_whose_worlds_have_a_payload_is_not_used_again(scenario, made):
    known = Known()
    loaded, light = (
        [prepare(scenario(SHORT, f"plant.payload={mass}"), known)] for mass in (2.0, 1.0)
    )  # what follows from a mass stays in the batch
    fresh = Simulation(light).run()
    made.clear()
    assert_same_bits(run_after(loaded, light), fresh)
    assert len(made) == 2


def test_batches_of_a_kind_that_is_no_longer_asked_for_make_room(scenario, made):
    batches, known = Batches(), Known()
    one = prepare(scenario(SHORT), known)
    for count in range(1, 20):  # worlds
        Simulation([one] * count, batches=batches).release()
    assert len(made) == 19 and len(batches._idle) == 1
