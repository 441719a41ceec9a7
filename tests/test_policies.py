"""What slowing down, stopping, damping and a second task promise of whole runs through and beyond singularities."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from project import mostly_long
from rmrc.scenario.choices import SCHEDULES, Status
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation

PLAIN = "control.inverse.method=inverse"
SLOW, STOP = "control.at_singularity=slow", "control.at_singularity=stop"


def error_norms(run):
    """Return the norms of position and orientation error, (T,) each."""
    return np.linalg.norm(run["pose_error"][:, :3], axis=1), np.linalg.norm(run["pose_error"][:, 3:], axis=1)


def has(run, status):
    """Return at which ticks a status bit is set."""
    return run["status"] & status > 0


# Slow ---------------------------------------------------------------------------------------------------------

OFFSETS = {
    "1 deg": "-88.4438 deg",
    "0.1 deg": "-89.8444 deg",
}  # of theta_4, for a hand so far beside theta_5 = 0


def wrist(offset, *more):
    """Return the overrides of a Stanford hand that sweeps past its boom and back."""
    return (
        "arm.model=models/stanford.xml", "arm.site=wrist", "task.axes=[x, y, z, rx, ry, rz]", PLAIN,
        f"arm.start=[0, 90 deg, 0.7, {OFFSETS[offset]}, 40 deg, 90 deg]",
        "target.path=[{turn: {axis: z, angle: 80 deg}}, {hold: {for: 0.5}}, {turn: {axis: z, angle: -80 deg}}]",
        "target.limits={angular_velocity: 0.5, angular_acceleration: 2.0, angular_jerk: 20.0}", *more,
    )  # fmt: skip


def off_the_path(prepared, run, every=20):
    """Return how far poses are from the nearest of the path [m], [rad]; neighbors of it are 0.5 mrad apart."""
    path, pose = prepared.reference.pose, run["pose"][::every]
    nearest = np.abs(pose[:, 3:] @ path[:, 3:].T).argmax(axis=1)
    same = np.abs(np.sum(pose[:, 3:] * path[nearest, 3:], axis=1)).clip(max=1.0)
    return (
        np.linalg.norm(pose[:, :3] - path[nearest, :3], axis=1).max(),
        2.0 * np.sqrt(2.0 * (1.0 - same)).max(),
    )


@pytest.mark.parametrize("plant", ["ideal", "servo"])
@pytest.mark.parametrize("offset", OFFSETS)
def test_slow_passes_a_wrist_singularity_on_its_path_and_within_its_rates(simulate, offset, plant):
    # No limit helps it: the pace alone keeps the rates.
    prepared, run = simulate(*wrist(offset, SLOW, f"plant.kind={plant}", "control.limits.on_excess=none"))
    assert np.all(np.abs(run["qdot_cmd"]) <= prepared.arm.rate_limit)
    position, orientation = error_norms(run)
    assert position.max() < 0.2e-3 and orientation.max() < 0.5e-3
    # Half a step between neighbors is 0.25 mrad; 0.5 mrad more is what the error may be.
    off = off_the_path(prepared, run)
    assert off[0] < 0.2e-3 and off[1] < 0.75e-3
    assert run.completed == 1.0 and run.is_complete
    assert run["path_rate"].min() < 0.2 and np.any(has(run, Status.SLOWED))
    assert_array_equal(has(run, Status.SLOWED), run["path_rate"] < 1.0)
    # theta_5 = 0 was passed: theta_4 made its half turn
    assert np.ptp(run["q"][:, 3]) > np.radians(150)


@pytest.mark.parametrize("offset", OFFSETS)
def test_without_slow_rates_time_or_path_are_given_up(simulate, offset):
    prepared, free = simulate(*wrist(offset, "control.limits.on_excess=none", "plant.kind=ideal"))
    assert np.any(np.abs(free["qdot_cmd"]) > 5 * prepared.arm.rate_limit)
    # Scaled rates keep the path as well, but the reference does not wait for them.
    _, scaled = simulate(*wrist(offset, "plant.kind=ideal"))
    assert error_norms(scaled)[1].max() > 0.1
    prepared, clamped = simulate(*wrist(offset, "plant.kind=ideal", "control.limits.on_excess=clamp"))
    assert off_the_path(prepared, clamped)[1] > 2e-3


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("change", [3.0, 10.0])
def test_the_pace_is_what_its_columns_say(simulate, offset, change):
    prepared, run = simulate(*wrist(offset, SLOW, f"control.slow.change={change}", "plant.kind=ideal"))
    pace, time, T = run["path_rate"], run["path_time"], run.period
    assert pace.min() >= 0.0 and pace.max() <= 1.0
    # the pace before the first tick is 1
    assert np.abs(np.diff(pace, prepend=1.0)).max() <= change * T + 1e-12
    end = (run.planned - 1) * T
    assert time[0] == 0.0 and time[-1] == pytest.approx(end)
    assert_allclose(time[1:], np.minimum(time[:-1] + pace[:-1] * T, end), rtol=0, atol=1e-9)
    before = np.minimum((time / T).astype(int), run.planned - 2)
    part = (time / T - before)[:, None]
    pose, twist = prepared.reference.pose, prepared.reference.twist
    after = (
        pose[before + 1]
        * np.where(np.sum(pose[before, 3:] * pose[before + 1, 3:], axis=1) < 0, -1, 1)[:, None]
    )
    after[:, :3] = pose[before + 1, :3]
    want = pose[before] + part * (after - pose[before])
    want[:, 3:] /= np.linalg.norm(want[:, 3:], axis=1, keepdims=True)
    # 1e-9: path_time is the path tick times the period, and divided by it here
    assert_allclose(run["pose_ref"], want, rtol=0, atol=1e-9)
    full = twist[before] + part * (twist[before + 1] - twist[before])
    assert_allclose(run["twist_ref"], pace[:, None] * full, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]",
         "target.path=[{line: {by: [0.05, 0.1, 0], turn: {axis: z, angle: 0.2}}}]"),
        ("arm.model=models/planar_3link.xml", "arm.start=home", "target.path=[{line: {by: [-0.1, 0.1]}}]",
         "control.nullspace={objective: manipulability, gain: 1}"),
    ],
    ids=["2-link", "Stanford", "3-link"],
)  # fmt: skip
@pytest.mark.parametrize("plant", ["ideal", "servo"])
def test_slow_changes_no_bit_where_nothing_is_near_a_singularity(simulate, overrides, plant):
    _, damp = simulate(*overrides, f"plant.kind={plant}")
    _, slow = simulate(*overrides, f"plant.kind={plant}", SLOW)
    assert np.all(slow["path_rate"] == 1.0)
    for name, column in damp.columns.items():
        assert_array_equal(slow[name], column, err_msg=name)


# Out of reach -------------------------------------------------------------------------------------------------

START = "arm.start=[41.409622 deg, -82.819244 deg]"  # at r = 1.5 m
COARSE = (
    "control.period=0.002",
    "control.feedback=5",
    "target.limits={velocity: 0.2, acceleration: 1.0, jerk: 10.0}",
)
BEYOND = "target.path=[{line: {to: [2.1, 0]}}, {line: {to: [1.5, 0]}}, {hold: {for: 1.0}}]"
REACH = "target.path=[{line: {to: [2.0, 0]}}, {hold: {for: 0.5}}, {line: {to: [1.5, 0]}}, {hold: {for: 1.0}}]"
OUT = (START, *COARSE, BEYOND, "plant.kind=ideal")


@pytest.mark.parametrize("patience", [0.2, 1.0, 3.0])
def test_slow_waits_beyond_reach_goes_on_and_comes_back(simulate, patience):
    _, run = simulate(*OUT, PLAIN, SLOW, f"control.slow.patience={patience}")
    # It takes 0.1 s for the pace to fall to 0, and some more where s* = 0 comes and goes.
    stands = np.count_nonzero(run["path_rate"] == 0.0) * run.period
    assert stands == pytest.approx(patience, abs=0.15)
    assert error_norms(run)[0][-1] < 0.002
    assert run.completed == 1.0 and run.is_complete
    assert len(run) > run.planned


def test_slow_ends_after_its_longest_time_wherever_it_is(simulate):
    _, run = simulate(*OUT, PLAIN, SLOW, "control.slow.longest=1")
    assert len(run) == run.planned and run.completed < 0.95 and not run.is_complete
    _, run = simulate(*OUT, PLAIN, SLOW, "control.slow={longest: 1.1, patience: 1000}")
    assert len(run) == np.ceil(1.1 * run.planned) and not run.is_complete
    assert run["path_rate"][-1] == 0.0  # it still waits


# Stop ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["ideal", "servo"])
@pytest.mark.parametrize("change", [5.0, 20.0])
def test_stop_holds_the_arm_before_the_singularity_and_lets_it_back(simulate, change, plant):
    _, run = simulate(
        *OUT, PLAIN, STOP, f"control.stop={{sigma: 0.2, change: {change}}}", f"plant.kind={plant}"
    )
    sigma, elbow = run["sigma"][:, -1], run["q"][:, 1]
    # Rates that fall to 0 by `change` lead on by rate/(2 change). sigma = sin(elbow)/sigma_1 falls by at most 0.47 of
    # that; a quarter more, as the rates that are taken away rise meanwhile.
    travel = np.abs(run["qdot"]).max() / (2 * change)
    assert sigma.min() >= 0.2 - 1.25 * 0.47 * travel
    assert sigma.min() < 0.2 and np.any(has(run, Status.STOPPED))
    held = has(run, Status.STOPPED) & (np.abs(run["qdot_cmd"]).max(axis=1) == 0.0)
    assert np.count_nonzero(held) * run.period > 1.0
    # while it is held it stands: ideal at once, servos when the last command has been obeyed, some timesteps later
    still = held & np.roll(held, 10)
    assert np.abs(run["qdot"][still]).max() <= (0.0 if plant == "ideal" else 1e-3)
    # It stands while the target is out there, and follows again once it is back.
    assert np.all(elbow < 0) and error_norms(run)[0][-1] < 0.002
    assert not has(run, Status.STOPPED)[-1]


def test_without_stop_the_same_arm_reaches_its_singularity(simulate):
    _, run = simulate(*OUT, PLAIN)
    assert run["sigma"][:, -1].min() < 0.01
    assert not np.any(has(run, Status.STOPPED))


def test_stop_holds_by_condition_as_well(simulate):
    _, run = simulate(*OUT, PLAIN, STOP, "control.stop={sigma: 1.0e-6, condition: 10, change: 20}")
    # Some of it is driven beyond while the rates fall, as above: 2 (0.47 rate/(2 change))/sigma of the condition
    assert 10.0 < run["condition"].max() < 11.5
    assert np.any(has(run, Status.STOPPED)) and error_norms(run)[0][-1] < 0.002
    assert run["sigma"][:, -1].min() > 0.15


@pytest.mark.parametrize("method", ["inverse", "damped"])
@pytest.mark.parametrize(
    ("start", "by"),
    [("[5 deg, -10 deg]", "[-0.5, 0]"), ("[5 deg, -10 deg]", "[-0.3, 0.3]"), ("[0, 0]", "[-0.3, 0.3]"), ("[0, 0]", "[-0.5, -0.5]")],
)  # fmt: skip
def test_an_arm_inside_the_bound_is_free_to_leave(simulate, method, start, by):
    # Straight, the way inwards alone is lost; a target to the side makes the elbow move.
    _, run = simulate(
        f"arm.start={start}", *COARSE, f"target.path=[{{line: {{by: {by}}}}}, {{hold: {{for: 1.0}}}}]",
        "plant.kind=ideal", f"control.inverse.method={method}", STOP, "control.stop.sigma=0.2",
    )  # fmt: skip
    assert run["sigma"][0, -1] < 0.2
    assert error_norms(run)[0][-1] < 0.002
    # At rest nothing leads out, so that the first tick may hold; after it nothing does.
    assert np.count_nonzero(has(run, Status.STOPPED)) <= 2


WRIST = """
<mujoco>
  <worldbody>
    <body>
      <joint name="yaw" axis="0 0 1"/>
      <geom size="0.05" mass="1"/>
      <body>
        <joint name="pitch" axis="0 1 0"/>
        <geom size="0.05" mass="1"/>
        <body>
          <joint name="roll" axis="0 0 1"/>
          <geom size="0.05" mass="1"/>
          <site name="tip" pos="0 0 0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_what_neither_leads_in_nor_out_is_held_whatever_the_rounding(scenario, tmp_path):
    # No yaw changes a singular value of this wrist, which turns about z by its yaw alone. Until β is 0 it moves.
    (tmp_path / "wrist.xml").write_text(WRIST)
    yaws = np.linspace(-3, 3, 13)
    worlds = [
        prepare(
            scenario(
                f"arm={{model: {tmp_path / 'wrist.xml'}, site: tip, start: [{yaw}, 0.1, {0.5 * yaw}]}}", *COARSE,
                "task.axes=[rx, ry, rz]", "target.path=[{turn: {axis: z, angle: 10 deg}}]", "plant.kind=ideal",
                "control.feedback=0", PLAIN, STOP, "control.stop.sigma=0.2",
            )
        )
        for yaw in yaws
    ]  # fmt: skip
    for run in Simulation(worlds).run():
        wished = np.abs(run["qdot_plain"][1:-1])
        assert np.all(wished[:, 0] > 0) and np.all(wished[:, 1:] <= 1e-12 * wished[:, :1])
        assert np.all(has(run, Status.STOPPED)) and np.abs(run["q"] - run["q"][0]).max() < 1e-3


