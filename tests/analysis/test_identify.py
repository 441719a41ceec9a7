"""Delay, lag and noise from logs: of a closed form with noise, of our own runs, of dirty files, and of useless ones."""

import json

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from logs import DELAY, LAG, NOISE, PERIOD, RESOLUTION, answer, commands, log

import rmrc
from project import examples
from rmrc.analysis.identify_log import choose, clock_of
from rmrc.analysis.identify_report import block, report
from rmrc.analysis.identify_response import Commands
from wording import says

TRUTH = {"total": DELAY + LAG, "delay": DELAY, "lag": LAG, "gain": 1.0}


@pytest.mark.parametrize("lag", [0.0, 0.0007, 0.3])
def test_the_answer_is_that_of_the_closed_form_at_any_times(lag):
    rng = np.random.default_rng(1)
    sent_at = np.cumsum(rng.uniform(0.001, 0.02, 300))
    rate = np.concatenate([[0.0], rng.uniform(-1, 1, 299)])
    time = np.sort(rng.uniform(0.0, 4.0, 500))
    sent = Commands(sent_at, rate, np.append(sent_at[1:], np.inf))
    travel, speed = sent.answer(time - 0.0123, lag)
    # sums of 300 terms of size 1
    np.testing.assert_allclose(travel, answer(time, sent_at, rate, 0.0123, lag), atol=1e-11)
    ahead, _ = sent.answer(time - 0.0123 + 1e-7, lag)
    inside = np.abs((time - 0.0123)[:, None] - sent_at).min(axis=1) > 1e-6
    # a difference over 1e-7 s errs by 1e-7 times the acceleration, 2/lag at most
    atol = 1e-6 + 1e-7 * (2 / lag if lag else 0)
    np.testing.assert_allclose(((ahead - travel) / 1e-7)[inside], speed[inside], atol=atol)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_rows_that_are_missing_are_counted_and_the_others_keep_their_times(share):
    rng, period = np.random.default_rng(5), 0.004
    rows = np.flatnonzero(rng.random(900) < share)
    clock = clock_of(period * rows + rng.normal(0.0, 0.02 * period, len(rows)))
    assert clock.period == pytest.approx(period, rel=0.02)
    assert clock.missing == np.ptp(rows) + 1 - len(rows)
    # a line through stamps that are off by 0.02 periods each
    np.testing.assert_allclose(clock.regular, period * rows, rtol=0, atol=0.01 * period)


@given(
    seed=st.integers(0, 10_000),
    period=st.sampled_from([0.002, 0.004, 0.008, 0.01]),
    delay=st.floats(0.0, 0.1),
    lag=st.floats(0.008, 0.08),
    noise=st.sampled_from([1e-6, 1e-5, 1e-4]),
)
@examples(2, 6)
def test_delay_is_found_within_a_tick_and_lag_within_5_percent(seed, period, delay, lag, noise):
    # 12 s of levels within 0.7 rad/s and ramps of 0.05 s: what is promised
    found = rmrc.identify(log(seed, "", 0.0, period, delay, lag, noise, joints=1))
    assert found.delay.value == pytest.approx(delay, abs=period)
    assert found.lag[0] == pytest.approx(lag, rel=0.05)


def test_a_fault_in_the_search_is_seen(monkeypatch):
    """The negative control: lags that decay by half the rate."""
    exact = Commands.answer
    monkeypatch.setattr(
        Commands, "answer", lambda self, t, lag=0, limit=np.inf: exact(self, t, 2 * lag, limit)
    )
    assert rmrc.identify(log(19, joints=1)).lag[0] != pytest.approx(LAG, rel=0.05)


# Intervals -------------------------------------------------------------------------------------


def covered(joints, beside=0.0, scale=1.0):
    """Return for how many joints the truth is within so many times the intervals of sum, delay, lag, gain, (4,)."""
    hits = []
    for joint in joints:
        for name, value in TRUTH.items():
            mean, low, high = getattr(joint.fit, name)
            hits.append(low <= mean + (value + beside - mean) / scale <= high)
    return np.sum(np.reshape(hits, (-1, len(TRUTH))), axis=0)


def colored(exact, rng):
    noise = rng.standard_normal(len(exact))
    for k in range(1, len(noise)):
        noise[k] += 0.8 * noise[k - 1]
    return exact + 6e-5 * noise


def coarse(exact, rng):
    return np.round(exact / 2e-4 + 0.2 * rng.standard_normal(len(exact))) * 2e-4


