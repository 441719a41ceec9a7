"""What the page draws of an arm: the visible shapes of its model, each as points whose hull it is.

A shape moves with an axis of the chain. The compiled kinematics give the frame behind each axis, whose origin
is on it, and whose axes are those of the world with all joints at 0: points are stored as they are then.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from rmrc.arm import Arm
from rmrc.arm.geometry import even_points
from rmrc.export.image import packed
from rmrc.recording.scene import Scene
from rmrc.results.run import Run
from rmrc.show.palette import css, distinct
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import Array, rotate

# Points on a round shape.
ROUND = 60
# A shape has a color, and is not gray, if its red, green and blue differ by this much.
COLORED = 0.3
# MuJoCo's numbers of shapes, and the first group of those that its own viewer hides.
SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(2, 8)
HIDDEN = 3
# Axes of the screen of an arm that moves in a plane, by the normal: to the right, up, and to the viewer.
X, Y, Z = [1, 0, 0], [0, 1, 0], [0, 0, 1]
SCREENS = (Y, Z, X), (X, Z, [0, -1, 0]), (X, Y, Z)
# Room around the arm at its start and its path, as a part of the reach.
MARGIN = 0.5
# Points of the line of the path, and instants at which another run is drawn.
PATH, INSTANTS = 400, 240


def floats(values: Any) -> str:
    """Return values as little-endian floats of 32 bits in base64."""
    with np.errstate(over="ignore"):  # numbers beyond the range have no place in a picture
        return packed(np.asarray(values, "<f4"))


def drawing(prepared: Prepared) -> dict[str, Any]:
    """Return the shapes of an arm, its joints, its path, the rows of its task, and the view."""
    arm, task, path, scene = prepared.arm, prepared.task, prepared.reference.pose[:, :3], Scene(prepared)
    chain, model, colors = arm.chain, arm.model, [css(color) for color in distinct(arm.n)]
    places, shapes = np.cumsum(chain.step, axis=0), []
    bodies, still = arm.frames(np.array([prepared.qpos, arm.placed(prepared.qpos, np.zeros(arm.n))]))[0]
    behind = _axes_of_bodies(arm)
    for geom, points in _hulls(model):
        body, rgba = int(model.geom_bodyid[geom]), _rgba(model, geom)
        axis, color = behind[body], "#" + "".join(f"{round(255 * part):02x}" for part in rgba[:3])
        where = still[body, :3] + rotate(still[body, 3:], points)
        if axis >= 0:
            where -= places[axis]
            color = colors[chain.leader[axis]] if np.ptp(rgba[:3]) >= COLORED else color
        shapes.append({"axis": axis, "color": color, "points": floats(where)})
    moving = [body for body, axis in enumerate(behind) if axis >= 0]
    seen = np.vstack([places[:1], path, arm.pose(prepared.qpos[arm.wiring.qpos])[:3], bodies[moving, :3]])
    center = (seen.max(axis=0) + seen.min(axis=0)) / 2
    screen = None if scene.normal is None else SCREENS[scene.normal]
    if screen is None:
        extent = np.full(2, np.linalg.norm(seen - center, axis=1).max())
    else:
        extent = np.abs((seen - center) @ np.transpose(screen)).max(axis=0)[:2]
    return {
        "shapes": shapes, "foot": places[0].tolist(), "axes": chain.axis.tolist(),
        "colors": [colors[leader] for leader in chain.leader],
        "rows": task.rows.tolist(), "scale": task.joint_scale.tolist(), "frame": task.view.frame,
        "base": np.asarray(task.view.base).tolist(),
        "path": floats(path[np.linspace(0, len(path) - 1, PATH).round().astype(int)]),
        "screen": screen, "center": center.tolist(), "reach": scene.reach,
        "extent": (2.0 * extent + MARGIN * scene.reach).tolist(),
    }  # fmt: skip


def skeletons(prepared: Prepared, run: Run) -> str:
    """Return joints and site of an arm at even instants of a run, as lines."""
    arm, rows = prepared.true_arm, np.linspace(0, len(run) - 1, INSTANTS).round().astype(int)
    model, bodies, points = arm.model, arm.frames(run["qpos"][rows])[0], []
    for joint in (model.joint(name).id for name in arm.chain.names):
        pose = bodies[:, model.jnt_bodyid[joint]]
        points.append(pose[:, :3] + rotate(pose[:, 3:], model.jnt_pos[joint]))
    return floats(np.stack([*points, run["pose"][rows, :3]], axis=1))


def _axes_of_bodies(arm: Arm) -> list[int]:
    """Return the axis of the chain that moves each body, the last of several; -1 for none."""
    model, axes = arm.model, [-1]
    moved = {int(model.joint(name).bodyid[0]): axis for axis, name in enumerate(arm.chain.names)}
    for body in range(1, model.nbody):  # parents come first
        axes.append(moved.get(body, axes[model.body_parentid[body]]))
    return axes


def _rgba(model: Any, geom: int) -> Array:
    material = model.geom_matid[geom]
    return np.asarray(model.geom_rgba[geom] if material < 0 else model.mat_rgba[material])


def _hulls(model: Any) -> Iterator[tuple[int, Array]]:
    """Yield the visible shapes of a model: their numbers, and points whose hull they are, in their bodies."""
    for geom, kind in enumerate(model.geom_type.tolist()):
        if kind in range(SPHERE, MESH + 1) and model.geom_group[geom] < HIDDEN and _rgba(model, geom)[3]:
            is_mesh, size = kind == MESH, model.geom_size[geom]
            points = _mesh(model, int(model.geom_dataid[geom])) if is_mesh else hull(kind, size)
            yield geom, model.geom_pos[geom] + rotate(model.geom_quat[geom], points)


def hull(kind: int, size: Array) -> Array:
    """Return points whose hull is a shape of MuJoCo, up to roundness, (p, 3) [m].

    Args:
        kind: Its number, but for a mesh.
        size: Its half sizes.
    """
    points, sides = _directions(), np.sign(_directions())
    if kind == BOX:
        return np.asarray(np.unique(sides * size, axis=0))
    if kind == CYLINDER:
        points[:, :2] *= size[0] / np.linalg.norm(points[:, :2], axis=1, keepdims=True)
        points[:, 2] = sides[:, 2] * size[1]
        return points
    points *= size if kind == ELLIPSOID else size[0]
    if kind == CAPSULE:
        points[:, 2] += sides[:, 2] * size[1]
    return points


def _mesh(model: Any, mesh: int) -> Array:
    """Return the vertices of a mesh that are farthest in some direction."""
    first = model.mesh_vertadr[mesh]
    vertices = np.array(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], np.float64)
    return np.asarray(vertices[np.unique((vertices @ _directions().T).argmax(axis=0))])


def _directions() -> Array:
    """Return unit vectors that cover the sphere evenly, (ROUND, 3)."""
    z, turn = even_points(ROUND, 2).T * [[2.0], [2.0 * np.pi]] - [[1.0], [0.0]]
    across = np.sqrt(1.0 - z * z)
    return np.asarray(np.transpose([across * np.cos(turn), across * np.sin(turn), z]))
