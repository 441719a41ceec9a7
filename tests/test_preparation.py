"""What a scenario is checked for against its arm, and what is found out about both before anything moves."""

import re

import numpy as np
import pytest

from chains import random_chain
from project import ROOT
from rmrc.arm import load
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import ScenarioError
from rmrc.support.notices import heard_by
from wording import says

THREE = ("arm.model=models/planar_3link.xml", "arm.start=home")
SECOND = (*THREE, "control.nullspace.objective=secondary")
SIX = "task.axes=[x, y, z, rx, ry, rz]"


def refusal(scenario, *overrides):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(*overrides))
    return str(caught.value)


@pytest.mark.parametrize(
    ("overrides", "rank"),
    [
        (("task.axes=[x, y, z]",), 2),  # a planar arm never moves along z
        ((SIX,), 2),  # two joints
        ((*THREE, SIX), 3),
        (("arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", SIX), 6),
        (("arm.start=[0.3, 0]", "target.path=[{hold: {for: 0.1}}]"), 2),  # stretched, where J has rank 1
    ],
)
def test_the_rank_of_a_task_is_that_of_almost_all_configurations(scenario, overrides, rank):
    assert prepare(scenario(*overrides)).task.rank == rank


@pytest.mark.parametrize("seed", range(3))
def test_a_site_is_moved_by_the_joints_whose_turning_changes_its_pose(tmp_path, seed):
    path = tmp_path / "chain.xml"
    path.write_text(random_chain(seed, 5, ranges=True))
    arm = load(path, "tip")
    q = np.full(5, 0.1)
    turned = [np.abs(arm.pose(q + step, "middle") - arm.pose(q, "middle")).max() for step in 0.2 * np.eye(5)]
    assert arm.moves("middle").tolist() == [change > 1e-6 for change in turned]
    assert not arm.moves("middle").all() and arm.moves("tip").all()  # joints behind it do not


STILL = ("plant.kind=ideal", "target.path=[{hold: {for: 1}}]")
LONG = "target.path=[{hold: {for: 8.0e+9}}]"
TINY = ("control.period=1.0e-310", "plant.timestep=1.0e-310", "target.path=[{hold: {for: 1.0e-310}}]")
REFUSED = {
    "second site": (
        (*SECOND, "control.nullspace.secondary.site=wirst"),
        'control.nullspace.secondary.site: … models/planar_3link.xml: … site "wirst" … "wrist"… wrist, tip',
    ),
    "nothing to slow": (
        ("control.at_singularity=slow", "control.feedforward=false"),
        'control.at_singularity: "slow" … control.feedforward: true … false',
    ),
    "rates": (
        ("control.nullspace={objective: rates, rates: [1]}",),
        "control.nullspace: control.nullspace.rates: … 2 … 1",
    ),
    "braking": (("control.limits.braking=[1, 2, 3]",), "control.limits.braking: … 2 … 3"),
    "a time that recordings cannot count": (
        ("plant.kind=ideal", "control.period=1.0e+9", LONG),
        "target.path: … 9 … 1e+09 s … 9e+09 s; … target.limits … control.period or control.slow.longest …",
    ),
    "length": (("task.length=5.0e-324",), "task.length: … 1e-30 and 1e+30 … 4.94066e-324"),
    "weight": (("task.weights=[1, 1.0e+300]",), "task.weights: task.weights[1]: … 1e-30 and 1e+30 … 1e+300"),
    "period": ((*STILL, "control.period=1.7976931348623157e+308"), "… 9e+09 s; …"),
    "step": (TINY, "plant.timestep: … 1e-12 s … 1e-310 s"),
    "start in degrees": (
        ("arm.start=[60, 0]",),
        'arm.start: arm.start[0]: … "shoulder" … [-2.96706, 2.96706] rad… 60; … 60 deg',
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_with_the_way_out(scenario, case):
    overrides, message = REFUSED[case]
    assert refusal(scenario, *overrides) == says(f"--set {message}" if message[0] != "…" else message)


@pytest.mark.parametrize("bound", ["1.0e-30", "1.0e+30"])
@pytest.mark.parametrize(
    "override", ["task.length={}", "task.weights=[1, {}]", "control.joint_weights=[{}, 1]"]
)
def test_scales_up_to_the_bounds_give_finite_numbers(scenario, override, bound):
    prepared = prepare(scenario(override.format(bound)))
    assert np.isfinite(prepared.task.matrix(prepared.arm.jacobian([0.3, 0.4])) ** 2).all()
    assert prepared.task.rank in (1, 2)


def test_an_ideal_plant_has_any_period(scenario):
    prepared = prepare(scenario(*STILL, "control.period=1.0e+8", "plant.timestep=5.0e-324"))
    assert prepared.plant.substeps == 0


def test_a_start_that_may_be_in_degrees_is_doubted(scenario, tmp_path):
    free = (ROOT / "models/planar_2link.xml").read_text().replace("common/", f"{ROOT}/models/common/")
    (tmp_path / "free.xml").write_text(re.sub(r' range="[^"]*"', "", free))
    told = []
    with heard_by(told.append):
        prepare(scenario(f"arm={{model: {tmp_path}/free.xml, site: tip, start: [60, 1]}}"))
    assert told == [says("warning: --set arm: arm.start[0]: 60 rad … 9.55 turns; … 60 deg")]


def test_the_problems_of_all_steps_are_told_together(scenario):
    problems = refusal(
        scenario, "arm.start=nowhere", "plant.lag=[1]", "plant.stretch.link_9=2", "task.length=1.0e-31",
        "control.joint_weights=[1]", "control.limits.profile=ur5e", "arm.encoder.noise=1.0e+7",
    ).splitlines()  # fmt: skip
    assert {line.removeprefix("--set ").partition(":")[0] for line in problems} == {
        "arm.start", "plant.lag", "plant.stretch.link_9", "task.length", "control.joint_weights",
        "control.limits.profile", "arm.encoder.noise",
    }  # fmt: skip
