"""The torques and loads of an arm at rest under a wrench, and the same wrench held in the physics.

It is held by rate servos with feedback of the position. The law gets one row of the task, one that is far
from singular, and the posture in its null space. Together they bring every joint back at the same rate,
singular or not, as joint servos do. The actuators are read once all is at rest, and compared with
`rmrc.analysis.statics` at the joint positions of rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.singularities import Direction, examine
from rmrc.analysis.subject import Model, Packages, axes_of, numbers, subject
from rmrc.analysis.trial import identity
from rmrc.arm import Arm
from rmrc.arm.adapting import is_behind
from rmrc.arm.wiring import SLIDE
from rmrc.law.task import Task
from rmrc.results.run import Run
from rmrc.scenario import Scenario
from rmrc.scenario.choices import SERVO
from rmrc.show.sheets import number
from rmrc.simulation.footprint import excess
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import DivergenceError, QuestionError, did_you_mean
from rmrc.support.spatial import AXES, Array, quat_to_matrix, twist_transform, wrench_transform
from rmrc.support.text import brief
from rmrc.textbook.chains import joint_torques

# Balance of the arm at rest -----------------------------------------------------------------------
#
# Actuator torques and link loads of an arm at rest under a wrench.
#
# The wrench is the one that acts *on* the arm. Jᵀ F is equivalent to it, −Jᵀ F balances it, see
# `rmrc.textbook.chains`. The load on a link is what acts on all bodies that its joint moves: the wrench,
# and their weight if the actuators bear it. The loads need no Jacobian, and are the second route to the
# same torques.


# A result below this share of its summands is rounding, and becomes 0.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Balance:
    """An arm at rest under a wrench, and under its weight if the actuators bear that.

    Attributes:
        arm: The arm.
        q: Joint positions, (n,).
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        bears_weight: Whether the actuators support the arm's weight; otherwise it is compensated.
        equivalent: Jᵀ F, (n,): with it the site presses on the world with F [N·m or N].
        equilibrium: −Jᵀ F, (n,): with it the arm holds still while F acts on it.
        gravity: Actuator torques against gravity, (n,); 0 if gravity is compensated.
        springs: Actuator torques against springs of the joints, (n,).
        torque: Actuator torques against all of them, (n,).
        size: The largest torque if nothing canceled.
        margin: Margin to each torque limit, (n,): negative where it is exceeded by more than rounding.
        exceeded: Names of those joints.
        axis: Each axis of the chain along the axes of its body, (ℓ, 3).
        reaction: [f; n] that the link behind each axis receives from the one before, along the axes of the
            link's body and at the joint's anchor, a point of that body, (ℓ, 6) [N, N·m]: of the wrench, and
            of the weight if the actuators bear it.
        driven: Its component along each axis, (ℓ,): the actuator provides it, with the joint's spring, or the
            coupling of a follower. It pushes along a slide, and turns a hinge or the hinge of a screw.
            Bearings and links carry the rest; the nut of a screw takes its share of a thrust as a moment.
        disagreement: Largest difference between the two routes to the torques against wrench and weight.
    """

    arm: Arm
    q: Array
    wrench: Array
    bears_weight: bool
    equivalent: Array
    equilibrium: Array
    gravity: Array
    springs: Array
    torque: Array
    size: float
    margin: Array
    exceeded: tuple[str, ...]
    axis: Array
    reaction: Array
    driven: Array
    disagreement: float


def without_rounding(values: Array, size: float) -> Array:
    """Return sums of terms of some size, 0 where they are rounding."""
    return np.where(np.abs(values) <= ROUNDING * size, 0.0, values)


def balance(arm: Arm, q: ArrayLike, wrench: ArrayLike, gravity: bool = False) -> Balance:
    """Return actuator torques and link loads of an arm at rest while a wrench acts on it.

    τ = −Jᵀ F by MuJoCo's Jacobian, and by forces from link to link [Craig05, §5.9, §5.10].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].
        gravity: Whether the actuators support the arm's weight; otherwise it is compensated.
    """
    q, wrench = np.asarray(q, dtype=np.float64), np.asarray(wrench, dtype=np.float64)
    J, (weight, springs) = arm.jacobian(q), arm.rest_torques(q)
    equivalent, weight = joint_torques(J, wrench), weight * gravity
    levers, acts = (np.linalg.norm(each.reshape(2, 3, -1), axis=1) for each in (J, wrench))
    size = float(((levers * acts).sum(axis=0) + np.abs(weight) + np.abs(springs)).max())
    torque = without_rounding(weight + springs - equivalent, size)
    margin = without_rounding(arm.torque_limit - np.abs(torque), size)
    reaction, driven, propagated = _loads(arm, q, wrench, arm.weights * gravity)
    largest = np.abs(reaction).max()
    return Balance(
        arm=arm, q=q, wrench=wrench, bears_weight=gravity, size=size,
        equivalent=without_rounding(equivalent, size), equilibrium=without_rounding(-equivalent, size),
        gravity=without_rounding(weight, size), springs=without_rounding(springs, size),
        torque=torque, margin=margin, exceeded=tuple(np.array(arm.joints)[margin < 0.0].tolist()),
        axis=arm.model.jnt_axis[arm.wiring.axis], reaction=without_rounding(reaction, largest),
        driven=without_rounding(driven, largest),
        disagreement=float(np.abs(weight - equivalent - propagated).max()),
    )  # fmt: skip


def _loads(arm: Arm, q: Array, wrench: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Return the loads on links, (ℓ, 6), their components along the axes, (ℓ,), and of actuators, (n,).

    Both halves of a screw have one axis, and bodies may hang on the first half alone: the link is all that
    the first moves, and each half gives its own component.
    """
    model, wiring, data = arm.model, arm.wiring, arm.data_at(arm.configuration(q))
    site, acts = data.site_xpos[wiring.site], wrench.reshape(2, 3)
    force, moment = np.zeros((2, model.njnt, 3))  # about the world's origin
    for joint in arm.others.own:
        behind = is_behind(model, int(model.jnt_bodyid[joint]))
        weight, borne = weights[joint] * behind[:, None], acts * behind[wiring.body]
        force[joint] = -borne[0] - weight.sum(axis=0)
        moment[joint] = -borne[1] - np.cross(site, borne[0]) - np.cross(data.xipos, weight).sum(axis=0)
    turning = moment - np.cross(data.xanchor, force)
    along = (data.xaxis * np.where(model.jnt_type[:, None] == SLIDE, force, turning)).sum(axis=1)
    link, driven, axes = wiring.axis.copy(), along[wiring.axis], wiring.axis.tolist()
    for follower, joint in zip(arm.followers, wiring.follower_joint, strict=True):
        if follower.pitch:
            axis = axes.index(wiring.joint[follower.leader])
            link[axis], driven[axis] = min(link[axis], joint), driven[axis] + follower.ratio * along[joint]
    body = model.jnt_bodyid[wiring.axis]
    R = data.xmat[body].reshape(-1, 3, 3)
    anchor = data.xpos[body] + (R @ model.jnt_pos[wiring.axis, :, None])[..., 0]
    loads = np.stack([force[link], moment[link] - np.cross(anchor, force[link])], axis=1)
    return (loads @ R).reshape(-1, 6), driven, along[model.dof_jntid] @ arm.motion


