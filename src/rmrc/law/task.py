"""The motion that an arm is asked for: the rows of its Jacobian that count, scaled as in the law."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario import Frame
from rmrc.support.spatial import (
    AXES,
    ORIGIN,
    exp_rotation,
    pose_error,
    pose_inverse,
    pose_product,
    quat_conjugate,
    quat_multiply,
    quat_to_matrix,
    tilt_error,
)

if TYPE_CHECKING:  # a task without an arm does not load MuJoCo
    from rmrc.arm import Arm, Positions
    from rmrc.scenario import SecondarySection

Array = NDArray[np.float64]

# Rows are independent if they are at one of this many random configurations. One would do with probability 1;
# more guard against configurations that are singular by chance.
SAMPLES = 20
# A singular value below this share of the largest, at a random configuration, is rounding.
RANK_TOLERANCE = 1e-9
# A row that depends on others up to this share of itself is not chosen: files have π/2 as 1.5708 or 1.57.
INDEPENDENT = 2e-3


@dataclass(frozen=True, eq=False)
class BareJoints:
    """Joints of which only the limits are known, in place of an `Arm`: the caller has their Jacobian.

    Attributes:
        joints: Names.
        position_limit: Lower and upper limits, (n, 2) [rad or m]; infinite where there are none.
        rate_limit: Largest rates, (n,) [rad/s or m/s]; infinite where there are none.
    """

    joints: tuple[str, ...]
    position_limit: Array
    rate_limit: Array
    base_pose = ORIGIN

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def is_slide(self) -> NDArray[np.bool_]:
        """Whether each counts as sliding, or as the same after a turn: none, as nothing is known of them."""
        return np.zeros(self.n, np.bool_)

    comes_round = is_slide


Joints: TypeAlias = "Arm | BareJoints"


class View(NamedTuple):
    """The axes along which the rows of a twist are taken.

    Attributes:
        frame: The frame: the world, the arm's base, or the site as it turns.
        base: Pose of the base, (7,).
        free: The axis of the site, 0 to 2, about which it may turn freely, or -1.
    """

    frame: Frame = "world"
    base: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    free: int = -1

    @property
    def codes(self) -> tuple[int, int]:
        """Codes of frame and free axis in a world's record."""
        from rmrc.law.kinematics import FRAMES  # imports numba, which reading a run does not need

        return FRAMES.index(self.frame), self.free

    def turned(self, rows: Array, pose: Array) -> Array:
        """Return twists (..., 6) or Jacobians (..., 6, n) along these axes; see `Task.turned`."""
        return rows if self.frame == "world" else _turned(np.moveaxis(self._axes(pose), -1, -2), rows)

    def back(self, rows: Array, pose: Array) -> Array:
        """Return vectors, (..., 3 or 6) or (..., 3 or 6, n), along world axes from those along these axes."""
        return rows if self.frame == "world" else _turned(self._axes(pose), rows)

    def _axes(self, pose: Array) -> Array:
        """Return the axes as columns, (..., 3, 3)."""
        base = np.broadcast_to(self.base, (*pose.shape[:-1], 7))
        return quat_to_matrix((pose if self.frame == "site" else base)[..., 3:])

    def error(self, pose_ref: Array, pose: Array) -> Array:
        """Return the error (..., 6) [m, rad] that `rmrc.law.kinematics.framed_error` writes."""
        error = self.turned(pose_error(pose_ref, pose), pose)
        if self.free >= 0:
            error[..., 3:] = tilt_error(
                quat_multiply(quat_conjugate(pose[..., 3:]), pose_ref[..., 3:]), self.free
            )
        return error


WORLD_VIEW = View()


def _turned(R: Array, rows: Array) -> Array:
    """Return R times each three rows of (..., 3 k) or (..., 3 k, n)."""
    columns = rows.shape[-1:] if rows.ndim == R.ndim else (1,)
    count = rows.shape[R.ndim - 2] // 3  # explicit, as the leading dimensions may be empty
    threes = rows.reshape(*R.shape[:-2], count, 3, *columns)
    return np.asarray((R[..., None, :, :] @ threes).reshape(rows.shape))


def view(arm: "Arm", frame: Frame, rows: NDArray[np.intp]) -> View:
    """Return the axes of some rows of an arm's twist."""
    free = {3, 4, 5} - set(rows.tolist())
    is_one = frame == "site" and len(free) == 1
    return View(frame, tuple(arm.base_pose.tolist()), free.pop() - 3 if is_one else -1)


