"""How near to singular an arm is over two of its joints, the others at rest."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rmrc.analysis.sheet import zero_curves
from rmrc.analysis.survey import BLOCK, Survey, jacobians, survey
from rmrc.analysis.task import Array, Task
from rmrc.errors import QuestionError, did_you_mean


@dataclass(frozen=True)
class JointMap:
    """What `joint_map` found.

    Attributes:
        task: The arm, and the rows whose singular values were taken.
        joints: Numbers of the two joints.
        first: Positions of the first, (A,) [rad or m].
        second: Positions of the second, (B,) [rad or m].
        q: Positions of all joints; those of the two do not matter, (n,).
        values: σ_min, w and κ, each (A, B).
        singular: Where det A = 0 of a square task, as polylines (k, 2) of both positions; none of another.
    """

    task: Task
    joints: tuple[int, int]
    first: Array
    second: Array
    q: Array
    values: dict[str, Array]
    singular: tuple[Array, ...]


def joint_map(
    task: Task,
    names: tuple[str, str],
    q: Array,
    cells: int = 200,
    on_samples: Callable[[int], None] | None = None,
) -> JointMap:
    """Find σ_min, w and κ over two joints.

    Each joint goes through its range, or through a turn if it has none.

    Args:
        task: The arm and the rows that count.
        names: Two of its joints.
        q: Positions of the others, (n,).
        cells: Steps over the range of each.
        on_samples: Called with the number of configurations that were looked at since the last call.

    Raises:
        QuestionError: There is no such joint, or it slides without limits.
    """
    arm, k = task.arm, min(len(task.rows), task.arm.n)
    for name in names:
        if name not in arm.joints:
            raise QuestionError(
                f'--over: no joint "{name}"{did_you_mean(name, arm.joints)}; '
                f"its joints: {', '.join(arm.joints)}"
            )
    if names[0] == names[1]:
        raise QuestionError(f'--over needs two different joints, got "{names[0]}" twice')
    one, other = joints = (arm.joints.index(names[0]), arm.joints.index(names[1]))
    steps = [_positions(task, joint, cells) for joint in joints]
    shape, is_square = (len(steps[0]), len(steps[1])), len(task.rows) == arm.n
    sigma, value = np.empty((*shape, k)), np.empty(shape)
    rows = max(1, BLOCK // shape[1])
    for begin in range(0, shape[0], rows):
        some = slice(begin, begin + rows)
        every = np.tile(q, (*value[some].shape, 1))
        every[..., one], every[..., other] = steps[0][some, None], steps[1]
        flat = every.reshape(-1, arm.n)
        sigma[some] = survey(task, flat).sigma.reshape(*value[some].shape, k)
        if is_square:
            value[some] = np.linalg.det(task.matrix(jacobians(task, flat)[1])).reshape(value[some].shape)
        if on_samples is not None:
            on_samples(len(flat))
    known = Survey(every, every, sigma.reshape(-1, k))
    values = {
        "sigma_min": sigma[..., -1],
        "manipulability": known.manipulability.reshape(shape),
        "condition": known.condition.reshape(shape),
    }
    curves = zero_curves(value) if is_square else []
    grid = [np.arange(len(step)) for step in steps]
    singular = tuple(
        np.stack([np.interp(curve[:, c], grid[c], steps[c]) for c in range(2)], axis=1) for curve in curves
    )
    return JointMap(task, joints, steps[0], steps[1], q, values, singular)


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
