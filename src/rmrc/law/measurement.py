"""Where a step finds the arm: in MuJoCo's data, or by the arm's own chain."""

from typing import TYPE_CHECKING, Any

import numpy as np

from rmrc.law.compiling import Array, Record, at, compiled
from rmrc.law.kinematics import carry, follow_chain, follow_second, geometric_jacobian, second_jacobian
from rmrc.scenario.choices import Status

if TYPE_CHECKING:
    from rmrc.arm import Arm
    from rmrc.law.task import SecondTask

TORQUE_LIMITED = int(Status.TORQUE_LIMITED)
# An actuator is at its limit when it gives all of it, up to the rounding of a gear.
AT_LIMIT = 1.0 - 1e-9

# Sources of the kinematics: MuJoCo's data of so many sites, the chain, or a Jacobian alone.
CHAIN_ALONE, JACOBIAN_ALONE = 0, -1


def look_at(world: np.void, data: Any, arm: "Arm", second: "SecondTask | None") -> list[int]:
    """Have the steps of a world read positions, rates and kinematics from MuJoCo's data.

    Args:
        world: Its record, which holds the addresses of the arrays of the data.
        data: The data, of any model with the arm.
        arm: The arm.
        second: A second task, if any.

    Returns:
        Ids of the bodies that steps read.

    Raises:
        ModelError: The model lacks a joint of the arm, or the body with the site.
    """
    model, engine, input_ = data.model, world["engine"], world["input"]
    there = arm.located(model, arm.site, *([second.site] if second else []))
    is_beside = any(place.site < 0 for place in there.places)
    for i, place in enumerate(there.places):
        engine["site_at"][i] = place.body if is_beside else place.site
        input_["site_place"][i] = [*place.position, *place.quat]
    input_["sites"], input_["is_beside"] = len(there.places), is_beside
    engine["qpos_at"][: arm.n] = model.jnt_qposadr[there.joint]
    engine["dof"][: arm.n] = model.jnt_dofadr[there.joint]
    engine["force_at"][: arm.n], input_["gear"][: arm.n], ends = *there.forces[:2], there.forces[2:]
    input_["force"][:, : arm.n], input_["torque"][:, : arm.n] = ends
    engine["joint"][: len(there.axis)], engine["base"] = there.axis, there.base
    sites = (data.xpos, data.xquat) if is_beside else (data.site_xpos, data.site_xquat)
    places = dict(zip(("site_xpos", "site_xquat"), sites, strict=True))
    engine["followers"] = len(there.followers)
    for i, follower in enumerate(there.followers):
        engine["follows"][i], engine["follower_ratio"][i] = follower.leader, follower.ratio
        engine["follower_dof"][i] = model.joint(follower.name).dofadr[0]
    places |= {"xpos": data.xpos, "xquat": data.xquat}
    for name in ("qpos", "qvel", "qfrc_actuator", "actuator_force", *places, "xanchor", "xaxis"):
        engine[name] = places.get(name, getattr(data, name)).ctypes.data
    for name in ("nq", "nv", "nu", "nbody"):
        engine[name] = getattr(model, name)
    return [*(place.body for place in there.places), *model.jnt_bodyid[there.axis]]


@compiled
def read_state(world: Record) -> None:
    """Read positions and rates of the joints from MuJoCo's data, and the actuators at their limits."""
    input_ = world.input
    input_.saturated = 0
    if input_.sites <= 0:
        return
    read_joints(world)
    read_forces(world)
    for j in range(world.n):
        if is_at_torque_limit(world, j):
            input_.saturated = TORQUE_LIMITED


@compiled
def read_joints(world: Record) -> None:
    """Read positions and rates of the joints."""
    engine, state = world.engine, world.state
    qpos, qvel = at(engine.qpos, engine.nq), at(engine.qvel, engine.nv)
    for j in range(world.n):
        state.q[j], state.qdot[j] = qpos[engine.qpos_at[j]], qvel[engine.dof[j]]


