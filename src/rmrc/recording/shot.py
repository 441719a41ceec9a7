"""One arm of a film, drawn off screen by MuJoCo's renderer, on white."""

import copy
import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rmrc.recording.opengl import PictureError, without_opengl
from rmrc.recording.scene import Scene
from rmrc.results.run import Run
from rmrc.show.palette import GREEN, HUES, RED, WHITE, distinct, mix
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import Array, quat_to_matrix
from rmrc.support.text import visible

Kind, BALL = mujoco.mjtGeom, np.eye(3)

# Number of ticks of a run for the frame of the camera, path and trail.
SAMPLES = 160
# Largest distance between the tip of the model and that of the run [m]: beyond, it is another model.
SAME = 1e-6
# Radii of skeleton, trail, wanted path, and of the balls at tip and target, relative to the reach; their ink.
BONE, TRAIL, WANTED, TIP, TARGET, INK = 0.008, 0.0075, 0.0045, 0.018, 0.014, 0x3A3F47FF
# Vertical angle of view: a long lens, which hardly magnifies near objects [rad]; room around what is seen.
ANGLE, ROOM = np.radians(30.0), 1.06
SIDES = (*np.eye(3), *-np.eye(3))
# Azimuth and elevation of the view [deg], by the world axis along which the arm does not move: almost along
# that axis, or oblique without one.
VIEWS = {None: (127.0, -24.0), 0: (169.0, -11.0), 1: (101.0, -11.0), 2: (90.0, -76.0)}
# Each pixel is the mean of FINER² samples: cheaper in software than OpenGL's own antialiasing.
FINER = 2
# Marks are drawn before the arm, in the same pixels: at this part of their distance, and smaller as much.
FRONT = 0.5


def fitted(points: Array, normal: int | None, aspect: float) -> mujoco.MjvCamera:
    """Return the nearest camera that sees all points.

    |x − c_x| ≤ t (z − c_z) holds for each point at depth z, with t the tangent of half the angle of view. The
    largest c_z follows from the two points that bind, and c_x is in the middle of the remaining range. y is
    similar.

    Args:
        points: Along world axes, (p, 3) [m].
        normal: World axis without motion, along which the camera looks; None: there is none.
        aspect: Width over height of the picture.
    """
    camera, (a, e) = mujoco.MjvCamera(), np.radians(VIEWS[normal])
    camera.azimuth, camera.elevation = VIEWS[normal]
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    forward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    axes = np.array([right, np.cross(right, forward), forward])
    seen, tangent = points @ axes.T, np.tan(ANGLE / 2) / ROOM * np.array([aspect, 1.0])
    upper = (seen[:, :2] - tangent * seen[:, 2:]).max(axis=0)
    lower = (seen[:, :2] + tangent * seen[:, 2:]).min(axis=0)
    depth = -((upper - lower) / (2.0 * tangent)).max()
    camera.distance = max(np.median(seen[:, 2]) - depth, 1e-3)
    camera.lookat[:] = np.array([*(upper + lower) / 2.0, depth + camera.distance]) @ axes
    return camera


