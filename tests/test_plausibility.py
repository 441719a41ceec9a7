"""What an arm can do bounds what it does, and values in another unit are told with what they should be."""

import numpy as np
import pytest

from chains import random_chain
from project import ROOT
from rmrc.arm import load
from rmrc.scenario import draft_of
from rmrc.simulation.plausibility import reach_of
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import ScenarioError, heard_by
from rmrc.support.shipped import shipped
from wording import says

# 100,000 random postures of six joints come within some percent of the farthest one, and of the published reach.
TIGHT = 0.85


def told(scenario, *overrides):
    lines = []
    with heard_by(lines.append):
        prepare(scenario(*overrides))
    return [line for line in lines if line.startswith("warning: ")]


def farthest(arm, center, count=2000):
    return max(np.linalg.norm(arm.pose(q)[:3] - center) for q in arm.sampled(count))


@pytest.mark.parametrize("seed", range(3))
def test_no_posture_of_a_random_arm_leads_beyond_its_reach(tmp_path, seed):
    path = tmp_path / "chain.xml"
    path.write_text(random_chain(seed, 5, ranges=True))
    arm = load(path, "tip")
    reach = reach_of(arm)
    assert farthest(arm, reach.center) <= reach.radius * (1 + 1e-9)


@pytest.mark.parametrize("model", ["ur5e", "stanford", "planar_3link", "so101"])
def test_the_reach_of_a_shipped_arm_bounds_its_postures_and_speeds_tightly(model):
    arm = load(shipped("models")[model])
    reach = reach_of(arm)
    assert TIGHT * reach.radius <= farthest(arm, reach.center) <= reach.radius
    rates = np.where(np.isfinite(arm.rate_limit), arm.rate_limit, 6.0)
    speeds = [np.abs(arm.jacobian(q)[:3] @ (rates * sign)).max() for q in arm.sampled(50) for sign in (1, -1)]
    assert max(speeds) <= reach.speed


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("target.path=[{line: {to: [2003, 0]}}]", "… target.path[0].line.to: … 2003 m … 2 m; … mm? write [2.003, 0.0]"),
        ("target={path: [{line: {to: [1, 0]}}], offset: [1000, 0]}", "… target.offset: … mm? write [1.0, 0.0]"),
    ],
)  # fmt: skip
def test_a_target_that_no_unit_but_millimeters_explains_is_refused(scenario, override, line):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario("task.axes=[x, y]", override))
    assert str(caught.value) == says(line)


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("target.limits.velocity=500", "… target.limits.velocity: 500 m/s, … mm/s? write 0.5"),
        ("control.period=1", "… control.period: 1 s, … 0.25; are these ms? write 0.001"),
    ],
)  # fmt: skip
def test_a_value_in_another_unit_is_told_and_runs(scenario, override, line):
    base = ("target.path=[{line: {by: [0.1, 0]}}]", "plant.timestep=null")
    (warning,) = told(scenario, *base, override)
    assert warning == says(line)


def test_a_coordinate_that_the_task_leaves_free_is_out_of_no_reach(scenario):
    path = "target.path=[{line: {to: [1.5, 1.9]}}]"
    assert told(scenario, "task.axes=[x]", path) == []
    (warning,) = told(scenario, "task.axes=[x, y]", path)
    assert "leads 2.421 m away" in warning


def test_nothing_is_told_of_shipped_scenarios_but_of_those_that_lead_far_beyond_reach():
    lines = []
    with heard_by(lines.append):
        for file in sorted((ROOT / "scenarios").glob("*.yaml")):
            prepare(draft_of(file).scenario())
    warned = {line.partition(".yaml")[0].rpartition("/")[2] for line in lines if line.startswith("warning")}
    assert warned <= {"beyond_reach", "stop_and_wait"}
