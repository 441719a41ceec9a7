"""Many configurations at once are what MuJoCo and numpy say of each, whatever the threads."""

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis import survey as surveys
from rmrc.analysis.survey import jacobians, survey
from rmrc.law.record import new_worlds
from rmrc.law.task import Task, choose
from screws import screw_chain

# Products of eight rotations with lengths of about 1 m.
ROUNDING = 1e-12


def check(arm, q):
    task = choose(arm)
    found, (position, J) = survey(task, q), jacobians(task, q)
    assert_array_equal(found.q, q)
    assert_array_equal(position, found.pose[:, :3])
    for i, positions in enumerate(q):
        pose = arm.pose(positions)
        assert_allclose(found.pose[i, :3], pose[:3], atol=ROUNDING)
        turn = Rotation.from_quat(found.pose[i, 3:], scalar_first=True)
        assert_allclose(
            turn.as_matrix(), Rotation.from_quat(pose[3:], scalar_first=True).as_matrix(), atol=ROUNDING
        )
        assert_allclose(J[i], arm.jacobian(positions), atol=ROUNDING * max(1.0, np.abs(J[i]).max()))
        sigma = np.linalg.svd(task.matrix(arm.jacobian(positions)), compute_uv=False)
        assert_allclose(found.sigma[i], sigma, atol=ROUNDING * max(1.0, sigma[0]))


@given(seeds)
def test_survey_of_any_chain_is_mujocos_kinematics_and_numpys_svd(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed))
    arm = arms.load(path)
    check(arm, arm.sampled(5, seed))


def test_survey_of_a_screw(tmp_path):
    path = tmp_path / "screw.xml"
    path.write_text(screw_chain())
    arm = arms.load(path)
    check(arm, arm.sampled(20))
    # Negative control: a screw without its pitch is seen.
    worlds = new_worlds(1, arm.n)
    choose(arm).write(worlds[0])
    worlds["chain"]["advance"] = 0.0
    pose, J = np.empty((1, 7)), np.empty((1, 6, arm.n))
    surveys.locate(worlds, np.array([[0.3, 0.5, 0.1]]), pose, J)
    assert np.abs(pose[0, :3] - arm.pose([0.3, 0.5, 0.1])[:3]).max() > 1e-3


def test_threads_change_no_bit(monkeypatch):
    arm = arms.load(ROOT / "models/stanford.xml")
    task, q = choose(arm), arm.sampled(1000)
    alone = survey(task, q, threads=1)
    monkeypatch.setattr(surveys, "SHARE", 2 * surveys.SIDE_BY_SIDE)
    shared = survey(task, q, threads=2)
    assert_array_equal(shared.pose, alone.pose)
    assert_array_equal(shared.sigma, alone.sigma)


def test_singular_values_are_numpys_of_any_size_and_near_singularities():
    arm = arms.load(ROOT / "models/stanford.xml")
    q = arm.sampled(100)  # not a multiple of the matrices that are decomposed side by side
    q[50:, 4] *= 10.0 ** -np.arange(0.0, 10.0, 0.2)
    for length in (1.0, 1e-70, 1e70):  # squares of either would leave the range
        task = choose(arm, None, 1.0) if length == 1.0 else Task(arm, np.arange(3), length)
        sigma = np.linalg.svd([task.matrix(arm.jacobian(one)) for one in q], compute_uv=False)
        assert_allclose(survey(task, q).sigma, sigma, atol=ROUNDING * sigma.max(), rtol=1e-12)
        # σ_min itself, of what is not rounding
        clear = sigma[:, -1] > 1e-6 * sigma[:, 0]
        assert_allclose(survey(task, q).sigma[clear, -1], sigma[clear, -1], rtol=1e-9)
    task = choose(arm, ["x"])  # and of a single row
    row = np.array([task.matrix(arm.jacobian(one)) for one in q])[:, 0]
    assert_allclose(survey(task, q).sigma[:, 0], np.linalg.norm(row, axis=1), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "axes"),
    [
        ("planar_2link", ("x", "y")),
        ("spherical_wrist", ("rx", "ry", "rz")),
        ("helical", ("x", "y", "z")),
        ("stanford", ("x", "y", "z", "rx", "ry", "rz")),
    ],
)
def test_a_task_is_what_the_arm_can_move_independently(name, axes):
    assert choose(arms.load(ROOT / f"models/{name}.xml")).axes == axes


WRIST = """<mujoco><compiler angle="radian"/><worldbody><body pos="1 1.25 .15" euler="{turn} 0 0">
<joint name="j1" axis="0 1 0" range="-.5 .14"/><geom size=".02"/><body pos="0 0 {size}">
<joint name="j2" axis="1 0 0" range="-.7 .5"/><geom size=".02"/><site name="palm"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("size", [0.034, 1e-4])
@pytest.mark.parametrize("turn", [np.pi / 2, 1.5708, 1.57, 1.571])
def test_rounding_of_a_file_gives_no_rows(tmp_path, turn, size):
    """Its first axis is vertical, so that ry is the second's alone, as rx is, but for the rounding of π/2."""
    path = tmp_path / "wrist.xml"
    path.write_text(WRIST.format(turn=turn, size=size))
    assert choose(arms.load(path)).axes == ("rx", "rz")
    path.write_text(WRIST.format(turn=1.55, size=size))  # what is more is meant
    assert choose(arms.load(path)).axes == ("rx", "ry")