# Backing out --------------------------------------------------------------------------------------------------

ROBUST = {
    name: ("control.inverse.method=damped", f"control.inverse.damping.schedule={name}")
    for name in SCHEDULES.names
    if name != "error"  # which vanishes when tracking is good
}
ROBUST |= {name: (f"control.inverse.method={name}",) for name in ("filtered", "jparse")}


@pytest.mark.parametrize("law", mostly_long(ROBUST, 4))
def test_a_robust_arm_comes_back_from_full_reach_and_from_beyond(scenario, law):
    known, worlds, names = Cache(), [], []
    for path in (REACH, BEYOND):
        for policy in ("damp", "slow", "stop"):
            for on_excess in ("scale", "clamp", "redistribute", "none"):
                policies = f"control.at_singularity={policy}", f"control.limits.on_excess={on_excess}"
                worlds.append(
                    prepare(
                        scenario(START, *COARSE, path, "plant.kind=ideal", *ROBUST[law], *policies), known
                    )
                )
                names.append((policy, on_excess, path))
    for name, run in zip(names, Simulation(worlds).run(), strict=True):
        assert run.divergence is None and run.is_complete, name
        assert error_norms(run)[0][-1] < 0.002, name


@pytest.mark.parametrize("path", [REACH, BEYOND], ids=["reach", "beyond"])
def test_truncated_locks_the_arm_straight(simulate, path):
    _, run = simulate(START, *COARSE, path, "plant.kind=ideal", "control.inverse.method=truncated")
    assert error_norms(run)[0][-1] > 0.1
    assert abs(run["q"][-1, 1]) < 0.05


