"""An arm at one configuration: pose, Jacobian, lost directions, ellipsoids, errors, reactions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.factors import Factor, factors
from rmrc.analysis.inspect.directions import LOST, SLOW, Lost, Motion, Slow, examine, rank_of
from rmrc.analysis.inspect.routes import Array, jacobians
from rmrc.analysis.inspect.words import amount, direction, listed
from rmrc.analysis.statics.balance import Balance, balance
from rmrc.analysis.subject import FRAMES, Model, Packages, numbers, subject
from rmrc.arm import Arm
from rmrc.arm.inventory import Mechanism, find_mechanism
from rmrc.law.task import SAMPLES, Task
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.spatial import AXES, quat_to_matrix
from rmrc.textbook.displacement import tip_covariance, tip_error
from rmrc.textbook.ellipsoid import Ellipsoid, force_ellipsoid, velocity_ellipsoid
from rmrc.textbook.euler import analytic_jacobian, zyz_angles, zyz_is_singular, zyz_rate_matrix
from rmrc.textbook.reference_frame import rotate_jacobian
from rmrc.textbook.singularity import rank_by_minors

WRENCH = ("fx", "fy", "fz", "nx", "ny", "nz")

# A joint counts as near its limit within this share of its range: some 10 degrees for most joints.
NEAR_LIMIT = 0.05
# A limit in degrees, rounded to radians in a file of eight digits, is not exceeded by less than this.
AT_LIMIT = 1e-6
# The largest number of minors to compute. 6 rows and 20 joints have 230 229, which take a tenth of a second.
MOST_MINORS = 250_000


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """Velocities for unit joint rates, and forces for unit joint torques, in one kind of rows.

    Slides count per L meters, the characteristic length, and their forces times L.

    Attributes:
        rows: Names of the rows: of x y z, or of rx ry rz.
        velocity: Half axes, descending [m/s or rad/s].
        force: Along the same axes, half axes ascending [N or N·m]; infinite along lost directions.
    """

    rows: tuple[str, ...]
    velocity: Ellipsoid
    force: Ellipsoid


@dataclass(frozen=True, eq=False)
class TipError:
    """The effect of joint errors on the site, to first order.

    Attributes:
        joints: Error of each joint, δθ, (n,) [rad or m].
        displacement: J δθ, rows x y z rx ry rz, (6,) [m, rad]: these errors, with their signs.
        covariance: J Σ Jᵀ for independent random errors with standard deviations |δθ|, (6, 6)
            [m², m rad, rad²].
        worst_translation: Largest standard deviation, times its direction, (3,) [m].
        worst_rotation: Likewise, (3,) [rad].
    """

    joints: Array
    displacement: Array
    covariance: Array
    worst_translation: Array
    worst_rotation: Array

    @property
    def deviation(self) -> Array:
        """Standard deviation of each of x y z rx ry rz, (6,) [m, rad]."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


