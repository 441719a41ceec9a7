"""The singular values of an arm over two of its joints, with the others at rest."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.analysis.factors import Rule, product
from rmrc.analysis.subject import Model, Packages, subject
from rmrc.analysis.survey import BLOCK, Survey, jacobians, survey
from rmrc.analysis.workspace.folds import zero_curves
from rmrc.analysis.workspace.footprint import MAPPED, refuse_excess
from rmrc.arm import Arm
from rmrc.law.task import Array, Task
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.legible import quoted

# Below this share of σ_1, σ_min is 0: a location is known to 1e-10 or so.
SINGULAR = 1e-8
# A determinant below this share of the largest is 0: rounding of products of sines.
ROUNDING = 1e-12
# Starts of a search between the positions, its largest number of steps, and its final step.
VALLEYS, ROUNDS, FINEST = 8, 200, 1e-11


@brief
@dataclass(frozen=True)
class JointMap:
    """The result of `joint_map`.

    Attributes:
        task: The arm, and the rows whose singular values were taken.
        joints: Numbers of the two joints.
        first: Positions of the first, (A,) [rad or m].
        second: Positions of the second, (B,) [rad or m].
        q: Positions of all joints; those of the two do not matter, (n,).
        values: σ_min, w and κ, each (A, B).
        ends: Smallest and largest of each over both ranges, also between the positions; 0, 0 and infinite
            where the arm is singular.
        singular: Curves det A = 0 of a square task, as polylines (k, 2) of both positions; none for others.
        families: Families of singularities, one for each factor of det A; none if no factors are known.
        family: Number of the family of each curve; none if no factors are known.
    """

    task: Task
    joints: tuple[int, int]
    first: Array
    second: Array
    q: Array
    values: dict[str, Array]
    ends: dict[str, tuple[float, float]]
    singular: tuple[Array, ...]
    families: tuple[Rule, ...]
    family: tuple[int, ...]


def joint_map(
    model: Model,
    over: Sequence[str],
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    cells: int = 200,
    on_samples: Callable[[int], None] | None = None,
) -> JointMap:
    """Find σ_min, w and κ over two joints; the function behind `rmrc workspace --over`.

    Each joint goes through its range, or through a turn if it has none.

    Args:
        model: An arm, an MJCF file, or a scenario.
        over: Names of two of its joints.
        q: Positions of the others, (n,) [rad or m]; those of the two do not matter. None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        axes: Rows of the twist whose singular values are taken; None: those of a scenario, or else those that
            the arm can move independently.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows
            they are, or else `world`.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        cells: Steps over the range of each.
        on_samples: Called with the number of configurations examined since the last call.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: There are no two such joints, one slides without limits, or the cells do not fit
            into memory.

    Example:
        >>> found = joint_map("models/planar_2link.xml", ["shoulder", "elbow"], cells=40)
        >>> found.ends["sigma_min"][0], len(found.singular)  # stretched: theta_2 = 0
        (0.0, 1)
    """
    asked = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    asked.arm.require_open()
    arm, task, positions = asked.arm, asked.task, asked.q
    k, joints = min(len(task.rows), arm.n), _joints(arm, over)
    refuse_excess(cells, MAPPED * (cells + 1) ** 2)
    one, other = joints
    steps = [_positions(task, joint, cells) for joint in joints]
    shape, is_square = (len(steps[0]), len(steps[1])), len(task.rows) == arm.n
    known = product(task)
    rules = () if known is None else known.rules
    # det A, or each of its factors as a share of its largest
    sigma, value = np.empty((*shape, k)), np.empty((*shape, max(len(rules), 1)))
    rows = max(1, BLOCK // shape[1])
    for begin in range(0, shape[0], rows):
        some = slice(begin, begin + rows)
        every = np.tile(positions, (*value[some].shape[:2], 1))
        every[..., one], every[..., other] = steps[0][some, None], steps[1]
        flat = every.reshape(-1, arm.n)
        seen = survey(task, flat)
        sigma[some] = seen.sigma.reshape(*every.shape[:2], k)
        if is_square:
            _, J = jacobians(task, flat)
            value[some] = (
                np.linalg.det(task.matrix(task.turned(J, seen.pose))).reshape(*every.shape[:2], 1)
                if known is None
                else (known.values(J) / known.largest).reshape(value[some].shape)
            )
        if on_samples is not None:
            on_samples(len(flat))
    seen = Survey(every, every, sigma.reshape(-1, k))
    values = {
        "sigma_min": sigma[..., -1],
        "manipulability": seen.manipulability.reshape(shape),
        "condition": seen.condition.reshape(shape),
    }
    layers = [value[..., i] for i in range(value.shape[-1])] if is_square else []
    curves = [(i, curve) for i, layer in enumerate(layers) for curve in _singular_curves(layer, bool(rules))]
    grid = [np.arange(len(step)) for step in steps]
    singular = tuple(
        np.stack([np.interp(curve[:, c], grid[c], steps[c]) for c in range(2)], axis=1) for _, curve in curves
    )
    family = tuple(i for i, _ in curves) if rules else ()
    ends = _ends(task, joints, positions, steps, values)
    return JointMap(task, joints, steps[0], steps[1], positions, values, ends, singular, rules, family)


def _joints(arm: Arm, names: Sequence[str]) -> tuple[int, int]:
    """Return the numbers of two joints."""
    if len(names) != 2:
        raise QuestionError(
            f"--over must name two joints, such as {','.join(arm.joints[:2])}, got {quoted(','.join(names))}"
        )
    names = [name.strip() for name in names]
    for name in names:
        if name not in arm.joints:
            raise QuestionError(
                f'--over: no joint "{name}"{did_you_mean(name, arm.joints)}; '
                f"its joints: {', '.join(arm.joints)}"
            )
    if names[0] == names[1]:
        raise QuestionError(f'--over needs two different joints, got "{names[0]}" twice')
    return arm.joints.index(names[0]), arm.joints.index(names[1])


def _singular_curves(value: Array, is_share: bool) -> list[Array]:
    """Return the curves on a grid where a value changes its sign, and the sides where it is 0.

    Args:
        value: A determinant, or one of its factors as a share of its largest, (A, B).
        is_share: Whether it is such a share: a factor may be rounding on the whole grid.
    """
    largest = 1.0 if is_share else np.abs(value).max()
    value = np.where(np.abs(value) <= ROUNDING * largest, 0.0, value)
    last = np.array(value.shape) - 1.0
    sides = ((value[0], 0, 0.0), (value[-1], 0, last[0]), (value[:, 0], 1, 0.0), (value[:, -1], 1, last[1]))
    curves = []
    for own, axis, at in sides:
        if not own.any():
            curve = np.full((2, 2), at)
            curve[:, 1 - axis] = 0.0, last[1 - axis]
            curves.append(curve)
    inside = [
        curve for curve in zero_curves(value) if not ((curve == 0.0) | (curve == last)).all(axis=0).any()
    ]
    return inside + curves


def _ends(
    task: Task, joints: tuple[int, int], q: Array, steps: list[Array], values: dict[str, Array]
) -> dict[str, tuple[float, float]]:
    """Return smallest and largest σ_min, w and κ, searched between the positions from the extreme ones.

    It is a compass search: the best of a location and its eight neighbors at some distance is the next
    location, and the distance is halved if that is the location itself. It needs no derivative, which σ_min
    does not have where it is 0.
    """
    # Minimized: each measure and its negative, κ as 1/κ.
    rows = [(name, sign) for name in values for sign in (1.0, -1.0)]
    grids = [sign * (1.0 / values[name] if name == "condition" else values[name]) for name, sign in rows]
    starts = [_valleys(grid) for grid in grids]
    owner = np.repeat(np.arange(len(rows)), [len(some) for some in starts])
    index = np.concatenate(starts)
    place = np.stack([steps[c][index[:, c]] for c in range(2)], axis=1)
    low, high = (np.array([step[end] for step in steps]) for end in (0, -1))
    away = np.tile([step[1] - step[0] for step in steps], (len(place), 1))
    around = np.array([(a, b) for a in (0, 1, -1) for b in (0, 1, -1)])

    def heights(places: Array) -> Array:
        every = np.tile(q, (places.shape[0] * 9, 1))
        every[:, joints] = places.reshape(-1, 2)
        found = survey(task, every)
        zero = found.sigma[:, -1] <= SINGULAR * found.sigma[:, 0]
        own = {
            "sigma_min": np.where(zero, 0.0, found.sigma[:, -1]),
            "manipulability": np.where(zero, 0.0, found.manipulability),
            "condition": np.where(zero, 0.0, 1.0 / found.condition),
        }
        every_row = np.stack([sign * own[name] for name, sign in rows])
        return np.asarray(every_row[np.repeat(owner, 9), np.arange(len(every))].reshape(-1, 9))

    for _ in range(ROUNDS):
        if (away < FINEST).all():
            break
        places = np.clip(place[:, None] + away[:, None] * around, low, high)
        height = heights(places)
        best = height.argmin(axis=1)
        place = places[np.arange(len(place)), best]
        away[best == 0] *= 0.5
    height = heights(np.clip(place[:, None] + 0.0 * around, low, high))[:, 0]
    ends = {}
    for name in values:
        least, most = (
            sign * min(float(height[owner == row].min()), float(grids[row].min()))
            for row, sign in ((rows.index((name, 1.0)), 1.0), (rows.index((name, -1.0)), -1.0))
        )
        if name == "condition":
            least, most = 1.0 / most, 1.0 / least if least > 0.0 else np.inf
        ends[name] = (least, most)
    return ends


def _valleys(grid: Array) -> NDArray[np.intp]:
    """Return the locations of a grid without a lower neighbor, the lowest ones, (K, 2)."""
    padded = np.pad(grid, 1, constant_values=np.inf)
    rows, columns = grid.shape
    beside = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    places = np.argwhere(grid <= np.min(beside, axis=0))
    order = np.argsort(grid[tuple(places.T)], kind="stable")
    return np.asarray(places[order[:VALLEYS]])


def _positions(task: Task, joint: int, cells: int) -> Array:
    low, high = task.arm.position_limit[joint]
    if not np.isfinite(high - low):
        if task.arm.is_slide[joint]:
            raise QuestionError(
                f'--over: joint "{task.arm.joints[joint]}" slides without limits; '
                "give it a range in the model"
            )
        low, high = -np.pi, np.pi
    return np.linspace(low, high, cells + 1)