def noisy(noise_of, seeds):
    """Return the joints of logs of 8 s with such a noise."""
    joints = []
    for seed in seeds:
        rng = np.random.default_rng([7, seed])
        time, rate = commands(rng, 0.008, 8.0, top=0.5)
        q = noise_of(answer(time, time, rate, DELAY, LAG), rng)
        joints += rmrc.identify({"t": time, "q": q, "qdot_cmd": rate}).joints
    return joints


def test_intervals_hold_the_truth_as_often_as_they_say_in_a_few_logs():
    joints = noisy(colored, range(8))
    # 8 logs at 95 %: 4 or fewer have a chance of 4e-4
    assert (covered(joints) >= 5).all()
    # negative control: a tenth of the width holds 16 % of the logs; 5 or more have a chance of 3e-3
    assert (covered(joints, scale=0.1)[2:] < 5).all()  # delay and sum have intervals of 0.1 ms at least


@pytest.mark.long
@pytest.mark.parametrize(("noise", "least"), [(coarse, 0.91), (colored, 0.82)])
def test_intervals_hold_the_truth_as_often_as_they_say(noise, least):
    assert (covered(noisy(noise, range(300))) >= 300 * least).all()


FEW = [("limit", 8.0), ("missing", 0.2), ("stamps", 1e-3), ("wrapped", 1.0)]
MANY = [("", 0.0), ("missing", 0.4), ("stamps", 3e-3), ("readings", 5e-4), ("limit", 4.0), ("backlash", 2e-3)]


@pytest.mark.parametrize(
    ("kind", "size", "count"),
    [
        *((*each, 3) for each in FEW),
        *(pytest.param(*each, 40, marks=pytest.mark.long) for each in FEW + MANY),
    ],
)
def test_spoiled_logs_hold_the_truth_as_often_as_they_say(kind, size, count):
    joints = [joint for seed in range(count) for joint in rmrc.identify(log(seed, kind, size)).joints]
    sound = [joint for joint in joints if not joint.trouble]
    assert len(sound) >= len(joints) * 2 / 3
    # a coverage of 95 %: of 6, 2 or more are outside with a chance of 3 %
    assert (covered(sound)[:3] >= (0.88 * len(sound) if count > 3 else len(sound) - 1)).all()
    # negative control, but where nearly half of the rows are missing: half a millisecond beside the truth
    assert size == 0.4 or covered(sound, beside=5e-4)[0] <= 0.05 * len(sound)


# Noise, and what else a log has ------------------------------------------------------------------


@pytest.mark.parametrize("noise", [2e-6, 1e-4])
def test_noise_and_resolution_are_those_of_the_encoder(noise):
    columns = log(2, noise=noise, period=0.004, joints=1)
    ((joint),) = rmrc.identify(columns | {"q0": np.round(columns["q0"], 6)}).joints
    assert joint.noise.resolution == pytest.approx(RESOLUTION, rel=1e-3)
    # of 3,000 rows; less than the resolution's own 1.4e-5 cannot be seen
    assert joint.noise.value == pytest.approx(noise, rel=0.05, abs=1e-5 if noise < 1e-5 else 0)


@pytest.mark.parametrize(("kind", "size", "rms"), [("stamps", 1e-3, 5.8e-4), ("readings", 5e-4, 5e-4)])
def test_a_jitter_of_stamps_is_no_noise_of_encoders(kind, size, rms):
    found = rmrc.identify(log(1, kind, size))
    (note,) = found.notes
    # of 1,500 rows; a jitter that the arm has as well hides a part of the noise
    assert float(note.removeprefix("stamps jitter by ").split()[0]) == pytest.approx(1e3 * rms, rel=0.1)
    noise = [joint.noise.value for joint in found.joints]
    assert noise == pytest.approx([NOISE] * 2, rel=0.2 if kind == "stamps" else 0.6)


@pytest.mark.parametrize(
    ("kind", "size", "name", "amount", "rel"),
    [
        ("limit", 8.0, "limit", 8.0, 0.02), ("backlash", 2e-3, "backlash", 2e-3, 0.1),
        ("index", 0.01, "drift", -0.01, 0.5),  # lost rows are random: 15 of 1,500, and not at even distances
    ],
)  # fmt: skip
def test_what_acts_beside_delay_and_lag_is_named_and_estimated(kind, size, name, amount, rel):
    texts = {
        "limit": "limits its acceleration to about …: large changes … small ones do not; log slower changes …",
        "backlash": "… backlash of about …",
        "drift": "positions and commands drift apart by … ms over … two clocks, or … rows lost; …",
    }
    for joint in rmrc.identify(log(3, kind, size)).joints:
        assert joint.cause == (name, pytest.approx(amount, rel=rel))
        assert [joint.trouble or joint.notes[-1]] == [says(texts[name])] and bool(joint.trouble) == (
            name == "drift"
        )


