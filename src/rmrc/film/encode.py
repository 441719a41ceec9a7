"""Frames as a file: PNG and GIF by Pillow, MP4 by the ffmpeg of imageio-ffmpeg; the same bytes each time."""

from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rmrc.film.opengl import PictureError
from rmrc.support.errors import QuestionError
from rmrc.support.files import written_whole

Frame = NDArray[np.uint8]

FILM = "MP4 is written by ffmpeg, which comes with `pip install 'rmrc[film]'`; GIF needs no extra"
# A GIF stores delays in this unit [s], and viewers slow down those below two units.
TICK = 0.01
# Duration of the last frame of a GIF before it begins again [s].
LAST = 1.5
# Colors of a GIF; the last one of 256 means unchanged.
COLORS = 255
# Quality of x264, with hardly any visible loss.
QUALITY = "20"


def delay_of(kind: str, fps: float) -> float:
    """Return the time between frames that a kind of file can store, nearest to the requested one [s].

    >>> delay_of(".gif", 30.0), delay_of(".mp4", 25.0)
    (0.03, 0.04)
    """
    return max(2, round(1.0 / (fps * TICK))) * TICK if kind == ".gif" else 1.0 / fps


def write_png(path: Path, frame: Frame) -> None:
    """Write one frame."""
    with written_whole(path) as temporary:
        Image.fromarray(frame).save(temporary, "PNG", optimize=True)


def write_gif(path: Path, frames: Iterator[Frame], samples: Sequence[Frame], delay: float) -> None:
    """Write frames, with one palette for all of them.

    Args:
        path: Path of the file.
        frames: In order, at least two.
        samples: Frames that have all relevant colors.
        delay: Time between frames [s].
    """
    colors = few_colors(Image.fromarray(np.concatenate(samples)), COLORS)
    # No dithering: flat areas stay flat, which is small, and nothing flickers.
    images = (Image.fromarray(one).quantize(palette=colors, dither=Image.Dither.NONE) for one in frames)
    first, *others = images
    durations = [round(1000 * delay)] * len(others) + [round(1000 * LAST)]
    with written_whole(path) as temporary:
        first.save(
            temporary, "GIF", save_all=True, append_images=others, duration=durations, loop=0, optimize=False
        )


def few_colors(image: Image.Image, count: int) -> Image.Image:
    """Return an image in its best palette, white among the colors, without dithering in flat areas.

    Args:
        image: In red, green and blue.
        count: Number of colors.
    """
    found = image.quantize(count, dither=Image.Dither.NONE)
    palette = np.array(found.getpalette(), np.uint8).reshape(-1, 3)
    palette[palette.sum(axis=1, dtype=int).argmax()] = 255
    found.putpalette(palette.ravel().tolist())
    return found


def write_mp4(path: Path, frames: Iterator[Frame], size: tuple[int, int], fps: float) -> None:
    """Write frames in H.264.

    Args:
        path: Path of the file.
        frames: In order.
        size: Width and height [pixels], both even.
        fps: Frames per second.

    Raises:
        PictureError: There is no ffmpeg, or it fails.
    """
    write = mp4_writer()
    with written_whole(path) as temporary:
        # One thread and no dates: the same bytes each time.
        out = write(
            str(temporary), size, fps=fps, macro_block_size=2, quality=None, ffmpeg_log_level="error",
            output_params=["-crf", QUALITY, "-threads", "1", "-fflags", "+bitexact", "-flags:v", "+bitexact",
                           "-map_metadata", "-1", "-movflags", "+faststart"],
        )  # fmt: skip
        out.send(None)
        try:
            for frame in frames:
                out.send(np.ascontiguousarray(frame))
        except OSError as error:
            raise PictureError(f"{path}: ffmpeg failed: {' '.join(str(error).split())[:200]}") from None
        finally:
            out.close()


def mp4_writer() -> Callable[..., Generator[None, Frame | None, None]]:
    """Return the library that writes MP4.

    Raises:
        QuestionError: It is not installed.
    """
    try:
        from imageio_ffmpeg import get_ffmpeg_exe, write_frames

        get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise QuestionError(FILM) from None
    return write_frames  # type: ignore[no-any-return]
