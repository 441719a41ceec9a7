"""The compiled loop against an independent one, and its promise: same world, same bits, whatever is beside it."""

import dataclasses
import threading

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from mujoco.batch import Batch, SimulationError
from numpy.testing import assert_allclose

import rmrc
from chains import random_chain, seeds
from oracles import AXES, NumpyLoop
from rmrc.arm import load
from rmrc.preparation import prepare
from rmrc.run import COLUMNS
from rmrc.simulation import BLOCK, Simulation

STANFORD = ("arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home")
SIX = (
    "task.axes=[x, y, z, rx, ry, rz]",
    "target.path=[{line: {by: [0.1, 0.1, 0.1], turn: {axis: z, angle: 0.3}}}]",
)
THREE = ("arm.model=models/planar_3link.xml", "arm.start=home")
REACH = "target.path=[{line: {to: [1.99, 0]}}, {line: {to: [1.5, 0]}}]"  # to 10 mm from full reach and back

# Every method, schedule, objective, limit, plant and weighting at least once, in square, wide and tall tasks.
VARIANTS = {
    "inverse": ("control.inverse.method=inverse",),
    "inverse, 6 joints": (*STANFORD, *SIX, "control.inverse.method=inverse"),
    "pseudoinverse, wide": (*THREE, "control.inverse.method=pseudoinverse"),
    "pseudoinverse, tall": ("task.axes=[x, y, rz]", "control.inverse.method=pseudoinverse"),
    "damped, reach": (REACH,),
    "damped, constant": (REACH, "control.inverse.damping.schedule=constant"),
    "damped, tall and weighted": (
        "task.axes=[x, y, rz]", "task.weights=[1, 2, 0.1]", "control.joint_weights=[1, 3]",
        "control.inverse.damping.schedule=constant",
    ),
    "damped, wide and weighted": (
        *THREE, "task.weights=[1, 4]", "control.joint_weights=[3, 1, 0.5]", "control.nullspace.objective=posture",
        "control.nullspace.posture=[0.5, -1, 0.5]",
    ),
    "6 joints, weighted, length": (
        *STANFORD, *SIX, "task.length=0.5", "control.joint_weights=[1, 2, 3, 1, 1, 1]",
        "task.weights=[1, 1, 1, 0.1, 0.1, 0.1]", "control.inverse.damping.schedule=constant",
    ),
    "position only, null space": (
        *STANFORD, "task.axes=[x, y, z]", "control.nullspace.objective=posture", "control.nullspace.gain=0.5",
        "control.nullspace.posture=[0.1, 1, 0.8, 0.2, 1, 0.3]", "target.path=[{line: {by: [0.1, 0.1, 0.1]}}]",
    ),
    "scaled rates": (REACH, "control.limits.rate=0.4"),
    "clamped rates": (REACH, "control.limits.rate=[0.4, 0.6]", "control.limits.on_excess=clamp"),
    "no feed-forward": ("control.feedforward=false",),
    "no feedback": ("control.feedback=0",),
    "ideal": (REACH, "plant.kind=ideal", "control.period=0.002"),
    "torque": ("plant.kind=torque",),
    "torque, 6 joints, substeps": (*STANFORD, *SIX, "plant.kind=torque", "control.period=0.002"),
    "servo, substeps, wrench": ("control.period=0.004", "plant.timestep=0.002", "plant.wrench=[5, -3, 1, 0, 0, 2]"),
}  # fmt: skip


def assert_same_run(run, want, rtol):
    """Each column that the oracle has, within rtol of its largest value."""
    for name, column in want.items():
        scale = max(1.0, np.abs(column).max())
        assert_allclose(run[name], column, rtol=0, atol=rtol * scale, err_msg=name)


@pytest.mark.parametrize("variant", VARIANTS)
def test_compiled_loop_equals_the_numpy_loop_over_a_whole_run(simulate, variant):
    prepared, run = simulate(*VARIANTS[variant])
    assert run.is_complete and run.divergence is None
    # 1e-9: both round differently, 1e-16 a tick, and physics and feedback carry it along for 1e3 ticks
    assert_same_run(run, NumpyLoop(prepared).run(), 1e-9)


@pytest.mark.parametrize("fault", ["feedback", "damping", "joint_weights"])
def test_the_comparison_finds_a_law_that_is_off_by_a_millionth(scenario, fault):
    prepared = prepare(scenario(REACH, "control.joint_weights=[1, 1]"))
    (run,) = Simulation([prepared]).run()
    wrong = {
        "feedback": ["control.feedback=20.00002"],
        "damping": ["control.inverse.damping.maximum=0.1000001"],
        "joint_weights": ["control.joint_weights=[1, 1.000001]"],
    }[fault]
    other = prepare(scenario(REACH, "control.joint_weights=[1, 1]", *wrong))
    with pytest.raises(AssertionError):
        assert_same_run(run, NumpyLoop(other).run(), 1e-9)


