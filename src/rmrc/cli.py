"""The face: verbs and exit codes, nothing else.

0  all went well                        3  a world diverged; what it recorded is kept
1  an expectation was not met         130  Ctrl-C; what was recorded is kept
2  bad input, one line says what
"""

import json
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

import rmrc
from rmrc import scenario as scenarios
from rmrc.errors import RmrcError

if TYPE_CHECKING:
    from rmrc.job import Ended

EXIT_MISSED, EXIT_INPUT, EXIT_DIVERGED, EXIT_INTERRUPTED = 1, 2, 3, 130

app = typer.Typer(
    name="rmrc",
    help="Resolved motion rate control in MuJoCo: what an arm does near its singularities.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,  # a trace is for us, and only for bugs
)

Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override any key of the scenario; repeatable."),
]


def main() -> NoReturn:
    """Run the command line; a user's mistake is one line for each problem, and exit code 2."""
    try:
        app(standalone_mode=True)
    except RmrcError as error:
        for line in str(error).splitlines():
            _complain(f"error: {line}")
        sys.exit(EXIT_INPUT)
    except OSError as error:
        if error.filename is None:  # not about a file: a bug
            raise
        _complain(f"error: {error.filename}: {(error.strerror or '').lower()}")
        sys.exit(EXIT_INPUT)
    sys.exit(0)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"rmrc {rmrc.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Resolved motion rate control in MuJoCo."""


@app.command()
def run(
    scenario: Annotated[Path, typer.Argument(help="The scenario, a YAML file.")],
    set_: Overrides = None,
    out: Annotated[Path, typer.Option(help="Folder for the recording, the arrays and the scorecard.")] = Path(
        "recordings"
    ),
    record: Annotated[bool, typer.Option(help="Write the .rrd recording.")] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only what went wrong.")] = False,
) -> None:
    """Run a scenario; leave NAME.rrd, NAME.npz (all columns) and NAME.json (scorecard)."""
    from rmrc.job import Job  # with numba and mujoco, which `schema` and `replay` do without
    from rmrc.output import tables

    console = Console(quiet=quiet)
    job = Job(scenarios.load(scenario, set_ or ()), out, record)
    try:
        with _notice("compiling the control law (once; kept for the next time) ..."):
            job.compile()
    except KeyboardInterrupt:
        _complain("interrupted before the first tick")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    screen = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
        console=screen, transient=True, disable=quiet or not screen.is_terminal,
    ) as progress:  # fmt: skip
        bar = progress.add_task(job.scenario.name, total=job.ticks)
        ended = job.run(lambda ticks: progress.update(bar, advance=ticks))
    console.print(tables.render(ended.scorecard, ended.outcomes))
    for path in ended.files:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True)
    if record:
        console.print(f"look at it: python -m rmrc replay {ended.files[0]}", soft_wrap=True)
    raise typer.Exit(_exit_code(ended))


def _exit_code(ended: "Ended") -> int:
    """Say on stderr what did not go well, and return the worst of it."""
    missed = [outcome for outcome in ended.outcomes if not outcome.ok]
    for outcome in missed:
        _complain(f"missed: {outcome}")
    if ended.interrupted:
        _complain(f"interrupted at tick {len(ended.run)} of {ended.run.planned}")
        return EXIT_INTERRUPTED
    if ended.run.divergence:
        _complain(f"error: {ended.run.name} {ended.run.divergence}")
        return EXIT_DIVERGED
    return EXIT_MISSED if missed else 0


@app.command()
def replay(
    recording: Annotated[Path, typer.Argument(help="A recording that `run` left.")],
    web: Annotated[bool, typer.Option("--web", help="Serve it to a browser instead.")] = False,
) -> None:
    """Open a recording in the rerun viewer, on this machine only and without telemetry."""
    from rmrc.output import viewer

    raise typer.Exit(viewer.replay(recording, web))


@app.command()
def schema(
    as_json: Annotated[bool, typer.Option("--json", help="JSON Schema, for editors.")] = False,
) -> None:
    """Print the keys of a scenario with type, unit, default and meaning."""
    from rmrc.output import tables

    if as_json:
        print(json.dumps(scenarios.json_schema(), indent=2, ensure_ascii=False))
    elif sys.stdout.isatty():
        Console().print(tables.schema(scenarios.schema_rows()))
    else:
        print(tables.schema_text(scenarios.schema_rows()))


@contextmanager
def _notice(text: str) -> Iterator[None]:
    """Say what takes long, but only if it does."""
    timer = threading.Timer(1.0, lambda: _complain(text))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _complain(text: str) -> None:
    print(f"rmrc: {text}", file=sys.stderr, flush=True)
