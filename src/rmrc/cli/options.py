"""Options that several verbs share, each declared once."""

import re
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from rmrc.cli.kinds import MODEL, expect
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted
from rmrc.support.notices import tell_assumed

if TYPE_CHECKING:
    from rmrc.arm import Arm

T = TypeVar("T")

# Positions and angles up to this [m or rad] are kept to 1e-10.
FARTHEST = 1e6


def within(option: str, least: float, most: float) -> Callable[[float], float]:
    """Return a check of an option's number, which nan and inf do not pass."""

    def check(value: float) -> float:
        if not least <= value <= most:
            raise QuestionError(f"{option} must be between {least:g} and {most:g}, got {value:g}")
        return value

    return check


Model = Annotated[
    Path,
    typer.Argument(
        help="The arm: an MJCF or URDF file, or the name of a shipped one.",
        show_default=False,
        callback=lambda path: expect(path, MODEL),
    ),
]
Site = Annotated[
    str | None, typer.Option(help="End effector (TCP) site; default: a site or body of the hand.")
]
Body = Annotated[str | None, typer.Option(help="Body whose frame is the end effector, instead of a site.")]
Packages = Annotated[
    list[str] | None,
    typer.Option(
        "--package",
        metavar="NAME=FOLDER",
        help="Folder of a package named in a URDF file, if not above that file; repeatable.",
    ),
]
Positions = Annotated[
    str | None,
    typer.Option("--q", metavar="Q1,Q2,...", help='Joint positions: rad, m, or angles such as "60 deg".'),
]
Keyframe = Annotated[str | None, typer.Option(help="Joint positions by name; default: home.")]
TaskAxes = Annotated[
    str | None,
    typer.Option(
        "--axes",
        metavar="x,y,...",
        help="Task rows, of x y z rx ry rz; default: those that the arm can move independently.",
    ),
]
Joints = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,NAME,...",
        help="Actuated joints, from the base outward; default: all joints of the chain.",
    ),
]
TaskFrame = Annotated[
    str | None,
    typer.Option(
        "--task-frame",
        metavar="world|base|site",
        help="Frame of the task rows, as task.frame of a scenario.",
        show_default="world",
    ),
]
length_within = within("--length", 1e-6, FARTHEST)
Length = Annotated[
    float | None,
    typer.Option(
        help="Characteristic length in m: makes meters and radians comparable in sigma, kappa and w.",
        callback=lambda length: length if length is None else length_within(length),
        show_default="that of the arm",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for machines.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors and warnings only.")]
Threads = Annotated[
    int | None, typer.Option(min=1, help="Number of threads, one batch each.", show_default="one per core")
]
Out = Annotated[Path, typer.Option(help="Folder for the files.")]
Junit = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Write JUnit XML for CI: .xml, one test case per expectation or check."
    ),
]
Summary = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Write a Markdown summary for CI: .md; appends to $GITHUB_STEP_SUMMARY."
    ),
]


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

    arm = load(model, joints=joints_of(joints), **asked(site, body, packages))
    # the answer names the site
    tell_assumed(note for note in arm.notes if not getattr(note, "is_obvious", False))
    return arm


def asked(site: str | None, body: str | None, packages: list[str] | None) -> dict[str, Any]:
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


PICTURES = (".png", ".svg", ".pdf")


def drawable(path: Path | None) -> Path | None:
    """Return the file of a picture, unless its kind cannot be drawn.

    Raises:
        QuestionError: It has another suffix.
    """
    if path is not None and path.suffix not in PICTURES:
        raise QuestionError(f"--picture {path}: must end in {', '.join(PICTURES[:-1])} or {PICTURES[-1]}")
    return path


# Units of the width of a picture; and its bounds [in].
INCHES = {"in": 1.0, "cm": 1 / 2.54, "mm": 1 / 25.4, "pt": 1 / 72.27}
NARROWEST, WIDEST = 2.0, 40.0


def inches(text: str) -> float:
    """Return the number of `--width` in inches.

    Raises:
        QuestionError: It is no length, or no picture can be so wide.
    """
    found = re.fullmatch(rf"\s*([0-9]*\.?[0-9]+)\s*({'|'.join(INCHES)})\s*", text)
    if not found:
        raise QuestionError(f"--width must be a length such as 3.5in, 88mm or 18cm, got {quoted(text)}")
    length = float(found[1]) * INCHES[found[2]]
    if not NARROWEST <= length <= WIDEST:
        raise QuestionError(f"--width must be between {NARROWEST:g}in and {WIDEST:g}in, got {quoted(text)}")
    return length


_Width = Annotated[
    str | None,
    typer.Option("--width", help="Width of the picture in in, cm, mm or pt; a journal column is 3.5in wide."),
]
_Font = Annotated[
    float | None,
    typer.Option(
        "--font",
        help="Font size of the picture [pt].",
        callback=lambda value: value if value is None else within("--font", 4.0, 40.0)(value),
    ),
]


def pictured(verb: Callable[..., T]) -> Callable[..., T]:
    """Give a verb that leaves a picture the options --width and --font, behind its own."""

    @wraps(verb)
    def call(*given: Any, width: str | None = None, font: float | None = None, **options: Any) -> T:
        from rmrc.show.asked import sized

        with sized(None if width is None else inches(width), font):
            return verb(*given, **options)

    more = {"width": _Width, "font": _Font}
    own = signature(verb)
    added = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=kind) for name, kind in more.items()
    ]
    call.__signature__ = own.replace(parameters=[*own.parameters.values(), *added])  # type: ignore[attr-defined]
    call.__annotations__ = {**verb.__annotations__, **more}
    return call
