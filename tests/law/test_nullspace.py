"""Motion that the task does not feel: that it does not, and that it does what it is for."""

import functools
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from worlds import Variant, chain_text, make_world, matrices, one_world, seeds

from codes import Method, Objective, Priority
from project import mostly_long
from records import resolve
from rmrc.arm import load

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


@pytest.mark.parametrize("damping_maximum", [1e-3, 0.1, 10.0])
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


@wishing
@given(seed=seeds, rows=st.integers(1, 5), n=st.integers(2, 8))
def test_task_rows_that_never_move_take_nothing_from_the_null_space(objective, seed, rows, n):
    # Rows that are zero at every configuration, as z of a planar arm: the structural rank is that of the others.
    rng = np.random.default_rng(seed)
    m = 6
    rank = min(rows, n)
    J = np.zeros((m, n))
    J[rng.permutation(m)[:rows]] = rng.normal(size=(rows, n))
    assume(np.linalg.svd(J, compute_uv=False)[rank - 1] > 1e-2)
    wq, parameters = rng.uniform(0.2, 5, n), wishes(objective, rng, n) | {"rank": rank}
    added, _ = extra(J, rng.normal(size=m), np.ones(m), wq, DAMPED, parameters)
    assert_allclose(J @ added, 0.0, rtol=0, atol=1e-10)
    if objective in (Objective.RATES, Objective.POSTURE):
        wish = (
            parameters["nullspace_rates"]
            if objective == Objective.RATES
            else parameters["nullspace_gain"] * (parameters["posture"] - parameters["q"])
        )
        want = free_directions(J, wq, rank) @ (np.sqrt(wq) * wish) / np.sqrt(wq)
        assert_allclose(added, want, rtol=0, atol=1e-10)


@given(matrices, seeds)
def test_a_structural_rank_below_k_leaves_what_dies_beyond_it_to_the_objective(J, seed):
    # r is given and never found: with r < k exactly the first r directions are held, whatever their σ.
    rng = np.random.default_rng(seed)
    m, n = J.shape
    s = np.linalg.svd(J, compute_uv=False)
    rank = int(rng.integers(0, min(m, n) + 1))
    assume(rank == 0 or s[rank - 1] > 1e-3)
    assume(rank in (0, len(s)) or s[rank - 1] - s[rank] > 1e-3)
    wished = rng.normal(size=n)
    _, tick = one_world(
        J,
        np.zeros(m),
        variant=DAMPED,
        rank=rank,
        objective=Objective.RATES,
        nullspace_gain=1.0,
        nullspace_rates=wished,
    )
    assert_allclose(tick["qdot_cmd"][:n], free_directions(J, np.ones(n), rank) @ wished, rtol=0, atol=1e-10)


def test_the_check_finds_the_classical_wrong_projector():
    # I − J*J with a damped J* is no projector: it leaks into the task by λ²/(σ² + λ²).
    J, wished = np.array([[1.0, 0.5, 0.2]]), np.array([1.0, 2.0, 3.0])
    damped = J.T @ np.linalg.inv(J @ J.T + 0.01 * np.eye(1))
    leak = J @ (np.eye(3) - damped @ J) @ wished
    assert abs(leak[0]) > 1e-3
    # and so does the unweighted projector where N is meant in the metric of W_q, by nothing: but it is another motion
    wq = np.array([1.0, 5.0, 0.2])
    unweighted = free_directions(J, np.ones(3), 1) @ wished
    added, _ = extra(
        J, np.zeros(1), np.ones(1), wq, DAMPED,
        {"objective": Objective.RATES, "nullspace_gain": 1.0, "nullspace_rates": wished},
    )  # fmt: skip
    assert np.abs(J @ unweighted).max() < 1e-12 and np.abs(added - unweighted).max() > 0.1


# The objective improves ---------------------------------------------------------------------------------------


