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
import rerun.blueprint as rrb

from rmrc.recording.picture import PALE, Picture, Stream, struct
from rmrc.recording.plots import BASELINE, Plot, write_numbers, write_strip
from rmrc.recording.scene import FORCE_EQUAL, FORCE_LONGEST, VELOCITY_SECONDS
from rmrc.results.run import Run
from rmrc.show.palette import distinct
from rmrc.show.panels import panels
from rmrc.simulation.prepare import Prepared
from rmrc.support.files import written_whole
from rmrc.support.spatial import Array

# Layout of the viewer -----------------------------------------------------------------------------
#
# The layout of a recording: picture and texts at the left, plots and statuses at the right.

# The viewer's vertical angle of view; width over height of the picture in a window of 1280 × 720 points.
VIEW_ANGLE, VIEW_ASPECT = np.radians(55.0), 0.95
# Relative heights of the rates, of σ and λ, of the tabs with all other plots, and of a lane of the strip,
# with room for so many.
RATES, SIGMA, TABS, LANE, MOST_LANES = 3.0, 2.2, 1.9, 0.55, 5

LEGEND = f"""\
| in the picture | is |
|---|---|
| **thin line**, **white ball** | path of the target, and the target now |
| **trail**, **ball** | end effector (tip), past and now; **red** near a singularity |
| **ball with a time** | the tip at that time, the instant to look at |
| **green ellipsoid** | velocities at unit-norm joint rates, {VELOCITY_SECONDS:g} s · σ_i; **flat**: lost |
| **pink wires** | forces at unit-norm joint torques, c/σ_i |
| **double arrow** | direction lost first (u_min), thin: its rotation; **red** as σ_min goes to 0 |
| **pale arm** | the arm as the controller sees it; gray: the baseline; in one color: another run |

Both are equal at σ = {FORCE_EQUAL:g} of the reach; pink is {FORCE_LONGEST:g} of it at most. σ_i here are \
those of the task's translations, with its rotations held. Links, axes and curves have the joints' colors.
"""


def layout(pictures: Sequence[Picture], plots: Sequence[Plot], texts: Sequence[str]) -> rrb.Blueprint:
    """Return the whole layout, without the viewer's own panels.

    Args:
        pictures: All runs in the picture.
        plots: The plots: rates, σ and λ, and others.
        texts: Titles of the texts.
    """
    rates, sigma, *others = plots
    shown = next((i for i, plot in enumerate(others) if plot.instants), 0)
    lanes = 1 if pictures[0].is_alone else len(pictures)
    right = rrb.Vertical(
        rates.view(),
        sigma.view(),
        rrb.Tabs(*(plot.view() for plot in others), active_tab=shown),
        rrb.StateTimelineView(contents="/status/**", time_view=rates.time_axis(), titlebar=False),
        row_shares=[RATES, SIGMA, TABS, LANE * (0.7 + min(lanes, MOST_LANES))],
    )
    documents = [rrb.TextDocumentView(origin=f"/text/{title.lower()}", name=title) for title in texts]
    numbers = [rrb.TextDocumentView(origin="/now", titlebar=False)] * pictures[0].is_alone
    shares = [7.0, *[1.15] * len(numbers), 2.1]
    left = rrb.Vertical(picture_view(pictures), *numbers, rrb.Tabs(*documents), row_shares=shares)
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[8, 12]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="playing", loop_mode="all"),
    )


def picture_view(pictures: Sequence[Picture]) -> rrb.Spatial3DView:
    """Return the picture of all runs, dark in both themes."""
    prefixes, normal = [picture.stream.prefix for picture in pictures], pictures[0].scene.normal
    points = np.vstack([picture.scene.points(picture.frames) for picture in pictures])
    begin, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    until_now = rrb.VisibleTimeRanges([rrb.VisibleTimeRange("sim_time", start=begin, end=now)])
    floor = rr.components.Plane3D.XY.with_distance(float(points[:, 2].min()))
    roots = ("arm", "believed", "target", "tip")
    return rrb.Spatial3DView(
        name=pictures[0].prepared.scenario.name,
        contents=[f"/{prefix}{root}/**" for prefix in prefixes for root in roots],
        overrides={f"{prefix}tip/trail": until_now for prefix in prefixes},
        eye_controls=eye(points, normal),
        line_grid=rrb.LineGrid3D(plane=floor, color=[255, 255, 255, 30]),
        background=rrb.Background(kind=rrb.BackgroundKind.SolidColor, color=[13, 16, 17]),
    )


def eye(points: Array, normal: int | None) -> rrb.EyeControls3D:
    """Return the eye that has all points (p, 3) in its frame.

    It sees a planar arm almost along its normal axis, and others obliquely.
    """
    toward = {None: (0.75, -1.0, 0.55), 0: (1.0, -0.2, 0.2), 1: (0.2, -1.0, 0.2), 2: (0.0, -0.25, 1.0)}
    back = np.array(toward[normal]) / np.linalg.norm(toward[normal])
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(back[:2])
    axes = np.array([right, np.cross(back, right), back])
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    across = (np.abs(seen - middle)[:, :2] / [VIEW_ASPECT, 1.0]).max(axis=1)
    distance = (across / np.tan(VIEW_ANGLE / 2) + (seen - middle)[:, 2]).max()
    center = middle @ axes
    return rrb.EyeControls3D(position=center + distance * back, look_target=center, eye_up=(0, 0, 1))


# The recorder -------------------------------------------------------------------------------------

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