# Known figures ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("damping", "rate", "error"),
    # About 2 and 1.2 rad/s, 5 and 13 mm. Starts 0.1 mm apart, which move the last tick before full reach, change
    # them by 1 %; 10 % are for the rounding of the figures themselves.
    [(0.05, 1.95, 5.4e-3), (0.1, 1.19, 13.2e-3)],
)
def test_constant_damping_at_full_reach_has_its_known_price(simulate, damping, rate, error):
    _, run = simulate(
        START, "control.period=0.002", "control.feedback=5", "plant.kind=ideal", "control.limits.on_excess=none",
        "target.path=[{line: {to: [2, 0]}}, {line: {to: [1.5, 0]}}]",
        "target.limits={velocity: 0.2, acceleration: 1000, jerk: 1.0e+6}",
        "control.inverse.damping.schedule=constant", f"control.inverse.damping.maximum={damping}",
    )  # fmt: skip
    assert np.abs(run["qdot_cmd"]).max() == pytest.approx(rate, rel=0.1)
    assert np.abs(run["pose_error"][:, 0]).max() == pytest.approx(error, rel=0.1)


def test_the_pseudoinverse_pays_with_rates_instead(simulate):
    _, run = simulate(
        START, "control.period=0.002", "control.feedback=5", "plant.kind=ideal", "control.limits.on_excess=none",
        "target.path=[{line: {to: [2, 0]}}, {line: {to: [1.5, 0]}}]", "control.inverse.method=pseudoinverse",
        "target.limits={velocity: 0.2, acceleration: 1000, jerk: 1.0e+6}",
    )  # fmt: skip
    # How much more than 10 depends on where the last tick falls, as 1/sigma does. The error is that of a tick or two.
    assert np.abs(run["qdot_cmd"]).max() > 10.0
    assert error_norms(run)[0].max() < 1e-3