class Chain:
    """A random arm with weights and a task, and the record of a world for any configuration of it."""

    def __init__(self, folder, seed, n, rows):
        path = folder / "chain.xml"
        path.write_text(chain_text(seed, n))
        self.arm = load(path, "tip")
        rng = np.random.default_rng(seed)
        self.n, self.rows = n, np.sort(rng.permutation(6)[:rows])
        self.wx, self.wq = rng.uniform(0.2, 5, rows), rng.uniform(0.2, 5, n)
        self.length = rng.uniform(0.2, 2)
        self.row_scale = np.sqrt(self.wx) / np.where(self.rows < 3, self.length, 1.0)
        self.joint_scale = np.where(self.arm.is_slide, self.length, 1.0) / np.sqrt(self.wq)
        self.limit = self.arm.model.jnt_range[self.arm.wiring.joint].T
        self.q = rng.uniform(*self.limit)
        self.posture = rng.uniform(*self.limit)
        self.wished = rng.normal(size=n)
        # Few hinges turn about few axes: some of these arms never have the full rank.
        self.rank = max(
            np.linalg.matrix_rank(self.weighted(rng.uniform(*self.limit)), 1e-9) for _ in range(3)
        )

    def weighted(self, q):
        """Return A at q."""
        return self.row_scale[:, None] * self.arm.jacobian(q)[self.rows] * self.joint_scale

    def extra(self, q, objective, gain=1.0, rank=None):
        """Return the rates at q with a zero twist: N qdot0."""
        world, tick = make_world(
            self.arm.jacobian(q), np.zeros(6), 1.0, self.joint_scale, method=Method.DAMPED, objective=objective,
            nullspace_gain=gain, q=q, posture=self.posture, nullspace_rates=self.wished, position_range=self.limit,
        )  # fmt: skip
        m = len(self.rows)
        world["m"], world["k"] = m, min(m, self.n)
        world["rank"] = self.rank if rank is None else rank
        world["row"][0, :m], world["row_scale"][0, :m] = self.rows, self.row_scale
        resolve(world, tick)
        return tick["qdot_cmd"][0, : self.n].copy()

    def middle(self, q):
        """Return H of the joint limits."""
        low, high = self.limit
        return np.mean(((q - (low + high) / 2) / (high - low)) ** 2) / 2

    def distance(self, q):
        """Return half the squared distance from the posture, in the metric of the joint weights."""
        return np.sum(((q - self.posture) / self.joint_scale) ** 2) / 2

    def manipulability(self, q):
        return np.prod(np.linalg.svd(self.weighted(q), compute_uv=False))

    def gradient(self, f, q, h=1e-4):
        """Return ∇f by central differences of fourth order: wrong by h⁴ and by rounding/h, some 1e-12."""
        slope = lambda e: (8 * (f(q + e) - f(q - e)) - (f(q + 2 * e) - f(q - 2 * e))) / (12 * h)  # noqa: E731
        return np.array([slope(h * e) for e in np.eye(self.n)])

    def projector(self, q):
        vt = np.linalg.svd(self.weighted(q))[2]
        return vt[self.rank :].T @ vt[self.rank :]


chains = pytest.mark.parametrize(("n", "rows"), [(2, 1), (4, 2), (5, 3), (7, 6), (8, 6), (8, 3)])


@functools.cache
def chain_of(seed, n, rows):
    """Return a chain that no test changes."""
    with tempfile.TemporaryDirectory() as folder:
        return Chain(Path(folder), seed, n, rows)


GOALS = {
    Objective.JOINT_LIMITS: (Chain.middle, -1),
    Objective.MANIPULABILITY: (Chain.manipulability, +1),
    Objective.POSTURE: (Chain.distance, -1),
}


def slope_along(f, q, direction, h=1e-4):
    """Return the derivative of f at q along a direction, by central differences of fourth order."""
    step = h * direction / max(1.0, np.abs(direction).max())
    slope = (8 * (f(q + step) - f(q - step)) - (f(q + 2 * step) - f(q - 2 * step))) / (12 * h)
    return slope * max(1.0, np.abs(direction).max())


@pytest.mark.parametrize("objective", GOALS, ids=lambda objective: objective.name.lower())
@chains
def test_the_objective_improves_at_the_rate_of_its_projected_slope(objective, n, rows):
    # d/dt H = ∇H · N (∓ gain S_q² ∇H) = ∓ gain ‖P S_q ∇H‖²: never the wrong way, and zero only where nothing is left.
    goal, sign = GOALS[objective]
    for seed in range(2):
        chain = chain_of(seed, n, rows)
        sigma = np.linalg.svd(chain.weighted(chain.q), compute_uv=False)
        assert sigma[chain.rank - 1] > 1e-4
        f = lambda q, chain=chain: goal(chain, q)  # noqa: E731
        moved = chain.extra(chain.q, objective, 0.7)
        want = (
            sign
            * 0.7
            * np.sum((chain.projector(chain.q) @ (chain.joint_scale * chain.gradient(f, chain.q))) ** 2)
        )
        got = slope_along(f, chain.q, moved)
        # Differences of fourth order are wrong by rounding over h, 1e-12; w of heavy arms is small, H of order 1.
        assert got == pytest.approx(want, rel=1e-6, abs=1e-10)
        assert sign * got >= -1e-10
        # and the task feels nothing
        felt = chain.arm.jacobian(chain.q)[chain.rows] @ moved
        assert_allclose(felt, 0, rtol=0, atol=1e-10 * max(1, np.abs(moved).max()))


