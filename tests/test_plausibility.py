"""What an arm can do bounds what it does, and values in another unit are told with what they should be."""

import numpy as np
import pytest

from chains import random_chain
from project import ROOT
from rmrc.arm import load
from rmrc.scenario import draft_of
from rmrc.simulation.plausibility import reach_of
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import ScenarioError
from rmrc.support.notices import heard_by
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


@pytest.mark.parametrize("seed", range(6))
def test_no_posture_of_a_random_arm_leads_beyond_its_reach(tmp_path, seed):
    path = tmp_path / "chain.xml"
    path.write_text(random_chain(seed, 5, ranges=True))
    arm = load(path, "tip")
    reach = reach_of(arm)
    assert farthest(arm, reach.center) <= reach.radius * (1 + 1e-9)


@pytest.mark.parametrize("model", ["ur5e", "puma560", "stanford", "planar_3link", "fr3", "so101"])
def test_the_reach_of_a_shipped_arm_bounds_its_postures_and_speeds_tightly(model):
    arm = load(shipped("models")[model])
    reach = reach_of(arm)
    assert TIGHT * reach.radius <= farthest(arm, reach.center) <= reach.radius
    rates = np.where(np.isfinite(arm.rate_limit), arm.rate_limit, 6.0)
    speeds = [np.abs(arm.jacobian(q)[:3] @ (rates * sign)).max() for q in arm.sampled(50) for sign in (1, -1)]
    assert max(speeds) <= reach.speed


def test_an_arm_on_an_endless_slide_has_no_end_and_one_that_only_turns_none_either(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body><joint name="s" type="slide"/><geom size="1"/><body><joint name="h"/>'
        '<geom size="1"/><site name="tip" pos="1 0 0"/><site name="hub"/></body></body></worldbody></mujoco>'
    )
    assert reach_of(load(path, "tip")).radius == np.inf
    assert reach_of(load(path, "hub", joints=["h"])).radius == np.inf


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("target.path=[{line: {to: [2003, 0]}}]", "… target.path[0].line.to: … 2003 m … 2 m; … mm? write [2.003, 0.0]"),
        ("target.path=[{set: {by: [500, 0], for: 1}}]", "… target.path[0].set.by: … mm? write [0.5, 0.0]"),
        ("target.path=[{arc: {center: [100, 0], angle: 3}}]", "… target.path[0].arc.center: … mm? write [0.1, 0.0]"),
        ("target={path: [{line: {to: [1, 0]}}], offset: [1000, 0]}", "… target.offset: … mm? write [1.0, 0.0]"),
    ],
)  # fmt: skip
def test_a_target_that_no_unit_but_millimeters_explains_is_refused(scenario, override, line):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario("task.axes=[x, y]", override))
    assert str(caught.value) == says(line)


def test_a_recorded_motion_in_millimeters_is_refused_with_the_way_out(scenario, tmp_path):
    rows = [f"{0.02 * i},{1000 + 100 * np.sin(0.02 * i)},{500},0,1,0,0,0" for i in range(100)]
    (tmp_path / "motion.csv").write_text("\n".join(["t,x,y,z,qw,qx,qy,qz", *rows]))
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(f"target.path=[{{file: {{path: {tmp_path}/motion.csv}}}}]"))
    assert str(caught.value) == says(
        "… target.path[0].file: … 2 m; are these mm? name its columns x_mm, y_mm and z_mm"
    )


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("target.path=[{line: {to: [2,003, 0.0]}}]", "… target.path[0].line.to: … 3.606 m … 2 m"),
        ("target.limits.velocity=500", "… target.limits.velocity: 500 m/s, … mm/s? write 0.5"),
        ("control.limits.rate=180", "… control.limits.rate: 180 rad/s, … 5; are these deg/s? write 180 deg/s"),
        ("control.period=1", "… control.period: 1 s, … 0.25; are these ms? write 0.001"),
        ("plant.payload=5000", "… plant.payload: 5000 kg, … g? write 5"),
        ("plant.delay=0.6", "… plant.delay: 0.6 s, … ms? write 0.0006"),
        ("plant.lag=[0.01, 9]", "… plant.lag[1]: 9 s, … ms? write 0.009"),
        ("arm.encoder.noise=0.1", "… arm.encoder.noise: 0.1 rad, … deg? write 0.1 deg"),
        ("target.path=[{line: {by: [0.1, 0], turn: {axis: z, angle: 90}}}]", "… target.path[0].line.turn.angle: 90 rad … write 90 deg"),
    ],
)  # fmt: skip
def test_a_value_in_another_unit_is_told_and_runs(scenario, override, line):
    base = ("target.path=[{line: {by: [0.1, 0]}}]", "plant.timestep=null")
    (warning,) = told(scenario, *base, override)
    assert warning == says(line)


def test_nothing_is_told_of_shipped_scenarios_but_of_those_that_lead_far_beyond_reach():
    lines = []
    with heard_by(lines.append):
        for file in sorted((ROOT / "scenarios").glob("*.yaml")):
            prepare(draft_of(file).scenario())
    warned = {line.partition(".yaml")[0].rpartition("/")[2] for line in lines if line.startswith("warning")}
    assert warned <= {"beyond_reach", "stop_and_wait"}
