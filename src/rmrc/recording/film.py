"""Runs as a picture or a film: each arm with its title above and its rates below, several side by side."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib import get_data_path
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from rmrc.recording.opengl import PictureError
from rmrc.recording.shot import Shot, fitted, renderer_of
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.figure import draw
from rmrc.show.panels import Panel, in_words, panels
from rmrc.simulation.prepare import Prepared
from rmrc.support.files import written_whole
from rmrc.support.text import visible

# Encoding -----------------------------------------------------------------------------------------
#
# Frames as a file: PNG and GIF by Pillow, MP4 by the ffmpeg of imageio-ffmpeg; the same bytes each time.

FrameAt = Callable[[float], NDArray[np.uint8]]

FILM = "MP4 needs a working ffmpeg, which comes with `pip install 'rmrc[film]'`; GIF needs no extra"
# A GIF stores delays in this unit [s], and viewers slow down those below two units; time of its last frame.
TICK, LAST = 0.01, 1.5
# Colors of a GIF, of which the last one of 256 means unchanged; number of frames from which they are taken.
COLORS, SAMPLES = 255, 8
# Quality of x264, with hardly any visible loss; one thread and no dates.
CODEC = "-crf 20 -threads 1 -fflags +bitexact -flags:v +bitexact -map_metadata -1 -movflags +faststart"


def delay_of(kind: str, fps: float) -> float:
    """Return the time between frames that a kind of file can store, nearest to the requested one [s].

    >>> delay_of(".gif", 30.0), delay_of(".mp4", 25.0)
    (0.03, 0.04)
    """
    return max(2, round(1.0 / (fps * TICK))) * TICK if kind == ".gif" else 1.0 / fps


def write_png(path: Path, frame_at: FrameAt, times: Sequence[float], _fps: float) -> None:
    """Write the frame of the first time."""
    Image.fromarray(frame_at(times[0])).save(path, "PNG", optimize=True)


def write_gif(path: Path, frame_at: FrameAt, times: Sequence[float], fps: float) -> None:
    """Write the frames of some times [s], two at least.

    They have one palette and no dithering: flat areas stay flat, which is small, and nothing flickers.
    """
    off, samples = Image.Dither.NONE, [frame_at(time) for time in times[:: -(-len(times) // SAMPLES)]]
    colors = Image.fromarray(np.concatenate(samples)).quantize(COLORS, dither=off)
    first, *others = (Image.fromarray(frame_at(time)).quantize(palette=colors, dither=off) for time in times)
    durations = [round(1000 * delay_of(".gif", fps))] * len(others) + [round(1000 * LAST)]
    first.save(path, "GIF", save_all=True, append_images=others, duration=durations, loop=0)


def write_mp4(path: Path, frame_at: FrameAt, times: Sequence[float], fps: float) -> None:
    """Write the frames of some times [s] in H.264.

    Raises:
        PictureError: There is no ffmpeg, or it fails.
    """
    try:
        from imageio_ffmpeg import write_frames

        size = frame_at(times[0]).shape[1::-1]
        codec = {"macro_block_size": 2, "quality": None, "output_params": CODEC.split()}
        with closing(write_frames(str(path), size, fps=fps, **codec)) as out:
            out.send(None)
            for time in times:
                out.send(frame_at(time))
    except (ImportError, RuntimeError, OSError) as error:
        raise PictureError(f"{FILM}: {' '.join(str(error).split())[:200]}") from None


# Films --------------------------------------------------------------------------------------------

Frame = NDArray[np.uint8]
Worlds = Mapping[str, tuple[Prepared, Run]]
Watch = Callable[[int], AbstractContextManager[Callable[[int], None]]]

WRITERS = {".png": write_png, ".gif": write_gif, ".mp4": write_mp4}
# Sizes of one run's part of the picture [pixels]: default, and minimum; maximum of the whole.
SIZE, LEAST, MOST = 480, 200, 4096
# Largest number of runs in a line, and of frames of a film: some ten minutes of drawing.
COLUMNS, MOST_FRAMES = 3, 6000
# Height of the title and of its letters [pixels], and height of the rates relative to the whole.
TITLE, LETTERS, RATES = 44, 15, 0.4
# Of the rates: pixels per inch, size of letters [pt], least height with a legend [pixels], color of cursor.
DPI, SMALL, ROOMY, CURSOR = 100.0, 8.0, 150, (230, 71, 77)


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
    worlds: Worlds, path: Path, cut: Cut = Cut(),  # noqa: B008 (frozen)
    size: tuple[int, int] | None = None, watch: Watch | None = None,
) -> None:  # fmt: skip
    """Draw runs into a file, atomically.

    Args:
        worlds: World and run of each, by label.
        path: `.png`, `.gif` or `.mp4`.
        cut: The instants.
        size: Width and height of the whole [pixels]; None: 480 × 480 for each run.
        watch: Called with the number of frames; it yields a function that is called with the number drawn.
            None: nobody watches.

    Raises:
        PictureError: OpenGL or ffmpeg is missing, a model is not the one that ran, a run is empty, or the
            size or the instants do not fit.
    """
    runs = [run for _, run in worlds.values()]
    if path.suffix not in WRITERS:
        raise PictureError(f"{visible(str(path))}: must end in {', '.join(WRITERS)}")
    if not all(map(len, runs)):
        raise PictureError("a run without ticks cannot be drawn")
    columns = min(len(runs), COLUMNS)
    lines = -(-len(runs) // columns)
    across, down = size or (SIZE * columns, SIZE * lines)
    width, height = across // columns, down // lines
    if min(width, height) < LEAST or max(across, down) > MOST:
        limits = f"from {LEAST * columns}x{LEAST * lines} to {MOST}x{MOST}"
        raise PictureError(f"--size must be {limits} here, got {across}x{down}")
    if path.suffix == ".mp4" and (across % 2 or down % 2):
        raise PictureError(f"--size of an MP4 must be even, got {across}x{down}")
    times = instants(runs, cut, path.suffix)
    shots, rates = [Shot(label, *world) for label, world in worlds.items()], round(RATES * height)
    points, tall = np.vstack([shot.points for shot in shots]), height - TITLE - rates
    camera = fitted(points, shots[0].scene.normal, width / tall)  # one for all, so that they can be compared
    described = [panels(run, ["rates"])[0] for run in runs]
    ends = min(panel.range[0] for panel in described), max(panel.range[1] for panel in described)
    last = max(float(run["time"][-1]) for run in runs)
    strips = [Strip(panel, ends, last, width, rates) for panel in described]
    renderers = [renderer_of(shot.arm.model, width, tall) for shot in shots]

    def frame_at(time: float) -> Frame:
        whole = np.full((down, across, 3), 255, np.uint8)
        for i, (shot, strip, renderer) in enumerate(zip(shots, strips, renderers, strict=True)):
            top, left = i // columns * height, i % columns * width
            parts = [_title(shot, time, width), shot.picture(time, renderer, camera), strip.at(time)]
            whole[top : top + height, left : left + width] = np.concatenate(parts)
        on_frames(1)
        return whole

    progress = watch(len(times)) if watch else nullcontext(lambda _: None)
    with progress as on_frames, written_whole(path) as temporary:
        WRITERS[path.suffix](temporary, frame_at, times, cut.fps)


def instants(runs: Sequence[Run], cut: Cut, kind: str) -> list[float]:
    """Return the times of the frames [s].

    Raises:
        PictureError: There are none, or too many.
    """
    last = max(float(run["time"][-1]) for run in runs)
    if kind == ".png":
        at = float(runs[0]["time"][runs[0]["sigma"][:, -1].argmin()]) if cut.at is None else cut.at
        if not 0.0 <= at <= last:
            raise PictureError(f"--at must be from 0 to {last:g} s, the end of the run, got {at:g}")
        return [at]
    end = last if cut.end is None else min(cut.end, last)
    if not 0.0 <= cut.begin < end:
        span = f"in this order between 0 and {last:g} s, the end of the run"
        raise PictureError(f"--from and --to must be {span}, got {cut.begin:g} and {end:g}")
    step = cut.speed * delay_of(kind, cut.fps)
    count = math.ceil((end - cut.begin) / step - 1e-9)
    if count >= MOST_FRAMES:
        way = "give a lower --fps, a higher --speed, or --from and --to"
        raise PictureError(f"{count} frames exceed the limit of {MOST_FRAMES}; {way}")
    return [cut.begin + i * step for i in range(count)] + [end]


class Strip:
    """The panel of the rates of a run, drawn once."""

    def __init__(self, panel: Panel, ends: tuple[float, float], last: float, width: int, height: int) -> None:
        """Draw a panel with the ends of its axis, until a time [s], at a size [pixels]."""
        with mpl.rc_context({"font.size": SMALL, "legend.fontsize": SMALL}):
            figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, layout="constrained")
            self._axes = axes = figure.add_subplot(xlim=(0.0, last), xlabel="time [s]")
            draw(axes, panel, 72.0 * width / DPI)
            axes.set_ylim(ends)
            if legend := axes.get_legend():  # beside the curves, which are low
                names = [text.get_text() for text in legend.get_texts()]
                lines = [*filter(None, legend.legend_handles)]
                axes.set_title(legend.get_title().get_text(), loc="left", fontsize=SMALL)
                if height >= ROOMY:
                    figure.legend(lines, names, loc="outside right upper", frameon=False)
                legend.remove()
            canvas = FigureCanvasAgg(figure)
            canvas.draw()  # type: ignore[no-untyped-call]
        self._picture = np.asarray(canvas.buffer_rgba())[:, :, :3]  # type: ignore[no-untyped-call]

    def at(self, time: float) -> Frame:
        """Return it with a cursor at a time [s], (height, width, 3)."""
        picture, box = self._picture.copy(), self._axes.get_window_extent()
        column = round(self._axes.transData.transform((time, self._axes.get_ylim()[0]))[0])
        rows = slice(len(picture) - round(box.y1), len(picture) - round(box.y0))
        picture[rows, column - 1 : column + 1] = CURSOR
        return picture


def _title(shot: Shot, time: float, width: int) -> Frame:
    """Return label, time, σ_min and the status of the law, (TITLE, width, 3)."""
    run, row = shot.run, shot.row(time)
    words = [in_words(flag) for flag in Status if flag and int(flag) & int(run["status"][row])]
    numbers = f"{run['time'][row]:.2f} s   σ_min {run['sigma'][row, -1]:.3f}   {', '.join(words[:2])}"
    image = Image.new("RGB", (width, TITLE), "white")
    font = ImageFont.truetype(Path(get_data_path(), "fonts/ttf/DejaVuSans.ttf"), LETTERS)
    ImageDraw.Draw(image).text((8, 3), f"{shot.label}\n{numbers}", "black", font)
    return np.asarray(image)
