"""What a scenario is checked for against its arm, and what is found out about both before anything moves."""

import numpy as np
import pytest

from chains import random_chain
from rmrc.analysis.task import structural_rank
from rmrc.arm import load
from rmrc.errors import ScenarioError
from rmrc.preparation import prepare, world_record
from screws import screw_chain

THREE = ("arm.model=models/planar_3link.xml", "arm.start=home")
SECOND = (*THREE, "control.nullspace.objective=secondary")


def refusal(scenario, *overrides):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(*overrides))
    return str(caught.value)


@pytest.mark.parametrize(
    ("overrides", "rank"),
    [
        (("task.axes=[x, y]",), 2),
        (("task.axes=[x, y, z]",), 2),  # a planar arm never moves along z
        (("task.axes=[x, y, z, rx, ry, rz]",), 2),  # two joints
        ((*THREE, "task.axes=[x, y, z, rx, ry, rz]"), 3),
        (("arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]"), 6),
    ],
)  # fmt: skip
def test_the_rank_of_a_task_is_that_of_almost_all_configurations(scenario, overrides, rank):
    assert world_record(prepare(scenario(*overrides)), 0)["rank"] == rank


def test_a_singular_start_does_not_lower_the_rank(scenario):
    arm = prepare(scenario()).arm
    assert np.linalg.matrix_rank(arm.jacobian([0.3, 0.0])[:2]) == 1  # the arm is stretched
    assert structural_rank(arm, np.array([0, 1]), np.ones(2), np.ones(2)) == 2
    stretched = prepare(scenario("arm.start=[0.3, 0]", "target.path=[{hold: {for: 0.1}}]"))
    assert world_record(stretched, 0)["rank"] == 2


@pytest.mark.parametrize("seed", range(8))
def test_a_site_is_moved_by_the_joints_whose_turning_changes_its_pose(tmp_path, seed):
    path = tmp_path / "chain.xml"
    path.write_text(random_chain(seed, 5, ranges=True))
    arm = load(path, "tip")
    assert set(arm.sites) == {"tip", "middle"}
    q = np.full(5, 0.1)
    turned = [np.abs(arm.pose(q + step, "middle") - arm.pose(q, "middle")).max() for step in 0.2 * np.eye(5)]
    assert arm.moves("middle").tolist() == [change > 1e-6 for change in turned]
    assert not arm.moves("middle").all()  # joints behind it do not
    assert arm.moves("tip").all()


def test_a_second_task_finds_its_site_in_the_model_that_is_stepped(scenario):
    # Site numbers are those of the author's model; adapting it must not change them.
    prepared = prepare(scenario(*SECOND, "control.nullspace.secondary={site: wrist, axes: [y], to: [0.3]}"))
    world, plant = world_record(prepared, 0), prepared.scenario.plant
    adapted = prepared.arm.adapted(plant.kind, prepared.kv, plant.timestep, plant.gravity_compensation)
    assert adapted.site(int(world["site_2"])).name == "wrist"
    assert world["pose_ref_2"][1] == 0.3
    start = prepared.arm.pose(prepared.qpos[prepared.arm.wiring.qpos], "wrist")
    np.testing.assert_array_equal(world["pose_ref_2"][[0, 2]], start[[0, 2]])


def test_a_second_task_that_cannot_be_is_refused(scenario):
    problem = refusal(scenario, *SECOND, "control.nullspace.secondary.site=wirst")
    assert problem.startswith("--set control.nullspace.secondary.site: ")
    assert problem.endswith(
        'models/planar_3link.xml: has no site "wirst"; did you mean "wrist"?; its sites: wrist, tip'
    )


def test_computed_torque_is_refused_for_a_screw(scenario, tmp_path):
    path = tmp_path / "screw.xml"
    path.write_text(screw_chain())
    shared = (f"arm.model={path}", "arm.start=home", "task.axes=[x, y, z]")
    assert refusal(scenario, *shared, "plant.kind=torque") == (
        f'--set plant.kind: "torque" knows no screw joints, and joint "screw" of {path} is one; take "servo"'
    )


def test_slow_is_refused_without_what_it_scales(scenario):
    assert refusal(scenario, "control.at_singularity=slow", "control.feedforward=false") == (
        '--set control.at_singularity: "slow" scales the feed-forward, so it needs control.feedforward: true, got false'
    )


def test_lists_of_the_new_keys_must_have_a_value_a_joint(scenario):
    lines = refusal(
        scenario, "control.nullspace={objective: rates, rates: [1]}", "control.limits.acceleration=[1]",
        "control.limits.braking=[1, 2, 3]",
    ).splitlines()  # fmt: skip
    keys = ("control.nullspace.rates", "control.limits.acceleration", "control.limits.braking")
    assert [line.split(": must have 2 values")[0].removeprefix("--set ") for line in lines] == [
        "control.nullspace: control.nullspace.rates", *keys[1:],
    ]  # fmt: skip
