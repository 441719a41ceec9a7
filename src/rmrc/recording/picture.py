"""The picture of a run: the arm, its path, trail and ellipsoids, and the direction that it loses first.

Entities of a run: `arm/<body>` and, where the law is misled, `believed/<body>`; `target/..` and `tip/..`.
They change sixty times a second. The arm has its visible geoms, in their form in rerun.

Values lie over two timelines: `tick` counts control ticks; `sim_time` is the time rounded to nanoseconds,
while the column `time` keeps all its bits.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as untyped
import rerun as rr
from numpy.typing import NDArray
from rerun.components import FillMode as Fill

from rmrc.arm import Arm
from rmrc.recording.scene import Scene
from rmrc.results.run import Run
from rmrc.show.palette import GREEN, RED, WHITE, hue, mix
from rmrc.show.panels import grouped
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import Array, rotate

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


pa: Any = untyped


@dataclass(frozen=True)
class Stream:
    """Writes the entities of one run.

    Attributes:
        recording: Where to write.
        prefix: Begins the path of each entity; "" or ends with a slash.
    """

    recording: rr.RecordingStream
    prefix: str = ""

    def log(self, path: str, *values: rr.AsComponents) -> None:
        """Write values that stay the same."""
        self.recording.log(self.prefix + path, *values, static=True)

    def send(self, path: str, ticks: NDArray[np.int64], time: NDArray[np.float64], columns: Any) -> None:
        """Write values at some ticks, (T,), and their time [s]."""
        nanoseconds = np.rint(1e9 * time).astype("timedelta64[ns]")
        index = [rr.TimeColumn("sim_time", duration=nanoseconds), rr.TimeColumn("tick", sequence=ticks)]
        self.recording.send_columns(self.prefix + path, index, columns)


def struct(columns: Mapping[str, NDArray[Any]], part: slice) -> Any:
    """Return some ticks of columns, (T,) or (T, width) each, as structs, bit for bit.

    No item may be null: the viewer draws nothing from a list that may hold nulls.
    """
    arrays, fields = [], []
    for name, values in columns.items():
        array = pa.array(np.ascontiguousarray(values[part]).reshape(-1))
        if values.ndim > 1:
            items = pa.list_(pa.field("item", array.type, nullable=False), values.shape[1])
            array = pa.FixedSizeListArray.from_arrays(array, type=items)
        arrays.append(array)
        fields.append(pa.field(name, array.type, nullable=False))
    return pa.StructArray.from_arrays(arrays, fields=fields)


# The picture --------------------------------------------------------------------------------------

# Interval between two pictures [s].
FRAME_PERIOD = 1.0 / 60.0
# Number of points in the line of the target path.
PATH_POINTS = 300
# Opacity of the arm as the law believes it, of a baseline, and of all runs but the first.
PALE = 0.3
# A geom has a color, and is not gray, if its red, green and blue differ by this much.
COLORED = 0.3
# 0xRRGGBBAA; only in the picture, which is dark in both themes.
PINK, YELLOW, CYAN = 0xE77BCBFF, 0xFFD60AFF, 0x3DC9FFFF


class Picture:
    """One run in the picture.

    Attributes:
        stream: Where it is written.
        prepared: Its world.
        run: The run.
        scene: Arm and task.
        rows: Ticks that are shown, (F,).
        frames: What is visible at them.
        is_alone: Whether each joint has its own color, and ellipsoids are shown.
    """

    def __init__(
        self, stream: Stream, prepared: Prepared, run: Run, color: int | None = None, opacity: float = 1.0
    ) -> None:
        """Compute what is visible.

        Args:
            stream: Where to write.
            prepared: Its world.
            run: The run, with at least one tick.
            color: Color of the whole arm, 0xRRGGBBAA; None: each joint has its own, and ellipsoids are shown.
            opacity: Opacity of the arm.
        """
        self.stream, self.prepared, self.run, self.scene = stream, prepared, run, Scene(prepared)
        self.is_alone, self._color, self._opacity = color is None, color or YELLOW, opacity
        stride = max(1, int(FRAME_PERIOD / run.period))
        self.rows = np.unique(np.append(np.arange(0, len(run), stride), len(run) - 1))
        self.frames = self.scene.frames(run, self.rows)
        self._thin = 0.004 * self.scene.reach

    def write(self) -> None:
        """Write everything."""
        scene, frames, thin = self.scene, self.frames, self._thin
        self._write_arm("arm", scene.arm, self._opacity, frames.bodies)
        if self.prepared.hardware.is_misled:
            self._write_arm("believed", scene.believed, PALE, scene.believed_bodies(self.run, self.rows))
        path = scene.path[np.linspace(0, len(scene.path) - 1, PATH_POINTS).round().astype(int)]
        self.stream.log("target/path", rr.LineStrips3D([path], colors=WHITE, radii=0.7 * thin))
        now = rr.Points3D.from_fields(colors=self._color, radii=5.5 * thin)
        self._write("tip/now", rr.Points3D.columns(positions=frames.tip), now)
        strips = np.stack([np.vstack([frames.tip[:1], frames.tip[:-1]]), frames.tip], axis=1)
        colors = ramp(frames.nearness * self.is_alone, self._color)
        trail = rr.LineStrips3D.columns(strips=strips, colors=colors)
        self._write("tip/trail", trail, rr.LineStrips3D.from_fields(radii=1.6 * thin))
        if self.is_alone:
            target = rr.Points3D.from_fields(colors=WHITE, radii=4 * thin)
            self._write("target/now", rr.Points3D.columns(positions=frames.target), target)
            self._write_ellipsoid("velocity", frames.velocity, GREEN, Fill.TransparentFillMajorWireframe)
            self._write_ellipsoid("force", frames.force, PINK, Fill.MajorWireframe)
            self._write_lost("dying_move", frames.dying_move, YELLOW, 2.0)
            self._write_lost("dying_turn", frames.dying_turn, CYAN, 1.0)

    def write_spot(self, row: int) -> None:
        """Write a ball where the tip is at a tick, with the time."""
        tip, text = self.run["pose"][row, :3], f"look: {grouped(float(self.run['time'][row]))} s"
        ball = rr.Points3D([tip], colors=WHITE, radii=3 * self._thin, labels=[text], show_labels=True)
        self.stream.log("tip/look", ball)

    def _write_arm(self, root: str, arm: Arm, opacity: float, bodies: Array) -> None:
        """Write geoms and the axes of joints, and the poses of their bodies, (F, nbody, 7).

        The fixed bodies of pale arms are where those of the others are.
        """
        parts = defaultdict[int, dict[str, rr.AsComponents]](dict)
        for shape in shapes_of(arm):
            if opacity == 1.0 or not self.scene.is_fixed[shape.body]:
                parts[shape.body][shape.name] = geometry(self._painted(shape, opacity))
        if self.is_alone and root == "arm":
            for j, (body, line) in enumerate(self.scene.joint_axes()):
                parts[body][f"axis {j}"] = rr.LineStrips3D([line], colors=hue(j), radii=1.5 * self._thin)
        for body, looks in parts.items():
            path = f"{root}/{rr.escape_entity_path_part(arm.body_names[body])}"
            count = 1 if self.scene.is_fixed[body] else len(bodies)
            place, turn = bodies[:count, body, :3], xyzw(bodies[:count, body, 3:])
            self._write(path, rr.Transform3D.columns(translation=place, quaternion=turn), count=count)
            for name, look in looks.items():
                self.stream.log(f"{path}/{rr.escape_entity_path_part(name)}", look)

    def _painted(self, shape: Shape, opacity: float) -> Shape:
        """Return a geom in the color of its joint, if it has any color at all, or of its run."""
        joint, rgba = self.scene.joint_of(shape.body), shape.rgba * [1.0, 1.0, 1.0, opacity]
        if not self.is_alone or (joint >= 0 and np.ptp(rgba[:3]) >= COLORED):
            color = hue(joint) if self.is_alone else self._color
            rgba[:3] = [(color >> shift & 255) / 255.0 for shift in (24, 16, 8)]
        return replace(shape, rgba=rgba)

    def _write_ellipsoid(self, name: str, half: Array, color: int, fill: Fill) -> None:
        """Write an ellipsoid at the tip, with half axes (F, 3)."""
        look = rr.Ellipsoids3D.from_fields(colors=color, line_radii=0.7 * self._thin, fill_mode=fill)
        turn = xyzw(self.frames.axes)
        columns = rr.Ellipsoids3D.columns(centers=self.frames.tip, half_sizes=half, quaternions=turn)
        self._write(f"tip/{name}_ellipsoid", columns, look)

    def _write_lost(self, name: str, arrow: Array, calm: int, width: float) -> None:
        """Write a direction that is lost, (F, 3), as a double arrow."""
        arrows = rr.Arrows3D.columns(
            vectors=np.stack([arrow, -arrow], axis=1).reshape(-1, 3),
            origins=self.frames.tip.repeat(2, axis=0),
            colors=ramp(self.frames.nearness.repeat(2), calm),
        )
        look = rr.Arrows3D.from_fields(radii=width * self._thin)
        self._write(f"tip/{name}", arrows.partition(np.full(len(arrow), 2)), look)

    def _write(self, path: str, columns: Any, look: Any = None, count: int | None = None) -> None:
        """Write what changes, at the ticks that are shown or the first of them, and how it looks."""
        rows = self.rows[:count]
        self.stream.send(path, rows, self.run["time"][rows], columns)
        if look is not None:
            self.stream.log(path, look)


def ramp(nearness: Array, calm: int) -> NDArray[np.uint32]:
    """Return colors from calm (0) to red (1), 0xRRGGBBAA."""
    return np.array([mix(calm, RED, part) for part in nearness.tolist()], np.uint32)
