"""What a scenario is checked for against its arm, and what is found out about both before anything moves."""

import re

import mujoco
import numpy as np
import pytest

from chains import random_chain
from project import ROOT
from rmrc.arm import load
from rmrc.law.record import new_worlds
from rmrc.law.sight import look_at
from rmrc.law.task import Task
from rmrc.simulation.prepare import Cache, prepare
from rmrc.support.errors import ScenarioError
from rmrc.support.notices import heard_by
from wording import says

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
    assert prepare(scenario(*overrides)).task.rank == rank


def test_a_singular_start_does_not_lower_the_rank(scenario):
    arm = prepare(scenario()).arm
    assert np.linalg.matrix_rank(arm.jacobian([0.3, 0.0])[:2]) == 1  # the arm is stretched
    assert Task(arm, np.array([0, 1])).rank == 2
    stretched = prepare(scenario("arm.start=[0.3, 0]", "target.path=[{hold: {for: 0.1}}]"))
    assert stretched.task.rank == 2


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
    prepared = prepare(scenario(*SECOND, "control.nullspace.secondary={site: wrist, axes: [y], to: [0.3]}"))
    (world,), adapted = new_worlds(1, prepared.arm.n), prepared.plant.model()
    prepared.law.write(world)
    second = world["second"]
    look_at(world, mujoco.MjData(adapted), prepared.arm, prepared.law.second)
    assert adapted.site(int(world["engine"]["site_at"][1])).name == "wrist"
    assert second["pose_ref"][1] == 0.3
    start = prepared.arm.pose(prepared.qpos[prepared.arm.wiring.qpos], "wrist")
    np.testing.assert_array_equal(second["pose_ref"][[0, 2]], start[[0, 2]])


def test_a_second_task_that_cannot_be_is_refused(scenario):
    problem = refusal(scenario, *SECOND, "control.nullspace.secondary.site=wirst")
    place = "--set control.nullspace.secondary.site: … models/planar_3link.xml"
    assert problem == says(f'{place}: … site "wirst" … "wrist"… wrist, tip')


def test_slow_is_refused_without_what_it_scales(scenario):
    told = says('--set control.at_singularity: "slow" … control.feedforward: true … false')
    assert refusal(scenario, "control.at_singularity=slow", "control.feedforward=false") == told


def test_lists_of_the_new_keys_must_have_a_value_a_joint(scenario):
    lines = refusal(
        scenario, "control.nullspace={objective: rates, rates: [1]}", "control.limits.acceleration=[1]",
        "control.limits.braking=[1, 2, 3]", "control.limits.jerk=[5000]",
    ).splitlines()  # fmt: skip
    counts = {
        "nullspace: control.nullspace.rates": 1, "limits.acceleration": 1, "limits.jerk": 1, "limits.braking": 3,
    }  # fmt: skip
    assert lines == [says(f"--set control.{key}: … 2 … {count}") for key, count in counts.items()]


@pytest.mark.parametrize(
    ("overrides", "refused"),
    [
        (("control.period=1.0e+9", "target.path=[{hold: {for: 6.0e+9}}]"), ""),
        (("control.period=1.0e+9", "target.path=[{hold: {for: 8.0e+9}}]"), "9 … 1e+09 s"),
        (("control.period=1.0e+300", "target.path=[{hold: {for: 1}}]"), "2 … 1e+300 s"),
        (
            ("control.period=1.0e+8", "target.path=[{hold: {for: 6.0e+9}}]", "control.at_singularity=slow", "control.limits.rate=1"),
            "610 … 1e+08 s",
        ),
    ],
)  # fmt: skip
def test_a_run_that_recordings_cannot_count_is_refused(scenario, overrides, refused):
    if not refused:
        prepared = prepare(scenario("plant.kind=ideal", *overrides))
        last = np.timedelta64(round(prepared.reference.ticks * prepared.reference.period * 1e9), "ns")
        assert last / np.timedelta64(1, "s") == 7e9  # seven ticks, and no wrap around
        return
    told = f"--set target.path: … {refused} … 9e+09 s; … target.limits … control.period or control.slow.longest …"
    assert refusal(scenario, "plant.kind=ideal", *overrides) == says(told)


