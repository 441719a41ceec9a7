"""One world in a recording: its columns at every tick, its arm and the moving objects at the tip in frames.

Its entities have a common prefix, so that a recording can hold many worlds:

    columns          at every tick, a field for every column of the run, of float64, status of int64, and
                     derived curves, of float32. Columns that equal others are left out: the arriving command
                     if it is the commanded one, the estimate if it is true, qpos if it is q, and the time
                     along a path that is not slowed. A few columns mostly follow from others to the bit
                     (`recording.thinning`): each is a component of its own, in the blocks where it
                     does not, because the viewer warns of a type that changes
    arm/<body>       poses, with the geometries; meshes are static children
    believed/<body>  the same, pale, at the law's assumed configuration, if that is different
    tip/..           position and trail
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rmrc.recording import stream
from rmrc.recording.events import Label
from rmrc.recording.layout import geometries, ghost, packed, xyzw
from rmrc.recording.scene import Frames, Scene
from rmrc.recording.shapes import Shape, shapes_of
from rmrc.recording.stream import Stream, Table, Values
from rmrc.recording.thinning import OFTEN_FOLLOWING, thinned
from rmrc.results.run import Run
from rmrc.scenario.choices import POLICIES
from rmrc.show.palette import hue
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import AXES

# Drawn objects are stored at this interval [s], as a screen shows them: every 16th tick at 1 kHz.
FRAME_PERIOD = 1.0 / 60.0
# Drawn objects are written for this many ticks at once, or after this long [s]: each entity takes a tenth of
# a millisecond and a kilobyte or two per write. A killed process loses at most one such part.
DRAWN, LONGEST = 4000, 0.5
# The columns from which drawn objects are made.
DRAWN_OF = (
    "time", "qpos", "q_believed", "qdot_cmd", "pose", "pose_ref", "twist_ref", "sigma", "u_min", "damping",
    "condition", "status",
)  # fmt: skip


def prefix_of(variant: str) -> str:
    r"""Return how the entities of a variant begin.

    >>> prefix_of("damped, 0.1")
    'variants/damped\\,\\ 0.1/'
    """
    return f"variants/{rr.escape_entity_path_part(variant)}/"


class Track:
    """Writes one world, block by block; subclasses add to arm and trail.

    Attributes:
        scene: The arm and the task.
        prefix: Begins the path of every entity.
        translations: Rows of the twist that the task has, of 0 to 2.
        rotations: The same of 3 to 5.
    """

    def __init__(self, out: Stream, prepared: Prepared, prefix: str = "", scene: Scene | None = None) -> None:
        """Examine the world at its start; nothing is written yet.

        Args:
            out: Where to write.
            prepared: The world that will run.
            prefix: Begins the path of every entity, and ends with a slash if it is not empty.
            scene: Of the world; None: it is made.
        """
        self.out, self.scene, self.prefix, self._prepared = out, scene or Scene(prepared), prefix, prepared
        self.stride = max(1, int(FRAME_PERIOD / prepared.scenario.control.period))
        self._ticks = self._framed = 0
        self._held: list[tuple[Run, NDArray[np.int64]]] = []
        self._drawn_ticks, self._drawn_at = 0, time.monotonic()
        self._planned = prepared.reference.ticks
        rows = [AXES.index(axis) for axis in prepared.scenario.task.axes]
        self.translations = [row for row in rows if row < 3]
        self.rotations = [row for row in rows if row > 2]
        self._last: Run | None = None
        self._tip = self.scene.path[:1]
        self._reached: list[NDArray[np.float64]] = []
        self._covered: list[NDArray[np.float64]] = []
        wiring = prepared.arm.wiring
        own = np.array_equal(wiring.qpos, np.arange(len(prepared.qpos)))
        direct, true = prepared.hardware.is_direct, not prepared.hardware.moves_q
        on_time = not POLICIES[prepared.scenario.control.at_singularity].slows
        unneeded = {"qdot_arrived": direct, "q_believed": true, "qpos": own, "path_time": on_time}
        self._left_out = {name for name, is_so in unneeded.items() if is_so}

    @property
    def reached(self) -> NDArray[np.float64]:
        """Outermost points that the arm reaches, (p, 3) [m]."""
        return np.vstack([np.empty((0, 3)), *self._reached])

    @property
    def covered(self) -> NDArray[np.float64]:
        """Points all over the arm at instants of the run, (p, 3) [m], if the scenario asks to look at one."""
        return np.vstack([np.empty((0, 3)), *self._covered])

    def write_arm(
        self, paint: Callable[[Shape], Shape | None], *, has_outlines: bool = False, has_axes: bool = False
    ) -> None:
        """Write the geometries, pale ones for the arm that the law assumes, and the poses of fixed bodies.

        Args:
            paint: Returns the drawn form of each geom; None: it is not drawn.
            has_outlines: Whether to draw outlines only.
            has_axes: Whether to draw the axes of the joints, in their colors in the plots.
        """
        scene, radius = self.scene, 0.006 * self.scene.reach
        poses = self._prepared.true_arm.frames(self._prepared.qpos[None])[0][0]
        painted = [one for one in map(paint, scene.shapes) if one is not None]
        for body, pose in enumerate(poses):
            own: list[rr.AsComponents] = []
            axes = {hue(j): line for j, (where, line) in enumerate(scene.joint_axes) if where == body}
            if scene.is_fixed[body] and any(shape.body == body for shape in scene.shapes):
                turn = rr.Quaternion(xyzw=xyzw(pose[3:]))
                own.append(rr.Transform3D(translation=pose[:3], quaternion=turn))
            if axes and has_axes:
                own.append(rr.LineStrips3D([*axes.values()], colors=[*axes], radii=radius))
            self._write_body("arm", body, painted, own, has_outlines)
        pale = [ghost(one) for one in map(paint, shapes_of(scene.believed)) if one is not None]
        for moving in np.flatnonzero(~scene.is_fixed) if self._prepared.hardware.is_misled else ():
            self._write_body("believed", int(moving), pale, [])

    def _write_body(
        self,
        root: str,
        body: int,
        shapes: list[Shape],
        own: list[rr.AsComponents],
        has_outlines: bool = False,
    ) -> None:
        """Write the geoms of one body, and the other parts of its entity."""
        found = geometries([shape for shape in shapes if shape.body == body], has_outlines)
        found[""] = own + found.get("", [])
        for rest, what in found.items():
            if what:
                self.out.log(self.prefix + self.body_path(root, body) + rest, *what)

    def write(self, part: Run) -> None:
        """Write one block of ticks; blocks come in order.

        Args:
            part: A run that holds only the ticks of this block.

        Raises:
            RecordingError: The file cannot be written.
        """
        if part.planned > DRAWN:
            self.out.open()
        if len(part):
            ticks = np.arange(self._ticks, self._ticks + len(part))
            self.write_block(part, ticks)
            self._hold(part, ticks, np.flatnonzero((ticks % self.stride == 0) | (ticks == self._planned - 1)))
            self._ticks += len(part)
            self._last = part
            if self._ticks - self._drawn_ticks >= DRAWN or time.monotonic() - self._drawn_at > LONGEST:
                self.out.open()
                self._write_drawn()
        if part.divergence is not None:
            at = stream.index(np.array([part.divergence.tick]), np.array([part.divergence.time]))
            self.write_divergence(str(part.divergence), part.divergence.time, at)

    def write_last(self) -> None:
        """Write the remaining drawn objects, and the last tick of a run that was cut short."""
        if self._last is not None and self._framed < self._ticks:
            ticks = np.arange(self._ticks - len(self._last), self._ticks)
            self._hold(self._last, ticks, np.array([len(ticks) - 1]))
        self._write_drawn()

    def send(self, path: str, index: list[rr.TimeColumn], *columns: object) -> None:
        """Write values over time below the prefix."""
        self.out.send(self.prefix + path, index, list(columns))

    def send_ellipsoid(
        self, name: str, half: NDArray[np.float64], frames: Frames, index: list[rr.TimeColumn]
    ) -> None:
        """Write an ellipsoid at the tip, with half axes (F, 3)."""
        where, size = Values(stream.CENTER, frames.tip), Values(stream.HALF, half)
        self.send(f"tip/{name}_ellipsoid", index, where, size, Values(stream.TURN, xyzw(frames.axes)))

    def send_bodies(self, root: str, bodies: NDArray[np.float64], index: list[rr.TimeColumn]) -> None:
        """Write the poses of the bodies that move, (F, nbody, 7), below a root."""
        poses = np.swapaxes(bodies, 0, 1)
        places, turns = poses[..., :3].astype(np.float32), xyzw(poses[..., 3:]).astype(np.float32)
        for body in np.flatnonzero(~self.scene.is_fixed):
            place = Values(stream.TRANSLATION, places[body]), Values(stream.ROTATION, turns[body])
            self.send(self.body_path(root, int(body)), index, *place)

    def write_strip(self, entity: str, labels: Sequence[Label]) -> None:
        """Write a lane of labels, at the root."""
        looks = {one.state: one for one in labels}
        texts, colors = [one.text for one in looks.values()], packed([one.color for one in looks.values()])
        self.out.log(entity, rr.StateConfiguration(values=[*looks], labels=texts, colors=colors))
        states = rr.StateChange.columns(state=[one.state for one in labels])
        self.out.send(entity, self.at([one.time for one in labels]), states)

    def at(self, times: Sequence[float]) -> list[rr.TimeColumn]:
        """Return both timelines of some times, (T,) [s]."""
        time = np.array(times)
        return stream.index(np.rint(time / self._prepared.scenario.control.period).astype(np.int64), time)

    # For subclasses to extend -------------------------------------------------------------------

    def write_block(self, part: Run, ticks: NDArray[np.int64]) -> None:
        """Write the values at every tick (T,) of a block."""
        kept = {name: one for name, one in thinned(part.columns).items() if name not in self._left_out}
        kept["status"] = part.columns["status"].astype(np.int64)
        drawn = {name: one.astype(np.float32) for name, one in self.curves(part).items()}
        index = stream.index(ticks, part["time"])
        rest = [Table(name, {name: kept.pop(name)}) for name in OFTEN_FOLLOWING if name in kept]
        self.send("columns", index, Table("columns", kept | drawn), *rest)

    def curves(self, part: Run) -> dict[str, NDArray[np.float64]]:
        """Return the derived curves of a block: (T, width) each."""
        raise NotImplementedError

    def write_frames(self, frames: Frames, index: list[rr.TimeColumn]) -> None:
        """Write the visible objects at some instants."""
        self.send_bodies("arm", frames.bodies, index)
        self._reached.append(self.scene.outermost(frames))
        if self._prepared.scenario.look is not None:
            self._covered.append(self.scene.covered(frames))
        self.send("tip/now", index, Values(stream.POINT, frames.tip))
        before = np.concatenate([self._tip, frames.tip[:-1]])
        self._tip = frames.tip[-1:]
        segments = np.stack([before, frames.tip], axis=1)
        colors = Values(stream.STRIP_COLOR, self.trail_colors(frames))
        self.send("tip/trail", index, Values(stream.STRIP, segments), colors)

    def write_drawn(self, part: Run, ticks: NDArray[np.int64]) -> None:
        """Write the drawn objects at some ticks (F,), from the columns `DRAWN_OF` of the run."""
        index, rows = stream.index(ticks, part["time"]), np.arange(len(ticks))
        self.write_frames(self.scene.frames(part, rows), index)
        if self._prepared.hardware.is_misled:
            self.send_bodies("believed", self.scene.believed_bodies(part, rows), index)

    def trail_colors(self, frames: Frames) -> NDArray[np.uint32]:
        """Return a color 0xRRGGBBAA for each instant, (F,)."""
        raise NotImplementedError

    def write_divergence(self, text: str, time: float, index: list[rr.TimeColumn]) -> None:
        """Write that the run ended there."""
        raise NotImplementedError

    # ----------------------------------------------------------------------------------------------

    def _hold(self, part: Run, ticks: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Keep the drawn objects of some rows of a block."""
        if len(rows):
            columns = {name: part.columns[name][rows] for name in DRAWN_OF}
            self._held.append((replace(part, columns=columns, divergence=None), ticks[rows]))
            self._framed = int(ticks[rows[-1]]) + 1

    def _write_drawn(self) -> None:
        self._drawn_ticks, self._drawn_at = self._ticks, time.monotonic()
        if self._held:
            parts, ticks = zip(*self._held, strict=True)
            self._held = []
            columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in DRAWN_OF}
            self.write_drawn(replace(parts[0], columns=columns), np.concatenate(ticks))

    def body_path(self, root: str, body: int) -> str:
        """Return the entity of a body of the arm, below a root."""
        return f"{root}/{rr.escape_entity_path_part(self.scene.body_names[body])}"
