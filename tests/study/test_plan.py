"""A plan is a function of an index: the same run always, a grid in order, chance that can be told apart."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.study.runs import Plan, plan_of, sobol_point

values = st.lists(st.integers(-9, 9), min_size=1, max_size=4, unique=True).map(tuple)
plans = st.builds(
    lambda lists, draw, sampler, samples, repeat, seed: Plan(
        {f"v{i}": one for i, one in enumerate(lists)},
        {f"d{i}": (-1.0 - i, 2.0 + i) for i in range(draw)},
        sampler,
        samples if draw else 1,
        repeat,
        seed,
    ),
    st.lists(values, max_size=3), st.integers(0, 3), st.sampled_from(["random", "sobol"]),
    st.integers(1, 4), st.integers(1, 3), st.integers(0, 2**32),
)  # fmt: skip


@given(plans, st.randoms())
def test_runs_are_the_grid_times_samples_times_repeats_whatever_the_order_they_are_asked_in(plan, random):
    per_cell = plan.samples * plan.repeat
    grid = list(itertools.product(*plan.vary.values()))
    assert len(plan) == len(grid) * per_cell
    runs = [plan.values(i) for i in range(len(plan))]
    assert [tuple(run[key] for key in plan.vary) for run in runs] == [
        cell for cell in grid for _ in range(per_cell)
    ]
    shuffled = random.sample(range(len(plan)), len(plan))
    assert {i: plan.values(i) for i in shuffled} == dict(enumerate(runs))
    seeds = [plan.run_seed(i) for i in range(len(plan))]
    assert len(set(seeds)) == per_cell
    for i, run in enumerate(runs):
        assert seeds[i] == seeds[i % per_cell]
        assert tuple(run) == plan.keys
        for key, (low, high) in plan.draw.items():
            assert low <= run[key] <= high
            # the same draw in every cell, and in every repeat of a sample
            assert run[key] == runs[i % per_cell // plan.repeat * plan.repeat][key]


def test_sobol_points_are_those_of_scipy():
    from scipy.stats import qmc  # which takes a second to load

    known = qmc.Sobol(20, scramble=False, bits=32).random(512)
    np.testing.assert_array_equal([sobol_point(i, 20) for i in range(512)], known)


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_a_shift_keeps_every_box_filled_alike(seed):
    """A (0, 2)-sequence in base 2 has one of its first 64 points in each box of 1/64, whatever its sides."""
    points = np.array([sobol_point(i, 2, seed) for i in range(64)])
    for power in range(7):
        sides = np.array([2**power, 2 ** (6 - power)])
        assert len({tuple(box) for box in (points * sides).astype(int)}) == 64
    assert not np.array_equal(points, [sobol_point(i, 2) for i in range(64)])
    # negative control: chance leaves a third of the boxes empty
    chance = np.random.default_rng(seed).random((64, 2))
    assert len({tuple(box) for box in (chance * 8).astype(int)}) < 64


def test_the_plan_of_a_scenario(scenario):
    one = scenario(
        "arm.encoder={seed: 4, deviation: 0.01}",
        "sweep.vary.control.feedback=[5, 1.0e-5]",
        "sweep.draw.arm.start[0]=[30 deg, 60 deg]",
        "sweep.samples=2",
    )
    plan = plan_of(one)
    assert plan.vary == {"control.feedback": (5, 1e-5)}
    assert plan.draw == {"arm.start[0]": (np.radians(30), np.radians(60))}
    assert (plan.sampler, plan.samples, plan.repeat, plan.seed, len(plan)) == ("random", 2, 1, 4, 4)
    # 1e-5 would be a text in YAML 1.1
    assert str(plan.changes(2)[0]) == "control.feedback=1.0e-05"
    assert str(plan.changes(3)[-1]) == "arm.encoder.seed=5"
    assert plan_of(scenario("sweep={vary: {control.feedback: [5, 6]}, seed: 9}")).seed == 9
    repeated = plan_of(
        scenario("arm.encoder.seed=4", "plant.seed=7", "sweep={vary: {control.feedback: [5, 6]}, repeat: 2}")
    )
    assert [str(change) for change in repeated.changes(1)[-2:]] == ["plant.seed=8", "arm.encoder.seed=5"]