# A second task ------------------------------------------------------------------------------------------------

TWO_TASKS = (
    "arm.model=models/planar_3link.xml", "arm.start=home", "control.feedback=20", "control.limits.on_excess=none",
    "control.inverse={method: damped, damping: {maximum: 0.1, below: 0.1}}", "plant.kind=ideal",
)  # fmt: skip
INTO = "target.path=[{line: {by: [0, -0.15]}}, {hold: {for: 0.5}}, {line: {by: [0, 0.15]}}]"  # the algorithmic one
AWAY = "target.path=[{line: {by: [0.1, 0.05]}}, {hold: {for: 2.0}}]"


def second(priority, damping=0.05):
    """Return the overrides of a wrist that shall keep its height."""
    return (
        "control.nullspace.objective=secondary",
        f"control.nullspace.secondary={{site: wrist, axes: [y], priority: {priority}, damping: {damping}}}",
    )


@pytest.mark.parametrize("path", [INTO, AWAY], ids=["into", "away"])
@pytest.mark.parametrize("priority", ["classical", "robust"])
def test_a_second_task_never_disturbs_the_first(simulate, path, priority):
    _, alone = simulate(*TWO_TASKS, path)
    prepared, run = simulate(*TWO_TASKS, path, *second(priority))
    assert np.abs(run["qdot_cmd"] - alone["qdot_cmd"]).max() > 0.005  # it does something
    assert run["damping"].max() == 0.0  # so the first task is done exactly, tick by tick
    for t in range(0, len(run), 5):
        asked = run["twist_ref"][t, :2] + 20 * run["pose_error"][t, :2]
        # 1e-10: rates of 1 rad/s, and an orthogonality of 1e-15 over a sigma_2 of down to 1e-3
        assert_allclose(
            prepared.arm.jacobian(run["q"][t])[:2] @ run["qdot_cmd"][t], asked, rtol=0, atol=1e-10
        )
    # What is left is Whitney's straight step along a curve: L |qdot|^2 T^2/2 a tick, of which feedback leaves the
    # (K T)-fold inverse. The arm is 2.4 m long.
    T, fastest = run.period, np.linalg.norm(run["qdot_cmd"], axis=1).max()
    assert np.abs(run["pose_error"][:, :2] - alone["pose_error"][:, :2]).max() <= 2.4 * fastest**2 * T / (
        2 * 20
    )