def elsewhere(arm: Arm, q: ArrayLike, wrench: ArrayLike, site: str) -> dict[str, Any]:
    """Return a wrench as seen at another site of the same body: it does the same work [Craig05, §5.11].

    Args:
        arm: The arm.
        q: Joint positions, (n,) [rad or m].
        wrench: [f; n] at the controlled site {B}, along world axes, (6,) [N, N·m].
        site: Name of the other site {A}.

    Returns:
        site: Name of {A}.
        wrench: [f; n] at the origin and along the axes of {A}, (6,) [N, N·m].
        force_transform: ᴬT_f,B = (ᴮT_v,A)ᵀ: wrench_a = ᴬT_f,B wrench_b, (6, 6).
        velocity_transform: ᴬT_v,B: twist_a = ᴬT_v,B twist_b, (6, 6).

    Raises:
        QuestionError: There is no such site, or another body carries it.
    """
    model, q = arm.model, np.asarray(q, dtype=np.float64)
    # Bodies that are welded together move as one.
    body = {name: int(model.body_weldid[model.site(name).bodyid[0]]) for name in arm.sites}
    alike = [name for name in arm.sites if body[name] == body[arm.site]]
    if site not in alike:
        unknown = f"is not a site of {arm.path}{did_you_mean(site, alike)}"
        what = "is on another body" if site in body else unknown
        raise QuestionError(f'--at: "{site}" {what}; sites that move with "{arm.site}": {", ".join(alike)}')
    here, there = arm.pose(q), arm.pose(q, site)
    R_b, R_a = quat_to_matrix(here[3:]), quat_to_matrix(there[3:])
    R_a_b, p_a_b = R_a.T @ R_b, R_a.T @ (here[:3] - there[:3])
    force_transform, velocity_transform = (
        without_rounding(transform(R_a_b, p_a_b), 1.0) for transform in (wrench_transform, twist_transform)
    )
    at_a = force_transform @ (np.reshape(wrench, (2, 3)) @ R_b).ravel()
    return {
        "site": site, "wrench": without_rounding(at_a, np.abs(at_a).max()),
        "force_transform": force_transform, "velocity_transform": velocity_transform,
    }  # fmt: skip