def renderer_of(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Return a renderer of a model for pictures of a size [pixels]: without floors and shadows.

    Raises:
        PictureError: There is no OpenGL here.
    """
    model, floor = copy.copy(model), model.geom_type == Kind.mjGEOM_PLANE
    look, model.vis.quality.offsamples, model.vis.quality.shadowsize = model.vis.global_, 0, 0
    look.offwidth, look.offheight, look.fovy, look.ipd = FINER * width, FINER * height, np.degrees(ANGLE), 0.0
    model.geom_rgba[floor, 3], model.geom_matid[floor] = 0.0, -1
    try:
        with warnings.catch_warnings(action="ignore"):  # of GLFW: the error says the same
            renderer = mujoco.Renderer(model, FINER * height, FINER * width)
    except Exception as error:
        raise without_opengl(error) from None
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 0
    return renderer


class Shot:
    """An arm over time.

    Attributes:
        label: Its name.
        run: Its run.
        arm: Its arm.
        scene: The arm and the task.
        points: What the camera must show, (p, 3) [m].
    """

    def __init__(self, label: str, prepared: Prepared, run: Run) -> None:
        """Examine a run.

        Args:
            label: Its name in messages.
            prepared: Its world.
            run: The run, with at least one tick.

        Raises:
            PictureError: The model is not the one that ran.
        """
        self.label, self.run, self.arm = label, run, prepared.true_arm
        self._rows = np.unique(np.linspace(0, len(run) - 1, SAMPLES).round().astype(np.int64))
        is_same = run["qpos"].shape[1] == self.arm.model.nq and run.joints == self.arm.joints
        data = [self.arm.data_at(run["qpos"][row]) for row in self._rows if is_same]
        bones = [self._bones(instant) for instant in data]
        if not is_same or np.abs([b[-1] for b in bones] - run["pose"][self._rows, :3]).max() > SAME:
            path = visible(str(self.arm.path))
            raise PictureError(f"{label}: {path} is no longer the model of the run; run it again")
        self.scene = Scene(prepared)
        self._frames = frames = self.scene.frames(run, self._rows)
        along = quat_to_matrix(frames.axes) * frames.velocity[:, None]
        ends = [frames.tip + sign * along[:, :, i] for i in range(3) for sign in (-1.0, 1.0)]
        bound = self.arm.model.geom_rbound[:, None]
        geoms = [instant.geom_xpos + bound * side for instant in data for side in SIDES]
        self.points = np.vstack([*geoms, *bones, *ends, self.scene.path])

    def _bones(self, data: mujoco.MjData) -> Array:
        """Return a point on each axis of the chain, and the tip, (ℓ + 1, 3) [m]."""
        return np.vstack([data.xanchor[self.arm.wiring.axis], data.site_xpos[self.arm.wiring.site]])

    def row(self, time: float) -> int:
        """Return the tick at a time [s]; after the end, the last."""
        after = int(np.searchsorted(self.run["time"], time - 0.5 * self.run.period))
        return min(after, len(self.run) - 1)

    def draw(self, scene: mujoco.MjvScene, data: mujoco.MjData, row: int) -> None:
        """Add to a scene skeleton, wanted path, trail, target, tip and velocity ellipsoid at a tick."""
        reach, path, before = self.scene.reach, self.scene.path, self._rows < row
        now, colors = self.scene.frames(self.run, np.array([row])), distinct(len(self.arm.joints))
        trail = np.vstack([self._frames.tip[before], now.tip])
        near = [mix(HUES[0], RED, part) for part in (*self._frames.nearness[before], *now.nearness)]
        path = path[np.linspace(0, len(path) - 1, SAMPLES).astype(int)]
        _add(scene, GREEN - 155, now.tip[0], now.velocity[0], quat_to_matrix(now.axes[0]))
        _add_rods(scene, self._bones(data), BONE * reach, [colors[j] for j in self.arm.chain.leader])
        _add_rods(scene, path, WANTED * reach, [INK] * len(path))
        _add_rods(scene, trail, TRAIL * reach, near)
        _add(scene, INK, now.target[0], np.full(3, TARGET * reach))
        _add(scene, HUES[1], now.tip[0], np.full(3, TIP * reach))

    def picture(self, time: float, renderer: mujoco.Renderer, camera: mujoco.MjvCamera) -> NDArray[np.uint8]:
        """Return the picture at a time [s], (height, width, 3)."""
        data = self.arm.data_at(self.run["qpos"][self.row(time)])
        renderer.update_scene(data, camera)
        view = renderer.scene.camera[0]
        # MuJoCo's own background is black: a wall of paper behind everything.
        ahead, far = np.array(view.forward), 0.9 * view.frustum_far / FRONT
        axes, size = np.column_stack([np.cross(ahead, view.up), view.up, ahead]), far * np.array([1, 1, 1e-3])
        _add(renderer.scene, WHITE, view.pos + far * ahead, size, axes).emission = 1.0
        self.draw(renderer.scene, data, self.row(time))
        return np.asarray(Image.fromarray(renderer.render()).reduce(FINER))


def _add_rods(scene: mujoco.MjvScene, points: Array, radius: float, colors: Sequence[int]) -> None:
    """Add rods with round ends from point to point, (p, 3), each in the color of its beginning."""
    for color, begin, end in zip(colors, points, points[1:], strict=False):
        if np.any(begin != end):
            _add(scene, color, begin, np.full(3, radius), end=end)


def _add(
    scene: mujoco.MjvScene, color: int, place: Array, size: Array, axes: Array = BALL,
    end: Array | None = None,
) -> mujoco.MjvGeom:  # fmt: skip
    """Add an ellipsoid, or a rod, to a scene, and return it.

    Args:
        scene: The scene, after its update.
        color: 0xRRGGBBAA.
        place: Center of the ellipsoid, or an end of the rod, (3,) [m].
        size: Half axes of the ellipsoid, or three times the radius of the rod, (3,) [m].
        axes: Columns: those of the ellipsoid, (3, 3).
        end: The other end of the rod, (3,) [m]; None: an ellipsoid.
    """
    eye, geom = np.array(scene.camera[0].pos), scene.geoms[scene.ngeom]
    kind = Kind.mjGEOM_ELLIPSOID if end is None else Kind.mjGEOM_CAPSULE
    place, size, rgba = eye + FRONT * (place - eye), FRONT * size, np.array([*color.to_bytes(4)], np.float32)
    mujoco.mjv_initGeom(geom, kind, size, place, axes.ravel(), rgba / 255)
    if end is not None:
        mujoco.mjv_connector(geom, kind, float(size[0]), place, eye + FRONT * (end - eye))
    geom.emission, geom.specular, geom.shininess = 0.2, 0.0, 0.0
    scene.ngeom += 1
    return geom
