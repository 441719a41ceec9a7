"""The picture of a run as arrays: bodies, ellipsoids, and the lost direction.

This module does not know the viewer, so that tests can check every length and direction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.results.run import Run
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import Array, matrix_to_quat, rotate
from rmrc.textbook.singularity import holding_jacobian

# The velocity ellipsoid is as long as the way of the tip in this time at unit-norm joint rates. An
# outstretched arm with one shoulder then shows a fifth of its reach, which is visible and hides little.
VELOCITY_SECONDS = 0.2
# The force ellipsoid has the size of the velocity ellipsoid where sigma is this part of the reach,
# and no radius is drawn longer than the second part: at a singularity 1/sigma has no bound.
FORCE_EQUAL, FORCE_LONGEST = 0.5, 0.3
# Half thickness of flat shapes, as a part of the reach: thin, but not so thin that it flickers.
THICKNESS = 0.002
# A path this near to the first moving body counts as at it [m].
POINT = 1e-6
# As parts of the reach: room around the arm and its path, half the length of a joint's axis, and each half of
# the double arrow along the lost direction.
MARGIN, AXIS, ARROW = 0.2, 0.12, 0.22
# Number of instants and of points of the path that the camera shows.
SHOWN = 50


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
        arm: The true arm.
        believed: The arm as the law knows it.
        is_fixed: Which bodies never move, (nbody,).
        reach: Largest distance from the first moving body to the tip, over start and target; of a wrist that
            turns about the tip itself that of its geoms from there [m].
        normal: Axis (0, 1, 2) along which the tip cannot move, or None for a spatial arm.
        path: Target positions, (p, 3) [m].
    """

    def __init__(self, prepared: Prepared) -> None:
        """Examine the arm at its start."""
        self.arm, self.believed, self._task = prepared.true_arm, prepared.arm, prepared.task
        rows, model = prepared.task.rows, self.arm.model
        self._rows, self._held, self._view = rows[rows < 3], rows[rows > 2], prepared.task.view
        self._below = prepared.scenario.control.inverse.damping.below
        self.is_fixed, self.path = model.body_weldid == 0, prepared.reference.pose[:, :3]
        q = prepared.qpos[self.arm.wiring.qpos]
        bodies, tip = self.arm.frames(prepared.qpos[None])[0][0], self.arm.pose(q)[:3]
        first = bodies[~self.is_fixed, :3][0]
        self.reach = float(np.linalg.norm(np.vstack([tip, self.path]) - first, axis=1).max())
        if self.reach < POINT:
            moving = ~self.is_fixed[model.geom_bodyid]
            sizes = np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound
            self.reach = float(sizes[moving].max(initial=0.0)) or 1.0
        # The corners of boxes around the visible geoms but planes, each with its body.
        seen = np.flatnonzero((model.geom_group < 3) & (model.geom_type > 1))
        signs = np.array([*np.ndindex(2, 2, 2)]) * 2.0 - 1.0
        boxes = model.geom_aabb[seen, None, :3] + signs * model.geom_aabb[seen, None, 3:]
        corners = model.geom_pos[seen, None] + rotate(model.geom_quat[seen, None], boxes)
        self._boxes = list(zip(model.geom_bodyid[seen].tolist(), corners, strict=True))
        # A second configuration, for an arm that only starts in a plane.
        lines = np.vstack([self.arm.jacobian(q + shift)[:3].T for shift in (0.0, 0.3)])
        still = np.flatnonzero(np.abs(lines).max(axis=0) < 1e-9 * self.reach)
        self.normal = int(still[-1]) if len(still) else None

    def joint_of(self, body: int) -> int:
        """Return the number of the joint that moves a body; -1: none of the arm's."""
        model, moved = self.arm.model, self.arm.model.jnt_bodyid[self.arm.wiring.joint].tolist()
        while body and body not in moved:
            body = int(model.body_parentid[body])
        return len(moved) - 1 - moved[::-1].index(body) if body else -1

    def joint_axes(self) -> list[tuple[int, Array]]:
        """Return body and axis of each joint, as a line in the frame of that body, (2, 3) [m]."""
        model, half = self.arm.model, AXIS * self.reach * np.array([[-1.0], [1.0]])
        return [
            (int(model.jnt_bodyid[joint]), model.jnt_pos[joint] + half * model.jnt_axis[joint])
            for joint in self.arm.wiring.joint
        ]

    def points(self, frames: Frames) -> Array:
        """Return points around the arm at some instants and around the path, (p, 3) [m]."""
        few, some = (slice(None, None, 1 + len(of) // SHOWN) for of in (frames.tip, self.path))
        moving = frames.bodies[few][:, ~self.is_fixed, :3].reshape(-1, 3)
        inner = np.vstack([moving, frames.tip, self.path[some]])
        room = MARGIN * self.reach * np.vstack([np.eye(3), -np.eye(3)])
        around = [(inner[:, None] + room).reshape(-1, 3)]
        for body, corners in self._boxes:
            pose = frames.bodies[few, None, body]
            around.append((pose[..., :3] + rotate(pose[..., 3:], corners)).reshape(-1, 3))
        return np.vstack(around)

    def believed_bodies(self, run: Run, rows: NDArray[np.int64]) -> Array:
        """Return the law's assumed poses of the bodies at some ticks of a run, (F, nbody, 7)."""
        placed = [self.believed.placed(run["qpos"][row], run["q_believed"][row]) for row in rows]
        return self.believed.frames(np.array(placed))[0]

    def frames(self, run: Run, rows: NDArray[np.int64]) -> Frames:
        """Return the visible objects at some ticks of a run.

        Both ellipsoids belong to M = J_v S_q (1 - J_w⁺ J_w): J_v has the translations that the task
        has, J_w = J_ω S_q its rotations, which are held, and S_q measures joint rates as the law does.
        At unit-norm joint rates the tip reaches velocities sigma_i along u_i of M; at unit-norm
        joint torques it holds forces 1/sigma_i [Yoshikawa85]. Without the projector, M would stay
        round at a wrist singularity, where translations are only possible with a turn.

        Args:
            run: The run.
            rows: Ticks, (F,).
        """
        bodies, jacobians = self.arm.frames(run["qpos"][rows])
        pose, reach = run["pose"][rows], self.reach
        J = self._view.turned(jacobians, pose)
        axes, sigma = principal(J * self._task.joint_scale, self._rows, self._held)
        axes, u_min = self._view.back(axes, pose), self._view.back(run["u_min"][rows], pose)
        velocity, force = half_axes(sigma, len(self._rows), reach)
        return Frames(
            bodies=bodies,
            tip=pose[:, :3],
            target=run["pose_ref"][rows, :3],
            axes=matrix_to_quat(axes),
            velocity=velocity,
            force=force,
            dying_move=ARROW * reach * u_min[:, :3],
            dying_turn=ARROW * reach * u_min[:, 3:],
            nearness=1.0 - np.clip(run["sigma"][rows, -1], 0.0, self._below) / self._below,
        )


def half_axes(sigma: Array, rows: int, reach: float) -> tuple[Array, Array]:
    """Return the half axes at which the two ellipsoids are drawn, (F, 3) each [m].

    Args:
        sigma: Singular values, falling; only the first `rows` are of the task, (F, 3) [m].
        rows: Translations that the task has; along the others the ellipsoids are flat.
        reach: Reach of the arm [m].
    """
    thin, longest = THICKNESS * reach, FORCE_LONGEST * reach
    velocity, force = np.full_like(sigma, thin), np.full_like(sigma, thin)
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
