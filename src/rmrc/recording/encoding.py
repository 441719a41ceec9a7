"""Frames as a file: PNG and GIF by Pillow, MP4 by the ffmpeg of imageio-ffmpeg; the same bytes each time."""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rmrc.recording.opengl import PictureError

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
