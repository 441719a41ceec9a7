"""The verdict on settings: limits against figures, dominance against its definition, and what decides."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.results.columns import Divergence
from rmrc.results.scorecard import Figure
from rmrc.tuning.space import Setting, Structure, all_structures
from rmrc.tuning.trials import Limits, Outcome, Point, dominates, front, worst
from rmrc.tuning.verdict import Trial, best, judge

# few values, so that ties are frequent
numbers = st.sampled_from([1.0, 1.5, 2.0, 3.0])
points = st.lists(st.builds(Point, numbers, numbers, numbers), max_size=14)


def beats(a, b):
    """The definition: no worse in rate and error, and better in one; or equal in both, and shorter."""
    no_worse = a.peak_rate <= b.peak_rate and a.error <= b.error
    better = a.peak_rate < b.peak_rate or a.error < b.error
    return no_worse and (better or a.time < b.time)


@given(points)
def test_the_front_is_what_nothing_beats(some):
    nothing_beats = [i for i, b in enumerate(some) if not any(beats(a, b) for a in some)]
    assert front(some) == sorted(nothing_beats, key=lambda i: (some[i], i))
    assert all(dominates(a, b) == beats(a, b) for a in some for b in some)


# A hinge and a slide on a task of 0.5 m.
LIMITS = Limits(
    ("arm", "rail"), np.array([1.0, 0.5]), 0.5, np.array([2.0, 1.0]), np.array([math.inf, 4.0]),
    np.array([100.0, math.inf]),
)  # fmt: skip
GOOD = {"position_error.max": 0.1, "orientation_error.max": 0.3, "joint_rate.arm.peak": 1.5, "joint_rate.rail.peak": 0.9,
        "joint_acceleration.rail.peak": 2.0, "duration": 3.0, "completed": 1.0, "chatter": 0.0,
        "joint_acceleration_cmd.rms": 1.2, "joint_jerk_cmd.peak": 50.0, "joint_jerk_cmd.peak_joint": "arm",
        "torque_limited.time": 0.0, "profile.refused": math.nan}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "divergence", "excess", "missed"),
    [
        ({}, None, 3.0 / 3.3 - 1, "duration is 3 s, and 3.3 is allowed"),
        ({"joint_rate.arm.peak": 2.019}, None, 2.019 / 2.02 - 1, "joint_rate.arm.peak is 2.019 s, and 2 is allowed"),
        ({"joint_acceleration.rail.peak": 8.08}, None, 1.0,
         "joint_acceleration.rail.peak is 8.08 s, and 4 is allowed"),
        ({"completed": 0.8}, None, 0.25, "80% of the path is completed in 3 s"),
        ({"joint_jerk_cmd.peak": 202.0}, None, 1.0, "joint_jerk_cmd.peak is 202 s, and 100 is allowed"),
        ({"torque_limited.time": 0.06}, None, 1.0, "torque_limited.time is 0.06 s, and 0.03 is allowed"),
        ({"profile.refused": 2.0}, None, 2.0, "the profile refuses 2 commands"),
        ({}, Divergence(1, 0.1, "rail", "not finite"), math.inf, "it diverged"),
    ],
)  # fmt: skip
def test_what_is_measured_is_held_against_each_limit(changed, divergence, excess, missed):
    def card(changed):
        return {name: Figure(value, "s", "") for name, value in (GOOD | changed).items()}

    out = LIMITS.measure(card(changed), 3.3, divergence)
    rates = changed.get("joint_rate.arm.peak", 1.5), changed.get("joint_rate.rail.peak", 0.9) / 0.5
    assert (out.error, out.peak_rate) == (0.15, max(rates))  # 0.3 rad on 0.5 m; the slide over 0.5 m
    assert out.excess == pytest.approx(excess, abs=1e-8)
    assert out.missed.startswith(missed)
    # of several runs, the worst of each figure counts, and what is exceeded most
    least = LIMITS.measure(card({"duration": 1.0}), 9.0)
    assert worst([least, out])[2:] == worst([out, least])[2:] == out[2:]
    # one that was ended misses no part of its path
    early = LIMITS.measure(card({"completed": 0.3, "duration": 1.0}), 3.3, ended=True)
    assert early.excess < 0 and not Trial(own("jparse"), {0: early}).keeps_limits


def own(method, number=1.0, policy="damp"):
    structure = Structure(method, "constant" if method == "damped" else "", policy)
    return Setting(structure, (number,) * len(structure.keys))


def tried(setting, error, rate, excess=-1.0, condition=0.0):
    return Trial(setting, {0: Outcome(error, rate, 1.0, 1.0, excess, "", condition=condition)})


def test_the_verdict_is_the_least_error_then_the_most_feedback_then_the_simplest():
    written = tried(own("filtered"), 5.0, 5.0)
    a, b = tried(own("jparse", 2.0), 1.0, 3.0), tried(own("jparse", 5.0), 1.009, 2.0)
    c, d = tried(own("jparse", 5.0, policy="stop"), 1.009, 2.0), tried(own("filtered", 2.0), 1.2, 2.1)
    verdict = judge([written, a, c, b, d], [written, a, c, b, d], written)
    assert (
        verdict.recommended is b
    )  # 0.9 % more error, more feedback; as good as the one that stops, and simpler
    assert (verdict.second, verdict.better, verdict.decided) == (d, b, "error")
    assert [trial.worst[:2] for trial in verdict.front] == [(1.009, 2.0), (1.0, 3.0)]
    assert judge([written, a], [written, a], tried(own("filtered"), 0.5, 0.5)).better is None
    near, far = tried(own("jparse"), 1.0, 1.0, 0.2), tried(own("filtered"), 1.0, 1.0, 0.3)
    assert judge([], [far, near], far).nearest is near
    strong, weak = (tried(own("jparse", feedback), 1.0, 2.0) for feedback in (40.0, 30.0))
    assert best([strong, weak]) is strong
    assert best([strong, tried(own("jparse", 30.0), 0.97, 2.0)]) is not strong  # 3 % of error are not alike
    # no more than has a margin of 2: of the two, the smaller error counts
    better = tried(own("jparse", 30.0), 0.999, 2.0)
    assert (best([strong, better]), best([strong, better], enough=20.0)) == (strong, better)
    assert len(set(all_structures(("damp", "slow", "stop")))) == 3 * (7 + 5) + 5


def test_of_equal_largest_errors_the_end_decides_and_then_the_scenario_itself():
    written = tried(own("filtered"), 5.0, 5.0)
    far, near = (tried(own("jparse", feedback), 1.0, 2.0) for feedback in (40.0, 30.0))
    for trial, end in ((written, 1e-3), (far, 0.9e-3), (near, 0.7e-3)):
        trial.outcomes[0] = trial.outcomes[0]._replace(end=(end, 0.0))
    assert best([far, near], written) is near and best([far, near]) is far
    # the largest error is that of another scenario; on the scenario itself one has 3 % less
    for trial, error in ((far, 0.5), (near, 0.485)):
        trial.outcomes[1] = trial.outcomes[0]
        trial.outcomes[0] = trial.outcomes[0]._replace(error=error)
    assert best([far, near]) is near


def test_a_plain_inverse_is_recommended_near_a_singularity_only_where_nothing_else_is_left():
    damped = tried(own("damped"), 1.5, 1.0, condition=400.0)
    others = [tried(own(name), 1.0, 1.0, condition=400.0) for name in ("pseudoinverse", "inverse")]
    verdict = judge([damped, *others], [damped, *others], damped)
    assert (verdict.recommended, verdict.second) == (damped, others[0])
    assert best(others) is others[0]
    far = tried(own("pseudoinverse"), 1.0, 1.0, condition=90.0)
    assert best([damped, far]) is far  # negative control: no singularity is near
