"""The compiled loop against an independent one, and its promise: same world, same run, whatever is beside it."""

import dataclasses
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from chains import random_chain
from oracles import NumpyLoop
from rmrc.arm import load
from rmrc.results.columns import COLUMNS
from rmrc.results.scorecard import scorecard
from rmrc.scenario.choices import (
    Status,
)
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import PIECE, Simulation

STANFORD = ("arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home")
COARSE = "control.period=0.016"  # the oracle takes half a millisecond a tick
BRISK = "target.path=[{line: {by: [0.002, 0.002]}}]"  # a hundred ticks, of 2 ms
FINER = "control.period=0.002"  # the torque plant carries rounding too far along at a longer one
SIX = (
    "task.axes=[x, y, z, rx, ry, rz]",
    "target.path=[{line: {by: [0.03, 0.03, 0.03], turn: {axis: z, angle: 0.1}}}]", COARSE,
)  # fmt: skip
STANDING = (
    "arm={model: tests/models/standing.xml, site: hand, start: [0.3, -0.9, 1.2, 0.2, 0.9, 0.3]}", COARSE,
    "target.path=[{line: {by: [0.02, 0.01, 0.02], turn: {axis: z, angle: 0.3}}}]", "task.axes=[x, y, z, rx, ry, rz]",
)  # fmt: skip
SMALL = "target.path=[{line: {by: [0.002, 0.002, 0.002]}}]"
THREE = ("arm.model=models/planar_3link.xml", "arm.start=home")
REACH = "target.path=[{line: {to: [1.99, 0]}}, {line: {to: [1.5, 0]}}]"  # to 10 mm from full reach and back
SHORT = "target.path=[{line: {by: [0.1, 0.1]}}]"
BRIEF = (SHORT, COARSE)
SHORT_AND_FINE = (BRISK, FINER)
NEAR = (
    COARSE, "arm.start=[15 deg, -30 deg]", "target.path=[{line: {to: [1.99, 0]}}, {line: {to: [1.95, 0]}}]",
)  # fmt: skip
POSITION = (*STANFORD, COARSE, "task.axes=[x, y, z]", "target.path=[{line: {by: [0.05, 0.05, 0.05]}}]")
WEIGHTED = ("task.length=0.5", "control.joint_weights=[1, 2, 3, 1, 1, 1]")
PLANAR = (*THREE, COARSE, "target.path=[{line: {by: [0.05, 0.05]}}]")
FOLDED = (*PLANAR, "arm.start=[0, 90 deg, 155 deg]")  # the last joint 5 deg from its limit
TORUS = ("arm.model=models/torus_3r.xml", "task.axes=[x, y, z]", COARSE)
# soon at the limit of joint 2, 170 deg; and with joint 3 in that of its own, 160 deg, besides
AT_STOP = (*TORUS, "arm.start=[30 deg, 165 deg, -145 deg]", "target.path=[{line: {by: [-0.2, -0.11, 0.06]}}]")
FOLDED_UP = (*TORUS, "arm.start=[0, 169 deg, -159 deg]", "target.path=[{line: {by: [-0.15, 0, -0.06]}}]")
DRIFT = "control.nullspace={objective: rates, rates: [1, -1, 1]}"
METHOD, SCHEDULE = "control.inverse.method=", "control.inverse.damping.schedule="
OBJECTIVE, ON_EXCESS = "control.nullspace.objective=", "control.limits.on_excess="


def second(text):
    """Return the overrides of a second task."""
    return (OBJECTIVE + "secondary", f"control.nullspace.secondary={{{text}}}")


