"""Past ticks of a world, which delays read back."""

import numpy as np

from rmrc.law.compiling import Array, Record, carray, compiled, pointer


@compiled
def past_of(world: Record) -> Array:
    """Return past ticks, (rows, 2 n + 1): true positions, commands, and the arrival of the command, in ticks.

    Tick t is in row t modulo rows.
    """
    engine = world.engine
    return carray(pointer(engine.past), (engine.past_rows, 2 * world.n + 1), np.float64)  # type: ignore[no-any-return]
