"""Blocks of ticks in one call of MuJoCo's: the bits of single ticks, and errors that end their own world alone."""

import ctypes
import threading

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from project import ROOT, mostly_long
from rmrc.plants import native
from rmrc.plants.native import FIELDS, Native
from rmrc.results.columns import COLUMNS
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from screws import screw_chain

SHORT = "target.path=[{line: {by: [0.02, 0.01]}}]"
# What stands in a tick, or between two of them.
KEYS = {
    "servo": (),
    "ideal": ("plant.kind=ideal",),
    "substeps": ("plant.timestep=0.00025", "control.period=0.002"),
    "wrench and payload": ("plant={wrench: [0, 3, 0, 0, 0, 1], payload: 0.5}",),
    "friction": ("plant.friction={coulomb: 0.1, viscous: 0.1}",),
    "late, lost, slow": ("plant={delay: 0.0025, jitter: 0.002, loss: 0.1, lag: 0.004}",),
    "play and resonance": ("plant={backlash: 1.0e-4, resonance: {frequency: 30, damping: 0.5}}",),
    "encoders": ("arm.encoder={noise: 1.0e-5, offset: 0.001}",),
    "pace": ("control.at_singularity=slow", "control.limits.rate=0.4"),
    "jerk": ("control.limits.jerk=5000",),
}
LIMITED = """<mujoco><compiler angle="radian"/><size memory="{}"/><worldbody><body name="upper">
  <joint name="a" axis="0 0 1" range="-1 1" limited="true"/>
  <geom type="capsule" size=".02" fromto="0 0 0 1 0 0" contype="0" conaffinity="0"/>
  <body name="lower" pos="1 0 0"><joint name="b" axis="0 0 1"/>
    <geom type="capsule" size=".02" fromto="0 0 0 1 0 0" contype="0" conaffinity="0"/>
    <site name="tip" pos="1 0 0"/></body></body></worldbody></mujoco>"""


def in_single_ticks(monkeypatch, run):
    """Return what a function returns where blocks do not serve."""
    with monkeypatch.context() as without:
        without.setattr(native, "serves", lambda _: False)
        return run()


def is_in_blocks(simulation):
    return [shard.batch._blocks is not None for shard in simulation._shards]


def results(prepared, threads=1):
    """Return runs and warnings of worlds, and whether they ran in blocks."""
    simulation = Simulation(prepared, threads)
    return simulation.run(), simulation.warnings(), is_in_blocks(simulation)


def assert_same_bits(found, wanted):
    for run, want in zip(found, wanted, strict=True):
        assert len(run) == len(want) and run.divergence == want.divergence
        for name in COLUMNS:
            assert_array_equal(run[name], want[name])


def assert_same_in_blocks(monkeypatch, prepared, threads=1):
    found, warned, in_blocks = results(prepared, threads)
    wanted, warned_singly, singly = in_single_ticks(monkeypatch, lambda: results(prepared))
    assert all(in_blocks) and not any(singly)
    assert warned == warned_singly
    assert_same_bits(found, wanted)
    return found


@pytest.mark.parametrize("name", mostly_long(KEYS, 2))
def test_blocks_have_the_bits_of_single_ticks(scenario, monkeypatch, name):
    worlds = [prepare(scenario(SHORT, *KEYS[name], f"control.feedback={k}")) for k in (2, 5, 10)]
    runs = assert_same_in_blocks(monkeypatch, worlds, threads=2)
    assert all(run.is_complete for run in runs)


def test_positions_of_joints_that_follow_are_kept_in_blocks_too(scenario, monkeypatch, tmp_path):
    (tmp_path / "screw.xml").write_text(screw_chain())
    keys = (f"arm.model={tmp_path}/screw.xml", "arm.start=home", "task.axes=[x, y, z]")
    for kind in ("servo", "ideal"):
        path = "target.path=[{line: {by: [0.0, 0.02, 0.01]}}]"
        (run,) = assert_same_in_blocks(monkeypatch, [prepare(scenario(*keys, path, f"plant.kind={kind}"))])
        assert run["qpos"].shape[1] > run["q"].shape[1] and np.ptp(run["qpos"], axis=0).all()