# The torques of an arm ----------------------------------------------------------------------------

WRENCH = ("fx", "fy", "fz", "nx", "ny", "nz")
# Control period, which is also the time constant of a servo [s]. MuJoCo's step is a fraction of it: with a
# step as long, such servos and the soft constraint of a screw excite each other.
PERIOD, TIMESTEP = 1e-3, 2.5e-4
# Rate at which a joint returns [1/s]: the stiffness of a joint is this times its servo's gain. A fiftieth of
# a second is slow for servos with a millisecond, and the arm still comes to rest within a second.
FEEDBACK = 50.0
# The longest time to hold a wrench [s].
LONGEST = 1000.0
# An arm is at rest if no joint was faster in the last tenth of a second [rad/s or m/s].
STILL, LAST = 1e-8, 0.1
# Below its dry friction a joint creeps, as MuJoCo's friction is soft. It is at rest at a rate at which its
# servo brakes by this share of the friction.
CREEP = 1e-2
# Tolerance of the actuator torques, relative to the torques if nothing canceled: far above rounding, far
# below what an actuator can measure. The constraint that makes a screw of a hinge and a slide is soft, and
# yields by some hundredths of a millimeter under a load.
SHARE, SHARE_OF_SCREWS = 1e-6, 1e-3


@brief
@dataclass(frozen=True, eq=False)
class Statics:
    """The result of `statics`.

    Attributes:
        balance: Actuator torques and link loads.
        free: Wrenches that need no torque here, which span all others: see `rmrc.analysis.singularities`.
        elsewhere: The wrench at another site: see `rmrc.analysis.statics.elsewhere`; None if no other
            was named.
        held: The result of holding the wrench in the physics: see `hold_wrench`; None if that was not
            requested.
    """

    balance: Balance
    free: tuple[Direction, ...]
    elsewhere: dict[str, Any] | None
    held: dict[str, Any] | None