@brief
@dataclass(frozen=True, eq=False)
class Inspection:
    """An arm at one configuration. Vectors are along world axes except `jacobian`.

    Attributes:
        arm: The arm, with its site.
        q: Joint positions, (n,) [rad or m].
        pose: Pose of the site in the world, [p, quat w x y z], (7,).
        angles: Its orientation as Z-Y-Z angles, (3,) [rad].
        frame: `world`, `site` or `base`: the axes of `jacobian` and of the words.
        R_world_frame: Its rotation, (3, 3).
        jacobian: J of the site's origin, rows [v; ω] along the axes of the frame, (6, n).
        disagreement: Largest entry of the difference from MuJoCo's J, by route of `routes.ROUTES` [m or 1].
        task: The rows that count.
        why: The reason for these rows, in words.
        determinant: Determinant of these rows of J along the axes of the task; None if they are not square.
        factors: Its factors, one for each family of singularities; none if no structure is known.
        sigma: Singular values of A = S_x J S_q, descending, (k,).
        rank: Rank of A, by its singular values.
        rank_by_minors: By its determinants; None if they are too many.
        lost: Task directions that cannot move.
        slow: Task directions that nearly cannot: their κ is at least 100, the law's SINGULAR.
        standing: Joint motions that do not move the task: of a redundant arm, or at a singularity.
        ellipsoids: Ellipsoids of the translations of the task, and of its rotations, along its axes.
        E: Ω = E Θ̇ for the Z-Y-Z angles, (3, 3).
        analytic_jacobian: Rows [ṗ; α̇; β̇; γ̇], (6, n); None where the angles are singular.
        angles_in_words: Whether the angles are singular here, and which motion they cannot describe.
        tip_error: None if no joint errors were given.
        balance: The torques that balance the wrench, without gravity; None if no wrench was given.
        mechanism: The motion of the site by the actuators where loops close the arm; None without loops.
        warnings: Problems of the question that do not prevent an answer.
    """

    arm: Arm
    q: Array
    pose: Array
    angles: Array
    frame: str
    R_world_frame: Array
    jacobian: Array
    disagreement: Mapping[str, float]
    task: Task
    why: str
    determinant: float | None
    factors: tuple[Factor, ...]
    sigma: Array
    rank: int
    rank_by_minors: int | None
    lost: tuple[Lost, ...]
    slow: tuple[Slow, ...]
    standing: tuple[Motion, ...]
    ellipsoids: tuple[Ellipsoids, ...]
    E: Array
    analytic_jacobian: Array | None
    angles_in_words: str
    tip_error: TipError | None
    balance: Balance | None
    mechanism: Mechanism | None
    warnings: tuple[str, ...]

    @property
    def condition(self) -> float:
        """κ = σ_1/σ_k, infinite where the rank is lost."""
        return float(self.sigma[0] / self.sigma[-1]) if self.rank == len(self.sigma) else np.inf

    @property
    def manipulability(self) -> float:
        """Manipulability w = ∏ σ [Yoshikawa85]."""
        return float(np.prod(self.sigma))

    @property
    def room(self) -> Array:
        """Distance of each joint from the nearer of its limits, (n,) [rad or m]; negative beyond it."""
        lower, upper = self.arm.position_limit.T
        return np.asarray(np.minimum(self.q - lower, upper - self.q))


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
    wrench: ArrayLike | None = None,
) -> Inspection:
    """Return the kinematics of an arm at one configuration; the function behind `rmrc inspect`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        q: Joint positions, (n,) [rad or m]; a warning reports those outside limits. None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
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
        wrench: [f; n] that acts on the arm at the site, along world axes, (6,) [N, N·m].

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: Any of the others does not fit the arm.

    Example:
        >>> found = inspect("models/planar_2link.xml", [0.0, 0.0])
        >>> found.rank, found.lost[0].words
        (1, 'cannot move along x; a force along x needs no torque')
        >>> found.standing[0].words
        'shoulder and elbow turn against each other, 1 : -2, without moving x and y of the site, \
which turns about -z'
    """
    asked = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    arm, q, task = asked.arm, asked.q, asked.task
    frame = task.frame if frame is None else frame
    if frame not in FRAMES:
        hint = did_you_mean(frame, FRAMES)
        raise QuestionError(f'frame: no frame "{frame}"{hint}; choose from {" ".join(FRAMES)}')
    pose, routes = arm.pose(q), jacobians(arm, q)
    J, R, turned = routes["mujoco"], quat_to_matrix(pose[3:]), _frame_rotation(arm, q, pose, frame)
    J_task, angles = task.turned(J, pose), zyz_angles(R)
    A = task.matrix(J_task)
    sigma, lost, slow, standing = examine(task, J, pose, turned, frame)
    minors = sum(comb(A.shape[0], r) * comb(A.shape[1], r) for r in range(1, len(sigma) + 1))
    return Inspection(
        arm=arm, q=q, pose=pose, angles=angles, frame=frame, R_world_frame=turned,
        jacobian=rotate_jacobian(J, turned.T),
        disagreement={
            name: float(np.abs(other - J).max()) for name, other in routes.items() if name != "mujoco"
        },
        task=task, why=_why(task, asked=asked.axes is not None),
        determinant=float(np.linalg.det(J_task[task.rows])) if A.shape[0] == A.shape[1] else None,
        factors=factors(task, J), sigma=sigma, rank=rank_of(sigma),
        rank_by_minors=int(rank_by_minors(A, LOST)) if minors <= MOST_MINORS else None,
        lost=lost, slow=slow, standing=standing, ellipsoids=_ellipsoids(task, J_task),
        E=zyz_rate_matrix(angles),
        analytic_jacobian=None if zyz_is_singular(angles) else analytic_jacobian(J, angles),
        angles_in_words=_angles_in_words(angles),
        tip_error=None if joint_error is None else _tip_error(arm, J, joint_error),
        balance=None if wrench is None else balance(arm, q, numbers("wrench", wrench, WRENCH)),
        mechanism=find_mechanism(arm, q),
        warnings=_warnings(arm, q),
    )  # fmt: skip


