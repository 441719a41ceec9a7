"""An arm at one configuration: pose, Jacobian, lost directions, ellipsoids, errors of joints at the site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.singularities import LOST, Direction, direction, examine, factors, jacobians
from rmrc.analysis.subject import Model, Packages, axes_of, numbers, subject
from rmrc.arm import Arm
from rmrc.arm.inventory import Mechanism, find_mechanism
from rmrc.law.task import Array, Task
from rmrc.show.sheets import Sheet, as_markdown, number
from rmrc.support.spatial import AXES, quat_to_matrix
from rmrc.support.text import brief
from rmrc.textbook.motion import (
    rotate_jacobian,
    tip_covariance,
    tip_error,
    zyz_angles,
    zyz_is_singular,
    zyz_rate_matrix,
)
from rmrc.textbook.singularity import force_ellipsoid, rank_by_minors, velocity_ellipsoid

# A limit in degrees, rounded to radians in a file of eight digits, is not exceeded by less than this.
AT_LIMIT = 1e-6
# The largest number of minors to compute. 6 rows and 20 joints have 230 229, which take a tenth of a second.
MOST_MINORS = 250_000


@brief
@dataclass(frozen=True, eq=False)
class Inspection:
    """An arm at one configuration.

    The attributes are also the keys of the JSON, where a number that is not finite is null. Units are SI and
    radians; vectors are along world axes except `jacobian`.

    Attributes:
        arm: The arm; in JSON its `model`, `site`, `assumed`, `joints`, `kinds`, `units` and `limits`.
        task: The rows that count; in JSON their `rows`, `frame` and `length`.
        q: Joint positions, (n,) [rad or m].
        pose: Pose of the site in the world, [p, quat w x y z], (7,).
        angles: Its orientation as Z-Y-Z angles, (3,) [rad].
        angles_in_words: The rates of these angles that the site needs at most, or that they are singular.
        frame: `world`, `site` or `base`: the axes of `jacobian` and of the words.
        jacobian: J of the site's origin, rows [v; ω] along the axes of the frame, (6, n).
        disagreement: Largest entry of the difference from MuJoCo's J, by method [m or 1].
        determinant: Determinant of the task's rows of J along their axes; None if they are not square.
        factors: Its factors: name, term, family, where, power, value, vanishes; see `Product`.
        sigma: Singular values of A = S_x J S_q, descending, (k,).
        rank: Rank of A, by its singular values.
        rank_by_minors: By its determinants; None if they are too many.
        condition: κ = σ_1/σ_k, infinite where the rank is lost.
        manipulability: Manipulability w = ∏ σ [Yoshikawa85].
        lost: Task directions that cannot move.
        self_motions: Joint motions that do not move the task: of a redundant arm, or at a singularity.
        ellipsoids: Of the translations of the task, and of its rotations: `rows`; `directions`, (m, 3);
            half axes along them, `velocity` for unit-norm joint rates [m/s or rad/s], descending, and
            `force` for unit-norm joint torques [N or N·m], infinite if lost. Slides count per L meters, the
            characteristic length, and their forces times L.
        tip_error: `joints`, the error of each joint; `displacement`, J times it; `deviation` of each row x y
            z rx ry rz if the errors are independent standard deviations; None if no errors were given.
        mechanism: The motion of the site by the actuators where loops close the arm; None without loops.
        warnings: Problems of the question that do not prevent an answer.
    """

    arm: Arm
    task: Task
    q: Array
    pose: Array
    angles: Array
    angles_in_words: str
    frame: str
    jacobian: Array
    disagreement: Mapping[str, float]
    determinant: float | None
    factors: Sequence[Mapping[str, Any]]
    sigma: Array
    rank: int
    rank_by_minors: int | None
    condition: float
    manipulability: float
    lost: tuple[Direction, ...]
    self_motions: tuple[Direction, ...]
    ellipsoids: Sequence[Mapping[str, Any]]
    tip_error: Mapping[str, Array] | None
    mechanism: Mechanism | None
    warnings: tuple[str, ...]

    def _repr_markdown_(self) -> str:
        """Return what a notebook shows of it."""
        rows = [
            ("q", ", ".join(map(number, self.q))), ("sigma", ", ".join(map(number, self.sigma))),
            ("condition kappa", number(self.condition)), ("manipulability w", number(self.manipulability)),
            *(("lost", each.words) for each in self.lost),
        ]  # fmt: skip
        title = f"{self.arm.path.name}, site {self.arm.site}"
        return as_markdown(Sheet(title, ("", "value"), rows, frozenset({0, 1})))


def inspect(
    model: Model,
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    frame: str | None = None,
    joint_error: ArrayLike | None = None,
) -> Inspection:
    """Return the kinematics of an arm at one configuration; the function behind `rmrc inspect`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        q: Joint positions, (n,) [rad or m]; a warning reports those outside limits. None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.tree`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        axes: Rows that count, of x y z rx ry rz; None: those of a scenario, or else those that the arm
            can move independently, see `rmrc.law.task.choose`.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows
            they are, or else `world`.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        frame: Frame of J and of the words: `world`, `site` or `base`, the body that carries the arm;
            None: that of the rows.
        joint_error: Error of each joint, whose magnitude is taken as a standard deviation as well, (n,)
            [rad or m].

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: Any of the others does not fit the arm.

    Example:
        >>> found = inspect("models/planar_2link.xml", [0.0, 0.0])
        >>> found.rank, found.lost[0].words
        (1, 'cannot move along x; a force along x needs no torque')
        >>> found.self_motions[0].words
        'shoulder and elbow turn against each other, 1 : -2, and the site turns about -z'
    """
    question = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    arm, q, task = question.arm, question.q, question.task
    frame, pose, J = frame or task.frame, arm.pose(q), arm.jacobian(q)
    R, rows, errors = axes_of(arm, q, frame), task.turned(J, pose), None
    A, angles = task.matrix(rows), zyz_angles(quat_to_matrix(pose[3:]))
    sigma, rank, lost, self_motions = examine(task, J, pose, R)
    mujoco, *others = jacobians(arm, q).items()
    if joint_error is not None:
        errors = _tip_error(J, numbers("joint error", joint_error, arm.joints))
    return Inspection(
        arm=arm, task=task, q=q, pose=pose, angles=angles, angles_in_words=_angles_in_words(angles),
        frame=frame, jacobian=rotate_jacobian(J, R.T),
        disagreement={name: float(np.abs(other - mujoco[1]).max()) for name, other in others},
        determinant=float(np.linalg.det(rows[task.rows])) if A.shape[0] == A.shape[1] else None,
        factors=factors(task, J), sigma=sigma, rank=rank,
        rank_by_minors=int(rank_by_minors(A, LOST)) if comb(sum(A.shape), len(A)) <= MOST_MINORS else None,
        condition=float(sigma[0] / sigma[-1]) if rank == len(sigma) else np.inf,
        manipulability=float(np.prod(sigma)), lost=lost, self_motions=self_motions,
        ellipsoids=_ellipsoids(task, rows, pose), tip_error=errors, mechanism=find_mechanism(arm, q),
        warnings=_warnings(arm, q),
    )  # fmt: skip


def _ellipsoids(task: Task, J: Array, pose: Array) -> list[dict[str, Any]]:
    ellipsoids = []
    for rows in (task.rows[task.rows < 3], task.rows[task.rows >= 3]):
        if len(rows):
            part = J[rows] * task.joint_scale
            velocity, directions = velocity_ellipsoid(part), np.zeros((3, len(rows)))
            directions[rows % 3] = velocity.axes
            ellipsoids.append({
                "rows": [AXES[row] for row in rows], "directions": task.view.back(directions, pose).T,
                "velocity": velocity.half_axes, "force": force_ellipsoid(part).half_axes,
            })  # fmt: skip
    return ellipsoids


def _angles_in_words(angles: Array) -> str:
    """Return whether Z-Y-Z angles are singular at an orientation, or how fast they change."""
    u, sigma, _ = np.linalg.svd(zyz_rate_matrix(angles))
    if not zyz_is_singular(angles):
        return f"they change at up to {1.0 / sigma[-1]:.3g} rad/s while the site turns at 1 rad/s"
    axis = direction(u[:, -1] * np.sign(u[np.argmax(np.abs(u[:, -1])), -1]))
    return f"the angles are singular here: no rates of theirs turn the site about {axis}; the arm need not be"


def _tip_error(J: Array, joints: Array) -> dict[str, Array]:
    variance = np.diag(tip_covariance(J, np.diag(joints**2)))
    deviation = np.sqrt(np.maximum(variance, 0.0))
    return {"joints": joints, "displacement": tip_error(J, joints), "deviation": deviation}


def _warnings(arm: Arm, q: Array) -> tuple[str, ...]:
    return tuple(
        f"{joint} = {position:.4g} is outside of its limits [{lower:.4g}, {upper:.4g}]"
        for joint, position, (lower, upper) in zip(arm.joints, q, arm.position_limit, strict=True)
        if not lower - AT_LIMIT <= position <= upper + AT_LIMIT
    )
