"""The verb `explore`: a page with sliders."""

import traceback
from pathlib import Path
from typing import Annotated

import typer

from rmrc import scenario as scenarios
from rmrc.cli.console import complain, interruption, output, print_line, warn
from rmrc.cli.kinds import MODEL, SCENARIO, Kind, expect
from rmrc.cli.options import Out
from rmrc.cli.scenarios import Overrides
from rmrc.support.errors import QuestionError
from rmrc.support.legible import visible
from rmrc.support.shipped import found

EXPLORED = Kind(
    "a scenario or a model", (*SCENARIO.suffixes, *MODEL.suffixes), verb="explore", shipped="scenarios"
)


def _explored(path: Path | None) -> Path | None:
    """Return the file of a scenario or a model; a bare name means a scenario first."""
    if path is None:
        return None
    shown = found(path, "scenarios")
    return expect(found(path, "models") if shown == path else shown, EXPLORED)


Explored = Annotated[
    Path | None,
    typer.Argument(
        metavar="SCENARIO|MODEL",
        help="A scenario, or a model, for which `new` makes one: a file, or the name of a shipped one.",
        show_default=False,
        callback=_explored,
    ),
]
Port = Annotated[
    int | None,
    typer.Option(min=1, max=65535, help="The port of the page; default: a free one.", show_default=False),
]
Host = Annotated[
    str,
    typer.Option(help="Address to listen on; if others can reach it, the path has a token; there is no TLS."),
]
LESSONS = ("reach", "wrist", "null-space", "duality", "algorithmic", "delay")
Asked = Annotated[
    str | None,
    typer.Option(
        "--lesson",
        metavar="NAME|FILE",
        help=f"A lesson: a scenario with questions and a number to find: {', '.join(LESSONS)}; or a YAML "
        "file of your own.",
        show_default=False,
    ),
]
Opens = Annotated[bool, typer.Option("--open", help="Open the page in the browser of this machine.")]

Drags = Annotated[bool, typer.Option("--drag", help="Begin in drag mode: you move the arm in real time.")]


def explore(
    scenario: Explored = None,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    port: Port = None,
    host: Host = "127.0.0.1",
    opens: Opens = False,
    lesson: Asked = None,
    drag: Drags = False,
) -> None:
    """Serve a page with sliders: each change runs the scenario again, and shows arm, rates and errors.

    Needs the extra `explore`. Prints the address of the page, serves only this machine by default, and ends
    with Ctrl-C.
    """
    with interruption("interrupted before the page was served"):
        from rmrc.explore.server import refuse_missing, serve
        from rmrc.scenario.lesson import load_lesson

        refuse_missing()
        asked = None
        if lesson is not None and scenario is None:
            asked, file = load_lesson(lesson)
            beside = file.parent / asked.scenario
            scenario = beside if beside.is_file() else _explored(Path(asked.scenario))
        elif lesson is not None or scenario is None:
            raise QuestionError("give a scenario, a model, or --lesson NAME: one of them")
        assert scenario is not None
        loaded = _loaded(scenario, set_ or [])
    serve(
        loaded,
        out,
        host,
        port or 0,
        asked,
        lambda url: print_line(output(), f"{url}  ({loaded.name}; Ctrl-C ends it)"),
        _failed,
        opens,
        drag,
    )


def _loaded(path: Path, settings: list[str]) -> "scenarios.Scenario":
    """Return the scenario of a file, with settings, or a new one for a model."""
    if path.suffix.lower() not in MODEL.suffixes:
        return scenarios.load(path, settings)
    if settings:
        raise QuestionError(f"--set is of a scenario, and {visible(str(path))} is a model; begin with `new`")
    from rmrc.analysis.new.new import new

    made = new(path)
    warn(f"{path.name}, of its move: {fault}" for fault in made.faults)
    return made.scenario


def _failed(error: Exception) -> None:
    """Print the error that ended a session; the other sessions continue."""
    traceback.print_exception(error)
    complain("internal error: a session of the page ended; the others continue")
