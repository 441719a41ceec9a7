"""The visible geoms of a model."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}
_NO_MESH = (np.empty((0, 3)), np.empty((0, 3), np.int32))


@dataclass(frozen=True)
class Shape:
    """A visible geom, fixed to a body.

    Attributes:
        name: Its name in the model, or its number.
        body: Index into the body poses.
        kind: `sphere`, `capsule`, `cylinder`, `ellipsoid`, `box` or `mesh`.
        size: MuJoCo's half sizes, (3,) [m].
        pose: In the body's frame, [p, quat w x y z], (7,).
        rgba: Color, (4,), 0 to 1.
        vertices: Vertices of a mesh, (v, 3) [m].
        faces: Faces of a mesh, (f, 3).
    """

    name: str
    body: int
    kind: str
    size: Array
    pose: Array
    rgba: Array
    vertices: Array
    faces: NDArray[np.int32]


def visible(model: mujoco.MjModel, stretch: Mapping[str, float]) -> list[Shape]:
    """Return the visible geoms of a model, without planes.

    Args:
        model: A model with its final sizes; only meshes keep the sizes that their author gave them.
        stretch: Factor on all lengths of a body, by its name.
    """
    shapes = []
    for i in range(model.ngeom):
        geom = model.geom(i)
        kind = SHAPES.get(int(geom.type[0]))
        # groups 3 to 5 are hidden by MuJoCo's own viewer, collision geometry by custom
        if kind is None or geom.group[0] > 2 or geom.rgba[3] == 0.0:
            continue
        rgba = geom.rgba if geom.matid[0] < 0 else model.mat_rgba[geom.matid[0]]
        vertices, faces = _mesh(model, int(geom.dataid[0])) if kind == "mesh" else _NO_MESH
        vertices = vertices * stretch.get(model.body(int(geom.bodyid[0])).name, 1.0)
        shapes.append(
            Shape(
                geom.name or f"geom{i}", int(geom.bodyid[0]), kind, np.array(geom.size),
                np.concatenate([geom.pos, geom.quat]), np.array(rgba, np.float64), vertices, faces,
            )
        )  # fmt: skip
    return shapes


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array, NDArray[np.int32]]:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.array(model.mesh_vert[first : first + count], np.float64)
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return vertices, np.array(model.mesh_face[first : first + count], np.int32)
