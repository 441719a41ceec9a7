"""Questions about rows along the axes of the site or the base: they are those of the law."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rmrc
from project import ROOT
from rmrc.arm import load
from rmrc.law.task import choose

POINTING = ["x", "y", "z", "rx", "ry"]
# of MuJoCo's J and LAPACK against sums along the chain, in another order
ROUNDING = 1e-12


@pytest.fixture(scope="module")
def puma():
    return load(ROOT / "models/puma560.xml")


def test_a_scenario_is_asked_about_along_the_axes_of_its_task():
    spray = rmrc.load("spray_past_the_wrist")
    found, run = rmrc.inspect(spray), rmrc.run(spray)
    np.testing.assert_allclose(found.sigma, run["sigma"][0], rtol=0, atol=ROUNDING)
    assert (found.task.frame, found.frame) == ("site", "site")
    # rows that are named are along world axes, where the turn about the gun is no single row
    world = rmrc.inspect(spray, axes=POINTING)
    assert world.task.frame == "world" and np.abs(world.sigma - found.sigma).max() > 0.1


def test_what_is_lost_is_told_along_the_axes_of_the_site_and_kept_along_the_worlds(puma):
    q = np.array([0.3, -0.9, 3.4, 0.4, 0.0, 0.2])  # the wrist in line
    found = rmrc.inspect(puma, q, task_frame="site", length=1.0)
    (lost,) = found.lost
    assert np.abs(puma.jacobian(q).T @ lost.wrench).max() < 1e-6 * np.linalg.norm(lost.wrench)
    (same,) = rmrc.inspect(puma, q, length=1.0).lost
    assert abs(abs(lost.twist @ same.twist) - 1.0) < 1e-9  # all rows count: the same direction of the world
    R = Rotation.from_quat(np.roll(puma.pose(q)[3:], -1)).as_matrix()
    assert np.abs(np.kron(np.eye(2), R.T) @ lost.twist - lost.twist).max() > 0.1  # and another of the site


FACING = """<mujoco><worldbody><body euler="0 0 {turn}">
<joint name="pan" axis="0 0 1"/><geom size="0.03"/>
<body pos="0 0 0.1"><joint name="lift" axis="0 1 0"/><geom size="0.03"/>
<body pos="0.03 0 0.2"><joint name="elbow" axis="0 1 0"/><geom size="0.03"/>
<body pos="0.2 0 0"><joint name="pitch" axis="0 1 0"/><geom size="0.03"/><site name="tool" pos="0.1 0 0"/>
</body></body></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("turn", "axes"), [(0, "x y z ry"), (90, "x y z rx"), (180, "x y z ry")])
def test_a_pan_and_three_pitches_get_the_rotation_that_they_have_at_home(tmp_path, turn, axes):
    """Of a hand at home, J of the rows that are taken has full rank; with the other rotation it has not."""
    (tmp_path / "arm.xml").write_text(FACING.format(turn=turn))
    arm = load(tmp_path / "arm.xml")
    assert choose(arm).axes == tuple(axes.split())
    J = arm.jacobian(np.array([0.0, 0.1, 0.2, 0.3]))
    other = {"rx": "ry", "ry": "rx"}[axes.split()[-1]]
    assert np.linalg.cond(J[choose(arm, axes.split()).rows]) < 1e3
    assert np.linalg.cond(J[choose(arm, ["x", "y", "z", other]).rows]) > 1e12