def test_plants_that_work_between_ticks_and_arms_that_may_touch_have_single_ticks(scenario, tmp_path):
    floor = '<worldbody><geom name="floor" type="plane" size="2 2 .1" pos="0 0 -1"/>'
    touching = LIMITED.format("1M").replace("<worldbody>", floor).replace('contype="0" conaffinity="0"', "")
    (tmp_path / "touching.xml").write_text(touching)
    touching = (f"arm.model={tmp_path}/touching.xml", "arm.start=[0.5, 0.5]", "task.axes=[x, y]")
    for keys in (("plant.kind=torque",), touching):
        assert is_in_blocks(Simulation([prepare(scenario(SHORT, *keys))])) == [False]


def test_a_world_whose_state_explodes_ends_alone(scenario, monkeypatch):
    pushed = prepare(scenario(SHORT, "plant.wrench=[0, 1.0e+15, 0, 0, 0, 0]"))
    runs = assert_same_in_blocks(monkeypatch, [prepare(scenario(SHORT)), pushed, prepare(scenario(SHORT))])
    assert [run.divergence is None for run in runs] == [True, False, True]


def test_an_error_of_the_engine_ends_its_own_world_and_not_the_process(scenario, monkeypatch, tmp_path):
    """MuJoCo's memory is enough for a step, but not at a joint limit, which one of the worlds reaches."""
    (tmp_path / "small.xml").write_text(LIMITED.format(600))
    keys = (f"arm.model={tmp_path}/small.xml", "arm.start=[0.9, 0.5]", "task.axes=[x, y]", "plant.kv=1")
    path = "target.path=[{hold: {for: 0.3}}]"
    free = prepare(scenario(*keys, path))
    pushed = prepare(scenario(*keys, path, "plant.wrench=[0, 20, 0, 0, 0, 0]"))
    runs = assert_same_in_blocks(monkeypatch, [free, pushed, free])
    assert [run.divergence is None for run in runs] == [True, False, True]
    assert "stack overflow" in runs[1].divergence.reason
    assert 0 < len(runs[1]) == runs[1].divergence.tick < len(runs[0])


