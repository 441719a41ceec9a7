"""MuJoCo's batches that are used again: worlds have the bits of a fresh batch, whatever was in it before."""

import mujoco
import numpy as np
import pytest
from mujoco.batch import MODEL_FIELDS
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.arm import load
from rmrc.arm.differences import NEED_CONSTANTS, loaded_fields, stretched_fields
from rmrc.plants import batches as module
from rmrc.plants.batches import Batches
from rmrc.plants.servo import RateServos
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation

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
        cache, own = Cache(), PLANTS[plant]
        before = [(*own, EXPLODES), (own[0], "arm.start=[1.0, -2.0]")]
        after = [(*own, SHORT), (own[0], SHORT, "control.feedback=5")]
        return tuple([prepare(scenario(*each), cache) for each in some] for some in (before, after))

    return pairs


@pytest.fixture
def made(monkeypatch):
    """Return a list of the batches that are made."""
    found = []

    def noted(fresh):
        def make(*arguments, **options):
            found.append(fresh(*arguments, **options))
            return found[-1]

        return make

    for name in ("Batch", "Native"):
        monkeypatch.setattr(module, name, noted(getattr(module, name)))
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
    monkeypatch.setattr(module.Native, "reset", lambda *_, **__: None)
    with pytest.raises(AssertionError):
        assert_same_bits(run_after(before, after), fresh)


def loaded(mass):
    return lambda model: loaded_fields(model, mass)


def stretched(**stretch):
    return lambda model: stretched_fields(model, stretch)


def take(batches, model, worlds):
    return batches.take(model, [world(model) for world in worlds])


CHANGES = {
    "payload": ([loaded(2.0), loaded(1.0)], [loaded(0.5), loaded(3.0)]),
    "stretch": ([stretched(link_1=2.0), stretched(link_1=3.0)], [stretched(link_1=0.5), stretched()]),
}


@pytest.fixture
def two_links():
    """Return a function: whether a payload has a body -> a model of two links."""
    arm = load(ROOT / "models/planar_2link.xml")
    servos = RateServos((1.0, 1.0))
    return lambda *, loaded: arm.adapted(servos, 0.001, gravity_compensation=False, loaded=loaded)


@pytest.fixture
def models(two_links):
    """Return a function: changes before and after -> models of worlds used again, and of fresh ones."""
    model = two_links(loaded=True)

    def both(before, after):
        batches = Batches()
        batches.give_back(take(batches, model, before))
        worlds = [take(each, model, after) for each in (batches, Batches())]
        return [[batch.get_model(w) for w in range(len(after))] for batch in worlds]

    return both


def assert_same_models(found, wanted):
    for one, want in zip(found, wanted, strict=True):
        for name in MODEL_FIELDS:
            group, _, field = name.rpartition(".")
            assert_array_equal(*(getattr(x.opt if group else x, field) for x in (one, want)))


@pytest.mark.parametrize("kind", CHANGES)
def test_what_follows_from_masses_and_lengths_is_that_of_the_new_worlds(models, made, kind):
    used, fresh = models(*CHANGES[kind])
    assert_same_models(used, fresh)
    assert len(made) == 2  # one for each `Batches`


@pytest.mark.parametrize("kind", CHANGES)
def test_constants_that_are_not_computed_anew_are_caught(models, monkeypatch, kind):
    _, fresh = models(*CHANGES[kind])
    monkeypatch.setattr(module.Batch, "set_const", lambda *_: None)
    used, _ = models(*CHANGES[kind])
    with pytest.raises(AssertionError):
        assert_same_models(used, fresh)


def test_a_world_that_is_like_its_model_keeps_the_constants_of_its_model(models):
    # it stands beside one that is stretched, for which all are computed anew
    (_, plain), _ = models(*CHANGES["stretch"])
    assert_same_models([plain], models([stretched()] * 2, [stretched()] * 2)[1][1:])


def test_a_last_link_that_is_stretched_has_constants_of_its_own_whoever_stands_beside_it(two_links):
    # without a payload's body there is none whose place is on it, so that no `body_pos` changes
    model = two_links(loaded=False)
    large, beside = stretched(link_2=2.0), stretched(link_1=2.0)
    alone, together = (take(Batches(), model, some) for some in ([large], [large, beside]))
    assert_same_models([alone.get_model(0)], [together.get_model(0)])
    assert not np.allclose(alone.get_model(0).dof_invweight0, model.dof_invweight0)


def test_constants_are_computed_anew_after_every_change_that_mujoco_reads_them_from(scenario):
    overrides = ("plant.gravity=[0, 0, 1]", "plant.payload=1", "arm.stretch.link_1=2", "plant.kv=300")
    plant = prepare(scenario(*overrides)).plant
    model = plant.model([plant])
    changed = plant.difference(model, plant.arm.wire(model)).keys()
    assert {"opt.gravity", "actuator_gainprm", "body_mass", "geom_size"} <= changed
    assert changed & set(mujoco.MjModel._setconst_inputs) == NEED_CONSTANTS


def test_a_simulation_that_is_released_twice_lends_its_batch_to_one_other_alone(scenario, made):
    batches, one = Batches(), prepare(scenario(SHORT))
    simulation = Simulation([one], batches=batches)
    simulation.release()
    simulation.release()
    others = [Simulation([one], batches=batches) for _ in range(2)]  # kept, both at work
    assert len(made) == len(others)


def test_batches_of_a_kind_that_is_no_longer_asked_for_make_room(scenario, made):
    batches, cache = Batches(), Cache()
    one = prepare(scenario(SHORT), cache)
    for count in range(1, 20):  # worlds
        Simulation([one] * count, batches=batches).release()
    assert len(made) == 19 and len(batches._idle) == 1