# Every method, schedule, objective, priority, policy, plant and weighting at least once, in square, wide and tall
# tasks. Of the limits those that no solver has: its answers, and bounded jerk, have tests of their own.
VARIANTS = {
    "inverse": (FINER, BRISK, METHOD + "inverse"),
    "pseudoinverse, tall": (*BRIEF, "task.axes=[x, y, rz]", METHOD + "pseudoinverse"),
    "truncated, 6 joints": (*STANFORD, *SIX, METHOD + "truncated", "control.inverse.cutoff=0.5", "plant.kind=torque", FINER),
    "truncated, stuck": (
        COARSE, "arm.start=[4 deg, -8 deg]", "target.path=[{line: {to: [2, 0]}}, {line: {to: [1.9, 0]}}]",
        METHOD + "truncated", "control.inverse.cutoff=0.1",
    ),
    "damped": NEAR,
    "held a little beyond reach, not stuck": (
        COARSE, "arm.start=[4 deg, -8 deg]", "target.path=[{line: {to: [2.01, 0]}}, {hold: {for: 1.5}}]",
    ),
    "about a free axis of the site, manipulability": (
        *STANDING, "task={frame: site, axes: [x, z, ry, rz]}", OBJECTIVE + "manipulability",
    ),
    "second task along its site, beside one along the base": (
        *STANDING, "task={frame: base, axes: [x, y, z]}",
        *second("axes: [rx, ry], to: [0.2, -0.1], frame: site, priority: classical"),
    ),
    "damped, wide and weighted": (
        *THREE, *BRIEF, "task.weights=[1, 4]", "control.joint_weights=[3, 1, 0.5]", OBJECTIVE + "posture",
        "control.nullspace.posture=[0.5, -1, 0.5]",
    ),
    "damped by manipulability": (*NEAR, SCHEDULE + "manipulability"),
    "damped by error": (
        *NEAR, SCHEDULE + "error", "control.inverse.damping.error_gain=50", "task.weights=[1, 4]", "task.length=2",
    ),
    "selectively damped, tall and weighted": (
        *BRIEF, "task.axes=[x, y, rz]", "task.weights=[1, 2, 0.1]", "control.joint_weights=[1, 3]",
        METHOD + "selectively_damped", "control.inverse.rate_bound=0.3",
    ),
    "jparse, 6 joints": (*STANFORD, *SIX, *WEIGHTED, METHOD + "jparse", "control.inverse.gamma=0.3"),
    "rates, through a row that never moves": (*PLANAR, "task.axes=[x, y, z]", DRIFT),
    "second task, classical": (
        *POSITION, *WEIGHTED, *second("site: wrist, axes: [x, z], to: [0.6, 0.6], priority: classical"),
    ),
    "second task, robust, undamped, a turn": (
        *POSITION, *WEIGHTED, *second("axes: [rx, ry, rz], to: [0.3, 0.2, -0.4], damping: 0"),
    ),
    "scaled, all limits": (*FOLDED, DRIFT, "control.limits={rate: 0.4, acceleration: 2, braking: 1}"),
    "clamped, all limits": (
        *FOLDED, DRIFT, "control.limits={rate: 0.4, acceleration: [2, 1, 2], braking: 3, on_excess: clamp}",
    ),
    "redistributed, all limits": (
        *FOLDED, DRIFT, "control.limits={rate: 0.4, acceleration: 2, braking: 1, on_excess: redistribute}",
        "control.joint_weights=[3, 1, 0.5]",
    ),
    "redistributed near a singularity, redundant": (
        *FOLDED, DRIFT, "control.limits={rate: 0.25, on_excess: redistribute}", METHOD + "damped",
        "control.inverse.damping={maximum: 0.2, below: 1.2}", "plant.kind=ideal",
    ),
    "at a stop": (*AT_STOP, "control.limits={acceleration: 30, braking: 10}"),
    "at two stops, constant damping, stuck": (*FOLDED_UP, SCHEDULE + "constant", "plant.kind=ideal"),
    "at a stop, redistributed": (*AT_STOP, ON_EXCESS + "redistribute", "control.limits.rate=[0.2, 3, 3]"),
    "at a stop, redundant": (
        *FOLDED, "arm.start=[0, -20 deg, 159 deg]", METHOD + "damped", "control.limits={rate: 2, braking: 3}",
        "control.inverse.damping={maximum: 0.2, below: 1.2}", DRIFT, "plant.kind=ideal",
    ),
    "slow": (*NEAR, "control.at_singularity=slow", "control.limits={rate: 0.5, acceleration: 5}"),
    "along the kernel": (
        *NEAR, "control.at_singularity=singularity_consistent", "control.limits={rate: 0.5, acceleration: 5}",
    ),
    "keep out, redundant, limits": (
        *PLANAR, DRIFT, "control.at_singularity=keep_out", "control.keep_out={sigma: 0.85, approach: 8}",
        "control.limits={rate: 0.3, acceleration: 4}",
    ),
    "stop, by condition": (
        *NEAR, "control.at_singularity=stop", "control.stop={condition: 15, change: 30}",
        "control.limits.acceleration=5", "plant.kind=ideal",
    ),
    "encoders off, stop, pushed, limits": (
        *FOLDED, DRIFT, "arm.encoder={deviation: 0.5 deg, seed: 1}", "control.limits={acceleration: 2, on_excess: clamp}",
        "control.at_singularity=stop", "plant={kind: torque, wrench: [5, -3, 1, 0, 0, 2]}", FINER,
    ),
    "encoders late, coarse and noisy": (
        *STANFORD, *SIX, "arm.encoder={delay: 0.016, resolution: [1.0e-4, 0, 1.0e-5, 0, 1.0e-3, 1.0e-4], noise: 1.0e-4}",
    ),
    "encoders late, filtered rates, torque": (
        *SHORT_AND_FINE, "arm.encoder={delay: 0.003, noise: 1.0e-6, offset: 0.01}", "control.rate_filter=0.004",
        "plant={kind: torque, bandwidth: 30}",
    ),
    "integrated, encoders off, limits": (
        *FOLDED, DRIFT, "control.state=integrated", "arm.encoder={offset: 0.01, noise: 1.0e-3}", "plant.kv=50",
        "control.limits={acceleration: 2, on_excess: clamp}", "plant.wrench=[5, -3, 1, 0, 0, 2]",
    ),
    "other lengths, stop": (
        *PLANAR, DRIFT, "plant.stretch={link_2: 1.1, link_3: 0.97}", "control.at_singularity=stop",
        "control.stop={sigma: 0.82}", "plant.wrench=[5, -3, 1, 0, 0, 2]",
    ),
    "other lengths and zeros, 6 joints, torque": (
        *STANFORD, *SIX, FINER, SMALL,
        "plant={kind: torque, stretch: {link_1: 1.02}, joint_offset: [0.01, -0.02, 0.005, 0, 0, 0.02]}",
        OBJECTIVE + "posture",
    ),
    "friction that nobody knows, torque": (*SHORT_AND_FINE, "plant={kind: torque, friction: {coulomb: 0.2, viscous: 1}}"),
    "no feed-forward": (*BRIEF, "control.feedforward=false",),
    "torque, 6 joints, substeps": (*STANFORD, *SIX, "plant.kind=torque", FINER),
    "model, 6 joints, pushed": (*STANFORD, *SIX, "plant={kind: model, wrench: [5, -3, 1, 0, 0, 2], bandwidth: 10}"),
    "late now and then, and lost, torque": (
        FINER, BRISK, "plant={kind: torque, delay: 0.003, jitter: 0.009, loss: 0.2, seed: 3}", "control.feedback=5",
    ),
    "lagging, slow": (
        *PLANAR, "control.at_singularity=slow", "control.limits.rate=0.3", "plant={delay: 0.008, lag: [0.05, 0, 0.01]}",
    ),
    "swinging, model": (
        SHORT, COARSE, "plant={kind: model, jitter: 0.001, resonance: {frequency: 12, damping: 0.05}}", "control.feedback=3",
    ),
    "play": (*PLANAR, DRIFT, "plant={delay: 0.003, backlash: [0.004, 0, 0.01]}", "control.feedback=5"),
    "servo, substeps, wrench": ("control.period=0.004", "plant.timestep=0.002", "plant.wrench=[5, -3, 1, 0, 0, 2]"),
}  # fmt: skip