def test_an_interrupt_after_a_block_loses_nothing(scenario, monkeypatch):
    prepared = prepare(scenario(SHORT))
    (want,) = Simulation([prepared]).run()
    simulation, apply, calls = Simulation([prepared]), Native.apply, []

    def interrupted(self, *about):
        calls.append(about)
        apply(self, *about)
        if len(calls) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(Native, "apply", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulation.run()
    assert 0 < len(simulation.runs()[0]) < len(want)
    assert_same_bits(simulation.run(), [want])


def test_an_interrupt_before_a_block_counts_no_tick(scenario, monkeypatch):
    prepared = prepare(scenario(SHORT))
    simulation = Simulation([prepared])

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as broken:
        broken.setattr(Native, "apply", interrupted)
        with pytest.raises(KeyboardInterrupt):
            simulation.run()
    assert len(simulation.runs()[0]) == 0
    assert_same_bits(simulation.run(), Simulation([prepared]).run())


# What of MuJoCo it rests on -----------------------------------------------------------------------


@pytest.mark.parametrize("field", ["warning", *FIELDS])
def test_where_data_keep_each_field_is_found(field):
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models/ur5e.xml"))
    data = mujoco.MjData(model)
    at = data._address + native.offsets()[field]
    if field == "warning":
        data.warning[3].lastinfo, data.warning[3].number = 12, 345
        assert list((ctypes.c_int * 14).from_address(at))[6:8] == [12, 345]
    else:
        assert ctypes.c_int64.from_address(at).value == getattr(data, field).ctypes.data


@pytest.mark.parametrize("field", FIELDS)
def test_a_field_that_is_elsewhere_has_ticks_be_single_ones(scenario, monkeypatch, field):
    prepared = prepare(scenario(SHORT))
    assert is_in_blocks(Simulation([prepared])) == [True]
    wrong = {**native.offsets(), field: native.offsets()[field] + 8}
    monkeypatch.setattr(native, "offsets", lambda: wrong)
    assert is_in_blocks(Simulation([prepared])) == [False]


def test_a_library_that_lacks_a_function_has_ticks_be_single_ones(monkeypatch):
    def lacking():
        raise AttributeError("mjb_apply")

    native.offsets.cache_clear()
    with monkeypatch.context() as other:
        other.setattr(native, "library", lacking)
        found = native.offsets()
    native.offsets.cache_clear()
    assert found == {} and native.offsets()


def test_a_callback_of_the_users_is_called_as_ever_and_stays(scenario):
    prepared, calls = prepare(scenario(SHORT)), []

    @ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    def counted(_model, _data):
        calls.append(1)

    (want,) = Simulation([prepared]).run()
    wired = Simulation([prepared])
    mujoco.set_mjcb_control(counted)
    try:
        installed = native._callbacks()[1].value
        simulation = Simulation([prepared])
        (run,) = simulation.run()
        assert is_in_blocks(simulation) == [False] and native._callbacks()[1].value == installed
        with pytest.raises(RuntimeError, match="callback"):  # too late for worlds that are wired
            wired.run()
    finally:
        mujoco.set_mjcb_control(None)
    assert len(calls) == len(run) - 1  # each step calls it once
    assert_same_bits([run], [want])
    assert_same_bits(wired.run(), [want])  # it is gone again


def test_data_of_others_are_stepped_by_the_engine_alone_while_blocks_run(scenario):
    """Nothing global is installed: another thread's simulation has the bits that it has alone."""
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models/planar_2link.xml"))
    prepared, done = prepare(scenario()), threading.Event()

    def stepped(is_enough):
        data, states = mujoco.MjData(model), []
        while not is_enough(len(states)):
            data.ctrl[:] = 1.0
            mujoco.mj_step(model, data)
            states.append([*data.qpos, *data.qvel])
        return states

    found = []
    thread = threading.Thread(target=lambda: found.extend(stepped(lambda n: done.is_set() and n >= 100)))
    thread.start()
    seen = []
    simulation = Simulation([prepared])
    simulation.step(lambda *_: seen.append(native.has_callbacks()))
    done.set()
    thread.join()
    assert seen and not any(seen) and is_in_blocks(simulation) == [True]
    assert found == stepped(lambda n: n == len(found))


def clock():
    return ctypes.c_void_p.in_dll(native.library(), "mjcb_time").value


def test_the_clock_of_the_engine_is_off_only_while_worlds_step(scenario, monkeypatch):
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models/planar_2link.xml"))
    data, installed, seen = mujoco.MjData(model), clock(), []
    stepped = Native.apply
    monkeypatch.setattr(Native, "apply", lambda *given: (seen.append(clock()), stepped(*given)))
    Simulation([prepare(scenario(SHORT))] * 2, threads=2).step()
    assert installed and seen and set(seen) == {None} and clock() == installed

    def fails(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Native, "apply", fails)
    with pytest.raises(KeyboardInterrupt):
        Simulation([prepare(scenario(SHORT))]).step()
    assert clock() == installed
    mujoco.mj_step(model, data)
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].number == 1


def test_a_clock_of_the_users_stays_on_and_the_bits_are_the_same(scenario):
    (want,), calls = Simulation([prepare(scenario(SHORT))]).run(), []
    mujoco.set_mjcb_time(lambda: float(calls.append(1) or len(calls)))
    try:
        (run,) = Simulation([prepare(scenario(SHORT))]).run()
        assert len(calls) > len(run)  # each step asks it more than once
        with native.untimed():
            mujoco.set_mjcb_time(None)
            installed = clock()
        assert clock() == installed
    finally:
        mujoco.set_mjcb_time(None)
    assert_same_bits([run], [want])


@pytest.mark.long
@pytest.mark.parametrize("path", sorted((ROOT / "scenarios").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_scenario_has_the_same_bits_in_blocks(monkeypatch, path):
    prepared = prepare(load(path))
    found, warned, _ = results([prepared])
    wanted, warned_singly, in_blocks = in_single_ticks(monkeypatch, lambda: results([prepared]))
    assert not any(in_blocks) and warned == warned_singly
    assert_same_bits(found, wanted)
