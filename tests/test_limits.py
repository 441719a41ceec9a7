"""What the limits promise: of any arm, at every tick, whatever is asked for."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from chains import random_chain, seeds
from codes import Method, OnExcess
from project import examples
from records import blank, put, resolve
from rmrc.arm import load
from rmrc.scenario.choices import LIMITS, Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

any_fixture = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
LIMITING = [one.name for one in LIMITS.options if one.acts]
SPEED = "target.limits={velocity: 2.0, acceleration: 50.0, jerk: 5.0e+3}"
# rates and changes are rounded once or twice after they were bounded
EXACT = 1e-9


def differences(run):
    """Return the changes of the command over the period; before the first tick the arm was at rest."""
    return np.diff(run["qdot_cmd"], axis=0, prepend=0.0) / run.period


def excess_of(values, bound):
    """Return by how much values exceed a bound, as a share of it."""
    return np.max(np.abs(values) / bound) - 1.0


def outside(prepared, run):
    """Return by how much positions leave the limits of the model; negative if they do not."""
    lower, upper = prepared.arm.position_limit.T
    return np.maximum(lower - run["q"], run["q"] - upper).max()


# Worlds that ask for too much ---------------------------------------------------------------------------------


def greedy(scenario, folder, seed, **chosen):
    """Return the prepared world of a random chain that is asked for far more than its limits allow."""
    rng = np.random.default_rng(seed)
    path = folder / f"{seed}.xml"
    path.write_text(random_chain(seed, ranges=True))
    arm = load(path, "tip")
    axes = [axis for axis in ("x", "y", "z", "rx", "ry", "rz") if rng.random() < 0.5] or ["y"]
    low, high = np.clip(arm.position_limit, -1, 1).T
    start = low + (high - low) * rng.uniform(0.02, 0.98, arm.n)
    limits = {
        "rate": rng.uniform(0.2, 3.0, arm.n).tolist(),
        "acceleration": [None, rng.uniform(1.0, 30.0, arm.n).tolist()][rng.integers(2)],
        "braking": rng.uniform(1.0, 30.0, arm.n).tolist(),
        "on_excess": "scale",
    }
    control = {
        "inverse": {"method": str(rng.choice(["pseudoinverse", "damped", "jparse"])), "damping": {"maximum": 0.01}},
        "feedback": 20.0, "at_singularity": str(rng.choice(["damp", "slow", "stop"])),
        "nullspace": {"objective": str(rng.choice(["none", "rates"])), "rates": rng.uniform(-2, 2, arm.n).tolist()},
        "slow": {"longest": 1.5}, "limits": {**limits, **chosen.get("limits", {})},
    }  # fmt: skip
    by = rng.normal(size=3)
    by *= 1.5 / np.linalg.norm(by)
    overrides = (
        f"arm.model={path}", f"arm.start={start.tolist()}", f"task.axes=[{', '.join(axes)}]",
        f"control={json.dumps(control)}", f"plant.kind={chosen.get('plant', 'ideal')}", SPEED,
        f"target.path=[{{line: {{by: {by.tolist()}, turn: {{axis: x, angle: 1.0}}}}}}]",
    )  # fmt: skip
    return prepare(scenario(*overrides))


@given(seeds)
@examples(2, 12, suppress_health_check=any_fixture.suppress_health_check)
def test_any_arm_keeps_all_its_limits_at_every_tick(scenario, tmp_path_factory, seed):
    folder = tmp_path_factory.mktemp("chain")
    worlds = [greedy(scenario, folder, seed, limits={"on_excess": on_excess}) for on_excess in LIMITING]
    for prepared, run in zip(worlds, Simulation(worlds).run(), strict=True):
        limits = prepared.scenario.control.limits
        assert run.divergence is None
        assert excess_of(run["qdot_cmd"], limits.rate) <= EXACT
        if limits.acceleration is not None:
            assert excess_of(differences(run), limits.acceleration) <= EXACT
        assert outside(prepared, run) <= 1e-12


# The shipped arms ---------------------------------------------------------------------------------------------

TWO = ("arm.model=models/planar_2link.xml", "arm.start=[60 deg, -120 deg]")
THREE = ("arm.model=models/planar_3link.xml", "arm.start=home")
STANFORD = ("arm.model=models/stanford.xml", "arm.site=wrist", "arm.start=home", "task.axes=[x, y, z]")
# Each is drawn in until a joint meets its limit, the elbows at 160 deg and the boom at 0.3 m, and comes back.
ARMS = {
    "2-link": (*TWO, "target.path=[{line: {to: [0.05, 0]}}, {line: {to: [1.2, 0]}}]"),
    "3-link": (
        *THREE, "arm.start=[60 deg, -140 deg, -60 deg]", "target.path=[{line: {by: [-1, 1]}}, {line: {by: [1, -1]}}]",
    ),
    "Stanford": (*STANFORD, "target.path=[{line: {by: [-0.45, 0, -0.2]}}, {line: {by: [0.45, 0, 0.2]}}]"),
}  # fmt: skip
INWARDS = (
    "control.inverse.method=pseudoinverse",
    "target.limits={velocity: 1.0, acceleration: 20.0, jerk: 2.0e+3}",
)


@pytest.mark.parametrize(
    ("on_excess", "arm", "limits"),
    [
        ("clamp", "3-link", "{acceleration: 20}"), ("redistribute", "Stanford", "{acceleration: 4}"),
        ("optimal", "Stanford", "{acceleration: 20}"), ("sns", "3-link", "{braking: 2, acceleration: 20}"),
        ("scale", "Stanford", "{}"),
    ],
)  # fmt: skip
def test_no_position_limit_is_crossed(simulate, arm, on_excess, limits):
    chosen = (*ARMS[arm], *INWARDS, f"control.limits={limits}", f"control.limits.on_excess={on_excess}")
    prepared, run = simulate(*chosen, "plant.kind=ideal")
    assert outside(prepared, run) <= 1e-12
    assert np.any(run["status"] & Status.POSITION_LIMITED)
    # Servos follow (26) with a lag of about a timestep, 1 ms. What a joint goes too far is seen, and braked harder, as
    # far as the acceleration limit lets it: some b · 1 ms² remain, and what other joints push. Where the braking is
    # the acceleration limit there is no harder, and the joint comes a timestep's way too far. The others go on while it
    # stands. Where nothing limits their acceleration, Stanford's shoulder starts with all of its torque and pushes the
    # boom, whose command stays 0, by 0.14 mm.
    prepared, run = simulate(*chosen, "plant.kind=servo")
    reserve = limits != "{acceleration: 4}"
    pushed = 2e-4 if limits == "{}" and arm == "Stanford" and on_excess != "clamp" else 1e-4
    assert outside(prepared, run) <= (pushed if reserve else 2e-3 * np.abs(run["qdot"]).max())


# Braking ------------------------------------------------------------------------------------------------------


def one_joint(**fields):
    """Return the records of one hinge whose task is its own rate, and that of its tick."""
    world, tick = blank(1, 1)
    law = {"method": Method.PSEUDOINVERSE, "tolerance": 1e-9, "on_excess": OnExcess.CLAMP}
    put(world, J=np.ones((1, 1)), **law, **fields)
    return world, tick


def answer(world, tick, wish):
    """Return the rate and the status of one tick."""
    world["twist_cmd"][0, 0] = wish
    resolve(world, tick)
    return float(tick["qdot_cmd"][0, 0]), Status(int(tick["status"][0]))


@given(st.floats(1e-3, 300.0), st.floats(0.1, 1e3), st.floats(1e-4, 0.02), st.booleans())
def test_a_joint_pushed_at_its_limit_brakes_as_told_and_arrives(ticks, braking, period, is_bounded):
    # Also where the acceleration limit is no larger than the braking, so that nothing is in reserve.
    d, q, rates = ticks * (ticks + 1) / 2 * braking * period**2, 0.0, []
    world, tick = one_joint(
        braking=braking, period=period, position_limit=[[-np.inf], [d]],
        acceleration_limit=braking if is_bounded else np.inf,
    )  # fmt: skip
    for _ in range(2 * int(ticks) + 10):
        world["q"][0, 0] = q
        rate, _ = answer(world, tick, 1e9)
        q += period * rate
        world["qdot_cmd_last"][0, 0] = rate
        rates.append(rate)
    assert q <= d * (1 + 1e-12) and q == pytest.approx(d)
    falls = -np.diff(rates) / period
    # rounding: rates of ticks · b T differ by b T
    assert falls.max() <= braking * (1 + 1e-9 * max(ticks, 1.0))
    if ticks > 3 and not is_bounded:
        assert falls.max() >= 0.99 * braking


# Status -------------------------------------------------------------------------------------------------------

ALL = Status.RATE_LIMITED | Status.ACCELERATION_LIMITED | Status.POSITION_LIMITED
ALONE = {
    Status.RATE_LIMITED: ("control.limits={rate: 0.3, position: false}",),
    Status.ACCELERATION_LIMITED: ("control.limits={rate: 1.0e+9, acceleration: 1.0, position: false}",),
    Status.POSITION_LIMITED: ("control.limits={rate: 1.0e+9}",),
}


@pytest.mark.parametrize("on_excess", LIMITING)
@pytest.mark.parametrize("bit", ALONE)
def test_a_limit_that_acts_alone_sets_its_own_bit_and_no_other(simulate, bit, on_excess):
    chosen = (*ARMS["3-link"], *INWARDS, *ALONE[bit], f"control.limits.on_excess={on_excess}")
    _, run = simulate(*chosen, "plant.kind=ideal")
    seen = run["status"] & ALL
    assert np.any(seen & bit)
    assert_array_equal(seen & ~bit, 0)


@pytest.mark.parametrize("on_excess", LIMITING)
def test_a_limit_that_does_not_act_sets_no_bit_and_changes_no_bit_of_a_number(simulate, on_excess):
    loose = "{rate: 100, acceleration: 1.0e+5, position: true"
    _, run = simulate("plant.kind=ideal", f"control.limits={loose}, on_excess: {on_excess}}}")
    _, free = simulate("plant.kind=ideal", "control.limits.on_excess=none")
    assert_array_equal(run["status"] & ALL, 0)
    assert_array_equal(run["qdot_cmd"], free["qdot_cmd"])


# The request ----------------------------------------------------------------------------------------------------

BESIDE = {
    "rate alone": {}, "acceleration": {"acceleration": 4.0}, "jerk": {"acceleration": 8.0, "jerk": 400.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("on_excess", "beside"),
    [
        ("scale", "rate alone"),
        ("clamp", "acceleration"),
        ("redistribute", "jerk"),
        ("optimal", "acceleration"),
    ],
)
def test_a_request_beyond_a_rate_limit_is_told_whatever_limits_act(scenario, tmp_path, on_excess, beside):
    (tmp_path / "arm.xml").write_text(random_chain(7, 5, ranges=True))
    limits = {"rate": [0.3, 0.5, 0.4, 0.6, 0.2], "position": False, "on_excess": on_excess, **BESIDE[beside]}
    control = {"inverse": {"method": "pseudoinverse"}, "feedback": 8.0, "limits": limits}
    prepared = prepare(scenario(
        f"arm.model={tmp_path}/arm.xml", "arm.start=[0.1, -0.1, 0.1, 0.1, -0.1]", "task.axes=[x, y, z]",
        f"control={json.dumps(control)}", "plant.kind=ideal", SPEED, "target.path=[{line: {by: [0.3, -0.2, 0.2]}}]",
    ))  # fmt: skip
    (run,) = Simulation([prepared]).run()
    twist = run["twist_ref"] + 8.0 * run["pose_error"]
    J = np.array([prepared.arm.jacobian(q)[:3] for q in run["q"]])
    asked = np.einsum("tjr,tr->tj", np.linalg.pinv(J), twist[:, :3])
    share = np.max(np.abs(asked) / limits["rate"], axis=1)
    is_told = (run["status"] & Status.RATE_LIMITED) != 0
    exceeds, keeps = share > 1 + 1e-9, share < 1 - 1e-9
    assert exceeds.any() and keeps.any()
    assert is_told[exceeds].all()
    if on_excess == "clamp":  # others hold joints at their rate limits too
        assert not is_told[keeps].any()
        # negative control: acceleration is the tighter limit
        assert (exceeds & (np.abs(run["qdot_cmd"]) < 0.9 * np.array(limits["rate"])).all(axis=1)).any()
