"""How much is done between two looks at whether to stop: bounded in steps, learned in time, and without a trace."""

import threading
from collections import Counter

import numpy as np
import pytest
from mujoco.batch import Batch, SimulationError
from numpy.testing import assert_array_equal

from project import mostly_long
from rmrc.plants import native
from rmrc.plants.native import Native
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support import pace
from rmrc.support.pace import Pace

SHORT = "target.path=[{line: {by: [0.02, 0.01]}}]"
# 40 steps a tick
MANY = ("control.period=0.01", "plant.timestep=0.00025")


def test_it_grows_to_what_fits_a_moment_and_falls_when_that_takes_longer():
    found = Pace(1)
    sizes = [found.steps]
    for _ in range(6):  # a step takes a fiftieth of a moment
        found.took(found.steps * pace.LOOK / 50, found.steps)
        sizes.append(found.steps)
    assert sizes == [1, 8, 50, 50, 50, 50, 50]
    found.took(50 * pace.LOOK, 50)  # now a moment
    assert found.steps == 1
    found.took(pace.LOOK / 2, 0)  # nothing was done: nothing was learned but that
    assert found.steps == 1


@pytest.mark.parametrize("worlds", [1, 7, pace.MOST, 3 * pace.MOST])
def test_steps_of_worlds_are_bounded_whatever_the_clock_says(worlds):
    found = Pace(worlds)
    for _ in range(20):
        found.took(0.0, found.steps)
    assert found.steps == max(1, pace.MOST // worlds)


class Watched(threading.Event):
    """An event that knows how often it was looked at."""

    def __init__(self):
        super().__init__()
        self.looks = 0

    def is_set(self):
        self.looks += 1
        return super().is_set()


@pytest.mark.parametrize("worlds", [1, 3])
@pytest.mark.parametrize("kind", ["servo", "torque"])
def test_no_more_steps_than_the_bound_are_done_between_two_looks(scenario, monkeypatch, kind, worlds):
    monkeypatch.setattr(pace, "MOST", 30)
    engine = Native if kind == "servo" else Batch  # what steps it
    step, stop, done = engine.step, Watched(), Counter()

    def counted(self, ids, steps, stage):
        done[stop.looks] += steps * len(self.state)
        step(self, ids, steps, stage)

    monkeypatch.setattr(engine, "step", counted)
    prepared = prepare(scenario(SHORT, *MANY, f"plant.kind={kind}"))
    Simulation([prepared] * worlds).step(stop=stop)
    assert sum(done.values()) == 40 * worlds * (prepared.reference.ticks - 1)  # all were done
    assert max(done.values()) <= 30  # a tick alone has 40, and 120


@pytest.mark.parametrize("most", mostly_long([1, 7, 39, 41, 100], 2, slow=[100]))
@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("plant.kind=torque", "plant.payload=1"),
        ("plant.kind=ideal",),
        ("arm.encoder.offset=0.01",),
        ("plant.wrench=[0, 3, 0, 0, 0, 0]", "control.at_singularity=slow", "control.limits.rate=0.4"),
    ],
    ids=["servo", "torque", "ideal", "encoders", "slow"],
)
def test_bits_do_not_depend_on_when_one_looks(scenario, monkeypatch, overrides, most):
    prepared = [prepare(scenario(SHORT, *MANY, f"control.feedback={k}", *overrides)) for k in (5, 10)]
    monkeypatch.setattr(pace, "MOST", 10**9)
    monkeypatch.setattr(pace, "LOOK", 1e9)  # all at once
    wanted = Simulation(prepared).run()
    monkeypatch.setattr(pace, "MOST", most)
    for run, want in zip(Simulation(prepared).run(), wanted, strict=True):
        for name in COLUMNS:
            assert_array_equal(run[name], want[name])


def test_a_stop_within_a_tick_can_be_gone_on_from(scenario, monkeypatch):
    prepared = prepare(scenario(SHORT, *MANY))
    (want,) = Simulation([prepared]).run()
    monkeypatch.setattr(pace, "MOST", 7)
    simulation, step, parts = Simulation([prepared]), Native.step, []
    stop = threading.Event()

    def stopping(self, ids, steps, stage):
        parts.append(steps)
        step(self, ids, steps, stage)
        if len(parts) % 10 == 0:  # 6 parts a tick
            stop.set()

    monkeypatch.setattr(Native, "step", stopping)
    while not simulation.runs()[0].is_complete:
        stop.clear()
        before = len(parts)
        simulation.step(stop=stop)
        assert len(parts) - before <= 10
    (run,) = simulation.runs()
    for name in COLUMNS:
        assert_array_equal(run[name], want[name])


@pytest.mark.parametrize("engine", [Batch, Native], ids=["single ticks", "blocks"])
def test_an_engine_error_within_a_tick_stops_only_its_own_world(scenario, monkeypatch, engine):
    monkeypatch.setattr(native, "serves", lambda _: engine is Native)
    prepared = prepare(scenario(SHORT, *MANY))
    (alone,) = Simulation([prepared]).run()
    monkeypatch.setattr(pace, "MOST", 3 * 13)  # parts of 13, 13, 13 and 1 step, but for the first ones
    step, calls = engine.step, []

    def failing(self, ids, steps, stage):
        calls.append((ids, steps))
        if sum(n for _, n in calls) == 5 * 40 + 26:
            others = np.setdiff1d(np.arange(3) if ids is None else ids, [1])
            step(self, others, steps, stage)
            raise SimulationError(np.array([1]), "mj_stackAlloc: out of memory", 3)
        step(self, ids, steps, stage)

    monkeypatch.setattr(engine, "step", failing)
    runs = Simulation([prepared] * 3).run()
    assert runs[1].divergence.tick == len(runs[1]) == 6
    assert "mj_stackAlloc: out of memory" in runs[1].divergence.reason
    for name in COLUMNS:
        assert_array_equal(runs[0][name], alone[name])
        assert_array_equal(runs[2][name], alone[name])
        assert_array_equal(runs[1][name], alone[name][:6])