@pytest.mark.parametrize("rows", [2, 5])
def test_commands_that_are_logged_too_late_give_no_delay(rows):
    shown = report(rmrc.identify(log(4, "late", rows)))
    for joint in shown.json["joints"]:  # the response begins 4 and 28 ms before
        assert joint["trouble"] == says("it begins to respond … ms before … logged later than commanded …")
        assert float(joint["trouble"].split()[4]) == pytest.approx(8 * rows - 12, abs=0.15)
        assert not {"total", "delay", "lag", "gain"} & joint.keys()
    assert not shown.met


def test_a_delay_that_coarse_noise_makes_negative_is_0_up_to_a_tenth_of_a_millisecond():
    found = rmrc.identify(log(1, delay=-0.001, lag=0.02, noise=5e-4))
    assert all(joint.trouble == "" and joint.fit.delay.high < 0.0 for joint in found.joints)
    assert found.delay == (0.0, 0.0, 1e-4)


def test_a_log_that_may_be_slower_than_its_loop_says_how_much_that_biases_it():
    found = rmrc.identify(log(5, "slow", 4))
    text = "… if the loop is faster than the log, delays are up to 16 ms longer …"
    assert report(found).json["facts"]["duration"] == says(text)
    # commands are known every 32 ms, and change every 8 ms: on average 12 ms after they are taken to begin
    for joint in found.joints:
        assert joint.fit.total.value == pytest.approx(DELAY + LAG - 0.012, abs=0.002)


def test_delay_and_lag_that_slow_commands_do_not_tell_apart_are_said_so():
    joint = rmrc.identify(log(17, noise=3e-4, lag=0.004, ramp=0.6, duration=20.0)).joints[0]
    assert joint.fit.lag.low == 0.0 and joint.notes == (says("… hard to separate … ± … ms …"),)
    assert joint.fit.total.low < 0.016 < joint.fit.total.high
    assert joint.fit.total.half < joint.fit.lag.half / 2


# Logs as people have them ------------------------------------------------------------------------


def rows_of(choice):
    """Return a change of a log: rows of it, by their times."""
    return lambda columns: ({name: values[choice(columns["t"])] for name, values in columns.items()}, {})


def renamed(*names, **how):
    """Return a change of a log: names of t, q0, q1 and the commanded rates."""
    return lambda columns: (dict(zip(names, columns.values(), strict=True)), how)


def in_degrees(columns):
    return {k: v if k == "t" else np.degrees(v) for k, v in columns.items()}, {"degrees": True}


def read_every_third_row(columns):
    rows = np.arange(len(columns["t"])) // 3 * 3
    return columns | {name: columns[name][rows] for name in ("q0", "q1")}, {}


PEOPLE = {
    "degrees": lambda columns: (in_degrees(columns)[0], {}),
    "spikes": lambda columns: (
        columns | {"q0": columns["q0"] + 1.5 * (np.arange(len(columns["t"])) % 211 == 40)}, {},
    ),
    "every third": read_every_third_row,
    "wrapped": lambda columns: in_degrees(
        columns | {name: (columns[name] + 6.2) % (2 * np.pi) for name in ("q0", "q1")}
    ),
    "coarse clock": lambda columns: (columns | {"t": np.floor(columns["t"] / 0.04 + 1e-9) * 0.04}, {}),
    "ns": lambda columns: (columns | {"t": 1.7e18 + np.round(columns["t"] * 1e9)}, {}),
    "maker": renamed("timestamp", "actual_q_0", "actual_q_1", "target_qd_0", "target_qd_1"),
    "pattern": renamed("t", "0 at", "1 at", "0 to", "1 to", columns={"q": "* at", "qdot_cmd": "* to"}),
    "gap": rows_of(lambda t: (t < 4.0) | (t > 5.3)),
    "twice": rows_of(lambda t: np.sort(np.concatenate([np.arange(len(t)), np.arange(0, len(t), 7)]))),
    "order": rows_of(lambda t: np.argsort(t + 0.02 * (np.arange(len(t)) % 200 == 100))),
}  # fmt: skip


@pytest.mark.parametrize("case", PEOPLE)
def test_a_log_as_people_have_them_tells_the_same(case, tmp_path):
    columns, how = PEOPLE[case](log(11))
    file = tmp_path / "log.csv"
    rows = [
        ",".join("" if np.isnan(x) else f"{x:.9f}" for x in row)
        for row in np.column_stack(list(columns.values()))
    ]
    file.write_text("\n".join([",".join(columns), *rows]) + "\n", "utf-8")
    found = rmrc.identify(file, **how)
    assert [joint.trouble for joint in found.joints] == ["", ""]
    assert found.delay.value == pytest.approx(DELAY, abs=0.002)
    assert found.lag == pytest.approx([LAG] * 2, rel=0.1)
    assert all(joint.fit.gain.value == pytest.approx(1.0, abs=1e-3) for joint in found.joints)


