"""A second decomposition: of what is left of A for the joints that are free, or of that of a second task."""

from rmrc.law.jit import Record, apart, compiled
from rmrc.law.svd import set_identity, svd
from rmrc.scenario.choices import LIMITS, OBJECTIVES


@apart(
    "call_rest",
    limits_on_excess=LIMITS.codes(lambda one: one.acts and one.name != "clamp"),
    nullspace_objective=(OBJECTIVES.code("secondary"),),
)
def decompose_rest(world: Record, m: int, n: int) -> None:
    """Decompose the leading (m, n) block of B, from what `u_B` or `v_B` holds: see `svd`."""
    svd(world.B, m, n, world.u_B, world.sigma_B, world.v_B)


@compiled
def decompose_rest_from_scratch(world: Record, m: int, n: int) -> None:
    """Decompose the leading (m, n) block of B, of which nothing is known from the last tick."""
    set_identity(world.u_B if m <= n else world.v_B, min(m, n))
    decompose_rest(world, m, n)