def _frame_rotation(arm: Arm, q: Array, pose: Array, frame: str) -> Array:
    """Return the rotation of a frame in the world, (3, 3)."""
    if frame == "world":
        return np.eye(3)
    if frame == "site":
        return quat_to_matrix(pose[3:])
    poses, _ = arm.frames(arm.configuration(q)[None])
    return quat_to_matrix(poses[0, arm.wiring.base, 3:])


def _why(task: Task, asked: bool) -> str:
    """Return the reason for these rows."""
    if asked:
        return "as requested"
    if len(task.rows) == 6:
        return "the arm can move all six independently"
    largest = np.max([np.abs(task.arm.jacobian(q)).max(axis=1) for q in task.arm.sampled(SAMPLES)], axis=0)
    still = [axis for axis, most in zip(AXES, largest, strict=True) if most <= LOST * largest.max()]
    tied = [axis for axis in AXES if axis not in still and axis not in task.axes]
    reasons = [
        f"{listed(names)} {verb}{'s' * (len(names) == 1)} {what}"
        for names, verb, what in ((still, "stay", "as it is" if len(still) == 1 else "as they are"),
                                  (tied, "follow", "from these"))
        if names
    ]  # fmt: skip
    return f"those that the arm can move independently; {', '.join(reasons)}"


def _ellipsoids(task: Task, J: Array) -> tuple[Ellipsoids, ...]:
    found = []
    for rows in (task.rows[task.rows < 3], task.rows[task.rows >= 3]):
        if len(rows):
            part = J[rows] * task.joint_scale
            names = tuple(AXES[row] for row in rows)
            found.append(Ellipsoids(names, velocity_ellipsoid(part), force_ellipsoid(part)))
    return tuple(found)


def _angles_in_words(angles: Array) -> str:
    """Return whether Z-Y-Z angles are singular at an orientation, and which motion they cannot describe."""
    u, sigma, _ = np.linalg.svd(zyz_rate_matrix(angles))
    hard = direction(u[:, -1] * np.sign(u[np.argmax(np.abs(u[:, -1])), -1]))
    if zyz_is_singular(angles):
        return (
            f"the angles are singular here: no rates of theirs turn the site about {hard}, and the "
            "analytic Jacobian has no value; the singularity belongs to the angles, not to the arm"
        )
    if sigma[-1] <= SLOW * sigma[0]:
        return (
            f"the angles are nearly singular here: to turn about {hard} at 1 rad/s they change at up to "
            f"{amount(1.0 / sigma[-1])} rad/s; the singularity belongs to the angles, not to the arm"
        )
    return "the angles are regular here: the analytic Jacobian is singular where J is, and nowhere else"


def _tip_error(arm: Arm, J: Array, errors: ArrayLike) -> TipError:
    joints = numbers("joint error", errors, arm.joints)
    covariance = tip_covariance(J, np.diag(joints**2))
    worst_translation, worst_rotation = (_worst(covariance[part, part]) for part in (slice(3), slice(3, 6)))
    return TipError(joints, tip_error(J, joints), covariance, worst_translation, worst_rotation)


def _worst(covariance: Array) -> Array:
    variances, directions = np.linalg.eigh(covariance)
    worst = directions[:, -1] * np.sqrt(max(variances[-1], 0.0))
    return np.asarray(worst if worst[np.argmax(np.abs(worst))] >= 0.0 else -worst)


def _warnings(arm: Arm, q: Array) -> tuple[str, ...]:
    said = []
    for joint, position, (lower, upper) in zip(arm.joints, q, arm.position_limit, strict=True):
        if not lower - AT_LIMIT <= position <= upper + AT_LIMIT:
            end, limit = ("lower", lower) if position < lower else ("upper", upper)
            said.append(f"{joint} = {position:.4g} is outside of its limits: the {end} one is {limit:.4g}")
    return tuple(said)
