"""The 3-D view of a run as arrays: bodies, ellipsoids, and the lost direction.

This module does not know the viewer, so that tests can check every length and direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.recording.shapes import Shape, shapes_of
from rmrc.results.run import Run
from rmrc.show.palette import hue
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import matrix_to_quat, quat_to_matrix
from rmrc.textbook.ellipsoid import holding_jacobian

Array = NDArray[np.float64]

# The velocity ellipsoid is as long as the way of the tip in this time at unit-norm joint rates. An
# outstretched arm with one shoulder then shows a fifth of its reach, which is visible and hides little.
VELOCITY_SECONDS = 0.2

# The force ellipsoid has the size of the velocity ellipsoid where sigma is this part of the reach,
# and no radius is drawn longer than the second part: at a singularity 1/sigma has no bound.
FORCE_EQUAL = 0.5
FORCE_LONGEST = 0.3

# Half thickness of flat shapes, as a part of the reach: thin, but not so thin that it flickers.
THICKNESS = 0.002

# A path this near to the first moving body counts as at it [m].
POINT = 1e-6

# Room around the path for the ellipsoids and arrows at the tip, as a part of the reach.
MARGIN = 0.3

# Least room around the hand in a picture of it alone, as a part of the reach, and as a multiple of its error.
CLOSEST, OFF = 0.1, 4.0

# A geometry has a color, and is not gray, if its red, green and blue differ by this much.
COLORED = 0.3

# Directions in which the farthest points must be in the frame: edges, corners and faces of a cube.
DIRECTIONS = np.array([step for step in np.ndindex(3, 3, 3) if step != (1, 1, 1)], float) - 1.0

# Points that stand for the arm, which a label must not cover: their distance as a part of the reach, their
# largest number along an edge of a box around a body, and the number of instants of each part of the run.
DENSE, MOST_POINTS, INSTANTS = 0.04, 24, 8

# Points in a ball of radius 1.
BALL = np.array([step for step in np.ndindex(9, 9, 9) if np.linalg.norm(np.subtract(step, 4)) <= 4.1]) / 4 - 1

# Length of a joint's axis outside its housing, and the largest size of a housing, as parts of the reach.
AXIS, LONGEST_AXIS = 0.05, 0.3

# Each half of the double arrow along the lost direction, as a part of the reach.
ARROW = 0.22


@dataclass(frozen=True, eq=False)
class Frames:
    """The visible objects at F instants; lengths in meters along world axes.

    Attributes:
        bodies: Pose of each body of the model, (F, nbody, 7).
        tip: Site, (F, 3).
        target: Its target, (F, 3).
        axes: Orientation of both ellipsoids, quat w x y z, (F, 4): local axis i is u_i.
        velocity: Half axes of the velocity ellipsoid, descending, (F, 3).
        force: Half axes of the force ellipsoid, along the same axes, (F, 3).
        dying_move: Translation that becomes impossible first, (F, 3).
        dying_turn: Axis of the rotation that becomes impossible first, (F, 3).
        nearness: 0 where no damping is due, 1 at the singularity, (F,).
    """

    bodies: Array
    tip: Array
    target: Array
    axes: Array
    velocity: Array
    force: Array
    dying_move: Array
    dying_turn: Array
    nearness: Array


class Scene:
    """The arm and the task of one world, ready to be drawn.

    Attributes:
        shapes: Visible geometries.
        body_names: Body names of all bodies; a body without a name is called by its number.
        is_fixed: Which bodies never move, (nbody,).
        reach: Largest distance from the first moving body to the tip, over start and target; of a wrist that
            turns about the tip itself the farthest corner of its shapes from there [m].
        points: Corners of the arm where it starts and around the target path, (p, 3) [m].
        normal: Axis (0, 1, 2) along which the tip cannot move, or None for a spatial arm.
        path: Target positions, (p, 3) [m].
        believed: The arm as the law knows it.
        joint_of: Joint that moves each body, by its number; -1: none of the arm's, (nbody,).
        joint_axes: Body and axis of each joint, as a line in the frame of that body, (2, 3) [m].
    """

    def __init__(self, prepared: Prepared) -> None:
        """Examine the arm at its start."""
        arm = prepared.true_arm
        self._arm, self.believed = arm, prepared.arm
        self._joint_scale = prepared.task.joint_scale
        rows = prepared.task.rows
        self._rows, self._held, self._view = rows[rows < 3], rows[rows > 2], prepared.task.view
        self._below = prepared.scenario.control.inverse.damping.below
        self.shapes = shapes_of(arm)
        self.body_names, self.is_fixed = arm.body_names, arm.model.body_weldid == 0
        self.path = prepared.reference.pose[:, :3]

        q = prepared.qpos[arm.wiring.qpos]
        bodies, tip = arm.frames(prepared.qpos[None])[0][0], arm.pose(q)[:3]
        moving = bodies[~self.is_fixed, :3]
        self.reach = float(np.linalg.norm(np.vstack([tip, self.path]) - moving[0], axis=1).max())
        boxes = [_box(shape, bodies[shape.body]) for shape in self.shapes]
        if self.reach < POINT:
            turned = [
                box for box, shape in zip(boxes, self.shapes, strict=True) if not self.is_fixed[shape.body]
            ]
            self.reach = max((float(np.linalg.norm(box - tip, axis=1).max()) for box in turned), default=1.0)
        tool = [box for box, shape in zip(boxes, self.shapes, strict=True) if shape.body == arm.wiring.body]
        room = max([MARGIN * self.reach, *(np.linalg.norm(box - tip, axis=1).max() for box in tool)])
        around = room * np.vstack([np.eye(3), -np.eye(3)])
        near_path = (self.path[:: max(1, len(self.path) // 50), None] + around).reshape(-1, 3)
        self.points = np.vstack([moving, near_path, *boxes])
        self._corners = _corners(self.shapes)
        self.joint_of, self.joint_axes = _joints(arm, self._corners, bodies, self.reach)
        # A second configuration, for an arm that only starts in a plane.
        lines = np.vstack([arm.jacobian(q + shift)[:3].T for shift in (0.0, 0.3)])
        still = np.flatnonzero(np.abs(lines).max(axis=0) < 1e-9 * self.reach)
        self.normal = int(still[-1]) if len(still) else None

    def painted(self, shape: Shape) -> Shape:
        """Return a geometry in the color of the joint that moves it, if it has any color at all."""
        joint = self.joint_of[shape.body]
        if joint < 0 or np.ptp(shape.rgba[:3]) < COLORED:
            return shape
        channels = [(hue(joint) >> shift & 255) / 255.0 for shift in (24, 16, 8)]
        return replace(shape, rgba=np.array([*channels, shape.rgba[3]]))

    def outermost(self, frames: Frames) -> Array:
        """Return the points of the arm that are farthest in many directions at some instants, (p, 3) [m]."""
        moving = [body for body in self._corners if not self.is_fixed[body]]
        corners = np.array([self._corners[body] for body in moving]).reshape(-1, 8, 3)
        turn = np.swapaxes(quat_to_matrix(frames.bodies[:, moving, 3:]), 2, 3)
        there = (frames.bodies[:, moving, None, :3] + corners @ turn).reshape(-1, 3)
        points = np.vstack([frames.tip, there]).astype(np.float32)
        return np.asarray(points[np.unique((DIRECTIONS @ points.T).argmax(axis=1))])

    def covered(self, frames: Frames) -> Array:
        """Return points all over the arm and of the tip at a few of some instants, (p, 3) [m]."""
        few = slice(None, None, -(-len(frames.tip) // INSTANTS))
        found = [frames.tip[few]]
        for body, corners in self._corners.items():
            low, high = corners.min(axis=0), corners.max(axis=0)
            counts = np.clip((high - low) / (DENSE * self.reach), 1, MOST_POINTS).astype(int) + 1
            inside = low + (high - low) * np.array([*np.ndindex(*counts)]) / (counts - 1)
            poses = frames.bodies[few, body]
            turn = np.swapaxes(quat_to_matrix(poses[:, 3:]), 1, 2)
            found.append((poses[:, None, :3] + inside @ turn).reshape(-1, 3))
        return np.vstack(found)

    def hand(self, instant: Run) -> Array:
        """Return points in the ellipsoids and on the arrows at the one tick of a run, (p, 3) [m]."""
        frames = self.frames(instant, np.array([0]))
        tip, axes = frames.tip[0], quat_to_matrix(frames.axes[0]).T
        arrows = np.linspace(-1.0, 1.0, len(BALL))[:, None] * (frames.dying_move + frames.dying_turn)
        return np.asarray(
            tip + np.vstack([BALL * frames.velocity @ axes, BALL * frames.force @ axes, arrows])
        )

    def around(self, instant: Run) -> Array:
        """Return points around the hand at the one tick of a run, (p, 3) [m].

        There is room for its ellipsoids, and for a few times its error.
        """
        frames = self.frames(instant, np.array([0]))
        tip, target = frames.tip[0], frames.target[0]
        longest = 1.05 * float(max(frames.velocity.max(), frames.force.max()))
        room = max(CLOSEST * self.reach, OFF * float(np.linalg.norm(target - tip)), longest)
        return np.vstack([tip + room * np.eye(3), tip - room * np.eye(3), target])

    def believed_bodies(self, part: Run, rows: NDArray[np.int64]) -> Array:
        """Return the law's assumed poses of the bodies at some ticks of a part of the run, (F, nbody, 7)."""
        arm = self.believed
        return arm.frames(np.array([arm.placed(part["qpos"][row], part["q_believed"][row]) for row in rows]))[
            0
        ]

    def frames(self, part: Run, rows: NDArray[np.int64]) -> Frames:
        """Return the visible objects at some ticks of a part of the run.

        Both ellipsoids belong to M = J_v S_q (1 - J_w⁺ J_w): J_v has the translations that the task
        has, J_w = J_ω S_q its rotations, which are held, and S_q measures joint rates as the law does.
        At unit-norm joint rates the tip reaches velocities sigma_i along u_i of M; at unit-norm
        joint torques it holds forces 1/sigma_i [Yoshikawa85]. Without the projector, M would stay
        round at a wrist singularity, where translations are only possible with a turn.

        Args:
            part: Any part of the run.
            rows: Ticks of that part, (F,).
        """
        bodies, jacobians = self._arm.frames(part["qpos"][rows])
        pose = part["pose"][rows]
        J = self._view.turned(jacobians, pose)
        axes, sigma = principal(J * self._joint_scale, self._rows, self._held)
        axes, u_min = self._view.back(axes, pose), self._view.back(part["u_min"][rows], pose)
        velocity, force = half_axes(sigma, len(self._rows), self.reach)
        return Frames(
            bodies=bodies,
            tip=pose[:, :3],
            target=part["pose_ref"][rows, :3],
            axes=matrix_to_quat(axes),
            velocity=velocity,
            force=force,
            dying_move=ARROW * self.reach * u_min[:, :3],
            dying_turn=ARROW * self.reach * u_min[:, 3:],
            nearness=1.0 - np.clip(part["sigma"][rows, -1], 0.0, self._below) / self._below,
        )


