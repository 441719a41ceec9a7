"""The image of two joints' ranges in a plane: the points that it covers, how often, and its folds."""

import numpy as np
from numpy.typing import NDArray

from rmrc.law.compiling import compiled
from rmrc.law.task import Array


def covering(
    at: Array, origin: Array, size: float, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], Array]:
    """Return the centers of cells that the image of a grid covers, each as often as it is covered.

    Each square of the grid is cut into two triangles, which are mapped to triangles; a center on a border
    that two triangles share belongs to one of them. Every layer of the image therefore counts once.

    Args:
        at: Images of the grid's nodes, (A, B, 2).
        origin: Lower corner of all cells, (2,).
        size: Side of a cell.
        shape: Number of cells along both coordinates.

    Returns:
        Index (first coordinate · shape[1] + second) of the cell, (K,), and the preimage of its center on the
        grid, in steps of the grid, (K, 2).

    Example:
        A square that is folded along its diagonal covers a half of itself twice:

        >>> at = np.array([[[0.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 0.0]]])
        >>> cells, where = covering(at, np.array([0.0, 0.0]), 0.25, (4, 4))
        >>> np.unique(np.bincount(cells, minlength=16)).tolist()
        [0, 2]
    """
    # Writable copies in order: for arrays of another type, all would be compiled again.
    at, origin, counts = np.array(at, np.float64, order="C"), np.array(origin), np.array(shape)
    count = scan(at, origin, size, counts, np.empty(0, np.int64), np.empty((0, 2)))
    cells, where = np.empty(count, np.int64), np.empty((count, 2))
    scan(at, origin, size, counts, cells, where)
    return cells, where


@compiled
def is_left(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> bool:
    """Return whether a point is left of the line from a to b; exactly the opposite for the line from b to a.

    The side is computed from the smaller end, so that both triangles of a border decide alike.
    """
    if (bx, by) < (ax, ay):
        return not (ax - bx) * (y - by) - (ay - by) * (x - bx) > 0.0
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0


@compiled
def scan(  # noqa: C901 - a loop for each of squares, halves, columns, rows
    at: Array, origin: Array, size: float, shape: NDArray[np.int64], cells: NDArray[np.int64], where: Array
) -> int:
    """Write cells and places as `covering` returns them, but not into empty arrays; return how many."""
    found, corner = 0, np.empty((3, 2))
    for i in range(at.shape[0] - 1):
        for j in range(at.shape[1] - 1):
            for half in range(2):
                # The corners of a half: its right angle, then a step along the first and the second joint.
                step = 1 - 2 * half
                for c in range(2):
                    corner[0, c] = at[i + half, j + half, c]
                    corner[1, c] = at[i + half + step, j + half, c]
                    corner[2, c] = at[i + half, j + half + step, c]
                ax, ay, bx, by, cx, cy = (
                    corner[0, 0], corner[0, 1], corner[1, 0], corner[1, 1], corner[2, 0], corner[2, 1]
                )  # fmt: skip
                if not np.isfinite(ax + ay + bx + by + cx + cy):
                    continue
                left = max(0, int(np.ceil((min(ax, bx, cx) - origin[0]) / size - 0.5)))
                right = min(shape[0] - 1, int(np.floor((max(ax, bx, cx) - origin[0]) / size - 0.5)))
                low = max(0, int(np.ceil((min(ay, by, cy) - origin[1]) / size - 0.5)))
                high = min(shape[1] - 1, int(np.floor((max(ay, by, cy) - origin[1]) / size - 0.5)))
                for u in range(left, right + 1):
                    x = origin[0] + (u + 0.5) * size
                    for v in range(low, high + 1):
                        y = origin[1] + (v + 0.5) * size
                        side = is_left(ax, ay, bx, by, x, y)
                        if side != is_left(bx, by, cx, cy, x, y) or side != is_left(cx, cy, ax, ay, x, y):
                            continue
                        if len(cells):
                            # Barycentric coordinates, by areas.
                            whole = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
                            s, t = 1.0 / 3.0, 1.0 / 3.0
                            if whole != 0.0:
                                s = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / whole
                                t = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / whole
                            cells[found] = u * shape[1] + v
                            where[found, 0], where[found, 1] = i + half + step * s, j + half + step * t
                        found += 1
    return found


def zero_curves(value: Array) -> list[Array]:
    """Return the curves on a grid along which a value changes its sign, as places in steps of the grid.

    A curve crosses edges of the grid where their ends differ in sign, at the zero of the line between them.

    Args:
        value: Values at the nodes, (A, B).

    Returns:
        Polylines, each (k, 2); closed ones end where they begin.

    Example:
        >>> [curve.round(2).tolist() for curve in zero_curves(np.array([[-1.0, -1.0], [3.0, 1.0]]))]
        [[[0.25, 0.0], [0.5, 1.0]]]
    """
    positive = value >= 0.0
    # The key of an edge is its lower node and its direction.
    _, width = value.shape
    node = np.arange(value.size).reshape(value.shape)
    edges = np.stack(
        [2 * node[:-1, :-1], 2 * node[1:, :-1] + 1, 2 * node[:-1, 1:], 2 * node[:-1, :-1] + 1], axis=-1
    )
    around = [positive[:-1, :-1], positive[1:, :-1], positive[1:, 1:], positive[:-1, 1:]]
    crossed = np.stack([around[0] != around[1], around[1] != around[2], around[2] != around[3],
                        around[3] != around[0]], axis=-1)  # fmt: skip
    links: dict[int, list[int]] = {}
    for i, j in np.argwhere(crossed.any(axis=-1)):
        ends = edges[i, j][crossed[i, j]].tolist()
        for a, b in zip(ends[::2], ends[1::2], strict=True):
            links.setdefault(a, []).append(b)
            links.setdefault(b, []).append(a)

    def place(edge: int) -> tuple[float, float]:
        i, j = divmod(edge // 2, width)
        k, m = (i, j + 1) if edge % 2 else (i + 1, j)
        part = value[i, j] / (value[i, j] - value[k, m])
        return i + part * (k - i), j + part * (m - j)

    return [np.array([place(edge) for edge in chain]) for chain in _chains(links)]


def _chains(links: dict[int, list[int]]) -> list[list[int]]:
    """Return the paths of a graph in which no node has more than two links; open ones first."""
    chains, left = [], set(links)
    ends = [edge for edge, others in links.items() if len(others) == 1]
    for start in [*ends, *links]:
        if start not in left:
            continue
        chain = [start]
        left.remove(start)
        while following := [edge for edge in links[chain[-1]] if edge in left]:
            chain.append(following[0])
            left.remove(following[0])
        if len(chain) > 2 and start in links[chain[-1]]:
            chain.append(start)
        chains.append(chain)
    return chains
