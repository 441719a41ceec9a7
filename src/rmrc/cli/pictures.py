"""The verbs that show results: `plot`, `report`, `render`, `replay` and `explore`; and `export`."""

import os
import re
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from rmrc.cli import options
from rmrc.cli.console import progress, working
from rmrc.cli.options import PICTURES, Count, File, Number, Text, expect, result_of, target, within
from rmrc.scenario import load
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.text import quoted

FILMS = (".gif", ".png", ".mp4")


def plot(
    source: options.Source,
    output: options.Output = None,
    vary: options.Vary = None,
    set_: options.Overrides = None,
    panels: Annotated[Text, Option(metavar="NAME,NAME,...", help="Panels; default: all with data.")] = None,
    width: options.Width = None,
    font: options.Font = None,
    quiet: options.Quiet = False,
) -> None:
    """Plot a run, or variants side by side, for a paper: path, rates, singular values, errors, status.

    Writes NAME.pdf, or FILE in .pdf, .svg or .png. Panels are arm, path, rates, sigma, error, turn_error,
    torque, pace, belief, joints, status and g, drawn in this order from the top. Those of a sweep are
    distributions, of its metrics, and keys: the first metric over each varied key. Default: 7.16in, 8 pt.
    """
    from rmrc.show.figure import NAMES
    from rmrc.study import pictures

    known = pictures.PANELS if source.suffix == ".parquet" else NAMES
    names = [name.strip() for name in panels.split(",")] if panels else []
    for name in names:
        if name not in known or names.count(name) > 1:
            choice = f"choose each once from {', '.join(known)}{did_you_mean(name, known)}"
            raise QuestionError(f"--panels: {quoted(name)} is not a panel, or is given twice; {choice}")
    file = target(source, output, PICTURES)
    with result_of(source, set_ or (), vary or (), quiet) as result:
        pictures.plot(result, file, names, width or 7.16, font or 8.0)
    _tell(file, quiet)


def report(
    source: options.Source,
    output: options.Output = None,
    vary: options.Vary = None,
    set_: options.Overrides = None,
    quiet: options.Quiet = False,
) -> None:
    """Write one HTML page to share: verdict, metrics, plots with readout, and blocks to copy.

    Writes NAME.html, or FILE. The page is self-contained and loads nothing over the network.
    """
    from rmrc.tuning.page import page

    file = target(source, output, (".html", ".htm"))
    with result_of(source, set_ or (), vary or (), quiet) as result:
        page(result).write(file)
    _tell(file, quiet)


def render(
    source: options.Source,
    output: options.Output = None,
    vary: options.Vary = None,
    set_: options.Overrides = None,
    at: Annotated[Number, Option(help="Time of a picture [s]; default: nearest to a singularity.")] = None,
    begin: Annotated[float, Option("--from", help="Start time of a film [s].")] = 0.0,
    end: Annotated[Number, Option("--to", help="End time of a film [s]; default: that of the run.")] = None,
    speed: Annotated[
        float, Option(callback=options.within(1e-4, 1e4), help="Simulated seconds per second of film.")
    ] = 1.0,
    fps: Annotated[float, Option(callback=options.within(0.1, 120.0), help="Frames per second.")] = 20.0,
    size: Annotated[
        str | None,
        Option(metavar="WIDTHxHEIGHT", help="Image size in pixels; default: 480x480 for each run."),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Draw a run, or variants side by side, as a picture or a film: the arm above its joint rates.

    Writes NAME.gif, or FILE in .gif, .png or, with the extra `film`, .mp4. MuJoCo renders off screen: without
    a display set MUJOCO_GL=egl or osmesa.
    """
    from rmrc.recording import film
    from rmrc.study.pictures import worlds_of

    file = target(source, output, FILMS)
    if at is not None and file.suffix != ".png":
        raise QuestionError("--at applies to a picture; for a film give --from and --to, or end FILE in .png")
    pixels = re.fullmatch(r"\s*(\d{1,6})\s*[x×]\s*(\d{1,6})\s*", size or "")
    if size and not pixels:
        raise QuestionError(f"--size must be WIDTHxHEIGHT in pixels, such as 960x540, got {quoted(size)}")
    cut = film.Cut(at, begin, end, speed, fps)
    with result_of(source, set_ or (), vary or (), quiet) as result:
        shape = (int(pixels[1]), int(pixels[2])) if pixels else None
        film.render(worlds_of(result), file, cut, shape, lambda n: progress("drawing", n, quiet))
    _tell(file, quiet)


def _tell(file: Path, quiet: bool) -> None:
    if not quiet:
        print(f"wrote {file}")


def replay(
    recording: Annotated[
        Path,
        Argument(
            help="NAME.rrd or NAME.npz of a run, or a folder: then its newest recording.",
            callback=lambda path: path if path.is_dir() else expect(path, "a recording", "a result"),
        ),
    ],
    web: Annotated[bool, Option("--web", help="Serve the viewer to a web browser instead.")] = False,
    at: Annotated[
        Number, Option(callback=within(0.0, 1e9), help="Time to pause at [s]; default: play.")
    ] = None,
    port: Annotated[Count, Option(min=1, max=65535, help="Port of 127.0.0.1; default: a free one.")] = None,
) -> None:
    """Open a recording, in a window or with --web in a browser.

    The rerun viewer runs on this machine only, and without telemetry.
    """
    from rmrc.recording import viewer

    viewer.replay(recording, web, at, port)


def explore(
    scenario: Annotated[
        Path | None,
        Argument(
            help="The scenario: a YAML file, or the name of a shipped one.",
            callback=lambda path: path and expect(path, "a scenario"),
        ),
    ] = None,
    lesson: Annotated[Text, Option(metavar="NAME", help="A lesson: its scenario with questions.")] = None,
    output: options.Output = None,
    set_: options.Overrides = None,
    quiet: options.Quiet = False,
) -> None:
    """Write one HTML page that runs the law in a browser, and open it: sliders, and a goal to drag.

    Writes NAME.explore.html, or FILE, which is not opened. The page needs no server and loads nothing. It has
    the ideal plant, beside the run of the scenario as written.
    """
    from rmrc import scenario as scenarios
    from rmrc.export import page

    if (scenario is None) == (lesson is None):
        raise QuestionError("give a scenario, or a lesson by --lesson NAME")
    questions = page.read_lesson(lesson) if lesson else None
    source = expect(Path(questions.scenario), "a scenario") if questions else scenario or Path()
    file = target(Path(f"{lesson or source.stem}.explore.yaml"), output, (".html", ".htm"))
    page.write(file, scenarios.load(source, set_ or ()), questions)
    _tell(file, quiet)
    has_display = sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if output is None and has_display:
        webbrowser.open(file.absolute().as_uri())


def export(
    scenario: options.Scenario,
    set_: options.Overrides = None,
    to: Annotated[str, Option("--to", metavar="c", help="The language of the program.")] = "c",
    output: Annotated[
        File,
        Option("--output", "-o", metavar="FOLDER", help="Folder; default: recordings/NAME_law."),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write the law of a scenario for a program in C: a header, objects for Linux, an example and CMake.

    It is the law that `run` uses, with the scenario's arm, method, gains and limits. It compiles for about
    half a minute. Test it on your robot: it has no certificate.
    """
    from rmrc.export.c_law import export as write

    if to != "c":
        raise QuestionError(f"--to must be c, got {quoted(to)}")
    folder = output or Path("recordings", f"{scenario.stem}_law")
    with working("compiling the law"):
        files = write(load(scenario, set_ or ()), folder)
    if not quiet:
        print("\n".join(f"wrote {file}" for file in files))
