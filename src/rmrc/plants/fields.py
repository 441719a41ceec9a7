"""Arrays at addresses in the record of a world, for compiled code: fields of MuJoCo's data, and tables."""

import numpy as np

from rmrc.law.compiling import Array, Record, at, carray, compiled, pointer


@compiled
def qpos_of(world: Record) -> Array:
    """Return the positions of all joints of the model, (nq,)."""
    return at(world.engine.qpos, world.engine.nq)


@compiled
def qvel_of(world: Record) -> Array:
    """Return the velocities of all degrees of freedom of the model, (nv,)."""
    return at(world.engine.qvel, world.engine.nv)


@compiled
def ctrl_of(world: Record) -> Array:
    """Return the controls of all actuators of the model, (nu,)."""
    return at(world.engine.ctrl, world.engine.nu)


@compiled
def past_of(world: Record) -> Array:
    """Return past ticks, (rows, 2 n + 1): true positions, commands, and the arrival of the command, in ticks.

    Tick t is in row t modulo rows.
    """
    engine = world.engine
    return carray(pointer(engine.past), (engine.past_rows, 2 * world.n + 1), np.float64)  # type: ignore[no-any-return]


@compiled
def chance_of(world: Record) -> Array:
    """Return the random numbers of this tick, (n + 2,): see `rmrc.plants.hardware.Hardware.chance`."""
    engine, size = world.engine, world.n + 2
    return at(engine.chance + 8 * size * engine.next, size)