def statics(
    model: Model,
    wrench: ArrayLike,
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    frame: str = "world",
    at: str | None = None,
    gravity: bool = False,
    hold: float | None = None,
    on_ticks: Callable[[int], None] | None = None,
) -> Statics:
    """Return actuator torques and link loads under a wrench on an arm; the function behind `rmrc statics`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        wrench: The wrench on the arm at the site: force and moment [f; n], (6,) [N, N·m], or a force alone,
            (3,) [N].
        q: Joint positions, (n,) [rad or m]; None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.tree`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        frame: Frame of the wrench: `world`, `base` or `site`.
        at: Another site of the same body, at which to report the wrench as well.
        gravity: Whether the actuators support the arm's weight, and links and bearings carry it; otherwise it
            is compensated.
        hold: Longest duration of holding the wrench in the physics, until all is at rest [s]; None: no
            holding.
        on_ticks: Called with the number of ticks of each block that was held.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: Any of the others does not fit the arm, or it cannot be held.
        DivergenceError: The physics broke in its first step.

    Example:
        >>> found = statics("models/planar_2link.xml", [0, -1, 0], [0, np.pi / 3])
        >>> found.balance.equilibrium.round(9).tolist(), found.balance.exceeded
        ([1.5, 0.5], ())
    """
    if hold is not None and not 0.0 < hold <= LONGEST:
        raise QuestionError(f"hold must be > 0 and at most {LONGEST:g} s, got {hold:g}")
    question = subject(model, q, keyframe, site, body=body, packages=packages)
    arm, q = question.arm, question.q
    arm.require_open()
    six = np.append(wrench, np.zeros(3)) if np.shape(wrench) == (3,) else wrench
    acts = (numbers("wrench", six, WRENCH).reshape(2, 3) @ axes_of(arm, q, frame).T).ravel()
    balanced, everything = balance(arm, q, acts, gravity), Task(arm, np.arange(6))
    return Statics(
        balance=balanced,
        free=examine(everything, arm.jacobian(q), arm.pose(q))[2],
        elsewhere=None if at is None else elsewhere(arm, q, acts, at),
        held=None if hold is None else hold_wrench(balanced, hold, on_ticks),
    )


# Held in the physics -----------------------------------------------------------------------------


def hold_wrench(
    wanted: Balance, seconds: float = 10.0, on_ticks: Callable[[int], None] | None = None
) -> dict[str, Any]:
    """Hold a wrench in the physics until the arm is at rest or the time is over.

    Args:
        wanted: The configuration and the wrench.
        seconds: Longest duration.
        on_ticks: Called with the number of ticks of each finished block.

    Returns:
        agrees: Whether the arm came to rest, with the torques of statics.
        still: Whether it came to rest.
        seconds: Time until then, or until the end [s].
        where_it_rests: Expected torques at the joint positions of rest, (n,) [N·m or N].
        measured: Measured torques, (n,).
        difference: Measured minus expected torques at rest, (n,).
        allowed: Its tolerance, (n,).
        at_limit: Joints whose actuator was at its limit at any time, (n,).
        rate: Rate of the fastest joint in the last tenth of a second [rad/s or m/s].
        verdict: The same in words.
        run: The run.

    Raises:
        QuestionError: A joint is beyond its limits, or a run of this length does not fit into memory.
        DivergenceError: The state was not finite after the first step.

    Example:
        >>> from rmrc.analysis.subject import subject
        >>> arm = subject("models/planar_2link.xml").arm
        >>> hold_wrench(balance(arm, [0.0, 1.0], [0, -1, 0, 0, 0, 0]), 2.0)["agrees"]
        True
    """
    arm = wanted.arm
    lower, upper = arm.position_limit.T
    for j in np.flatnonzero((wanted.q < lower) | (wanted.q > upper)):
        within = f"within its limits [{lower[j]:.6g}, {upper[j]:.6g}] {arm.units[j]}, got {wanted.q[j]:.6g}"
        raise QuestionError(
            f'cannot hold: joint "{arm.joints[j]}" must be {within}; choose other joint positions'
        )
    for j in np.flatnonzero(arm.inertia <= 0.0):
        raise QuestionError(
            f'cannot hold: joint "{arm.joints[j]}" must have an inertia > 0 at home, got '
            f"{arm.inertia[j]:.6g}; correct the masses or the armature of the model"
        )
    prepared = prepare(hold_scenario(wanted, seconds), Cache(arm))
    if too_much := excess([prepared]):
        raise QuestionError(f"--hold: {seconds:g} s need {too_much}; hold for a shorter time")
    simulation, kv = Simulation([prepared]), np.array(prepared.scenario.plant.kv)
    friction = arm.model.dof_frictionloss @ np.abs(arm.motion)
    slow, share = np.maximum(STILL, CREEP * friction / kv), SHARE_OF_SCREWS if arm.followers else SHARE

    def judged(run: Run) -> dict[str, Any]:
        """Return the torques, the rate and their judgment at the end of a run."""
        ended = balance(arm, run["q"][-1], wanted.wrench, wanted.bears_weight)
        last, measured = round(LAST / PERIOD), run["tau"][-1]
        rates = np.abs(run["qdot"][-last:]).max(axis=0) if len(run) >= last else np.full(arm.n, np.inf)
        still = run.divergence is None and bool((rates <= slow).all())
        # M q̈ brakes the remaining motion, and the actuator values are a step old: both are within this.
        moving = kv * np.maximum(rates, min(rates.max(), STILL))
        difference, allowed = measured - ended.torque, share * ended.size + moving + friction
        return {
            "agrees": still and bool((np.abs(difference) <= allowed).all()), "still": still,
            "where_it_rests": ended.torque, "measured": without_rounding(measured, ended.size),
            "difference": difference, "allowed": allowed, "rate": float(rates.max()),
        }  # fmt: skip

    simulation.step(
        lambda _, part: on_ticks(len(part)) if on_ticks else None,
        rule=lambda _, run: bool(judged(run)["agrees"]),
    )
    (run,) = simulation.runs()
    if not len(run):
        raise DivergenceError(f"cannot hold: {run.divergence}")
    held = judged(run) | {
        "seconds": len(run) * PERIOD, "run": run,
        "at_limit": (np.abs(run["tau"]) >= arm.torque_limit).any(axis=0),
    }  # fmt: skip
    return held | {"verdict": _verdict(arm.joints, held)}


