"""The visible geoms of an arm."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm

Array = NDArray[np.float64]

# By MuJoCo's numbers, without planes, height fields and distance fields.
_KINDS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}


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


def shapes_of(arm: Arm) -> list[Shape]:
    """Return the visible geoms of an arm's model, stretched as its bodies are."""
    model, shapes = arm.model, []
    for geom in map(model.geom, range(model.ngeom)):
        kind, body = _KINDS.get(int(geom.type[0])), int(geom.bodyid[0])
        # groups 3 to 5 are hidden by MuJoCo's own viewer, collision geometry by custom
        if kind is None or geom.group[0] > 2 or geom.rgba[3] == 0.0:
            continue
        rgba = geom.rgba if geom.matid[0] < 0 else model.mat_rgba[geom.matid[0]]
        vertices, faces = np.empty((0, 3)), np.empty((0, 3), np.int32)
        if kind == "mesh":  # only meshes keep the sizes that their author gave them
            mesh = model.mesh(geom.dataid[0])
            first, face = mesh.vertadr[0], mesh.faceadr[0]
            vertices = np.array(model.mesh_vert[first : first + mesh.vertnum[0]], np.float64)
            vertices *= arm.stretch.get(model.body(body).name, 1.0)
            faces = np.array(model.mesh_face[face : face + mesh.facenum[0]], np.int32)
        pose = np.concatenate([geom.pos, geom.quat])
        name, color = geom.name or f"geom{geom.id}", np.array(rgba, np.float64)
        shapes.append(Shape(name, body, kind, np.array(geom.size), pose, color, vertices, faces))
    return shapes
