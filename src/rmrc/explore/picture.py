"""The arm in the page's 3-D view, its path, trail and ellipsoids, and another run as a ghost."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Shape
from rmrc.explore.answer import Answer
from rmrc.film.camera import ANGLE, fitted
from rmrc.recording.scene import Frames, Scene
from rmrc.show.palette import GOLD, GREEN, HUES, MAGENTA, RED, mix
from rmrc.support.spatial import quat_to_matrix

Array = NDArray[np.float64]

# Opacities of the other run's arm, and of the ellipsoids.
GHOST, ELLIPSOID = 0.22, 0.35
# Colors, 0xRRGGBBAA: of a ghost; of the wanted path.
GRAY, PATH = 0x909090FF, 0x777777FF
# Parts of the reach: radii of tip and target; thickness of an arrow's shaft.
TIP, TARGET, SHAFT = 0.018, 0.014, 0.006
# Room around arm and path, as a part of the reach.
ROOM = 0.12
# Widths of lines [px]; pieces of a path, of which every other one is drawn.
TRAIL, WANTED, PIECES = 4.0, 2.5, 200
# Colors of a trail, from far from a singularity to in it.
CALM, NEAR = HUES[0], RED
# Properties of a geometry that determine its look.
PARTS = ("size", "pose", "vertices", "rgba")
# Least half thickness that is drawn, as a part of the reach: flat ellipsoids are thickened to it.
THINNEST = 1e-3


def rgb(color: int) -> tuple[int, int, int]:
    """Return a color 0xRRGGBBAA in viser's form."""
    return (color >> 24) & 255, (color >> 16) & 255, (color >> 8) & 255


def _ends(frames: Frames, marks: Collection[str]) -> Iterator[Array]:
    """Yield the ends of the arrows, and of the half axes of the ellipsoids, (p, 3) [m]."""
    ways = [frames.dying_move, frames.dying_turn] if "lost" in marks else []
    axes = quat_to_matrix(frames.axes)
    for name in sorted({"velocity", "force"}.intersection(marks)):
        half = getattr(frames, name)
        ways += [half[:, i, None] * axes[:, :, i] for i in range(3)]
    for way in ways:
        yield frames.tip + way
        yield frames.tip - way


@dataclass(frozen=True)
class View:
    """The position and the aim of the camera.

    Attributes:
        position: The position of the camera, (3,) [m].
        look_at: The point in the middle of the view, (3,) [m].
        up: The upward direction of the picture, (3,).
        fov: Vertical angle of view [rad].
    """

    position: Array
    look_at: Array
    up: Array
    fov: float


