"""Joints that follow others: the arm moves them with their leaders, in kinematics, law and plants.

The oracles are the equalities themselves, mj_jacSite with the followers' columns added, differences of poses, and
plain loops over MuJoCo that place what follows.
"""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from chains import random_chain, random_followers, seeds
from physics import moved as run_along
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.singularities import jacobians as routes
from rmrc.analysis.statics import balance
from rmrc.analysis.survey import jacobians, survey
from rmrc.law.task import choose
from rmrc.support.errors import ModelError
from rmrc.textbook.chains import geometric_from_screws, space_jacobian
from screws import screw_chain
from wording import says

MODELS = ROOT / "tests/models"
# Products of eight rotations with lengths of about 1 m, and ratios of up to some ten between the joints.
ROUNDING = 1e-11


def made(folder, text):
    path = folder / "model.xml"
    path.write_text(text)
    return arms.load(path, "tip")


@pytest.fixture
def write(tmp_path):
    return lambda text: made(tmp_path, text)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("followers")


def moved(arm):
    """Return F (nv, n): how far each joint of the model moves with the arm's, as configurations are affine in q."""
    zero = arm.configuration(np.zeros(arm.n))
    rows = np.zeros((arm.n, arm.model.nv))
    for row, one in zip(rows, np.eye(arm.n), strict=True):
        mujoco.mj_differentiatePos(arm.model, row, 1.0, zero, arm.configuration(one))
    return rows.T


def projected(arm, q, site="tip"):
    """Return J (6, n): each column of mj_jacSite, those of followers times their ratios added."""
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_fwdPosition(arm.model, data)
    full = np.zeros((6, arm.model.nv))
    mujoco.mj_jacSite(arm.model, data, full[:3], full[3:], arm.model.site(site).id)
    return full @ moved(arm)


@given(seeds)
def test_any_chain_with_any_followers_moves_as_its_equalities_say(folder, seed):
    n = 1 + seed % 8
    arm = made(folder, random_chain(seed, n, followers=True))
    rules = random_followers(seed, n)
    following = {rule[0] for rule in rules}
    assert set(arm.joints) == {f"j{j}" for j in range(n)} - following and not arm.ties
    (q,) = arm.sampled(1, seed)
    model, qpos = arm.model, arm.configuration(q)
    beyond = {
        name: qpos[model.joint(name).qposadr[0]] - model.joint(name).qpos0[0]
        for name in {*following, *(r[1] for r in rules)}
    }
    for follower, leader, a, b in rules:
        assert beyond[follower] == pytest.approx(a + b * beyond[leader], abs=ROUNDING)
    J = projected(arm, q)
    size = max(1.0, np.abs(J).max())
    assert_allclose(arm.jacobian(q), J, atol=ROUNDING * size)
    assert_allclose(jacobians(choose(arm), q[None])[1][0], J, atol=ROUNDING * size)
    assert_allclose(survey(choose(arm), q[None]).pose[0, :3], arm.pose(q)[:3], atol=ROUNDING * size)
    for name, other in routes(arm, q).items():
        # differences: see DIFFERENCE_STEP; third derivatives grow with the cube of the ratios
        assert_allclose(other, J, atol=(1e-8 * size**2 if name == "differences" else ROUNDING * size))
    screws = space_jacobian(arm.chain.screws, q[arm.chain.leader])  # as a run keeps them
    along = geometric_from_screws(screws, arm.pose(q)[:3]) @ np.eye(arm.n)[arm.chain.leader]
    assert_allclose(along, J, atol=ROUNDING * size)
    # statics: the same power by MuJoCo's columns and from link to link
    wrench = np.random.default_rng(seed).normal(size=6)
    assert balance(arm, q, wrench).disagreement <= ROUNDING * size * 10


# Plants -----------------------------------------------------------------------------------------------------------

TIMESTEP = 0.001


def ran(model, kind, by, **plant):
    """Return a world, and what it did: a short move and a pause."""
    axes = ("x", "y", "z") if model == "telescope" else ("x", "z")
    control = {"feedback": 20.0, "inverse": {"method": "inverse"}, "limits": {"on_excess": "none"}}
    path = ({"line": {"by": by}}, {"hold": {"for": 0.1}})
    return run_along(
        MODELS / f"{model}.xml", kind, path, axes=axes, control=control, timestep=TIMESTEP, **plant
    )


MOVES = {"telescope": (0.1, 0.05, -0.02), "mimic": (-0.1, 0.0, 0.05)}


# How far followers lag [m or rad]: what equalities as stiff as this step bears give way to the forces of this move.
# Measured were 1.5e-8. With MuJoCo's own stiffness, 20 ms, it is up to 1e-2.
LAG = 1e-7