@pytest.mark.parametrize(
    ("n", "rows"), mostly_long([(1, 1), (2, 1), (2, 4), (4, 2), (3, 3), (6, 6), (7, 6), (8, 6)], 3)
)
def test_the_wishes_are_the_gradients_by_central_differences(n, rows):
    # With a structural rank of 0 nothing is projected, so that the wish itself is seen: gain S_q² ∇.
    for seed in range(12):
        chain = chain_of(seed, n, rows)
        for objective, (goal, sign) in GOALS.items():
            f = lambda q, goal=goal, chain=chain: goal(chain, q)  # noqa: E731
            got = chain.extra(chain.q, objective, 0.7, rank=0)
            want = sign * 0.7 * chain.joint_scale**2 * chain.gradient(f, chain.q)
            # rounding over h, 1e-12 of f, in units of joints that are up to 5 times lighter; f itself is of order 1
            assert_allclose(got, want, rtol=0, atol=1e-7 * np.abs(want).max() + 1e-10, err_msg=str(objective))


def test_a_joint_without_limits_is_not_drawn_to_a_middle(tmp_path):
    chain = Chain(tmp_path, 3, 4, 2)
    bounded = chain.extra(chain.q, Objective.JOINT_LIMITS, rank=0)
    chain.limit[:, 1] = -np.inf, np.inf
    free = chain.extra(chain.q, Objective.JOINT_LIMITS, rank=0)
    assert free[1] == 0.0
    assert_allclose(np.delete(free, 1), np.delete(bounded, 1), rtol=1e-14)  # 1/n counts all joints, as before


@pytest.mark.parametrize("objective", GOALS, ids=lambda objective: objective.name.lower())
def test_many_small_steps_improve_the_objective_every_time(tmp_path, objective):
    goal, sign = GOALS[objective]
    chain = Chain(tmp_path, 5, 7, 3)
    q, values = chain.q.copy(), []
    for _ in range(300):
        values.append(sign * goal(chain, q))
        q = q + 0.01 * chain.extra(q, objective)
    assert all(after > before for before, after in pairwise(values))
    assert values[-1] - values[0] > 1e-3


def test_the_check_finds_gradients_that_forget_the_joint_weights(tmp_path):
    # −∇H projected in the metric of W_q, without S_q²: for unequal weights it raises H of some arm.
    def is_worse(seed):
        chain = Chain(tmp_path, seed, 3, 2)
        slope = chain.gradient(chain.middle, chain.q)
        moved = chain.joint_scale * (chain.projector(chain.q) @ (-slope / chain.joint_scale))
        return slope @ moved > 1e-4

    assert any(map(is_worse, range(40)))


# A second task ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("priority", list(Priority), ids=lambda priority: priority.name.lower())
@pytest.mark.parametrize("damping_2", [0.0, 0.05, 1.0])
@given(seed=seeds)
def test_the_second_task_is_solved_in_what_the_first_leaves(priority, damping_2, seed):
    rng = np.random.default_rng(seed)
    m, rows = (int(size) for size in rng.integers(1, 4, 2))
    n = int(rng.integers(m + 1, 9))
    J, t, wx, wq = rng.normal(size=(m, n)), rng.normal(size=m), rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    parameters = wishes(Objective.SECONDARY, rng, n)
    row_scale = rng.uniform(0.5, 2, rows)
    parameters |= {
        "m_2": rows,
        "row_scale_2": row_scale,
        "priority": int(priority),
        "nullspace_secondary_damping": damping_2,
    }
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

    def inverse(B):
        u, s, vt = np.linalg.svd(B, full_matrices=False)
        g = s / (s**2 + damping_2**2) if damping_2 else np.where(s > 1e-6, 1 / np.maximum(s, 1e-6), 0)
        return (vt.T * g) @ u.T

    if priority == Priority.CLASSICAL:
        y = inverse(A_2 @ P) @ (t_2 - A_2 @ (np.sqrt(wq) * first))
    else:
        y = inverse(A_2) @ t_2
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
