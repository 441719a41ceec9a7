"""One arm of a film: its scene at the instants of the film, and its picture at each."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rmrc.film import marks
from rmrc.film.camera import Camera
from rmrc.film.marks import Mark
from rmrc.film.opengl import PictureError
from rmrc.film.renderer import Renderer
from rmrc.recording.scene import Scene
from rmrc.results.run import Run
from rmrc.show.palette import HUES
from rmrc.simulation.prepare import Prepared
from rmrc.support.legible import visible
from rmrc.support.spatial import quat_to_matrix

Array = NDArray[np.float64]

# Largest distance of the model's tip from the run's, over the reach; beyond it, the model counts as another.
SAME = 1e-6
# Number of ticks of a run for the trail and for the frame of the camera.
SAMPLES, POSTURES = 600, 40


class Shot:
    """An arm over time.

    Attributes:
        run: Its run.
        scene: The arm and the task.
        model: Its visible model.
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
        self.run, self.scene, self._arm = run, Scene(prepared), prepared.true_arm
        self.model = self._arm.model
        path, model = visible(str(self._arm.path)), self._arm.model
        if "qpos" not in run.columns:
            raise PictureError(
                f"{label}: its file lacks qpos, which older versions did not write; run it again"
            )
        if run["qpos"].shape[1] != model.nq or run.joints != self._arm.joints:
            raise PictureError(
                f"{label}: {path} is no longer the model of the run: its joints differ; run again"
            )
        self.rows = np.unique(np.linspace(0, len(run) - 1, SAMPLES).round().astype(np.int64))
        self.frames = self.scene.frames(run, self.rows)
        tip = np.array(
            [self._arm.pose(run["qpos"][row][self._arm.wiring.qpos])[:3] for row in self.rows[::60]]
        )
        off = float(np.linalg.norm(tip - run["pose"][self.rows[::60], :3], axis=1).max())
        if not off <= SAME * self.scene.reach:
            raise PictureError(
                f"{label}: {path} is no longer the model of the run: it puts the tip {1e3 * off:.3g} mm "
                "away; run again"
            )

    def points(self, renderer: Renderer) -> Array:
        """Return the points that the camera must show: all of arm, path and ellipsoids, (p, 3) [m]."""
        some = self.rows[np.linspace(0, len(self.rows) - 1, POSTURES).round().astype(int)]
        boxes = [renderer.corners(self.run["qpos"][row], self._arm.mocap) for row in some]
        frames, marked = self.frames, 3 * marks.TRAIL * self.scene.reach
        along = quat_to_matrix(frames.axes) * frames.velocity[:, None, :]
        ends = [frames.tip + sign * along[:, :, i] for i in range(3) for sign in (-1.0, 1.0)]
        around = marked * np.vstack([np.eye(3), -np.eye(3)])
        near = [(points[:, None] + around).reshape(-1, 3) for points in (self.scene.path[::10], frames.tip)]
        return np.vstack([*boxes, *ends, *near])

    def row(self, time: float) -> int:
        """Return the tick at a time [s]; after the end, the last."""
        after = int(np.searchsorted(self.run["time"], time - 0.5 * self.run.period))
        return min(after, len(self.run) - 1)

    def picture(self, time: float, renderer: Renderer, camera: Camera) -> NDArray[np.uint8]:
        """Return the picture at a time [s], (height, width, 3)."""
        row = self.row(time)
        return renderer.draw(self.run["qpos"][row], camera, self.marks(row), self._arm.mocap)

    def marks(self, row: int) -> Sequence[Mark]:
        """Return the marks beside the arm at a tick: wanted path, trail, target, tip and ellipsoid."""
        scene, reach = self.scene, self.scene.reach
        now = scene.frames(self.run, np.array([row]))
        passed = self.rows < row
        ink = np.tile(marks.rgba(marks.INK), (len(scene.path), 1))
        trail = np.vstack([self.frames.tip[passed], now.tip])
        colors = marks.nearing(np.concatenate([self.frames.nearness[passed], now.nearness]))
        return [
            *marks.line(scene.path, marks.WANTED * reach, ink, is_dashed=True),
            *marks.line(trail, marks.TRAIL * reach, colors),
            marks.ball(now.target[0], marks.TARGET * reach, marks.INK),
            marks.ball(now.tip[0], marks.TIP * reach, HUES[1]),
            marks.ellipsoid(now.tip[0], now.velocity[0], quat_to_matrix(now.axes[0])),
        ]
