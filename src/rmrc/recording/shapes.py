"""The visible geoms of an arm, and their form in rerun."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.support.spatial import rotate

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


def geometry(shape: Shape) -> rr.AsComponents:
    """Return a geom in rerun's form; MuJoCo's sizes are half sizes."""
    place, quat, color = shape.pose[:3], shape.pose[3:], (255 * shape.rgba).round().astype(np.uint8)
    if shape.kind == "mesh":
        vertices = place + rotate(quat, shape.vertices)
        return rr.Mesh3D(vertex_positions=vertices, triangle_indices=shape.faces, albedo_factor=color)
    radius, half, _ = shape.size
    look: dict[str, Any] = {"quaternions": [xyzw(quat)], "colors": [color], "fill_mode": "solid"}
    if shape.kind == "capsule":  # rerun's begins at its origin, MuJoCo's is centered
        start = place - rotate(quat, np.array([0.0, 0.0, half]))
        return rr.Capsules3D(lengths=[2 * half], radii=[radius], translations=[start], **look)
    if shape.kind == "cylinder":
        return rr.Cylinders3D(lengths=[2 * half], radii=[radius], centers=[place], **look)
    if shape.kind == "box":
        return rr.Boxes3D(half_sizes=[shape.size], centers=[place], **look)
    half_sizes = np.full(3, radius) if shape.kind == "sphere" else shape.size
    return rr.Ellipsoids3D(half_sizes=[half_sizes], centers=[place], **look)


def xyzw(quat: Array) -> Array:
    """Return quaternions w x y z in rerun's order."""
    return quat[..., [1, 2, 3, 0]]