def view(answer: Answer, aspect: float, marks: Collection[str] = (), room: float = ROOM) -> View:
    """Return a view of a whole run.

    Args:
        answer: The run.
        aspect: Width over height of the picture.
        marks: The marks of `Picture` that it shows.
        room: Room around arm and path, as a part of the reach.
    """
    scene, frames = answer.scene, answer.frames
    seen = np.vstack(
        [scene.outermost(frames), scene.path[:: max(1, len(scene.path) // 50)], frames.bodies[0, 1:, :3]]
    )
    around = room * scene.reach * np.vstack([np.eye(3), -np.eye(3)])
    points = np.vstack([(seen[:, None] + around).reshape(-1, 3), *_ends(frames, marks)])
    camera = fitted(points, scene.normal, aspect)
    up = camera.axes[1] if scene.normal == 2 else np.array([0.0, 0.0, 1.0])
    return View(camera.position, camera.position - camera.distance * camera.axes[2], up, float(ANGLE))


class Picture:
    """The nodes of one browser's scene.

    Args:
        nodes: The scene of that browser in viser's form.
        marks: The shown ones of `velocity`, `force` and `lost`.

    Attributes:
        marks: The same.
    """

    def __init__(self, nodes: Any, marks: Iterable[str]) -> None:
        """Draw nothing yet."""
        self._nodes = nodes
        self._bodies: dict[str, list[tuple[int, Any]]] = {}
        self._shapes: dict[str, Any] = {}
        self._marks: dict[str, Any] = {}
        self.marks = frozenset(marks)

    def show(self, answer: Answer, other: Answer | None) -> None:
        """Draw the lines of a run, and its arm if the arm is new.

        Args:
            answer: The run.
            other: The ghost; None: no ghost.
        """
        self._arm("arm", answer.scene, 1.0)
        if other is not None:
            self._arm("ghost", other.scene, GHOST)
        self._show_ghost(other is not None)
        scene, frames = answer.scene, answer.frames
        self._line("path", _dashes(scene.path), np.array(rgb(PATH)), WANTED)
        ramp = np.array([rgb(mix(CALM, NEAR, part)) for part in np.linspace(0.0, 1.0, 33)])
        colors = ramp[(32 * frames.nearness).round().astype(int)]
        self._line("trail", _joined(frames.tip), _joined(colors), TRAIL)
        before = _joined(other.frames.tip) if other is not None else np.zeros((0, 2, 3))
        self._line("trail_before", before, np.array(rgb(GRAY)), TRAIL)

    def _show_ghost(self, is_there: bool) -> None:
        for _, node in self._bodies.get("ghost", ()):
            node.visible = is_there

    def at(self, answer: Answer, other: Answer | None, time: float) -> None:
        """Move everything to an instant.

        Args:
            answer: The run.
            other: The ghost.
            time: The instant [s].
        """
        row = answer.at(time)
        self._pose("arm", answer, row)
        if other is not None:
            self._pose("ghost", other, other.at(time))
        frames, reach = answer.frames, answer.scene.reach
        tip = frames.tip[row]
        self._ball("tip", tip, TIP * reach, HUES[1])
        self._ball("target", frames.target[row], TARGET * reach, PATH)
        self._ellipsoid("velocity", answer, row, frames.velocity[row], GREEN, "velocity" in self.marks)
        self._ellipsoid("force", answer, row, frames.force[row], GOLD, "force" in self.marks)
        for name, way in (("lost", frames.dying_move[row]), ("lost_turn", frames.dying_turn[row])):
            long = float(np.linalg.norm(way)) > 0.05 * reach * 0.22
            self._arrow(name, tip, way, reach, "lost" in self.marks and long)

    # The arm ---------------------------------------------------------------------------------

    def _arm(self, root: str, scene: Scene, opacity: float) -> None:
        """Make the bodies of an arm, unless they exist: most settings do not change them."""
        if self._shapes.get(root) is not None and _are_alike(self._shapes[root], scene):
            return
        for _, node in self._bodies.pop(root, []):
            node.remove()
        self._shapes[root] = scene.shapes
        made: dict[int, Any] = {}
        for i, shape in enumerate(scene.shapes):
            if root == "ghost" and scene.is_fixed[shape.body]:
                continue
            if shape.body not in made:
                made[shape.body] = self._nodes.add_frame(f"/{root}/{shape.body}", show_axes=False)
            painted = scene.painted(shape)
            color = tuple(round(255 * float(part)) for part in painted.rgba[:3])
            through = opacity * float(painted.rgba[3])
            told = {
                "color": color if root == "arm" else rgb(GRAY),
                "opacity": None if through > 0.99 else through,
                "cast_shadow": False,
                "receive_shadow": False,
            }
            for j, (draw, how) in enumerate(_pieces(painted)):
                getattr(self._nodes, draw)(f"/{root}/{shape.body}/{i}_{j}", **told, **how)
        self._bodies[root] = list(made.items())

    def _pose(self, root: str, answer: Answer, row: int) -> None:
        for body, node in self._bodies[root]:
            pose = answer.frames.bodies[row, body]
            node.position, node.wxyz = pose[:3], pose[3:]

    # Its marks -------------------------------------------------------------------------------

    def _line(self, name: str, points: Array, colors: NDArray[Any], width: float) -> None:
        """Draw pieces (p, 2, 3) of a line."""
        shown, points = np.broadcast_to(colors, points.shape).astype(np.uint8), points.astype(np.float32)
        node = self._marks.get(name)
        if node is not None and np.array_equal(node.points, points) and np.array_equal(node.colors, shown):
            return
        if node is not None and len(points):
            node.points, node.colors = points, shown
        elif node is not None:
            self._marks.pop(name).remove()
        elif len(points):
            self._marks[name] = self._nodes.add_line_segments(
                f"/{name}", points, shown, thickness=width, thickness_units="screen"
            )

    def _ball(self, name: str, center: Array, radius: float, color: int) -> None:
        if name not in self._marks:
            self._marks[name] = self._nodes.add_icosphere(
                f"/{name}", radius, rgb(color), cast_shadow=False, receive_shadow=False
            )
        self._marks[name].position = center

    def _ellipsoid(
        self, name: str, answer: Answer, row: int, half: Array, color: int, is_shown: bool
    ) -> None:
        if name not in self._marks:
            self._marks[name] = self._nodes.add_icosphere(
                f"/{name}", 1.0, rgb(color), opacity=ELLIPSOID, cast_shadow=False, receive_shadow=False
            )
        node = self._marks[name]
        node.visible = is_shown
        if is_shown:
            node.position, node.wxyz = answer.frames.tip[row], answer.frames.axes[row]
            node.scale = tuple(float(one) for one in np.maximum(half, THINNEST * answer.scene.reach))

    def _arrow(self, name: str, tip: Array, way: Array, reach: float, is_shown: bool) -> None:
        points = np.array([[tip, tip + way], [tip, tip - way]], np.float32)
        if name not in self._marks:
            self._marks[name] = self._nodes.add_arrows(
                f"/{name}", points, rgb(MAGENTA if name == "lost" else RED), shaft_radius=SHAFT * reach,
                head_radius=2.5 * SHAFT * reach, head_length=6.0 * SHAFT * reach,
            )  # fmt: skip
        node = self._marks[name]
        node.visible = is_shown
        if is_shown:
            node.points = points


def _are_alike(shapes: list[Shape], scene: Scene) -> bool:
    """Return whether two arms look the same."""
    pairs = zip(shapes, scene.shapes, strict=False)
    return len(shapes) == len(scene.shapes) and all(
        one.body == other.body
        and all(np.array_equal(getattr(one, part), getattr(other, part)) for part in PARTS)
        for one, other in pairs
    )


def _pieces(shape: Shape) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the drawing of each part of a geometry: a function of the scene, and its arguments."""
    position, turn = shape.pose[:3], shape.pose[3:]
    size = [float(one) for one in shape.size]
    place = {"position": position, "wxyz": turn}
    if shape.kind == "mesh":
        vertices, faces = shape.vertices.astype(np.float32), shape.faces.astype(np.uint32)
        yield "add_mesh_simple", {"vertices": vertices, "faces": faces, "side": "double", **place}
    elif shape.kind == "box":
        yield "add_box", {"dimensions": tuple(2.0 * one for one in size), **place}
    elif shape.kind in ("sphere", "ellipsoid"):
        half = (size[0],) * 3 if shape.kind == "sphere" else tuple(size)
        yield "add_icosphere", {"radius": 1.0, "scale": half, **place}
    else:
        yield "add_cylinder", {"radius": size[0], "height": 2.0 * size[1], **place}
    if shape.kind == "capsule":
        along = size[1] * quat_to_matrix(turn)[:, 2]
        for end in (position - along, position + along):
            yield "add_icosphere", {"radius": size[0], "position": end}


def _joined(points: NDArray[Any]) -> NDArray[Any]:
    """Return the pieces between points, (p - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def _dashes(path: Array) -> Array:
    """Return every other piece of a path, evenly along it, (p, 2, 3)."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    if way[-1] == 0.0:
        return np.zeros((0, 2, 3))
    stops = np.linspace(0.0, way[-1], PIECES)
    at = np.stack([np.interp(stops, way, path[:, i]) for i in range(3)], axis=1)
    return _joined(at)[::2]
