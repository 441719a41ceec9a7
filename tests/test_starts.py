"""A run that starts in a pose of the site, outside its limits, or along the recording of another."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc.arm import load
from rmrc.scenario import StartPose
from rmrc.simulation.configuration import start_positions
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import ScenarioError, TargetError, heard_by
from rmrc.support.spatial import pose_error

PUMA = load(ROOT / "models/puma560.xml")
NEAR = np.array([0.3, -0.9, 3.0, 0.2, 0.9, 0.3])
ARM = ("arm.model=models/puma560.xml", "arm.site=tool", "arm.start=[0.3, -0.9, 3.0, 0.2, 0.9, 0.3]",
       "task.axes=[x, y, z, rx, ry, rz]", "plant.kind=ideal")  # fmt: skip
# What is promised of the search, in rad and in m over a length of 1 m.
FOUND = 1e-9


def start(**pose):
    return start_positions(PUMA, StartPose.model_validate(pose), NEAR, 1.0)


@pytest.mark.parametrize("seed", range(2))
def test_an_arm_starts_where_it_was_told_and_near_to_where_it_would(seed):
    q = NEAR + np.random.default_rng(seed).uniform(-0.15, 0.15, 6)
    pose = PUMA.pose(q)
    found = start(position=pose[:3].tolist(), orientation=pose[3:].tolist())
    assert np.linalg.norm(pose_error(PUMA.pose(found), pose)) < FOUND
    # σ_6 there is above 0.05, so that there is no other posture near
    assert_allclose(found, q, rtol=0, atol=1e-7)


def test_a_pose_out_of_reach_is_refused_with_how_far_it_is():
    with pytest.raises(
        TargetError, match=r"must be within reach, the nearest pose found is (\S+) m away"
    ) as caught:
        start(position=[3.0, 0.0, 0.5])
    away = float(str(caught.value).split("found is ")[1].split()[0])
    # the nearest of 2000 random postures is no nearer
    nearest = min(np.linalg.norm(PUMA.pose(q)[:3] - [3.0, 0, 0.5]) for q in PUMA.sampled(2000))
    assert 1.0 < away <= nearest


def test_a_scenario_starts_in_its_pose_and_names_the_key_of_one_that_cannot_be(scenario):
    pose = PUMA.pose(NEAR)[:3] + np.array([0.02, 0.03, -0.01])
    prepared = prepare(scenario(*ARM, f"arm.pose={{position: {pose.tolist()}}}"))
    assert_allclose(prepared.reference.pose[0, :3], pose, rtol=0, atol=FOUND)
    with pytest.raises(
        ScenarioError, match=r"arm\.pose: must be within reach, the nearest pose found is .* m away"
    ):
        prepare(scenario(*ARM, "arm.pose.position=[9, 0, 0]"))
    assert (prepare(scenario(*ARM)).qpos[PUMA.wiring.qpos] == NEAR).all()


PATH = "target.path=[{line: {by: [0.1, 0.05, -0.05], frame: site, turn: {axis: z, angle: 0.3}}}]"


@pytest.mark.parametrize("columns", ["pose_ref", "pose", "q"])
def test_a_run_is_a_target_of_another(simulate, tmp_path, columns):
    """Its reference leads to the same joint positions, but for the cubic splines between rows that are the ticks.

    The pose and the joints of a run lag behind its reference by 1e-4 at most here, and the replay as much again.
    """
    _, run = simulate(*ARM, PATH)
    run.save(tmp_path / "run.npz")
    limits = "target.limits={velocity: 1, acceleration: 20, angular_velocity: 5, angular_acceleration: 100}"
    file = f"target.path=[{{file: {{path: {tmp_path}/run.npz, columns: {columns}}}}}]"
    _, again = simulate(*ARM, file, limits)
    assert len(again) == len(run)
    assert_allclose(again["q"], run["q"], rtol=0, atol=1e-9 if columns == "pose_ref" else 2e-3)


# A start at a limit, and outside ---------------------------------------------------------------

SO101 = load(ROOT / "models/so101.xml")
LOWER = float(SO101.position_limit[1, 0])
HELD = ("arm.model=models/so101.xml", "arm.site=tool", "task.axes=[x, y, z]", "control.feedback=5",
        "control.limits.rate=2", "target.path=[{line: {by: [0.02, 0, 0.02]}}, {hold: {for: 1.5}}]")  # fmt: skip


def starting_at(position):
    return (*HELD, f"arm.start=[0, {position!r}, 0.5, 0.2, 0]")


@pytest.mark.parametrize("kind", ["ideal", "torque"])
def test_an_arm_that_starts_outside_its_limits_comes_back_and_is_told_of(simulate, kind):
    told = []
    with heard_by(told.append):
        _, run = simulate(*starting_at(LOWER - 0.05), f"plant.kind={kind}")
    (line,) = [text for text in told if "outside its limits" in text]
    assert line.startswith("warning: ") and 'joint "shoulder_lift" starts 0.05 rad outside' in line
    q, rates = run["q"][:, 1], run["qdot_cmd"][:, 1]
    assert q[0] == pytest.approx(LOWER - 0.05)
    back = int(np.argmax(q >= LOWER))
    # at 5/s towards a point 1 mrad inside the limit it takes ln(51)/5 s, and the plant's lag
    assert back > 0 and run["time"][back] < 0.9 and run.divergence is None
    # a servo's limit keeps a joint to 1 mrad
    assert (q[back:] >= LOWER - 1e-3).all() and (rates[:back] >= 0.0).all()
    # then the arm follows its target as from any start
    assert np.linalg.norm(run["pose_error"][-1, :3]) < 1e-3
