"""Motion that the task does not feel: that it does not, and that it does what it is for."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from worlds import Variant, matrices, one_world, seeds

from codes import Method, Objective, Priority
from oracle_inverse import second_inverse

DAMPED, PSEUDOINVERSE = Variant(Method.DAMPED), Variant(Method.PSEUDOINVERSE)

# What every objective needs besides a chain. Those of a chain get it in `chain_world`.
OBJECTIVES = [objective for objective in Objective if objective != Objective.NONE]
wishing = pytest.mark.parametrize("objective", OBJECTIVES, ids=lambda objective: objective.name.lower())


def wishes(objective, rng, n):
    """Return the parameters of an objective with random wishes, for a world with any J."""
    parameters = {
        "objective": objective,
        "nullspace_gain": rng.uniform(0.5, 2),
        "q": rng.normal(size=n),
        "posture": rng.normal(size=n),
        "nullspace_rates": rng.normal(size=n),
        "position_range": np.array([rng.uniform(-3, -2, n), rng.uniform(2, 3, n)]),
    }
    if objective == Objective.SECONDARY:
        rows = int(rng.integers(1, 4))
        parameters |= {
            "m_2": rows, "row_2": np.arange(6), "row_scale_2": rng.uniform(0.5, 2, rows), "moves_2": np.ones(n, int),
            "J_2": rng.normal(size=(6, n)), "pose_2": [*rng.normal(size=3), 1, 0, 0, 0],
            "pose_ref_2": [*rng.normal(size=3), 1, 0, 0, 0], "feedback_2": 2.0,
            "priority": int(rng.integers(2)), "nullspace_secondary_damping": rng.choice([0.0, 0.1]),
        }  # fmt: skip
    return parameters


def extra(J, t, wx, wq, variant, parameters):
    """Return N qdot0: what the objective adds to the rates."""
    n = J.shape[1]
    _, still = one_world(J, t, wx, wq, variant, **{**parameters, "objective": Objective.NONE})
    _, moving = one_world(J, t, wx, wq, variant, **parameters)
    return (moving["qdot_cmd"] - still["qdot_cmd"])[:n], moving


def free_directions(J, wq, rank):
    """Return P = I − Σ v_i v_iᵀ of the first `rank` right vectors of the weighted J, by LAPACK."""
    vt = np.linalg.svd(J / np.sqrt(wq))[2]
    return vt[rank:].T @ vt[rank:]


# The task feels nothing ---------------------------------------------------------------------------------------


@wishing
@pytest.mark.parametrize("variant", [DAMPED, PSEUDOINVERSE], ids=str)
@given(J=matrices, seed=seeds, sigma_min=st.sampled_from([1.0, 1e-6, 0.0]))
def test_the_task_feels_nothing_of_the_null_space_down_to_rank_loss(objective, variant, J, seed, sigma_min):
    rng = np.random.default_rng(seed)
    m, n = J.shape
    u, s, vt = np.linalg.svd(J, full_matrices=False)
    J = (u * np.append(s[:-1], s[-1] * sigma_min)) @ vt
    t, wx, wq = rng.normal(size=m), rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    added, tick = extra(J, t, wx, wq, variant, wishes(objective, rng, n))
    # The difference of two rates is right to 1e-16 of their size, which is up to 1e6 where nothing is damped.
    size = 1 + np.abs(tick["qdot_cmd"]).max()
    assert_allclose(J @ added, np.zeros(m), rtol=0, atol=1e-10 * max(1.0, 1e-4 * size))
    if m >= n:
        assert_allclose(added, 0.0, rtol=0, atol=1e-10 * size)  # nothing is left over


@pytest.mark.parametrize("damping_maximum", [1e-3, 10.0])
@given(J=matrices, seed=seeds)
def test_null_space_motion_is_the_whole_projection_of_the_wish(damping_maximum, J, seed):
    # Not merely some motion that is harmless, such as none; and the same however much the first term is damped.
    rng = np.random.default_rng(seed)
    m, n = J.shape
    s = np.linalg.svd(J, compute_uv=False)
    assume(s[-1] > 1e-3 * s[0])
    wq, parameters = rng.uniform(0.2, 5, n), wishes(Objective.RATES, rng, n)
    parameters["damping_maximum"] = damping_maximum
    added, _ = extra(J, np.zeros(m), np.ones(m), wq, DAMPED, parameters)
    want = free_directions(J, wq, min(m, n)) @ (np.sqrt(wq) * parameters["nullspace_rates"]) / np.sqrt(wq)
    # LAPACK and the law turn the null space by rounding times κ < 1e4
    assert_allclose(added, want, rtol=0, atol=1e-10)


def test_the_wishes_are_those_of_the_theory_and_a_joint_without_limits_has_no_middle():
    """With a structural rank of 0 nothing is projected: gain (q_0 − q), and −gain S_q² ∇H of the middles."""
    rng, n = np.random.default_rng(0), 4
    wq, q, posture = rng.uniform(0.2, 5, n), rng.normal(size=n), rng.normal(size=n)
    low, high = rng.uniform(-3, -2, n), rng.uniform(2, 4, n)
    middle = (q - (low + high) / 2) / (high - low) ** 2 / n
    low[1], high[1], middle[1] = -np.inf, np.inf, 0.0
    wanted = {Objective.POSTURE: 0.7 * (posture - q), Objective.JOINT_LIMITS: -0.7 * middle / wq}
    for objective, want in wanted.items():
        parameters = {
            "objective": objective, "nullspace_gain": 0.7, "q": q, "posture": posture, "rank": 0,
            "position_range": np.array([low, high]),
        }  # fmt: skip
        added, _ = extra(rng.normal(size=(2, n)), np.zeros(2), 1.0, wq, DAMPED, parameters)
        assert_allclose(added, want, rtol=1e-12, atol=1e-15)


# A second task ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("priority", list(Priority), ids=lambda priority: priority.name.lower())
@pytest.mark.parametrize("damping_2", [0.0, 0.05])
@given(seed=seeds)
def test_the_second_task_is_solved_in_what_the_first_leaves(priority, damping_2, seed):
    rng = np.random.default_rng(seed)
    m, rows = (int(size) for size in rng.integers(1, 4, 2))
    n = int(rng.integers(m + 1, 9))
    J, t, wx, wq = rng.normal(size=(m, n)), rng.normal(size=m), rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    parameters = wishes(Objective.SECONDARY, rng, n)
    row_scale = rng.uniform(0.5, 2, rows)
    parameters |= {
        "m_2": rows, "row_scale_2": row_scale, "priority": int(priority), "nullspace_secondary_damping": damping_2,
    }  # fmt: skip
    A_2 = row_scale[:, None] * parameters["J_2"][:rows] / np.sqrt(wq)
    P = free_directions(np.sqrt(wx)[:, None] * J, wq, m)
    sigma = np.linalg.svd(A_2 @ P, compute_uv=False)
    # What a first task of m rows leaves has rank n − m; what is lost for good is 0, nothing else near a threshold.
    assume(np.all((sigma < 1e-12) | (sigma > 1e-2)))
    assume(np.linalg.svd(A_2, compute_uv=False)[-1] > 1e-2)
    added, tick = extra(J, t, wx, wq, DAMPED, parameters)
    first = tick["qdot_cmd"][:n] - added
    error = np.subtract(parameters["pose_ref_2"], parameters["pose_2"])[:rows]
    t_2 = row_scale * parameters["feedback_2"] * error

    norm = np.linalg.norm(A_2)
    if priority == Priority.CLASSICAL:
        y = second_inverse(A_2 @ P, norm, damping_2) @ (t_2 - A_2 @ (np.sqrt(wq) * first))
    else:
        y = second_inverse(A_2, norm, damping_2) @ t_2
    # σ is above 1e-2: rounding times 1/σ², and by rates of up to 1e3
    assert_allclose(added, (P @ y) / np.sqrt(wq), rtol=0, atol=1e-9 * (1 + np.abs(y).max()))
    assert tick["secondary_sigma"] == pytest.approx(sigma[-1], abs=1e-11)
    if priority == Priority.CLASSICAL and damping_2 == 0.0 and sigma[-1] > 1e-2 and rows <= n - m:
        # both tasks are possible: the second is done entirely
        assert_allclose(
            A_2 @ (np.sqrt(wq) * tick["qdot_cmd"][:n]), t_2, rtol=0, atol=1e-9 * (1 + np.abs(y).max())
        )


def test_the_robust_second_task_stays_bounded_at_an_algorithmic_singularity_and_the_classical_does_not():
    # Both tasks are possible, and A_2 P loses rank: the second row leans more and more to the first.
    sizes = {}
    for angle in (1e-1, 1e-3, 1e-5):
        J = np.array([[1.0, 0.0, 0.0]])
        J_2 = np.zeros((6, 3))
        J_2[0] = np.cos(angle), np.sin(angle), 0.0
        for priority in Priority:
            parameters = {
                "objective": Objective.SECONDARY, "m_2": 1, "row_2": np.arange(6), "row_scale_2": [1.0],
                "moves_2": np.ones(3, int), "J_2": J_2, "pose_2": [0, 0, 0, 1, 0, 0, 0],
                "pose_ref_2": [1, 0, 0, 1, 0, 0, 0], "feedback_2": 1.0, "priority": int(priority),
            }  # fmt: skip
            added, tick = extra(J, np.zeros(1), 1.0, 1.0, PSEUDOINVERSE, parameters)
            sizes[priority, angle] = np.linalg.norm(added)
            assert abs(J @ added) < 1e-10
            assert tick["secondary_sigma"] == pytest.approx(np.sin(angle), rel=1e-9)
    for angle in (1e-1, 1e-3, 1e-5):
        assert sizes[Priority.CLASSICAL, angle] == pytest.approx(1 / np.sin(angle), rel=1e-6)
        assert sizes[Priority.ROBUST, angle] <= 1.0
