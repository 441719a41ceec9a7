"""Many variants of one scenario: prepared once, they are to the bit and to the word what each is alone."""

import functools
import threading

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.law.record import new_worlds
from rmrc.results.expectations import refuse_unknown
from rmrc.results.scorecard import scorecard
from rmrc.scenario import Variant, draft_of, load
from rmrc.scenario.changes import read_setting
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError

# Each key that others are found by is changed, and changed back.
VARIED = [
    [], ["control.inverse.damping.maximum=0.07"], ["plant.payload=1"], ["target.limits.velocity=0.3"], [],
    ["task.length=0.5"], ["control.period=0.002", "plant.timestep=0.002"], ["plant.gravity=[0, -1, 0]"],
    ["target.path=[{line: {by: [0.01, -0.0]}}]"], ["target.path=[{line: {by: [0.01, 0.0]}}]"], ["arm.start=home"], [],
    ["control.state=integrated"], ["arm.encoder.noise=0.0001", "control.rate_filter=0.01"], ["arm.encoder.noise=0.0001"], [],
]  # fmt: skip
SHARED = ["control.feedback=12"]
FIELDS = ("time", "pose", "twist", "starts")


def changes(texts):
    return tuple(map(read_setting, texts))


def variants(varied):
    return [Variant(f"v{i}", changes(texts)) for i, texts in enumerate(varied)]


def assert_same(one, other):
    assert one.scenario == other.scenario
    assert repr(one.scenario) == repr(other.scenario)  # which tells 0.0 from -0.0
    assert_array_equal(one.qpos, other.qpos)
    for name in FIELDS:
        assert getattr(one.reference, name).tobytes() == getattr(other.reference, name).tobytes()
    assert record(one) == record(other)
    model = one.plant.model()  # the payload has a body in both or in none
    fields, others = (each.plant.difference(model, one.arm.wire(model)) for each in (one, other))
    assert fields.keys() == others.keys()
    for name, values in fields.items():
        assert_array_equal(values, others[name])


def record(prepared):
    """Return the parameters in a world's record, as bytes."""
    (world,) = new_worlds(1, prepared.arm.n, len(prepared.arm.axis_names))
    prepared.law.write(world)
    prepared.hardware.write(world)
    return world.tobytes()


def alone(path, overrides, varied):
    prepared = prepare(load(path, [*overrides, *varied]))
    refuse_unknown(prepared.scenario, prepared.arm.joints)
    return prepared


@pytest.mark.parametrize("name", ["approach_singularity", "stanford_wrist", "null_space"])
def test_each_variant_is_what_it_is_alone(name):
    path = ROOT / f"scenarios/{name}.yaml"
    once = functools.cache(lambda *texts: alone(path, SHARED, texts))
    arm = once().arm
    moving = next(
        body for body, fixed in zip(arm.body_names, arm.model.body_weldid == 0, strict=True) if not fixed
    )
    varied = [*VARIED, [f"arm.stretch.{moving}=1.01"], [f"arm.stretch.{moving}=0.99"], []]
    wanted, fitting = [], []
    for texts in varied:
        try:
            wanted.append(once(*texts))
            fitting.append(texts)
        except ScenarioError:  # not every change fits every scenario
            assert texts
    assert len(fitting) > 8
    for one, want in zip(Study(draft_of(path, SHARED)).prepare_all(variants(fitting)), wanted, strict=True):
        assert_same(one, want)


def test_a_watcher_sees_every_tick_and_can_end_the_runs():
    study = Study(
        draft_of(ROOT / "scenarios" / "approach_singularity.yaml", ["target.path=[{hold: {for: 3}}]"])
    )
    starts = ("[1, -1]", "[1, -1.5]", "[1, -2]")
    worlds = study.prepare_all(variants([[f"arm.start={start}"] for start in starts]))
    whole, seen, stop = study.step(worlds), [], threading.Event()

    def watch(index, part):
        if not seen:
            study.step(worlds[2:])  # another world of the same model
        seen.append((index, len(part)))
        if index == 1:
            stop.set()

    some = study.step(worlds, stop, watch)
    assert [one.status for one in whole] == ["complete"] * 3
    assert [one.status for one in some] == ["complete", "interrupted", "interrupted"]
    assert 0 == len(some[2].run) < len(some[1].run) < len(some[0].run) == len(whole[0].run)
    for index, (one, other) in enumerate(zip(some, whole, strict=True)):
        assert len(one.run) == sum(ticks for which, ticks in seen if which == index)
        assert one.run["q"].tobytes() == other.run["q"][: len(one.run)].tobytes()
        for name, figure in scorecard(other.run).items():  # NaN among them
            np.testing.assert_equal(other.scorecard[name], figure)
    (alone,) = Simulation([prepare(worlds[1].scenario)]).run()
    assert whole[1].run["q"].tobytes() == alone["q"].tobytes()
    assert whole[0].run["q"].tobytes() != alone["q"].tobytes()  # negative control
