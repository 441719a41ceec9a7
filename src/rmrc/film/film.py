"""Runs as a picture or a film: each arm with its title above and its rates below, several side by side."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import get_data_path
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from rmrc.film import encode
from rmrc.film.camera import fitted
from rmrc.film.opengl import PictureError
from rmrc.film.renderer import Renderer
from rmrc.film.shot import Shot
from rmrc.film.strip import Strip, share_scale
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import Prepared
from rmrc.support.legible import quoted, visible

Worlds = Mapping[str, tuple[Prepared, Run]]
Frame = NDArray[np.uint8]
Watch = Callable[[int], AbstractContextManager[Callable[[int], None]]]

KINDS = (".png", ".gif", ".mp4")
# Largest number of runs side by side: more would be too small.
MOST_RUNS = 9
# Sizes of one run's part of the picture [pixels]: default, and minimum.
WIDTH, HEIGHT, LEAST_WIDTH, LEAST_HEIGHT, MOST_SIZE = 480, 480, 200, 200, 4096
# Largest number of frames of a film: some ten minutes of drawing.
MOST_FRAMES = 6000
# Heights of the title and of the rates below, relative to the whole; largest height of the title [pixels].
TITLE, RATES, TITLE_MOST = 0.12, 0.4, 44
# Size of a subscript, relative to the letters.
SUBSCRIPT = 0.7
# Number of frames from which the palette of a GIF is made.
SAMPLES = 8


class Cut(NamedTuple):
    """The instants to show.

    Attributes:
        at: Time of a picture [s]; None: where the first run is nearest to a singularity.
        begin: Start of a film [s].
        end: End of a film [s]; None: of the longest run.
        speed: Simulated seconds in one second of the film.
        fps: Frames per second.
    """

    at: float | None = None
    begin: float = 0.0
    end: float | None = None
    speed: float = 1.0
    fps: float = 20.0


def render(
    worlds: Worlds,
    path: Path,
    cut: Cut = Cut(),  # noqa: B008 (frozen)
    size: tuple[int, int] | None = None,
    watch: Watch = lambda _: nullcontext(lambda _: None),
) -> None:
    """Draw runs into a file, atomically.

    Args:
        worlds: World and run of each, by label.
        path: `.png`, `.gif` or `.mp4`.
        cut: The instants.
        size: Width and height of the whole [pixels]; None: 480 × 480 for each run.
        watch: Called with the number of frames; it yields a function that is called with the number drawn.

    Raises:
        PictureError: OpenGL is missing, a model is not the one that ran, a run is empty, or the size does not
            fit.
        QuestionError: MP4 cannot be written here.
    """
    kind = path.suffix
    if kind not in KINDS:
        kinds = ", ".join(KINDS[:-1])
        raise PictureError(f"--out {visible(str(path))}: must end in {kinds} or {KINDS[-1]}")
    for label, (_, run) in worlds.items():
        if not len(run):
            raise PictureError(f"{quoted(label)} has no ticks to draw")
    if kind == ".mp4":
        encode.mp4_writer()
    film = Film(worlds, size, even=kind == ".mp4")
    times = film.instants(cut, kind)
    some = np.linspace(0, len(times) - 1, min(SAMPLES, len(times))).round().astype(int)
    sampled = [times[i] for i in some] if kind == ".gif" else []
    with film, watch(len(times) + len(sampled)) as on_frames:

        def frames(instants: Sequence[float]) -> Iterator[Frame]:
            for time in instants:
                yield film.frame(time)
                on_frames(1)

        if kind == ".png":
            encode.write_png(path, next(frames(times)))
        elif kind == ".gif":
            delay = encode.delay_of(kind, cut.fps)
            encode.write_gif(path, frames(times), list(frames(sampled)), delay)
        else:
            encode.write_mp4(path, frames(times), film.size, cut.fps)


class Film:
    """Frames of some runs; a context manager.

    Attributes:
        size: Width and height of a frame [pixels].
        columns: Columns of runs.
    """

    def __init__(self, worlds: Worlds, size: tuple[int, int] | None, even: bool = False) -> None:
        """Examine the runs.

        Args:
            worlds: World and run of each, by label.
            size: Size of a frame; None: 480 × 480 for each run.
            even: Whether width and height must be even.

        Raises:
            PictureError: They are too many, a model is not the one that ran, or the size does not fit.
        """
        if len(worlds) > MOST_RUNS:
            raise PictureError(
                f"{len(worlds)} runs do not fit into one picture, which takes {MOST_RUNS} ; compare fewer "
                "variants"
            )
        self._labels = list(worlds)
        self.columns = len(worlds) if len(worlds) <= 3 else math.ceil(math.sqrt(len(worlds)))
        self._lines = math.ceil(len(worlds) / self.columns)
        width, height = size or (WIDTH * self.columns, HEIGHT * self._lines)
        least = LEAST_WIDTH * self.columns, LEAST_HEIGHT * self._lines
        if not (least[0] <= width <= MOST_SIZE and least[1] <= height <= MOST_SIZE):
            raise PictureError(
                f"--size must be from {least[0]}x{least[1]} to {MOST_SIZE}x{MOST_SIZE} here, got "
                f"{width}x{height}"
            )
        if even and (width % 2 or height % 2):
            raise PictureError(f"--size of an MP4 must be even, got {width}x{height}")
        self.size = width, height
        self._cell = width // self.columns, height // self._lines
        self._shots = [Shot(label, *world) for label, world in worlds.items()]
        self.end = max(float(shot.run["time"][-1]) for shot in self._shots)
        self._heights = self._parts(self._cell[1])
        self._strips = [Strip(shot.run, self.end, self._cell[0], self._heights[2]) for shot in self._shots]
        share_scale(self._strips)
        folder = Path(get_data_path()) / "fonts" / "ttf"
        pixels = max(10, round(0.34 * self._heights[0]))
        self._bold, self._plain, self._oblique, self._low = (
            ImageFont.truetype(folder / f"DejaVuSans{name}.ttf", round(share * pixels))
            for name, share in (("-Bold", 1.0), ("", 1.0), ("-Oblique", 1.0), ("", SUBSCRIPT))
        )

    @staticmethod
    def _parts(height: int) -> tuple[int, int, int]:
        """Return the heights of title, arm and rates [pixels]."""
        title, rates = min(TITLE_MOST, round(TITLE * height)), round(RATES * height)
        return title, height - title - rates, rates

    def instants(self, cut: Cut, kind: str) -> list[float]:
        """Return the times of the frames [s].

        Raises:
            PictureError: There are none, or too many.
        """
        if kind == ".png":
            run = self._shots[0].run
            at = float(run["time"][int(np.argmin(run["sigma"][:, -1]))]) if cut.at is None else cut.at
            if not 0.0 <= at <= self.end:
                raise PictureError(f"--at must be from 0 to {self.end:g} s, the end of the run, got {at:g}")
            return [at]
        end = self.end if cut.end is None else min(cut.end, self.end)
        if not 0.0 <= cut.begin < end:
            raise PictureError(
                f"--from and --to must be in this order between 0 and {self.end:g} s, the end of the run, "
                f"got {cut.begin:g} and {end:g}"
            )
        step = cut.speed * encode.delay_of(kind, cut.fps)
        count = math.ceil((end - cut.begin) / step - 1e-9)
        if count >= MOST_FRAMES:
            raise PictureError(
                f"{count} frames exceed the limit of {MOST_FRAMES} ; give a lower --fps, a higher --speed, "
                "or --from and --to"
            )
        return [cut.begin + i * step for i in range(count)] + [end]

    def __enter__(self) -> "Film":
        """Open the renderers: one for each run, as models may differ.

        Raises:
            PictureError: There is no OpenGL here.
        """
        with ExitStack() as stack:
            width, height = self._cell[0], self._heights[1]
            self._renderers = [
                stack.enter_context(Renderer(shot.model, width, height)) for shot in self._shots
            ]
            pairs = zip(self._shots, self._renderers, strict=True)
            seen = [shot.points(renderer) for shot, renderer in pairs]
            # One camera for all, so that they can be compared, unless the arms want different views.
            normals = {shot.scene.normal for shot in self._shots}
            self._cameras = [
                fitted(np.vstack(seen) if len(normals) == 1 else points, shot.scene.normal, width / height)
                for shot, points in zip(self._shots, seen, strict=True)
            ]
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self._stack.close()

    def frame(self, time: float) -> Frame:
        """Return the frame of a time [s], (height, width, 3)."""
        width, height = self.size
        whole = np.full((height, width, 3), 255, np.uint8)
        for i in range(len(self._shots)):
            line, column = divmod(i, self.columns)
            cell = self._part(i, time)
            top, left = line * self._cell[1], column * self._cell[0]
            whole[top : top + cell.shape[0], left : left + cell.shape[1]] = cell
        return whole

    def _part(self, i: int, time: float) -> Frame:
        """Return the part of a run at a time, (height, width, 3): title, arm, rates."""
        shot = self._shots[i]
        arm = shot.picture(time, self._renderers[i], self._cameras[i])
        return np.concatenate([self._title(i, time), arm, self._strips[i].at(time)])

    def _title(self, i: int, time: float) -> Frame:
        """Return label, time, σ_min and the status of the law, (height, width, 3)."""
        run, row, (title, _, _) = self._shots[i].run, self._shots[i].row(time), self._heights
        image = Image.new("RGB", (self._cell[0], title), "white")
        draw, margin = ImageDraw.Draw(image), max(4, self._cell[0] // 60)
        draw.text((margin, 0.06 * title), self._labels[i], "black", self._bold)
        flags = int(run["status"][row])
        words = [str(flag.name).lower().replace("_", " ") for flag in Status if flag and int(flag) & flags]
        after = f" {run['sigma'][row, -1]:.3f}   {', '.join(words[:2])}"
        x, base, lower = float(margin), 0.54 * title + self._plain.getmetrics()[0], 0.2 * self._low.size
        for text, font, drop in (
            (f"{run['time'][row]:.2f} s   ", self._plain, 0.0), ("σ", self._oblique, 0.0),
            ("min", self._low, lower), (after, self._plain, 0.0),
        ):  # fmt: skip
            draw.text((x, base + drop), text, "#444", font, anchor="ls")
            x += font.getlength(text)
        return np.asarray(image)