def test_the_same_world_gives_the_same_bits_alone_among_others_and_on_threads(scenario):
    chosen = [
        (REACH,), (REACH, "control.inverse.method=pseudoinverse"), (REACH, "control.inverse.method=inverse"),
        (REACH, "arm.start=[50 deg, -100 deg]", "control.nullspace.objective=posture"),
        ("control.limits.rate=0.3",), ("task.axes=[x, y, rz]",), ("plant.kind=torque",), ("plant.kind=ideal",),
        (REACH, "plant.kv=500"), (REACH, "control.inverse.damping.schedule=constant"), STANFORD + SIX,
    ]  # fmt: skip
    prepared = [prepare(scenario(*overrides)) for overrides in chosen]
    alone = [Simulation([one]).run()[0] for one in prepared]
    for threads in (1, 2, 3):
        for run, want in zip(Simulation(prepared, threads).run(), alone, strict=True):
            for name in COLUMNS:
                np.testing.assert_array_equal(run[name], want[name])
    again = Simulation([prepare(scenario(*chosen[0]))]).run()[0]
    for name in COLUMNS:
        np.testing.assert_array_equal(again[name], alone[0][name])


def test_blocks_are_the_run_in_pieces(scenario):
    prepared = [prepare(scenario(REACH)), prepare(scenario())]
    pieces = ([], [])
    runs = Simulation(prepared).run(lambda world, part: pieces[world].append(part))
    for parts, run in zip(pieces, runs, strict=True):
        for name in COLUMNS:
            joined = np.concatenate([part[name] for part in parts])
            np.testing.assert_array_equal(joined, run[name])


def test_an_interrupt_keeps_what_was_recorded(scenario):
    prepared = prepare(scenario(REACH))
    full = Simulation([prepared]).run()[0]
    simulation, seen = Simulation([prepared]), []

    def interrupt(_, part):
        seen.append(len(part))
        if sum(seen) >= BLOCK:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulation.run(interrupt)
    (run,) = simulation.runs()
    assert len(run) == sum(seen) < len(full)
    assert not run.is_complete and run.divergence is None
    np.testing.assert_array_equal(run["q"], full["q"][: len(run)])


def nan_at(prepared, tick):
    """The same world with a reference that is not a number from a tick on."""
    pose = prepared.reference.pose.copy()
    pose[tick:, 0] = np.nan
    reference = dataclasses.replace(prepared.reference, pose=pose)
    return dataclasses.replace(prepared, reference=reference)


@pytest.mark.parametrize("plant", ["ideal", "servo", "torque"])
def test_divergence_stops_its_own_world_and_keeps_what_it_has(scenario, plant, tmp_path, monkeypatch):
    good = prepare(scenario(REACH, f"plant.kind={plant}"))
    (alone,) = Simulation([good]).run()
    bad = nan_at(good, 700)
    monkeypatch.chdir(tmp_path)
    first, second, third = Simulation([good, bad, good]).run()
    assert len(second) == 700
    assert str(second.divergence) == (
        'diverged at tick 700 (0.7000 s) at joint "shoulder": '
        "position, rate or command is not finite or beyond 1e10"
    )
    for name in COLUMNS:
        np.testing.assert_array_equal(first[name], alone[name])
        np.testing.assert_array_equal(third[name], alone[name])
        np.testing.assert_array_equal(second[name], alone[name][:700])
    assert list(tmp_path.iterdir()) == []  # no MUJOCO_LOG.TXT


def test_a_state_that_explodes_in_the_physics_is_a_divergence(scenario, tmp_path, monkeypatch):
    # An external force of 1e12 N makes accelerations that MuJoCo itself calls bad.
    prepared = prepare(scenario("plant.wrench=[0, 1.0e+15, 0, 0, 0, 0]"))
    monkeypatch.chdir(tmp_path)
    (run,) = Simulation([prepared]).run()
    assert run.divergence is not None and len(run) < 10
    assert np.isfinite(run["q"]).all() and np.isfinite(run["qdot"]).all()
    assert list(tmp_path.iterdir()) == []


def test_worlds_of_different_length_end_on_their_own(scenario):
    short, long = prepare(scenario()), prepare(scenario(REACH))
    runs = Simulation([short, long]).run()
    assert [len(run) for run in runs] == [len(short.reference.time), len(long.reference.time)]
    assert all(run.is_complete for run in runs)


