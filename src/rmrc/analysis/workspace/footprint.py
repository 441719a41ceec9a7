"""What a map of a workspace takes of memory: refused before anything moves where it does not fit."""

from rmrc.simulation.footprint import LIBRARIES
from rmrc.support.errors import QuestionError
from rmrc.support.memory import excess

# Measured [B]: of each node of a surface's grid, of each cell where it is sampled, and of a map over joints.
NODE, CELL, MAPPED = 150, 500, 300


def refuse_excess(cells: int, size: int) -> None:
    """Refuse a grid that does not fit into memory.

    Args:
        cells: That were asked for along the longer side.
        size: What is held [B].

    Raises:
        QuestionError: It does not fit.
    """
    too_much = excess(LIBRARIES + size)
    if too_much:
        raise QuestionError(f"--cells: {cells} need {too_much}; ask for fewer")
