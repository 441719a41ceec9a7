"""The memory of a map of a workspace: one that does not fit is refused before the computation."""

from rmrc.simulation.footprint import LIBRARIES
from rmrc.support.errors import QuestionError
from rmrc.support.memory import excess

# Measured [B]: per node of a surface's grid, per sampled cell, and per node of a map over joints.
NODE, CELL, MAPPED = 150, 500, 300


def refuse_excess(cells: int, size: int) -> None:
    """Refuse a grid that does not fit into memory.

    Args:
        cells: Requested number along the longer side.
        size: Memory of the data [B].

    Raises:
        QuestionError: It does not fit.
    """
    too_much = excess(LIBRARIES + size)
    if too_much:
        raise QuestionError(f"--cells: {cells} need {too_much}; ask for fewer")