@dataclass(frozen=True, eq=False)
class Task:
    """Rows of an arm's Jacobian, weighted and made comparable by a characteristic length.

    Attributes:
        arm: The arm, or the bare joints of a law that is given the Jacobian of its rows.
        rows: Rows of the twist that count, (m,), ascending.
        length: Characteristic length L, which makes meters and radians comparable [m].
        weights: Task weights W_x, (m,); None: all 1.
        joint_weights: Joint weights W_q, (n,): a heavier joint moves less; None: all 1.
        frame: The frame of the rows: the world, the arm's base, or the site as it turns.
    """

    arm: "Arm"
    rows: NDArray[np.intp]
    length: float = 1.0
    weights: Sequence[float] | None = None
    joint_weights: Sequence[float] | None = None
    frame: Frame = "world"

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the rows: of x y z rx ry rz."""
        return tuple(AXES[row] for row in self.rows)

    @cached_property
    def row_scale(self) -> Array:
        """Diagonal of S_x = W_x^½, linear rows over L, (m,)."""
        weight = np.sqrt(1.0 if self.weights is None else self.weights)
        return np.asarray(weight / np.where(self.rows < 3, self.length, 1.0))

    @cached_property
    def joint_scale(self) -> Array:
        """Diagonal of S_q = W_q^-½, sliding joints times L, (n,)."""
        weight = np.sqrt(1.0 if self.joint_weights is None else self.joint_weights)
        return np.asarray(np.where(self.arm.is_slide, self.length, 1.0) / weight)

    @cached_property
    def rank(self) -> int:
        """Rank of A almost everywhere: the largest at the configurations of `Arm.proportions`."""
        if isinstance(self.arm, BareJoints):
            return min(len(self.rows), self.arm.n)
        sigma = self._sigma
        return int(np.count_nonzero(sigma > RANK_TOLERANCE * sigma[:, :1], axis=1).max())

    @cached_property
    def _sigma(self) -> Array:
        """Singular values at the configurations of `Arm.proportions`, (s, k)."""
        places = self.arm.proportions
        A = self.matrix(self.turned(places.jacobian, _poses(self.arm, self.frame, places.q)))
        return np.asarray(np.linalg.svd(A, compute_uv=False))

    @property
    def least_sigma(self) -> Array:
        """Smallest σ that is not always 0, at the configurations of `Arm.proportions`, (s,)."""
        return np.asarray(self._sigma[:, max(self.rank, 1) - 1])

    @property
    def usual_sigma(self) -> float:
        """The usual σ_min, see `rmrc.arm.geometry`; 0 if the joints do not move the rows."""
        return float(np.median(self.least_sigma)) if self.rank else 0.0

    def matrix(self, jacobian: Array) -> Array:
        """Return A = S_x J S_q, (..., m, n), for a Jacobian along the axes of the frame, (..., 6, n)."""
        return self.row_scale[:, None] * jacobian[..., self.rows, :] * self.joint_scale

    @cached_property
    def view(self) -> "View":
        """The axes of its rows."""
        return view(self.arm, self.frame, self.rows)

    def turned(self, rows: Array, pose: Array) -> Array:
        """Return twists (..., 6) or Jacobians (..., 6, n) along the axes of the frame.

        Args:
            rows: Twists or Jacobians along world axes.
            pose: Pose of the site, (..., 7).
        """
        return self.view.turned(rows, pose)

    def write(self, world: np.void) -> None:
        """Write the rows, their scales and the geometry of the arm into a world's record."""
        task, chain, m, n = world["task"], world["chain"], len(self.rows), self.arm.n
        world["n"], world["m"], world["k"], world["rank"] = n, m, min(m, n), self.rank
        (task["frame"], task["free"]), task["base"] = self.view.codes, self.view.base
        task["row"][:m], task["row_scale"][:m] = self.rows, self.row_scale
        task["joint_scale"][:n] = self.joint_scale
        if isinstance(self.arm, BareJoints):
            chain["axes"], chain["leader"][:n], chain["ratio"][:n] = n, np.arange(n), 1.0
            return
        geometry = self.arm.chain
        axes = chain["axes"] = len(geometry.names)
        slides = np.isinf(geometry.pitch)
        chain["leader"][:axes], chain["ratio"][:axes] = geometry.leader, geometry.ratio
        chain["turns"][:axes], chain["advance"][:axes] = ~slides, np.where(slides, 1.0, geometry.pitch)
        chain["axis_0"][:axes], chain["step_0"][:axes] = geometry.axis, geometry.step
        chain["tip"] = [*geometry.tip_step, *geometry.tip_quat]


def _poses(arm: "Arm", frame: Frame, q: Array) -> Array:
    """Return poses of the site, (s, 7), at joint positions (s, n), or others if the frame needs none."""
    return np.array([arm.pose(one) if frame == "site" else ORIGIN for one in q])