@pytest.mark.parametrize(("model", "kind"), [("telescope", "servo"), ("mimic", "torque")])
def test_in_the_physics_followers_stay_with_their_leaders(model, kind):
    prepared, run = ran(model, kind, MOVES[model])
    arm = prepared.arm
    for at in run["qpos"]:
        assert_allclose(at, arm.configuration(at[arm.wiring.qpos]), atol=LAG)
    assert np.abs(run["pose_error"][:, :3][:, prepared.task.rows]).max() < 2e-4
    assert np.abs(run["pose_error"][-1, :3][prepared.task.rows]).max() < 1e-5


def test_limits_of_followers_bound_their_leaders():
    arm = arms.load(MODELS / "telescope.xml", "tip")
    # s1 and s2 have ranges, s4 a servo of 0.3 m/s, s2 a motor of 500 N.
    assert_allclose(arm.position_limit[1], [-0.05, 0.13])
    assert arm.rate_limit[1] == 0.3 and arm.torque_limit[1] == 500.0
    assert_allclose(arm.configuration("home")[1:5], 0.05)


# What cannot be followed -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("equality", "told"),
    [
        ('<joint joint1="travel" joint2="screw" polycoef="0 0.05 1 0 0"/>', 'joint "travel" … linearly; … 0 0.05 1 0 0'),
        ('<joint joint1="travel" joint2="screw"/><joint joint1="screw" joint2="travel"/>', 'joint "travel" … circle, …'),
    ],
)  # fmt: skip
def test_what_cannot_be_followed_is_refused_by_name(write, equality, told):
    with pytest.raises(ModelError) as caught:
        write(screw_chain(equality=equality))
    assert str(caught.value).split("model.xml: ")[1] == says(told)


def test_a_joint_may_be_held_by_an_equality_and_follows_none_that_is_inactive(write):
    held = write(screw_chain(equality='<joint joint1="travel" polycoef="0.02 0 0 0 0"/>'))
    assert held.joints == ("turn", "screw", "swing") and held.idle() == ("travel",)
    assert held.configuration(np.zeros(3))[2] == pytest.approx(0.03)  # from qpos0
    inactive = '<joint joint1="swing" joint2="screw" polycoef="0 1 2 0 0" active="false"/>'
    assert write(screw_chain(equality=inactive)).joints == ("turn", "screw", "travel", "swing")


# What ties an arm ---------------------------------------------------------------------------------------------------

TWO_LINKS = """<mujoco><compiler angle="radian"/><default><joint axis="0 1 0"/>
<geom type="capsule" size="0.03" contype="0" conaffinity="0"/></default><worldbody>{world}
<body name="upper" pos="0 0 0.5"><joint name="shoulder"/><geom fromto="0 0 0 0.5 0 0"/><site name="mid" pos="0.3 0 0"/>
<body name="hand" pos="0.5 0 0"><joint name="elbow"/><geom fromto="0 0 0 0.4 0 0"/><site name="tip" pos="0.4 0 0"/>{hand}
</body></body></worldbody>{more}</mujoco>"""
CUBE = '<body name="cube" pos="0.9 0 0.5"><freejoint/><geom type="box" size="0.02 0.02 0.02"/></body>'
FOUR_BAR = """<body name="crank" pos="0.4 0 0"><joint name="crank"/><geom fromto="0 0 0 0 0 0.1"/>
<body name="bar" pos="0 0 0.1"><joint name="bar"/><geom fromto="0 0 0 0.1 0 0"/></body></body>
<body name="rocker" pos="0.5 0 0"><joint name="rocker"/><geom fromto="0 0 0 0 0 0.1"/></body>"""
SECOND = """<body name="other" pos="1.4 0 0.5"><joint name="o1"/><geom fromto="0 0 0 -0.3 0 0"/>
<body name="grip" pos="-0.3 0 0"><joint name="o2"/><geom fromto="0 0 0 -0.2 0 0"/></body></body>"""


@pytest.mark.parametrize(
    ("world", "hand", "more", "tie"),
    [
        ("", "", '<equality><weld name="w" body1="hand"/></equality>', 'equality weld "w"'),

        ("", "", '<equality><weld name="w" body1="hand" active="false"/></equality>', ""),
        (CUBE, "", '<equality><weld name="w" body1="hand" body2="cube"/><weld name="v" body1="cube"/></equality>', 'equality weld "w", equality weld "v"'),
        ("", FOUR_BAR, '<equality><connect body1="bar" body2="rocker" anchor="0.1 0 0"/></equality>', ""),

        ("", FOUR_BAR, '<equality><joint joint1="crank" joint2="elbow"/><joint name="j" joint1="crank" joint2="shoulder"/></equality>',
         'equality joint 0, equality joint "j"'),

    ],
)  # fmt: skip
def test_what_takes_freedom_from_the_joints_ties_the_arm(write, world, hand, more, tie):
    arm = write(TWO_LINKS.format(world=world, hand=hand, more=more))
    if not tie:
        assert arm.ties == () and arm.notes == ()
        arm.require_open()
        return
    with pytest.raises(ModelError) as caught:
        arm.require_open()
    assert str(caught.value) == says(f"{arm.path}: {tie} … open chain … active …")
