"""Options, arguments and files that verbs share, each declared once.

Where a verb takes a result and gets a scenario, the scenario is run first.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from typer import Argument, CallbackParam, Option

from rmrc import scenario as scenarios
from rmrc.cli.console import progress
from rmrc.scenario import angle
from rmrc.support.errors import QuestionError, tell_assumed
from rmrc.support.shipped import Folder, found
from rmrc.support.spatial import AXES
from rmrc.support.text import command, quoted, visible

if TYPE_CHECKING:
    from rmrc.arm import Arm
    from rmrc.show.sheets import Report

# Optional values
Text: TypeAlias = str | None
Texts: TypeAlias = list[str] | None
Number: TypeAlias = float | None
Count: TypeAlias = int | None
File: TypeAlias = Path | None

# Positions, angles and lengths up to this [m or rad] are kept to 1e-10.
FARTHEST = 1e6

# Units of the width of a picture; and its bounds [in].
INCHES = {"in": 1.0, "cm": 1 / 2.54, "mm": 1 / 25.4, "pt": 1 / 72.27}
NARROWEST, WIDEST = 2.0, 40.0


def inches(text: str) -> float:
    """Return the number of `--width` in inches.

    Raises:
        QuestionError: It is no length, or no picture can be so wide.
    """
    match = re.fullmatch(rf"\s*([0-9]*\.?[0-9]+)\s*({'|'.join(INCHES)})\s*", text)
    length = float(match[1]) * INCHES[match[2]] if match else 0.0
    if not NARROWEST <= length <= WIDEST:
        raise QuestionError(
            f"must be a length between {NARROWEST:g}in and {WIDEST:g}in, such as 3.5in, 88mm or 18cm, "
            f"got {quoted(text)}"
        )
    return length


def within(least: float, most: float) -> Callable[[CallbackParam, Number], Number]:
    """Return a check of an option's number, which nan and inf do not pass."""

    def check(param: CallbackParam, value: Number) -> Number:
        if value is not None and not least <= value <= most:
            raise QuestionError(f"{param.opts[0]} must be between {least:g} and {most:g}, got {value:g}")
        return value

    return check


# Of scenarios and results
Scenario = Annotated[
    Path,
    Argument(
        help="The scenario: a YAML file, or the name of a shipped one.",
        callback=lambda path: expect(path, "a scenario"),
    ),
]
Source = Annotated[
    Path,
    Argument(
        help="NAME.npz, .rrd or .json of a run, NAME.parquet; or a scenario, which is run first.",
        callback=lambda path: expect(path, "a scenario", "a result", "a recording"),
    ),
]
Overrides = Annotated[Texts, Option("--set", metavar="KEY=VALUE", help="Override any key; repeatable.")]
Vary = Annotated[Texts, Option(metavar="KEY=V1,V2,...", help="Values of a key; repeat it for a grid.")]
Threads = Annotated[Count, Option(min=1, help="Number of threads; default: one per core.")]

# Of arms
Model = Annotated[
    Path,
    Argument(
        help="The arm: an MJCF or URDF file, or the name of a shipped one.",
        callback=lambda path: expect(path, "a model"),
    ),
]
Site = Annotated[Text, Option(help="End effector (TCP) site; default: a site or body of the hand.")]
Body = Annotated[Text, Option(help="Body whose frame is the end effector, instead of a site.")]
Packages = Annotated[Texts, Option(metavar="NAME=FOLDER", help="Package of a URDF file; repeatable.")]
Joints = Annotated[Text, Option(metavar="NAME,NAME,...", help="Actuated joints, outward; default: all.")]
Positions = Annotated[Text, Option(metavar="Q1,Q2,...", help='Joint positions: rad, m, or "60 deg".')]
Keyframe = Annotated[Text, Option(help="Joint positions by name; default: home.")]
TaskAxes = Annotated[
    Text, Option(metavar="x,y,...", help="Task rows, of x y z rx ry rz; default: the independent ones.")
]
TaskFrame = Annotated[Text, Option(metavar="world|base|site", help="Frame of the task rows.")]
Length = Annotated[
    Number,
    Option(callback=within(1e-6, FARTHEST), help="Length [m] that makes meters and radians comparable."),
]

