"""What few worlds need is compiled apart, when a world that needs it is prepared, and called at its address."""

import os
import subprocess
import sys

import numpy as np
import pytest

from project import ROOT
from rmrc.law import jit
from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.law.record import ADDRESSES
from rmrc.plants import lockstep
from rmrc.plants.wiring import WIRING
from rmrc.scenario import load
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

WORLD = np.dtype([
    ("call_toy", np.int64), ("call_chosen", np.int64), ("call_doubled", np.int64), ("call_late", np.int64), ("is_doubled", np.int64), ("is_toy", np.int64), ("choice", np.int64), ("values", float, (3,))
])  # fmt: skip
TICK = np.dtype([("sum", float)])


def add(world: Record, tick: Record, values: Array, factor: int) -> float:  # noqa: ARG001 - as all take it
    for value in values:
        tick.sum += factor * value
    return tick.sum


@compiled
def once(world: Record, tick: Record) -> None:  # noqa: ARG001
    tick.sum += 1.0


@compiled
def twice(world: Record, tick: Record) -> None:  # noqa: ARG001
    tick.sum += 2.0


def double(world: Record, tick: Record) -> None:  # noqa: ARG001
    tick.sum *= 2.0


added = jit.apart("call_toy", is_toy=())(add)
doubled = jit.apart("call_doubled", is_late=True)(double)
chosen = jit.apart_by_code("call_chosen", "choice", {1: once, 2: twice})


@entry
def call_toys(worlds: Record, ticks: Record) -> None:
    for w in range(worlds.shape[0]):
        if worlds[w].is_toy:
            worlds[w].values[0] = added(worlds[w], ticks[w], worlds[w].values, 2)
        if worlds[w].choice:
            chosen(worlds[w], ticks[w])
        if worlds[w].is_doubled:
            doubled(worlds[w], ticks[w])


def worlds_of(is_toy, choice, is_doubled=0):
    worlds, ticks = np.zeros(len(is_toy), WORLD), np.zeros(len(is_toy), TICK)
    worlds["is_doubled"] = is_doubled
    worlds["is_toy"], worlds["choice"], worlds["values"] = is_toy, choice, [1.0, 2.0, 4.0]
    return worlds, ticks


def names():
    return [key[0].__name__ for key in jit._addresses if key[0].__module__ == __name__]


def test_a_function_is_compiled_when_a_world_first_needs_it():
    worlds, ticks = worlds_of([0, 0], [0, 0])
    machine_code(call_toys, worlds, ticks, at_need=True)(worlds, ticks)
    assert ticks["sum"].tolist() == [0.0, 0.0] and names() == []
    worlds, ticks = worlds_of([0, 1, 0], [0, 2, 2])
    machine_code(call_toys, worlds, ticks, at_need=True)(worlds, ticks)
    assert ticks["sum"].tolist() == [0.0, 2.0 * 7.0 + 2.0, 2.0]
    assert worlds["values"][:, 0].tolist() == [1.0, 14.0, 1.0]
    assert names() == ["add", "twice"]  # and not `once`
    assert (worlds["call_toy"] != 0).tolist() == [False, True, False]


def test_a_world_that_was_not_prepared_raises_and_harms_nothing():
    worlds, ticks = worlds_of([1], [0])
    with pytest.raises(RuntimeError, match="nothing is at call_toy"):
        call_toys(worlds, ticks)
    assert ticks["sum"] == 0.0


@pytest.fixture
def unfound(monkeypatch):
    monkeypatch.setattr(jit, "_addresses", {})


@pytest.mark.usefixtures("unfound")
def test_a_late_function_is_compiled_at_its_first_call():
    worlds, ticks = worlds_of([1, 0, 0], [0, 2, 1], [0, 1, 1])
    call = machine_code(call_toys, worlds, ticks, at_need=True)
    assert "double" not in names() and not worlds["call_doubled"].any()
    with jit.compiling_late():
        call(worlds, ticks)
    assert ticks["sum"].tolist() == [14.0, 4.0, 2.0]
    assert "double" in names() and (worlds["call_doubled"] != 0).tolist() == [False, True, True]


@pytest.mark.usefixtures("unfound")
def test_a_late_function_is_compiled_before_a_loop_in_real_time_and_for_other_processes():
    worlds, ticks = worlds_of([0], [0], [1])
    machine_code(call_toys, worlds, ticks)
    assert names() == ["double"] and worlds["call_doubled"].all()
    jit._addresses.clear()
    worlds, ticks = worlds_of([0], [0], [1])
    with jit.all_at_once():
        machine_code(call_toys, worlds, ticks, at_need=True)
    assert names() == ["double"] and worlds["call_doubled"].all()


@pytest.mark.usefixtures("unfound")
@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_an_interrupt_waits_for_a_late_function_and_an_error_ends_the_tick(error, monkeypatch):
    found, times = jit._found, []

    def fails_once(*about):
        times.append(about)
        if len(times) == 1:
            raise error
        return found(*about)

    worlds, ticks = worlds_of([0], [2], [1])
    call = machine_code(call_toys, worlds, ticks, at_need=True)
    monkeypatch.setattr(jit, "_found", fails_once)
    with pytest.raises(error), jit.compiling_late():
        call(worlds, ticks)
    assert ticks["sum"] == (4.0 if error is KeyboardInterrupt else 2.0)
    with jit.compiling_late():  # raised once
        call(worlds, ticks)
    assert ticks["sum"] == (12.0 if error is KeyboardInterrupt else 8.0)


def test_each_address_is_declared_and_used():
    known = [one for one in jit._APARTS if one.function.__module__ != __name__]
    assert lockstep.tick
    declared = {one.name for one in (*ADDRESSES, *WIRING) if one.name.startswith("call_")} - {jit.LATE}
    assert {one.field for one in known} == declared


RUN = ["-m", "rmrc", "run", "scenarios/approach_singularity.yaml", "--quiet", "--set", "baseline={}"]
USED = {
    "reference.sample", "damping.smallest_singular_value", "inverses.damped", "limits.scale",
    "physics.read_drives", "servo.tell_servos", "lockstep.tick", "blocks.block", "tally.add",
}  # fmt: skip


@pytest.mark.long
def test_the_first_run_compiles_what_it_needs(tmp_path):
    def kept(*more):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
        command = [sys.executable, *RUN, "--out", str(tmp_path / "run"), *more]
        subprocess.run(command, cwd=ROOT, env=environment, check=True)
        return {path.name.partition("-")[0] for path in (tmp_path / "kept").rglob("*.nbc")}

    assert kept() == USED
    assert kept("--set", "control.at_singularity=slow") == USED | {"policies.slow"}  # negative control


def at_the_stop():
    prepared = prepare(load(ROOT / "scenarios/at_the_stop.yaml"))
    return Simulation([prepared])


def test_joints_at_their_stops_meet_a_late_function_and_an_interrupt_waits_for_it(monkeypatch):
    found, compiled_late = jit._found, []

    def interrupted(one, *about):
        if one.is_late and not compiled_late:
            compiled_late.append(one.function.__name__)
            raise KeyboardInterrupt
        return found(one, *about)

    with jit.all_at_once():
        (wanted,) = at_the_stop().run()
    monkeypatch.setattr(jit, "_addresses", {})
    monkeypatch.setattr(jit, "_finders", {})
    simulation = at_the_stop()
    monkeypatch.setattr(jit, "_found", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulation.run()
    assert compiled_late == ["give_way"]
    (run,) = simulation.run()
    assert all(run[name].tobytes() == wanted[name].tobytes() for name in wanted.columns)
    assert (run["status"] & int(Status.POSITION_LIMITED)).any()
