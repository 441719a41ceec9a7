"""A second decomposition: of the columns of A that remain for the free joints, or of a second task's A."""

from rmrc.law.compiling import Record, call, compiled


@compiled
def decompose_afresh(world: Record, m: int) -> None:
    """Decompose `rest.matrix`, (m, n), without a warm start."""
    world.rest.age, world.rest.rows = 0, m
    call(world.methods.decompose, world, world.rest)