@pytest.mark.parametrize("key", ["task.length", "task.weights[1]", "control.joint_weights[0]"])
@pytest.mark.parametrize(
    ("value", "shown"), [("5.0e-324", "4.94066e-324"), ("1.0e-31", "1e-31"), ("1.0e+300", "1e+300")]
)
def test_scales_whose_squares_are_not_finite_are_refused(scenario, key, value, shown):
    given = {"task.length": "{}", "task.weights[1]": "[1, {}]", "control.joint_weights[0]": "[{}, 1]"}[key]
    place = key.partition("[")[0]
    where = f"--set {place}" if key == place else f"--set {place}: {key}"
    override = f"{place}={given}"
    assert refusal(scenario, override.format(value)) == says(f"{where}: … 1e-30 and 1e+30 … {shown}")
    for bound in ("1.0e-30", "1.0e+30"):
        prepared = prepare(scenario(override.format(bound)))
        scaled = prepared.task.matrix(prepared.arm.jacobian([0.3, 0.4]))
        assert np.isfinite(scaled**2).all()
        assert prepared.task.rank in (1, 2)


def test_an_ideal_plant_has_any_period(scenario):
    still = ("plant.kind=ideal", "target.path=[{hold: {for: 1}}]")
    prepared = prepare(scenario(*still, "control.period=1.0e+8", "plant.timestep=5.0e-324"))
    assert prepared.plant.substeps == 0
    assert refusal(scenario, *still, "control.period=1.7976931348623157e+308") == says("… 9e+09 s; …")


@pytest.mark.parametrize("kind", ["servo", "torque"])
def test_a_step_in_which_nothing_moves_is_refused(scenario, kind):
    short = (
        f"plant.kind={kind}",
        "target.path=[{hold: {for: TIME}}]",
        "control.period=TIME",
        "plant.timestep=TIME",
    )
    assert prepare(scenario(*(one.replace("TIME", "1.0e-12") for one in short))).plant.substeps == 1
    told = refusal(scenario, *(one.replace("TIME", "1.0e-310") for one in short))
    assert told == says("--set plant.timestep: … 1e-12 s … 1e-310 s")


def test_more_steps_than_a_number_holds_are_refused(scenario):
    # The quotient is a whole number below 1.8e308, but not its product with the ticks.
    steps = ("control.period=1.0e-16", "plant.timestep=1.0e-320", "target.path=[{hold: {for: 1.0e-10}}]")
    assert refusal(scenario, *steps) == says("--set plant.timestep: … inf … 9.99989e-321 s …")


@pytest.mark.parametrize("name", ["offset", "deviation"])
@pytest.mark.parametrize(
    ("value", "is_refused"), [("1.0e+6", False), ("1.7e+308", True), ("[0, 1.1e+6]", True)]
)
def test_an_encoder_that_is_off_beyond_sense_is_refused(scenario, name, value, is_refused):
    # drawn offsets would be infinite
    override = f"arm.encoder.{name}={value}"
    if is_refused:
        assert refusal(scenario, override) == says(f"--set arm.encoder.{name}… ±1e+06 rad or m … 1.…")
    else:
        assert np.isfinite(prepare(scenario(override)).hardware.encoders.offset).all()


@pytest.mark.parametrize(
    ("start", "refused"),
    [
        ("[1]", "--set arm.start: … 2 … (shoulder, elbow) … 1"),
        ("hom", '--set arm.start: … "hom"… keyframes: …'),
        ("zero", "--set arm.start: … [0, 0] … zero"),
        ("30 deg", "--set arm.start: … [30 deg, 30 deg] …"),
        ("[400, 0]", '--set arm.start: arm.start[0]: … "shoulder" … [-2.96706, 2.96706] rad… 400'),
        ("[60, 0]", '--set arm.start: arm.start[0]: … "shoulder" … [-2.96706, 2.96706] rad… 60; … 60 deg'),
    ],
)
def test_a_start_that_cannot_be_is_refused_with_the_way_out(scenario, start, refused):
    assert refusal(scenario, f"arm.start={start}") == says(refused)


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
    keys = {line.removeprefix("--set ").partition(":")[0] for line in problems}
    assert keys == {
        "arm.start", "plant.lag", "plant.stretch.link_9", "task.length", "control.joint_weights",
        "control.limits.profile", "arm.encoder.noise",
    }  # fmt: skip


def test_variants_share_what_they_have_in_common(scenario):
    cache = Cache()
    first, other, moved = (
        prepare(scenario(override), cache)
        for override in ("control.feedback=1", "control.feedback=2", "arm.start=[0.5, -1]")
    )
    assert other.arm is first.arm and other.task is first.task and other.reference is first.reference
    assert moved.arm is first.arm and moved.task is first.task and moved.reference is not first.reference
