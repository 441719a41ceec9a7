"""Four routes to one Jacobian agree for every arm, and a fault in one of them is seen."""

import numpy as np
import pytest
from hypothesis import given

from chains import random_chain, seeds
from rmrc import arm as arms
from rmrc.analysis import singularities
from rmrc.analysis.singularities import jacobians, link_transforms
from rmrc.support.spatial import quat_to_matrix
from screws import screw_chain

# Products of ten rotations with lengths of about 1 m; and central differences, see DIFFERENCE_STEP.
ROUNDING, DIFFERENCES = 1e-12, 1e-8


def differences(arm, q):
    found = jacobians(arm, q)
    scale = max(1.0, np.abs(found["mujoco"]).max())
    return {name: np.abs(J - found["mujoco"]).max() / scale for name, J in found.items()}


def agree(arm, q):
    by = differences(arm, q)
    assert by["screws"] < ROUNDING and by["propagation"] < ROUNDING and by["differences"] < DIFFERENCES, by


@pytest.fixture
def screw(tmp_path):
    path = tmp_path / "screw.xml"
    path.write_text(screw_chain())
    return arms.load(path)


@given(seeds)
def test_routes_agree_for_any_chain(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed))
    arm = arms.load(path)
    (q,) = arm.sampled(1, seed)
    agree(arm, q)
    # Link transforms end at the site.
    links, _, tip = link_transforms(arm, q)
    end = np.linalg.multi_dot([*links, tip]) if len(links) else tip
    pose = arm.pose(q)
    np.testing.assert_allclose(end[:3, 3], pose[:3], atol=ROUNDING)
    np.testing.assert_allclose(end[:3, :3], quat_to_matrix(pose[3:]), atol=ROUNDING)


@pytest.mark.parametrize(("order", "axis"), [("hinge first", "0 0 1"), ("slide first", "0 0 -1")])
def test_routes_agree_for_a_screw(tmp_path, order, axis):
    path = tmp_path / "screw.xml"
    path.write_text(screw_chain(slide_axis=axis, order=order))
    arm = arms.load(path)
    for q in arm.sampled(5):
        agree(arm, q)


# Negative control: a fault in one route is seen in that route, and in no other.


def test_screws_without_pitch_disagree(screw, monkeypatch):
    whole = singularities.joint_screw
    monkeypatch.setattr(
        singularities,
        "joint_screw",
        lambda axis, point, pitch: whole(axis, point, np.where(np.isinf(pitch), pitch, 0.0)),
    )
    by = differences(screw, [0.3, 0.5, 0.1])
    assert by["screws"] > 1e-3 and by["propagation"] < ROUNDING and by["differences"] < DIFFERENCES