# Two ways to the same rates differ by so much in the worst of 300 random chains [rad/s or m/s].
RATE_ROUNDING = 1e-10


def assert_same_run(run, want, rtol, kv=0.0):
    """Each column that the oracle has, within rtol of its largest value; and no bit that does not belong there.

    A servo's torque is its gain kv times what is left of a rate, and so is its rounding.
    """
    assert len(run) == len(want["q"])
    known = Status.SLOWED | Status.STOPPED | Status.SINGULAR | Status.STUCK | Status.KEPT_OUT
    limits = Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED
    assert_array_equal(run["status"] & known, want["status"])
    assert_array_equal(run["status"] & limits & ~want["limited"], 0, err_msg="a limit that is not there")
    for name in want.keys() - {"status", "limited"}:
        column = want[name]
        scale = np.abs(column[np.isfinite(column)]).max(initial=1.0)
        rounding = kv * RATE_ROUNDING if name == "tau" else 0.0
        allowed = np.broadcast_to(np.maximum(rtol * scale, rounding), column.shape)
        if name == "qdot_plain":  # what J is off is divided by σ once more than what is asked
            allowed = allowed / np.minimum(1.0, np.maximum(want["sigma"][:, -1:], 1e-14))
        # As `assert_allclose` takes one tolerance for all: in shares of what is allowed to each.
        assert_allclose(run[name] / allowed, column / allowed, rtol=0, atol=1.0, err_msg=name)


