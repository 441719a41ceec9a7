"""What a scenario is checked for against its arm, and what is found out about both before anything moves."""

import numpy as np
import pytest

from chains import random_chain
from rmrc.arm import load
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import ScenarioError
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
REFUSED = {
    "second site": (
        (*SECOND, "control.nullspace.secondary.site=wirst"),
        'control.nullspace.secondary.site: … models/planar_3link.xml: … site "wirst" … "wrist"… wrist, tip',
    ),
    "a time that recordings cannot count": (
        ("plant.kind=ideal", "control.period=1.0e+9", LONG),
        "target.path: … 9 … 1e+09 s … 9e+09 s; … target.limits … control.period or control.slow.longest …",
    ),
    "start in degrees": (
        ("arm.start=[60, 0]",),
        'arm.start: arm.start[0]: … "shoulder" … [-2.96706, 2.96706] rad… 60; … 60 deg',
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_with_the_way_out(scenario, case):
    overrides, message = REFUSED[case]
    assert refusal(scenario, *overrides) == says(f"--set {message}" if message[0] != "…" else message)


def test_the_problems_of_all_steps_are_told_together(scenario):
    problems = refusal(
        scenario, "arm.start=nowhere", "plant.lag=[1]", "plant.stretch.link_9=2", "task.length=1.0e-31",
        "control.joint_weights=[1]", "control.limits.profile=ur5e", "arm.encoder.noise=1.0e+7",
    ).splitlines()  # fmt: skip
    assert {line.removeprefix("--set ").partition(":")[0] for line in problems} == {
        "arm.start", "plant.lag", "plant.stretch.link_9", "task.length", "control.joint_weights",
        "control.limits.profile", "arm.encoder.noise",
    }  # fmt: skip