@given(seeds)
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_chain_under_any_law_equals_the_numpy_loop(scenario, tmp_path_factory, seed):
    compare_random_chain(scenario, tmp_path_factory, seed)


def compare_random_chain(scenario, tmp_path_factory, seed):
    """Chains that nobody drew, with joints that are not the arm's, and every choice drawn with them."""
    rng = np.random.default_rng(seed)
    path = tmp_path_factory.mktemp("chain") / "model.xml"
    path.write_text(random_chain(seed))
    n = load(path, "tip").n
    axes = [axis for axis in AXES if rng.random() < 0.6] or ["y"]
    start = rng.uniform(-1, 1, n)
    methods = ["damped", "pseudoinverse"] + (["inverse"] if len(axes) == n else [])
    chosen = [
        f"arm.model={path}", f"arm.start={start.tolist()}", f"task.axes=[{', '.join(axes)}]",
        f"control.inverse.method={rng.choice(methods)}", f"control.inverse.damping.maximum={rng.uniform(0.05, 0.5)}",
        f"control.inverse.damping.schedule={rng.choice(['constant', 'smallest_singular_value'])}",
        f"control.joint_weights={rng.uniform(0.3, 3, n).tolist()}",
        f"task.weights={rng.uniform(0.3, 3, len(axes)).tolist()}", f"task.length={rng.uniform(0.3, 3)}",
        f"control.nullspace={{objective: {rng.choice(['none', 'posture'])}, posture: {(start + 0.2).tolist()}}}",
        f"control.limits.rate={rng.uniform(0.3, 3)}", f"control.limits.on_excess={rng.choice(['scale', 'clamp'])}",
        f"plant.kind={rng.choice(['ideal', 'servo', 'torque'])}",
        "target.path=[{line: {by: [0.02, 0.02, 0.02], turn: {axis: x, angle: 0.05}}}]",
    ]  # fmt: skip
    prepared = prepare(scenario(*chosen))
    (run,) = Simulation([prepared]).run()
    assert run.is_complete
    # Undamped rates near rank loss amplify rounding by 1/σ; a pseudoinverse even jumps at its tolerance.
    ratio = run["sigma"][:, -1] / run["sigma"][:, 0]
    assume("damped" in chosen[3] or ratio.min() > 1e-3)
    assert_same_run(run, NumpyLoop(prepared).run(), 1e-8)


@pytest.mark.parametrize("call", [700, BLOCK])  # in the middle of a block, and at the end of one
def test_an_engine_error_stops_only_its_own_world(scenario, monkeypatch, call):
    prepared = prepare(scenario(REACH))
    (alone,) = Simulation([prepared]).run()
    step, calls = Batch.step, []

    def failing(self, ids, substeps, stage):
        calls.append(ids)
        if len(calls) == call:
            step(self, np.array([0, 2]), substeps, stage)
            raise SimulationError(np.array([1]), "mj_stackAlloc: out of memory", 3)
        step(self, ids, substeps, stage)

    monkeypatch.setattr(Batch, "step", failing)
    runs = Simulation([prepared] * 3).run()
    assert len(runs[1]) == call
    assert runs[1].divergence.tick == call and "mj_stackAlloc: out of memory" in runs[1].divergence.reason
    for name in COLUMNS:
        np.testing.assert_array_equal(runs[0][name], alone[name])
        np.testing.assert_array_equal(runs[2][name], alone[name])
        np.testing.assert_array_equal(runs[1][name], alone[name][:call])


def test_the_package_lends_the_names_that_a_notebook_needs(scenario):
    (run,) = rmrc.Simulation([rmrc.prepare(scenario())]).run()
    assert isinstance(run, rmrc.Run)
    assert_allclose(rmrc.resolve_rates(np.eye(2), np.array([1.0, 2.0]), "inverse"), [1.0, 2.0])
    with pytest.raises(AttributeError, match=r"^module 'rmrc' has no attribute 'nothing'$"):
        _ = rmrc.nothing


@pytest.mark.long
@given(seeds)
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_many_chains_under_many_laws_equal_the_numpy_loop(scenario, tmp_path_factory, seed):
    compare_random_chain(scenario, tmp_path_factory, seed)


def test_stop_ends_all_worlds_after_their_block_and_is_left_as_it_was(scenario):
    prepared = [prepare(scenario(REACH)), prepare(scenario(REACH, "plant.kind=ideal"))]
    stop = threading.Event()
    runs = Simulation(prepared, 2).run(lambda *_: stop.set(), stop)
    assert all(0 < len(run) <= 2 * BLOCK < run.planned for run in runs)
    free = threading.Event()
    assert all(run.is_complete for run in Simulation(prepared, 2).run(None, free))
    assert not free.is_set()
