"""One Jacobian at another point of the last link, and along the axes of another frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.spatial import shift_twist


def shift_jacobian(jacobian: ArrayLike, p: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of another point of the same link, along the same axes.

    J_E = [[I, −P̂], [0, I]] J_W, since v_E = v_W + ω × P: each column is a twist [Khatib08].
    Where P is known in frame {n} but J along the axes of frame {0}, rotate it first:
    ⁰P = R ⁿP, which is the same as ⁰P̂ = R ⁿP̂ Rᵀ.

    Args:
        jacobian: J_W, rows [v; ω], (..., 6, n).
        p: P, from the point W of J to the new point E, along the axes of J, (..., 3) [m].

    Returns:
        J_E, rows [v; ω], (..., 6, n).

    Example:
        From the wrist point of a three-link arm to its end-effector, 1 m further along x:

        >>> from rmrc.textbook.planar import embed_planar_jacobian, planar_jacobian
        >>> wrist = embed_planar_jacobian(planar_jacobian([2, 1, 0], [0, 0, 0]))
        >>> shift_jacobian(wrist, [1, 0, 0])[[0, 1, 5]] + 0.0
        array([[0., 0., 0.],
               [4., 2., 1.],
               [1., 1., 1.]])
    """
    columns = np.swapaxes(np.asarray(jacobian, dtype=np.float64), -1, -2)
    back = -np.asarray(p, dtype=np.float64)[..., None, :]
    return np.swapaxes(shift_twist(columns, back), -1, -2)


def rotate_jacobian(jacobian: ArrayLike, R_a_b: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the same point along the axes of another frame.

    ᴬJ = [[R, 0], [0, R]] ᴮJ: the determinant of a square J is the same in all frames, and so are
    its singular values [Craig05, §5.7] [Khatib08].

    Args:
        jacobian: ᴮJ, rows [v; ω], or only one of these, (..., 6 or 3, n).
        R_a_b: Rotation of b in a, (..., 3, 3).

    Returns:
        ᴬJ, (..., 6 or 3, n).

    Example:
        x of a frame that is turned by 90° about z is y of the other:

        >>> R = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        >>> rotate_jacobian([[3.0], [0.0], [0.0], [0.0], [0.0], [1.0]], R).T + 0.0
        array([[0., 3., 0., 0., 0., 1.]])
    """
    J, R = np.asarray(jacobian, dtype=np.float64), np.asarray(R_a_b, dtype=np.float64)
    return np.concatenate([R @ J[..., row : row + 3, :] for row in range(0, J.shape[-2], 3)], axis=-2)