@pytest.mark.parametrize("column", ["t", "q1", "qdot_cmd1"])
def test_a_cell_that_is_no_number_costs_its_row_alone_and_is_told(column, tmp_path):
    columns, file = log(11), tmp_path / "log.csv"
    table = np.column_stack(list(columns.values())).astype(str)
    table[100, list(columns).index(column)] = "oops"
    file.write_text("\n".join(map(",".join, [columns, *table.tolist()])), "utf-8")
    found = rmrc.identify(file)
    assert f'{column} has "oops" in row 101' in found.log.facts["rows"].replace("'", '"')
    assert found.lag == pytest.approx([LAG] * 2, rel=0.1)


def test_a_joint_without_commands_is_named():
    columns = log(11)
    del columns["qdot_cmd1"]
    assert rmrc.identify(columns).log.facts["joints"] == "left out, as they lack positions or commands: 1"


@pytest.mark.parametrize("digit", [0.01, 1.0])
def test_stamps_with_few_digits_are_no_missing_rows(digit):
    """Rows of 8 ms whose stamps are rounded to 10 ms, or to seconds."""
    columns = log(3)
    found = rmrc.identify(columns | {"t": np.round(columns["t"] / digit) * digit})
    for joint in found.joints:
        assert joint.fit.samples.commands.period == pytest.approx(PERIOD, rel=0.05 * digit)
    assert found.delay.value == pytest.approx(DELAY, abs=0.002)
    assert not [line for line in found.notes if "missing" in line]


def test_commands_with_rows_of_their_own_are_taken_when_they_were_logged():
    columns = log(11, joints=1)
    none, t = np.full(len(columns["t"]), np.nan), np.concatenate([columns["t"], columns["t"] + 0.003])
    order = np.argsort(t, kind="stable")
    q, rate = np.concatenate([columns["q0"], none]), np.concatenate([none, columns["qdot_cmd0"]])
    found = rmrc.identify({"t": t[order], "q0": q[order], "qdot_cmd0": rate[order]})
    assert found.delay.value == pytest.approx(DELAY - 0.003, abs=0.001)


def test_arrays_npz_and_a_run_are_logs_and_what_is_assumed_is_said(tmp_path, simulate):
    columns = log(13, duration=4.0)
    arrays = {key: np.column_stack([columns[f"{key}{j}"] for j in (0, 1)]) for key in ("q", "qdot_cmd")}
    np.savez(tmp_path / "log.npz", time=1e3 * columns["t"], **arrays)
    found, whole = rmrc.identify(tmp_path / "log.npz"), rmrc.identify(columns)
    assert found.delay == pytest.approx(whole.delay, abs=1e-9)
    assert found.log.facts["time"] == says('"time" in ms: … 8 ms') and "rows" not in found.log.facts
    assert found.log.facts["positions"] == says("… rad … --degrees …")
    _, run = simulate("plant.kind=ideal", "plant.delay=0.01")
    found = rmrc.identify(run)
    assert [joint.name for joint in found.joints] == list(run.joints)
    assert found.delay.value == pytest.approx(0.01, abs=1e-4)


def test_what_a_run_had_is_found_in_its_file_and_the_scenario_with_the_block_runs(tmp_path):
    plant = {"plant.kind": "torque", "plant.delay": 0.012, "plant.lag": 0.009}
    scenario = rmrc.load("approach_singularity").set(plant | {"control.period": 0.002, "control.feedback": 4})
    before = rmrc.run(scenario, out=tmp_path)
    found = rmrc.identify(tmp_path / f"{scenario.name}.npz")
    # computed torque has what is commanded within the tick: a tick less
    assert found.delay.value == pytest.approx(0.012, abs=scenario.control.period * 1.01)
    assert found.lag == pytest.approx([0.009, 0.009], rel=0.05)
    pasted = yaml.safe_load(block(found))
    again = rmrc.run(scenario.set({f"plant.{key}": value for key, value in pasted["plant"].items()}))
    error = "position_error.max"
    assert again.is_complete
    assert again.scorecard[error].value == pytest.approx(before.scorecard[error].value, rel=0.1)