def test_away_from_the_algorithmic_singularity_classical_priority_does_both(simulate):
    _, classical = simulate(*TWO_TASKS, AWAY, *second("classical"))
    assert classical["secondary_sigma"].min() > 0.1
    # its damping of 0.05 leaves a part (0.05/0.16)^2 of the rate, some 1e-3 m on the way, which goes with time
    assert classical["secondary_error"].max() < 1e-3
    assert classical["secondary_error"][-1] < 1e-6
    assert error_norms(classical)[0][-1] < 1e-6
    _, robust = simulate(*TWO_TASKS, AWAY, *second("robust"))
    assert robust["secondary_error"][-1] > 1e-3  # what its safety costs: it converges slower


def test_at_the_algorithmic_singularity_robust_priority_stays_calm(simulate):
    _, classical = simulate(*TWO_TASKS, INTO, *second("classical", 0.0))
    assert np.abs(classical["qdot_cmd"]).max() > 100.0
    assert classical["secondary_sigma"].min() < 0.01
    _, robust = simulate(*TWO_TASKS, INTO, *second("robust", 0.0))
    assert np.abs(robust["qdot_cmd"]).max() < 1.0
    assert error_norms(robust)[0].max() < 5e-5
    # and neither task is singular by itself
    assert robust["sigma"].min() > 0.5
