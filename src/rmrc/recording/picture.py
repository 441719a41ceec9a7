"""The picture of a run: the arm, its path, trail and ellipsoids, and the direction that it loses first.

Entities of a run: `arm/<body>` and, where the law is misled, `believed/<body>`; `target/..` and `tip/..`.
They change sixty times a second.
"""

from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.components import FillMode as Fill

from rmrc.arm import Arm
from rmrc.recording.scene import Scene
from rmrc.recording.shapes import Shape, geometry, shapes_of, xyzw
from rmrc.recording.stream import Stream
from rmrc.results.run import Run
from rmrc.show.palette import GREEN, RED, WHITE, hue, mix
from rmrc.show.panels import grouped
from rmrc.simulation.prepare import Prepared

Array = NDArray[np.float64]

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