def test_columns_are_known_by_many_habits():
    for q, rate in (
        ("q{}", "qdot_cmd{}"), ("q_{}", "qdot_cmd_{}"), ("q[{}]", "qdot_cmd[{}]"), ("pos_{}", "vel_cmd_{}"),
        ("/joint_states/{}/position", "/commands/{}/velocity_command"), ("actual_q_{}", "target_qd_{}"),
        ("q_meas.{}", "dq_d.{}"), ("Position {} [deg]", "Velocity Command {} [deg/s]"),
    ):  # fmt: skip
        for joints in (("0", "1"), ("shoulder_pan_joint", "elbow_joint"))[: 1 if q == "q{}" else 2]:
            names = ["time", *(q.format(one) for one in joints), *(rate.format(one) for one in joints)]
            _, positions, rates, _ = choose({name: np.arange(9.0) for name in names}, {})
            assert tuple(positions) == joints, (q, rate)
            assert [column.name for column in [*positions.values(), *rates.values()]] == names[1:]


# Logs that do not tell ---------------------------------------------------------------------------

NOISY = np.random.default_rng(0).standard_normal(1500)
USELESS = {
    "still": (lambda q, u: (0 * q, u), "moves 0 …: … actuator …"),
    "nearly still": (lambda _, u: (1e-5 * NOISY, u), "moves … commands ask for …: … actuator …"),
    "not driven": (lambda q, u: (q, 0 * u), "commanded rate is 0 throughout: … starts and stops"),
    "of another": (lambda q, u: (q, np.roll(u, 700)), "explains … %… log it alone …"),
    "at a limit": (lambda q, u: (np.minimum(q, np.quantile(q, 0.6)), u), "explains … %… limits …"),
    "hardly moved": (
        lambda q, u: (2e-4 * (q + NOISY), 2e-4 * u),
        "uncertain by … ms: … noise …; … sharper …",
    ),
    "too few": (lambda q, u: (np.where(np.arange(1500) < 20, q, np.nan), u), "30 rows …: log 10 s or more"),
}


def test_a_joint_that_tells_nothing_says_in_a_line_what_to_log_instead_and_the_others_tell():
    columns, spoiled = log(15, joints=1), log(15)
    for k, (spoil, _) in enumerate(USELESS.values(), 1):
        columns[f"q{k}"], columns[f"qdot_cmd{k}"] = spoil(spoiled["q1"] - 2.0, spoiled["qdot_cmd1"])
    found = rmrc.identify(columns)
    assert found.joints[0].trouble == "" and set(found.lag) == {found.lag[0]}  # taken from the other
    for joint, (_, text) in zip(found.joints[1:], USELESS.values(), strict=True):
        assert joint.trouble == says(f"… {text}"), joint
    shown = report(found)
    assert "taken from the others: 1, 2, 3, 4, 5, 6, 7." in shown.block.replace("\n# ", " ")
    assert shown.met and [joint["name"] for joint in json.loads(json.dumps(shown.json))["joints"]] == [
        *"01234567"
    ]
    assert not report(rmrc.identify({name: columns[name] for name in ("t", "q1", "qdot_cmd1")})).met


REFUSED = {
    "no time": ({"q0": [1.0], "qdot_cmd0": [1.0]}, {}, "no column of time; … q0, qdot_cmd0; … --columns t=NAME …"),
    "no commands": ({"t": [0.0], "q0": [1.0], "q_cmd0": [1.0]}, {}, "rates (commanded positions …); … qdot_cmd=NAME …"),
    "of other joints": ({"t": [0.0], "q_a": [1.0], "qdot_cmd_0": [1.0]}, {}, "joints a, … 0: … --columns …"),
    "of many other joints": (
        {"t": [0.0]} | {f"q_{name}": [1.0] for name in "abcefghijk"} | {f"qdot_cmd_{i}": [1.0] for i in range(10)}, {},
        "joints a, b, c, e, f, g, h, i and 2 more, commands of 0, 1, 2, 3, 4, 5, 6, 7 and 2 more: … --columns …",
    ),
    "no such column": ({"t": [0.0], "q0": [1.0], "qdot_cmd0": [1.0]}, {"q": "q7"}, "q=q7: … 'q7'; … q0, qdot_cmd0"),
    "two logs": ({"t": [*range(40)] * 2, "q0": [1.0] * 80, "qdot_cmd0": [1.0] * 80}, {"t": "t s"}, "falls by 39 s …"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_log_is_refused_in_a_line(case):
    columns, mapping, text = REFUSED[case]
    with pytest.raises(rmrc.QuestionError) as caught:
        rmrc.identify(columns, columns=mapping)
    assert str(caught.value) == says(f"log: … {text}") and "\n" not in str(caught.value)