class SecondTask:
    """A pose of a second site that the arm keeps as far as the first task leaves room for it.

    Attributes:
        site: Name of the site.
    """

    def __init__(self, first: Task, section: "SecondarySection", start: "Positions") -> None:
        """Bind it to an arm.

        Args:
            first: The first task; its arm and length apply here as well.
            section: The section `secondary` of the scenario.
            start: Start configuration, (n,), or MuJoCo's data.
        """
        arm = first.arm
        self.site, self._feedback = section.site or arm.site, section.feedback
        self._rows = np.array([AXES.index(axis) for axis in section.axes])
        self._row_scale = 1.0 / np.where(self._rows < 3, first.length, 1.0)
        self._moves = arm.moves(self.site)
        self._by_chain = arm.behind(self.site)
        self._view = view(arm, section.frame, self._rows)
        self._pose = arm.pose(start, self.site)
        base = arm.base_at(start)
        if section.to is not None:
            frame = {"world": ORIGIN, "base": base, "site": self._pose}[section.frame]
            own = pose_product(pose_inverse(frame), self._pose)
            wanted = np.concatenate([own[:3], np.zeros(3)])
            wanted[self._rows] = section.to
            own = np.concatenate([wanted[:3], quat_multiply(exp_rotation(wanted[3:]), own[3:])])
            self._pose = pose_product(frame, own)
        self._in_base = pose_product(pose_inverse(base), self._pose)

    def write(self, world: np.void) -> None:
        """Write its rows and its target into a world's record."""
        second, m = world["second"], len(self._rows)
        second["m"], second["row"][:m], second["row_scale"][:m] = m, self._rows, self._row_scale
        second["frame"], second["free"] = self._view.codes
        second["pose_ref"], second["in_base"] = self._pose, self._in_base
        second["moves"][: len(self._moves)] = self._moves
        second["last_axis"], second["tip"][:3], second["tip"][3:] = self._by_chain
        second["feedback"] = self._feedback


def choose(
    arm: "Arm", axes: Sequence[str] | None = None, length: float | None = None, frame: Frame = "world"
) -> Task:
    """Return the task of some axes, or of those that the arm can move independently of each other.

    These are the rows of its reduced Jacobian [Khatib08]: of x y z rx ry rz, in this order, each that raises
    the rank that the rows before it have almost everywhere. A 2-link planar arm gets x and y, a SCARA arm
    x, y, z and rz, an arm with six joints or more usually all. A row that moves by a few thousandths of the
    others is rounding of the file. The rotations come first if they alone can distinguish all joints and the
    translations cannot: a spherical wrist gets rx, ry and rz at any of its points. Of equally good rotations,
    those that the arm has at home come first: a pan and three pitches that face along x get ry, not rx.

    Args:
        arm: The arm.
        axes: Of x y z rx ry rz; None to choose.
        length: Characteristic length [m]; None: that of the arm, see `rmrc.arm.geometry`.
        frame: The frame of the rows: the world, the arm's base, or the site as it turns.

    Raises:
        ValueError: No such axis.
    """
    names = _independent(arm, length or 1.0, frame) if axes is None else axes
    rows = np.array(sorted({AXES.index(axis) for axis in names}), np.intp)
    return Task(arm, rows, arm.proportions.length(rows) if length is None else length, frame=frame)


def _independent(arm: "Arm", length: float, frame: Frame) -> list[str]:
    """Return the axes that the arm can move independently of each other, in the order of choice."""
    task = Task(arm, np.arange(6), length, frame=frame)
    q = np.vstack([arm.sampled(SAMPLES), arm.configuration("home")[arm.wiring.qpos]])
    J = task.turned(np.array([arm.jacobian(each) for each in q]), _poses(arm, frame, q)) * task.joint_scale
    size = np.linalg.norm(J, axis=2).max(axis=0)
    # each row in its own unit, as a small arm is no worse than a large one
    J = np.where((size > RANK_TOLERANCE * size.max())[:, None], J / np.maximum(size, 1e-300)[:, None], 0.0)

    def rank(rows: Sequence[int], some: Array = J) -> int:
        return int((np.linalg.svd(some[:, rows], compute_uv=False) > INDEPENDENT).sum(axis=1).max(initial=0))

    turns_first = rank([3, 4, 5]) == arm.n > rank([0, 1, 2])
    rows: list[int] = []
    at_home = J[-1:]
    for some, order in ((J, range(0 if turns_first else 3)), (at_home, range(3, 6)), (J, (3, 4, 5, 0, 1, 2))):
        for row in order:
            more = [*rows, row]
            if row not in rows and rank(more) > len(rows) and rank(more, some) > rank(rows, some):
                rows = more
    return [AXES[row] for row in rows]
