"""MuJoCo's renderer off screen: a model at a configuration, with marks, as pixels on white."""

import copy
import itertools
from collections.abc import Sequence
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.film.camera import ANGLE, Camera
from rmrc.film.marks import Mark
from rmrc.film.opengl import no_picture, opened, quietly

Array = NDArray[np.float64]

# Each pixel is the mean of FINER² samples: cheaper in software than OpenGL's own antialiasing, and exact at
# edges.
FINER = 2
# Marks in front of the arm are drawn at this part of their distance, and smaller by the same factor.
FRONT = 0.5
# Largest number of marks in a picture, beside the arm.
MOST_MARKS = 2000
# Nearest and farthest drawn distance, and that of the wall behind, relative to the camera's distance.
NEAREST, FARTHEST, PAPER = 0.02, 20.0, 15.0

Flag = mujoco.mjtRndFlag


class Renderer:
    """Draws one model; a context manager, for one thread.

    Attributes:
        width: Width of the pictures [pixels].
        height: Height of the pictures [pixels].
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        """Open the renderer.

        Args:
            model: Model of the arm; it stays as it is.
            width: Width of the pictures [pixels].
            height: Height of the pictures [pixels].

        Raises:
            PictureError: There is no OpenGL here.
        """
        self.width, self.height = width, height
        self._model = model = copy.copy(model)
        look = model.vis
        look.global_.offwidth, look.global_.offheight = FINER * width, FINER * height
        look.global_.fovy, look.quality.offsamples, look.quality.shadowsize = np.degrees(ANGLE), 0, 0
        self._gl = opened(FINER * width, FINER * height)
        try:
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except Exception as error:  # of OpenGL, by any of its three routes
            with quietly():
                self._gl.free()
            raise no_picture(error) from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._data = mujoco.MjData(model)
        self._scene = mujoco.MjvScene(model, model.ngeom + 100 + MOST_MARKS)
        self._option = mujoco.MjvOption()
        for flag in (Flag.mjRND_SHADOW, Flag.mjRND_SKYBOX, Flag.mjRND_HAZE, Flag.mjRND_REFLECTION):
            self._scene.flags[flag] = 0
        self._hide_planes()

    def _hide_planes(self) -> None:
        """Hide floors: the paper is white."""
        for i in range(self._model.ngeom):
            if self._model.geom_type[i] == mujoco.mjtGeom.mjGEOM_PLANE:
                self._model.geom_rgba[i, 3] = 0.0
                self._model.geom_matid[i] = -1

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the resources of OpenGL."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def draw(self, qpos: Array, camera: Camera, marks: Sequence[Mark], mocap: Array) -> NDArray[np.uint8]:
        """Return the picture of a configuration, (height, width, 3).

        Args:
            qpos: Qpos of the model, (nq,).
            camera: The camera.
            marks: The marks to draw beside the arm.
            mocap: Poses of the mocap bodies, (nmocap, 7).
        """
        scene, every = self._scene, mujoco.mjtCatBit.mjCAT_ALL
        self._place(qpos, mocap)
        self._gl.make_current()
        self._model.stat.extent = camera.distance
        self._model.vis.map.znear, self._model.vis.map.zfar = NEAREST, FARTHEST
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, _free(camera), every, scene)
        _add_paper(scene, camera)
        for mark in marks[: scene.maxgeom - scene.ngeom]:
            _add(scene, mark, camera)
        return self._pixels()

    def corners(self, qpos: Array, mocap: Array) -> Array:
        """Return the corners of boxes around all visible geoms of the model, (8 per geom, 3) [m].

        Args:
            qpos: Qpos of the model, (nq,).
            mocap: Poses of the mocap bodies, (nmocap, 7).
        """
        self._place(qpos, mocap)
        model, data = self._model, self._data
        # The renderer leaves out groups 3 to 5, which are collision geometry by custom.
        seen = (model.geom_group < 3) & (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE)
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        boxes = model.geom_aabb[seen]
        local = boxes[:, None, :3] + signs * boxes[:, None, 3:]
        turned = local @ data.geom_xmat[seen].reshape(-1, 3, 3).swapaxes(1, 2)
        found: Array = (turned + data.geom_xpos[seen][:, None]).reshape(-1, 3)
        return found

    def _place(self, qpos: Array, mocap: Array) -> None:
        data = self._data
        data.qpos[:] = qpos
        if len(mocap):
            data.mocap_pos[:], data.mocap_quat[:] = mocap[:, :3], mocap[:, 3:]
        mujoco.mj_forward(self._model, data)

    def _pixels(self) -> NDArray[np.uint8]:
        """Return the picture of the scene."""
        width, height = FINER * self.width, FINER * self.height
        colors = np.empty((height, width, 3), np.uint8)
        where = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(where, self._scene, self._context)
        mujoco.mjr_readPixels(colors, None, where, self._context)
        fine = colors[::-1].astype(np.uint16)
        parts = [fine[i::FINER, j::FINER] for i in range(FINER) for j in range(FINER)]
        found: NDArray[np.uint8] = (np.add.reduce(parts) // FINER**2).astype(np.uint8)
        return found


def _free(camera: Camera) -> mujoco.MjvCamera:
    """Return MuJoCo's camera at the same position."""
    found, back = mujoco.MjvCamera(), camera.axes[2]
    found.type = mujoco.mjtCamera.mjCAMERA_FREE
    found.lookat[:] = camera.position - camera.distance * back
    found.distance = camera.distance
    found.azimuth = np.degrees(np.arctan2(-back[1], -back[0]))
    found.elevation = -np.degrees(np.arcsin(back[2]))
    return found


def _add_paper(scene: mujoco.MjvScene, camera: Camera) -> None:
    """Add a white wall behind everything: MuJoCo's own background is black, or a sky."""
    away = PAPER * camera.distance
    wide = away * np.tan(ANGLE) * max(camera.aspect, 1.0)
    place, size = camera.position - away * camera.axes[2], np.array([wide, wide, 1e-3 * away])
    white = np.ones(4, np.float32)
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, size, place, camera.axes.T.ravel(), white)
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission, geom.specular, geom.shininess = 1.0, 0.0, 0.0  # independent of all lights
    scene.ngeom += 1


def _add(scene: mujoco.MjvScene, mark: Mark, camera: Camera) -> None:
    """Add a mark to a scene."""
    part = FRONT if mark.is_front else 1.0
    ends = [one for one in (mark.center, mark.end) if one is not None]
    places, size = [camera.nearer(one, part) for one in ends], part * mark.size
    geom = scene.geoms[scene.ngeom]
    kind = mujoco.mjtGeom.mjGEOM_ELLIPSOID if mark.end is None else mujoco.mjtGeom.mjGEOM_CAPSULE
    mujoco.mjv_initGeom(geom, kind, size, places[0], mark.axes.ravel(), mark.color.astype(np.float32))
    if mark.end is not None:
        mujoco.mjv_connector(geom, kind, float(size[0]), *places)
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission, geom.specular, geom.shininess = 0.2, 0.0, 0.0  # not too dark at the edges
    scene.ngeom += 1