# Negative control: what the comparison must find. A threshold that is off by a millionth may not be felt at any tick;
# the one of `truncated` is off by more.
OFF = {
    "feedback": ("damped", "control.feedback=20.00002"),
    "slope of w": ("about a free axis of the site, manipulability", "control.nullspace.gain=1.000001"),
    "damping at a stop": ("at a stop, redundant", "control.inverse.damping.maximum=0.2000002"),
    "acceleration": ("clamped, all limits", "control.limits.acceleration=[2, 1.000001, 2]"),
    "plant.stretch": ("other lengths, stop", "plant.stretch.link_3=0.970001"),
}  # fmt: skip


@pytest.mark.parametrize("variant", VARIANTS)
def test_compiled_loop_equals_the_numpy_loop_and_none_that_is_off_by_a_millionth(simulate, variant):
    prepared, run = simulate(*VARIANTS[variant])
    assert run.divergence is None
    want = NumpyLoop(prepared).run()
    # 1e-9: both round differently, 1e-16 a tick, and physics and feedback carry it along for 1e3 ticks
    assert_same_run(run, want, 1e-9)
    for wrong in (wrong for name, wrong in OFF.values() if name == variant):
        _, other = simulate(*VARIANTS[variant], wrong)
        with pytest.raises(AssertionError, match=r"Not equal to tolerance|Arrays are not equal"):
            assert_same_run(other, want, 1e-9)


def test_the_same_world_gives_the_same_bits_alone_among_others_and_on_threads(scenario):
    chosen = [(REACH,), (REACH, "plant.kv=500"), *list(VARIANTS.values())[::7]]
    prepared = [prepare(scenario(*overrides)) for overrides in chosen]
    alone = [Simulation([one]).run()[0] for one in prepared]
    for threads in (1, 3):
        for run, want in zip(Simulation(prepared, threads).run(), alone, strict=True):
            for name in COLUMNS:
                assert_array_equal(run[name], want[name])
    again = Simulation([prepare(scenario(*chosen[0]))]).run()[0]
    for name in COLUMNS:
        assert_array_equal(again[name], alone[0][name])


def test_an_interrupt_keeps_what_was_recorded(scenario):
    prepared = prepare(scenario(REACH))
    full = Simulation([prepared]).run()[0]
    simulation, seen = Simulation([prepared]), []

    def interrupt(_, part):
        seen.append(len(part))
        if sum(seen) >= 300:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulation.run(interrupt)
    (run,) = simulation.runs()
    assert len(run) == sum(seen) < len(full)
    assert not run.is_complete and run.divergence is None
    assert_array_equal(run["q"], full["q"][: len(run)])


def nan_at(prepared, tick):
    """The same world with a reference that is not a number from a tick on."""
    path, nowhere = prepared.reference, np.array([np.nan, 0.0, 0.0, 0.0, 0.0, 0.0])
    return dataclasses.replace(prepared, reference=path.displaced(tick, path.ticks, nowhere))


