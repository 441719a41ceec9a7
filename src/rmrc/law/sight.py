"""Where a step outside a run finds the arm: in MuJoCo's data, or by the arm's own chain."""

from typing import TYPE_CHECKING, Any

import numpy as np

from rmrc.law.compiling import Array, Record, at, compiled
from rmrc.law.kinematics import (
    follow_chain,
    follow_second,
    geometric_jacobian,
    quat_product,
    second_jacobian,
    turned,
)

if TYPE_CHECKING:
    from rmrc.arm import Arm
    from rmrc.law.task import SecondTask

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
        KeyError: The model lacks a joint of the arm, or the body with the site.
    """
    model, engine, input_ = data.model, world["engine"], world["input"]
    joints = [model.joint(name).id for name in arm.joints]
    axes = [model.joint(name).id for name in arm.axis_names]
    sites = [arm.site, second.site] if second else [arm.site]
    is_beside = not {model.site(i).name for i in range(model.nsite)}.issuperset(sites)
    bodies = []
    for i, name in enumerate(sites):
        owner = arm.model if is_beside else model
        site = owner.site(name)
        body = int(owner.site_bodyid[site.id])
        bodies.append(model.body(owner.body(body).name).id if is_beside else body)
        engine["site_at"][i] = bodies[-1] if is_beside else site.id
        input_["site_quat"][i], input_["site_step"][i] = site.quat, site.pos
    input_["sites"], input_["is_beside"] = len(sites), is_beside
    engine["qpos_at"][: arm.n], engine["dof"][: arm.n] = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    engine["joint"][: len(axes)] = axes
    places = {"site_xpos": data.xpos, "site_xquat": data.xquat} if is_beside else {}
    for name in ("qpos", "qvel", "site_xpos", "site_xquat", "xanchor", "xaxis"):
        engine[name] = places.get(name, getattr(data, name)).ctypes.data
    for name in ("nq", "nv", "njnt"):
        engine[name] = getattr(model, name)
    engine["nsite"] = model.nbody if is_beside else model.nsite
    return [*bodies, *model.jnt_bodyid[axes]]


@compiled
def read_state(world: Record) -> None:
    """Read positions and rates of the joints from MuJoCo's data."""
    engine, state = world.engine, world.state
    if world.input.sites <= 0:
        return
    qpos, qvel = at(engine.qpos, engine.nq), at(engine.qvel, engine.nv)
    for j in range(world.n):
        state.q[j], state.qdot[j] = qpos[engine.qpos_at[j]], qvel[engine.dof[j]]


@compiled
def look(world: Record) -> None:
    """Write poses and Jacobians, from the arm's own chain or from MuJoCo's data."""
    second, state, sites = world.second, world.state, world.input.sites
    if sites == CHAIN_ALONE:
        follow_chain(world, state.q)
        geometric_jacobian(world)
        if second.m > 0:
            follow_second(world, state.q)
    elif sites > 0:
        read_axes(world)
        read_site(world, 0, state.pose)
        geometric_jacobian(world)
        if sites == 2:
            read_site(world, 1, second.pose)
            second_jacobian(world)


@compiled
def read_axes(world: Record) -> None:
    """Read the axes of the chain and points on them from MuJoCo, so that nothing is differentiated."""
    engine, chain = world.engine, world.chain
    anchors, axes = at(engine.xanchor, 3 * engine.njnt), at(engine.xaxis, 3 * engine.njnt)
    for a in range(chain.axes):
        first = 3 * engine.joint[a]
        for i in range(3):
            chain.axis[a, i], chain.anchor[a, i] = axes[first + i], anchors[first + i]


@compiled
def read_site(world: Record, i: int, pose: Array) -> None:
    """Write the pose of a site; where the model lacks it, by its place in the body that is read instead."""
    engine, input_ = world.engine, world.input
    number, places = engine.site_at[i], at(engine.site_xpos, 3 * engine.nsite)
    turns, quat = at(engine.site_xquat, 4 * engine.nsite), input_.site_quat[i]
    for c in range(3):
        pose[c] = places[3 * number + c]
    for c in range(4):
        pose[3 + c] = turns[4 * number + c]
    if input_.is_beside:
        turn = (pose[3], pose[4], pose[5], pose[6])
        x, y, z = turned(turn, input_.site_step[i])
        pose[0], pose[1], pose[2] = pose[0] + x, pose[1] + y, pose[2] + z
        pose[3], pose[4], pose[5], pose[6] = quat_product(turn, (quat[0], quat[1], quat[2], quat[3]))