# Of answers
AsJson = Annotated[bool, Option("--json", help="Print JSON, for machines.")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print errors and warnings only.")]
Out = Annotated[Path, Option(metavar="FOLDER", help="Folder for the files.")]
Output = Annotated[File, Option("--output", "-o", metavar="FILE", help="File to write.")]
Picture = Annotated[
    File,
    Option(
        *("--output", "-o"),
        metavar="FILE",
        help="File of the picture: .png, .svg or .pdf.",
        callback=lambda path: suffixed("--output", path, PICTURES),
    ),
]
Width = Annotated[
    Number, Option(parser=inches, metavar="LENGTH", help="Width of the picture, such as 3.5in or 88mm.")
]
Font = Annotated[Number, Option(callback=within(4.0, 40.0), help="Font size of the picture [pt].")]
Junit = Annotated[File, Option(metavar="FILE", help="Write JUnit XML for CI: .xml, a case per check.")]
Summary = Annotated[File, Option(metavar="FILE", help="Write Markdown for CI: .md, $GITHUB_STEP_SUMMARY.")]


def draw(report: "Report", file: File, width: Number = None, font: Number = None) -> list[Path]:
    """Draw the picture of an answer, if it has one and a file is given; return the files written."""
    from rmrc.show.palette import sized

    if file is None or report.draw is None:
        return []
    with sized(width, font):
        report.draw(file)
    return [file]


def values(
    option: str, text: str | None, read: Callable[[str], float] = angle, most: float = FARTHEST
) -> list[float] | None:
    """Return the numbers of a text such as `0.5,60 deg`; None for None.

    Args:
        option: Its name, for messages.
        text: Numbers with commas between them.
        read: Reads one of them.
        most: Largest size of one.

    Raises:
        QuestionError: One is no number, or too large to compute with.
    """
    if text is None:
        return None
    numbers = list[float]()
    for part in text.strip().strip("[]").split(","):
        try:
            numbers.append(read(part))
        except ValueError as error:
            raise QuestionError(f"{option}: {error}") from None
        if not abs(numbers[-1]) <= most:
            raise QuestionError(f"{option}: must be numbers within ±{most:g}, got {quoted(part.strip())}")
    return numbers


def rows(text: str | None) -> list[str] | None:
    """Return the rows of `--axes`; None for None, so that the question chooses.

    Raises:
        QuestionError: The order differs from that of the twist, so that --to would be misread.
    """
    if text is None:
        return None
    names = [part.strip() for part in text.strip().strip("[]").split(",")]
    ordered = [axis for axis in AXES if axis in names]
    if names != ordered:
        raise QuestionError(f"--axes: must be of {' '.join(AXES)}, once each and in this order, got {text}")
    return names


def frame_of(site: str | None, body: str | None, packages: Iterable[str] | None) -> dict[str, Any]:
    """Return the model options as arguments of the library's functions.

    Raises:
        QuestionError: Both a site and a body are given, or a package is invalid.
    """
    if site is not None and body is not None:
        raise QuestionError("give --site or --body, not both")
    folders = {}
    for text in packages or ():
        name, _, folder = text.partition("=")
        if not (name and folder and Path(folder).is_dir()):
            raise QuestionError(f"--package must be NAME=FOLDER with an existing folder, got {quoted(text)}")
        folders[name] = Path(folder)
    return {"site": site, "body": body, "packages": folders}


def joints_of(text: str | None) -> list[str] | None:
    """Return the names of `--joints`; None if it is not given."""
    return None if text is None else [name.strip() for name in text.split(",")]


def read_arm(
    model: Path, site: str | None, body: str | None, packages: list[str] | None, joints: str | None = None
) -> "Arm":
    """Return the arm for a verb, and report assumptions about it.

    Raises:
        QuestionError: Both a site and a body are given, or a package is invalid.
        ModelError: See `rmrc.arm.load`.
    """
    from rmrc.arm import load

    arm = load(model, joints=joints_of(joints), **frame_of(site, body, packages))
    # the answer names the site
    tell_assumed(note for note in arm.notes if not getattr(note, "is_obvious", False))
    return arm


# Kinds of files with their suffixes, and the verb that takes them.
KINDS = {
    "a scenario": ((".yaml", ".yml"), "run"),
    "a model": ((".xml", ".mjcf", ".urdf"), "inspect"),
    "a recording": ((".rrd",), "replay"),
    "a result": ((".npz", ".json", ".parquet"), "report"),
}
SHIPPED: dict[str, Folder] = {"a scenario": "scenarios", "a model": "models"}
# Files of `run` and `compare`, and of `sweep` and `tune`.
OF_RUNS, OF_SEARCHES = (".npz", ".rrd", ".json"), (".parquet",)
PICTURES = (".pdf", ".png", ".svg")


def expect(path: Path, *kinds: str) -> Path:
    """Return the file that a verb was given, unless its suffix is that of another kind, or it is a folder.

    Args:
        path: Or the bare name of a shipped file. It need not exist: the reader reports a missing file best.
        kinds: The kinds that the verb takes.

    Raises:
        QuestionError: It is something else; the message names the verb for it.
    """
    for kind in kinds:
        path = found(path, SHIPPED[kind]) if kind in SHIPPED else path
    wanted = " or ".join(kinds)
    if path.is_dir():
        raise QuestionError(f"{visible(str(path))}: is a folder; give {wanted}")
    for kind, (suffixes, verb) in KINDS.items():
        if path.suffix.lower() in suffixes and kind not in kinds and path.exists():
            way = f"use `{command(verb, path)}`, or give {wanted}"
            raise QuestionError(f"{visible(str(path))}: is {kind}; {way}")
    return path


def suffixed(option: str, path: Path | None, suffixes: Sequence[str]) -> Path | None:
    """Return the path of an option, unless it ends otherwise.

    Raises:
        QuestionError: It has another suffix.
    """
    if path is not None and path.suffix not in suffixes:
        raise QuestionError(f"{option} {visible(str(path))}: must end in {' or '.join(suffixes)}")
    return path


def target(source: Path, output: Path | None, suffixes: Sequence[str]) -> Path:
    """Return the file to write: that of `--output`, or beside a result, or in `recordings` for a scenario.

    Raises:
        QuestionError: It has a suffix that cannot be written.
        OSError: It cannot be written.
    """
    from rmrc.support.files import refuse_unwritable

    folder = source if source.suffix in OF_RUNS + OF_SEARCHES else Path("recordings", source.name)
    file = suffixed("--output", output, suffixes) or folder.with_suffix(suffixes[0])
    refuse_unwritable([file])
    return file


@contextmanager
def result_of(source: Path, overrides: Sequence[str], vary: Sequence[str], quiet: bool) -> Iterator[Path]:
    """Yield the columns of a run, or the rows of a sweep or search; a scenario is run first.

    Args:
        source: A result, or a scenario.
        overrides: `KEY=VALUE` texts, for a scenario.
        vary: `KEY=V1,V2,...` texts, for a scenario: its variants are compared.
        quiet: Whether to show no progress.

    Raises:
        QuestionError: The columns are missing, or a result is to be run otherwise.
        ScenarioError: Lists all problems of the scenario.
    """
    if source.suffix in OF_RUNS + OF_SEARCHES:
        if overrides or vary:
            raise QuestionError(f"{source}: is a finished run whose keys cannot change; give the scenario")
        columns = source if source.suffix in OF_SEARCHES else source.with_suffix(".npz")
        if source.exists() and not columns.exists():
            raise QuestionError(
                f"{visible(str(source))}: {visible(columns.name)}, which has the columns, is missing next to "
                f"it; `{command('run', 'SCENARIO')}` writes both"
            )
        yield columns
        return
    from rmrc.study.run import Job

    with TemporaryDirectory() as folder:
        job = Job(source, folder, False, scenarios.variants(vary) if vary else (), overrides)
        with progress(job.name, sum(world.reference.ticks for world in job.worlds), quiet) as on_ticks:
            job.run(on_ticks)
        if job.interrupted:
            raise KeyboardInterrupt
        yield job.files[0]