@pytest.mark.parametrize("plant", ["ideal", "torque"])
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
        assert_array_equal(first[name], alone[name])
        assert_array_equal(third[name], alone[name])
        assert_array_equal(second[name], alone[name][:700])
    assert list(tmp_path.iterdir()) == []  # no MUJOCO_LOG.TXT


def test_stop_ends_all_worlds_within_a_moment_and_is_left_as_it_was(scenario):
    prepared = [prepare(scenario(REACH)), prepare(scenario(REACH, "plant.kind=ideal"))]
    stop = threading.Event()
    runs = Simulation(prepared, 2).run(lambda *_: stop.set(), stop)
    assert all(len(run) <= PIECE < run.planned for run in runs)
    assert any(len(run) > 0 for run in runs)  # the one that set it; the other may not have begun
    free = threading.Event()
    assert all(run.is_complete for run in Simulation(prepared, 2).run(None, free))
    assert not free.is_set()


# Chains that nobody drew, with joints that are not the arm's, under laws of every family.
LAWS = (
    "{inverse: {method: jparse, gamma: 0.3}, limits: {rate: 0.5, acceleration: 5}}",
    "{nullspace: {objective: manipulability}, limits: {rate: 1, braking: 2, on_excess: clamp}}",
    "{inverse: {method: truncated, cutoff: 0.2}, at_singularity: slow, limits: {rate: 0.5}}",
    "{inverse: {method: pseudoinverse}, limits: {rate: 0.4, on_excess: redistribute}}",
)


@pytest.mark.parametrize(("seed", "law", "kind"), [
    (1, 0, "ideal"), (2, 1, "servo"), (5, 2, "torque"), (8, 3, "servo"), (11, 1, "torque"),
])  # fmt: skip
def test_any_chain_equals_the_numpy_loop(simulate, tmp_path, seed, law, kind):
    rng, path = np.random.default_rng(seed), tmp_path / "model.xml"
    path.write_text(random_chain(seed, 4, ranges=True))
    low, high = np.clip(load(path, "tip").position_limit, -1, 1).T
    start = low + (high - low) * rng.uniform(0.02, 0.98, 4)
    prepared, run = simulate(
        f"arm.model={path}", f"arm.start={start.tolist()}", "task.axes=[x, z, ry]", "task.weights=[1, 3, 0.5]",
        f"control={LAWS[law]}", "control.joint_weights=[1, 2, 0.5, 1]", f"plant.kind={kind}", FINER,
        "target.path=[{line: {by: [0.02, 0.02, 0.02], turn: {axis: x, angle: 0.05}}}]",
    )  # fmt: skip
    assert run.divergence is None
    # near rank loss slopes of w, and inverses, amplify rounding
    assert np.min(run["sigma"][:, -1] / run["sigma"][:, 0]) > 0.02
    assert_same_run(run, NumpyLoop(prepared).run(), 1e-8, prepared.plant.kv if kind == "servo" else 0.0)


def test_scorecards_without_columns_are_those_of_the_columns_whatever_the_threads(scenario):
    # Several laws and plants, one world that diverges, and runs of different lengths.
    prepared = [prepare(scenario(*overrides)) for overrides in ((REACH,), *list(VARIANTS.values())[1::9], ())]
    prepared.append(nan_at(prepared[0], 700))
    kept = Simulation(prepared)
    wanted = [scorecard(run) for run in kept.run()]
    for threads in (1, 3):
        simulation = Simulation(prepared, threads, keep_columns=False)
        simulation.step(None)
        for card, want in zip(simulation.scorecards(), wanted, strict=True):
            assert (card.name, card.joints) == (want.name, want.joints)
            # as text, which tells bits apart and NaN from nothing; all but the wall clock
            for name in want.keys() - {"wall_time", "speed"}:
                assert repr(card[name]) == repr(want[name]), name
        assert simulation.divergences() == kept.divergences()
    assert [one is not None for one in kept.divergences()] == [False] * (len(prepared) - 1) + [True]
