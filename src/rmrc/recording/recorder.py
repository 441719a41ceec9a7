"""Writes runs as a recording, once they are over: every column bit for bit, a picture, and plots.

Entities of a run alone; those of its baseline begin with `baseline/`, and those of several runs with
`variants/<label>/`:

    columns          at every tick: every column of the run, and `curves` that are only drawn
    arm, believed, target, tip
                     the picture, sixty times a second
    look, tip/look   the values and the tip at the instant at which the scenario asks to look

Entities of all: `levels/..` and `peaks/..` of the plots, `status` or `status/<label>`, `text/..`, and `now`,
the line of numbers.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from uuid import uuid4

import numpy as np
import rerun as rr

from rmrc.recording.events import write_numbers, write_strip
from rmrc.recording.layout import LEGEND, layout
from rmrc.recording.picture import PALE, Picture
from rmrc.recording.plots import BASELINE, Plot
from rmrc.recording.stream import Stream, struct
from rmrc.results.run import Run
from rmrc.show.palette import distinct
from rmrc.show.panels import panels
from rmrc.simulation.prepare import Prepared
from rmrc.support.files import written_whole

# Ticks of a piece: columns of fewer than some 64 kB are packed better, as many are alike.
PIECE = 1000
# Every so many pictures have a line of numbers: nobody could read faster changes.
READ = 3
# Time for the last piece to reach the disk [s].
PATIENCE = 60.0
# Color of a baseline in the picture, 0xRRGGBBAA.
GHOST = 0xB8B8B8FF

World = tuple[Prepared, Run]


def write(path: Path, worlds: Mapping[str, World], baseline: World | None, texts: Mapping[str, str]) -> None:
    """Write runs as one recording, atomically.

    Args:
        path: Path of the recording, ending in `.rrd`; its folder is created if missing.
        worlds: The runs, each with one tick at least, with their worlds, by label.
        baseline: The `baseline` of a run alone, with its world.
        texts: Texts in Markdown beside the picture, by title.

    Raises:
        OSError: It cannot be written, as on a full disk.
    """
    rr.set_strict_mode(True)  # otherwise its errors are only warnings
    # The viewer takes no two recordings of one application whose arms have different joints.
    application = re.sub(r"[^A-Za-z0-9 _-]", "-", f"rmrc {path.stem}")[:100]
    recording = rr.RecordingStream(application, recording_id=str(uuid4()), send_properties=False)
    pictures = _pictures(recording, worlds)
    ghosts = [Picture(Stream(recording, BASELINE), *baseline, GHOST, PALE)] if baseline else []
    runs = [picture.run for picture in [*pictures.values(), *ghosts]]
    size = sum(column.nbytes for run in runs for column in run.columns.values())
    with written_whole(path) as temporary:
        # Rerun waits forever for a writer that found the disk full: fail here if it has no room.
        with temporary.open("wb") as file:
            for _ in range(size // 2**20 + 1):
                file.write(bytes(2**20))
        try:
            _write(recording, temporary, pictures, ghosts, texts)
        except (RuntimeError, ValueError) as error:
            raise OSError(f"cannot write the recording: {' '.join(str(error).split())}") from None


def _pictures(recording: rr.RecordingStream, worlds: Mapping[str, World]) -> dict[str, Picture]:
    """Return the runs in the picture, by the labels of their curves; that of a run alone is ""."""
    if len(worlds) == 1:
        (world,) = worlds.values()
        return {"": Picture(Stream(recording), *world)}
    pictures = dict[str, Picture]()
    for (label, world), color in zip(worlds.items(), distinct(len(worlds)), strict=True):
        stream = Stream(recording, f"variants/{rr.escape_entity_path_part(label)}/")
        pictures[label] = Picture(stream, *world, color, PALE if pictures else 1.0)
    return pictures


def _write(
    recording: rr.RecordingStream, path: Path, pictures: Mapping[str, Picture], ghosts: Sequence[Picture],
    texts: Mapping[str, str],
) -> None:  # fmt: skip
    """Write everything: the layout first, or a page that reads the file as it comes shows one of its own."""
    root, every, first = Stream(recording), [*pictures.values(), *ghosts], next(iter(pictures.values()))
    runs = {label: picture.run for label, picture in pictures.items()}
    prefixes = {label: picture.stream.prefix for label, picture in pictures.items()}
    scenario = first.prepared.scenario
    described = [*panels(runs), *panels(runs, ["joints"])]
    plots = [Plot(panel, runs, prefixes, scenario.look) for panel in described]
    instants = next((plot.instants for plot in plots if plot.instants), {})
    yaml = [f"```yaml\n{picture.prepared.scenario.to_yaml()}```\n" for picture in pictures.values()]
    texts = {"Legend": LEGEND, **texts, "Scenario": "\n".join(yaml)}
    recording.save(path)
    recording.send_blueprint(layout(every, plots, list(texts)))
    recording.send_recording_name(scenario.name)
    root.log("", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    for heading, text in texts.items():
        root.log(f"text/{heading.lower()}", rr.TextDocument(text, media_type="text/markdown"))
    for plot in plots:
        plot.write(root, first.run.period)
    for picture in every:
        picture.write()
        _write_columns(picture.stream, picture.run, plots)
    for label, run in runs.items():
        write_strip(root, f"status/{rr.escape_entity_path_part(label)}" if label else "status", run)
    for label, row in instants.items():
        pictures[label].write_spot(row)
    if first.is_alone:
        write_numbers(root, first.prepared, first.run, first.rows[::READ])
    recording.flush(timeout_sec=PATIENCE)
    recording.disconnect()


def _write_columns(stream: Stream, run: Run, plots: Sequence[Plot]) -> None:
    """Write all columns of a run, and the curves that are only drawn."""
    curves = {name: values for plot in plots for name, values in plot.curves(stream.prefix).items()}
    for begin in range(0, len(run), PIECE):
        part = slice(begin, begin + PIECE)
        structs = {"columns": struct(run.columns, part), "curves": struct(curves, part)}
        stream.send("columns", np.arange(len(run))[part], run["time"][part], rr.AnyValues.columns(**structs))