def _verdict(joints: tuple[str, ...], held: dict[str, Any]) -> str:
    """Return how the holding went, and the way out."""
    names = ", ".join(name for name, is_there in zip(joints, held["at_limit"], strict=True) if is_there)
    reached = f"{names or 'no actuator'} reached its torque limit"
    if held["agrees"]:
        return f"met: still, and the actuator torques agree with statics; {reached}."
    if held["run"].divergence:
        return f"MISSED: {held['run'].divergence}; {reached}."
    state = "still, but the actuator torques differ"
    if not held["still"]:
        state = f"not still, the fastest joint moves at {number(held['rate'])} rad/s or m/s"
    support = "a contact or the end of a range may carry a part of the load: hold it for longer, or elsewhere"
    return f"MISSED: {state}; {reached}{'' if names else f'; {support}'}."


def hold_scenario(wanted: Balance, seconds: float) -> Scenario:
    """Return the scenario of an arm that holds a wrench at its configuration.

    Args:
        wanted: The configuration and the wrench.
        seconds: Duration.
    """
    arm = wanted.arm
    # The row that moves most: no arm has lost it.
    rows = Task(arm, np.arange(6)).matrix(arm.jacobian(wanted.q))
    axis = AXES[int(np.argmax(np.linalg.norm(rows, axis=1)))]
    keys = identity(arm, Path.resolve)
    keys.pop("stretch", None)  # the given arm is stretched already
    return Scenario.model_validate({
        "name": "hold",
        "arm": keys | {"start": tuple(wanted.q)},
        "task": {"axes": (axis,)},
        "control": {
            "period": PERIOD, "feedback": FEEDBACK, "inverse": {"method": "pseudoinverse"},
            "nullspace": {"objective": "posture", "gain": FEEDBACK},
            "limits": {"position": False, "on_excess": "none"},
        },
        "target": {"path": ({"hold": {"for": seconds}},)},
        "plant": {
            "kind": SERVO.name, "kv": tuple(arm.inertia / PERIOD), "timestep": TIMESTEP,
            "friction_compensation": False,
            "gravity_compensation": not wanted.bears_weight, "wrench": tuple(wanted.wrench),
        },
    })  # fmt: skip
