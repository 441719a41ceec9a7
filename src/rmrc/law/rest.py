"""A second decomposition: of the columns of A that remain for the free joints, or of a second task's A."""

from rmrc.law.jit import Record, apart, compiled
from rmrc.law.svd import set_identity, svd
from rmrc.scenario.choices import LIMITS, OBJECTIVES

# Limits at which the other joints make up for one that is held.
MAKE_UP = LIMITS.codes(lambda one: one.acts and one.name != "clamp")


@apart(
    "call_rest", is_late=True, limits_on_excess=MAKE_UP, nullspace_objective=(OBJECTIVES.code("secondary"),)
)
def decompose_rest(world: Record, m: int, n: int) -> None:
    """Decompose the leading (m, n) block of B, warm-started from `u_B` or `v_B`: see `svd`."""
    svd(world.B, m, n, world.u_B, world.sigma_B, world.v_B)


@compiled
def decompose_rest_from_scratch(world: Record, m: int, n: int) -> None:
    """Decompose the leading (m, n) block of B without a warm start."""
    set_identity(world.u_B if m <= n else world.v_B, min(m, n))
    decompose_rest(world, m, n)