def half_axes(sigma: Array, rows: int, reach: float) -> tuple[Array, Array]:
    """Return the half axes at which the two ellipsoids are drawn, (F, 3) each [m].

    Args:
        sigma: Singular values, falling; only the first `rows` are of the task, (F, 3) [m].
        rows: Translations that the task has; along the others the ellipsoids are flat.
        reach: Reach of the arm [m].
    """
    thin, longest = THICKNESS * reach, FORCE_LONGEST * reach
    velocity = np.full_like(sigma, thin)
    force = np.full_like(sigma, thin)
    velocity[:, :rows] = np.maximum(VELOCITY_SECONDS * sigma[:, :rows], thin)
    # c/sigma, with c so that both are equal where sigma = FORCE_EQUAL · reach
    c = VELOCITY_SECONDS * (FORCE_EQUAL * reach) ** 2
    force[:, :rows] = c / np.maximum(sigma[:, :rows], c / longest)
    return velocity, force


def principal(J: Array, rows: NDArray[np.int64], held: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the axes u_i as columns of rotation matrices (F, 3, 3), and sigma, falling (F, 3) [m].

    Axes of the world that are not in `rows` come last, with sigma 0; they must not mix with a u_i
    whose sigma is 0.

    Args:
        J: Jacobians, (F, 6, n).
        rows: Rows of the translations that count, 0 to 2.
        held: Rotation rows that are held, 3 to 5.
    """
    frames, a = len(J), len(rows)
    axes, sigma = np.zeros((frames, 3, 3)), np.zeros((frames, 3))
    others = np.setdiff1d(np.arange(3), rows)
    axes[:, others, np.arange(a, 3)] = 1.0
    if a:
        u, s, _ = np.linalg.svd(holding_jacobian(J[:, rows], J[:, held]))
        axes[:, rows, :a] = u
        sigma[:, : s.shape[1]] = s
    axes[:, :, 2] *= np.linalg.det(axes)[:, None]  # a rotation, not a reflection
    return axes, sigma


def _joints(
    arm: Arm, corners: dict[int, Array], bodies: Array, reach: float
) -> tuple[list[int], list[tuple[int, Array]]]:
    """Return the joint that moves each body, and the drawn axis of each joint, out of its housing."""
    model, ids = arm.model, arm.wiring.joint.tolist()
    moved = [int(model.jnt_bodyid[one]) for one in ids]
    joint_of, lines = [-1], []
    for body in range(1, model.nbody):
        own = [j for j, one in enumerate(moved) if one == body]
        joint_of.append(own[-1] if own else joint_of[model.body_parentid[body]])
    for body, one in zip(moved, ids, strict=True):
        turn, half = quat_to_matrix(bodies[body, 3:]), 0.0
        axis, anchor = model.jnt_axis[one], model.jnt_pos[one]
        for near in {body, int(model.body_parentid[body])} & corners.keys():
            world = bodies[near, :3] + corners[near] @ quat_to_matrix(bodies[near, 3:]).T
            along = ((world - bodies[body, :3]) @ turn - anchor) @ axis
            half = max(half, min(along.max(), -along.min()))
        half = min(half, LONGEST_AXIS * reach) + AXIS * reach
        lines.append((body, np.array([anchor - half * axis, anchor + half * axis])))
    return joint_of, lines


def _corners(shapes: Sequence[Shape]) -> dict[int, Array]:
    """Return the corners of a box around the visible geoms of each body, in its frame, (8, 3)."""
    here, boxes = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), dict[int, list[Array]]()
    for shape in shapes:
        boxes.setdefault(shape.body, []).append(_box(shape, here))
    found = {}
    for body, around in boxes.items():
        ends = np.array([np.vstack(around).min(axis=0), np.vstack(around).max(axis=0)])
        found[body] = np.array([ends[corner, [0, 1, 2]] for corner in np.ndindex(2, 2, 2)])
    return found


def _box(shape: Shape, body: Array) -> Array:
    """Return two corners of a world-aligned box around a shape, (2, 3)."""
    turn = quat_to_matrix(body[3:])
    center = body[:3] + turn @ shape.pose[:3]
    turn = turn @ quat_to_matrix(shape.pose[3:])
    radius, half, _ = shape.size
    if shape.kind == "mesh":
        corners: Array = center + shape.vertices @ turn.T
        return np.array([corners.min(axis=0), corners.max(axis=0)])
    extents = {
        "sphere": [radius] * 3,
        "capsule": [radius, radius, half + radius],
        "cylinder": [radius, radius, half],
    }.get(shape.kind, shape.size)
    extent = np.abs(turn) @ np.array(extents)
    return np.array([center - extent, center + extent])
