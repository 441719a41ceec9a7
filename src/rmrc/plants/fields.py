"""The fields of MuJoCo's data that compiled code reads and writes, as arrays at their addresses."""

from rmrc.law.compiling import Array, Record, at, compiled


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