@compiled
def read_forces(world: Record) -> None:
    """Write tau of the last step: the forces of all actuators at the joints."""
    read_at_joints(world, world.engine.qfrc_actuator, world.tick.tau)


@compiled
def read_at_joints(world: Record, address: int, forces: Array) -> None:
    """Write the force at each joint, (n,), from an array over all degrees of freedom, with its followers'."""
    engine, force = world.engine, at(address, world.engine.nv)
    for j in range(world.n):
        forces[j] = force[engine.dof[j]]
    for f in range(engine.followers):
        forces[engine.follows[f]] += engine.follower_ratio[f] * force[engine.follower_dof[f]]


@compiled
def is_at_torque_limit(world: Record, j: int) -> bool:
    """Return whether the actuators of a joint gave all of their force in the last step."""
    return bool(abs(world.tick.tau[j]) >= AT_LIMIT * world.limits.torque[j] > 0.0)


@compiled
def is_held(world: Record, j: int, rate: float) -> bool:
    """Return whether MuJoCo's data show that the actuator of a joint cannot give more towards a rate."""
    engine, input_ = world.engine, world.input
    if input_.saturated == 0:
        return False
    if is_at_end(world.tick.tau[j], input_.torque[0, j], input_.torque[1, j], rate):
        return True
    k = engine.force_at[j]
    if k < 0:
        return False
    force = at(engine.actuator_force, k + 1)[k]
    return is_at_end(force, input_.force[0, j], input_.force[1, j], input_.gear[j] * rate)


@compiled
def is_at_end(force: float, least: float, most: float, rate: float) -> bool:
    """Return whether a force is at the end of its range towards a rate."""
    return bool((rate > 0.0 and force >= AT_LIMIT * most) or (rate < 0.0 and force <= AT_LIMIT * least))


@compiled
def look(world: Record) -> None:
    """Write poses and Jacobians, from the arm's own chain or from MuJoCo's data."""
    second, state, engine, sites = world.second, world.state, world.engine, world.input.sites
    if sites == CHAIN_ALONE:
        follow_chain(world, state.q)
        geometric_jacobian(world)
        if second.m > 0:
            follow_second(world)
    elif sites > 0:
        if engine.base >= 0:
            read_base(world)
        read_axes(world)
        read_site(world, 0, state.pose)
        geometric_jacobian(world)
        if sites == 2:
            read_site(world, 1, second.pose)
            second_jacobian(world)


@compiled
def read(address: int, item: int, values: Array, first: int, size: int) -> None:
    """Read an item of so many numbers, of an array of MuJoCo's data, into some values, from the first on."""
    numbers = at(address + 8 * item * size, size)
    for c in range(size):
        values[first + c] = numbers[c]


@compiled
def read_axes(world: Record) -> None:
    """Read the axes of the chain and points on them from MuJoCo, so that nothing is differentiated."""
    engine, chain = world.engine, world.chain
    for a in range(chain.axes):
        read(engine.xaxis, engine.joint[a], chain.axis[a], 0, 3)
        read(engine.xanchor, engine.joint[a], chain.anchor[a], 0, 3)


@compiled
def read_base(world: Record) -> None:
    """Read the pose of the base, which other joints or a mocap body may move."""
    engine, base = world.engine, world.task.base
    read(engine.xpos, engine.base, base, 0, 3)
    read(engine.xquat, engine.base, base, 3, 4)


@compiled
def read_site(world: Record, i: int, pose: Array) -> None:
    """Write the pose of a site; where the model lacks it, by its place in the body that is read instead."""
    engine = world.engine
    read(engine.site_xpos, engine.site_at[i], pose, 0, 3)
    read(engine.site_xquat, engine.site_at[i], pose, 3, 4)
    if world.input.is_beside:
        carry(pose, world.input.site_place[i], pose)
