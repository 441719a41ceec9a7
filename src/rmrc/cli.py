"""The face: verbs and exit codes, nothing else.

0  all went well                        3  a world diverged; what it recorded is kept
1  an expectation was not met         130  Ctrl-C; what was recorded is kept
2  bad input, one line says what
"""

import json
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
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
    from rmrc.comparison import Comparison, Results
    from rmrc.job import Ended, Job

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
Out = Annotated[Path, typer.Option(help="Folder for the files.")]
Record = Annotated[bool, typer.Option(help="Write the .rrd recording.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only what went wrong.")]


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
    out: Out = Path("recordings"),
    record: Record = True,
    quiet: Quiet = False,
) -> None:
    """Run a scenario; leave NAME.rrd, NAME.npz (all columns) and NAME.json (scorecard)."""
    from rmrc.job import Job  # with numba and mujoco, which `schema` and `replay` do without
    from rmrc.output import tables

    console = Console(quiet=quiet)
    job = Job(scenarios.load(scenario, set_ or ()), out, record)
    _compile(job)
    with _progress(job.scenario.name, job.ticks, quiet) as on_ticks:
        ended = job.run(on_ticks)
    console.print(tables.render(ended.scorecard, ended.outcomes))
    _list(console, ended.files, record)
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
    if not ended.run.is_complete:
        _complain(
            f"{ended.run.name} came {ended.run.completed:.0%} of its path in {len(ended.run)} ticks, "
            "where control.slow.longest ends it"
        )
    return EXIT_MISSED if missed else 0


@app.command()
def compare(
    scenario: Annotated[Path, typer.Argument(help="The scenario, a YAML file.")],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary", metavar="KEY=V1,V2,...", help="Values of a key to compare; repeatable: a grid."
        ),
    ] = None,
    set_: Overrides = None,
    out: Out = Path("recordings"),
    record: Record = True,
    quiet: Quiet = False,
) -> None:
    """Run variants of a scenario side by side; leave NAME.compare.rrd, .json, .png and .svg.

    The exit code is that of the runs, whatever the scenario expects: what was missed is in the table.
    """
    from rmrc.comparison import Comparison
    from rmrc.output import comparison_table as table

    # The table needs 100 columns, and a pipe has any number.
    console = Console(quiet=quiet, width=None if sys.stdout.isatty() else 100)
    comparison = Comparison(scenario, vary or (), set_ or (), out, record)
    _compile(comparison)
    with _progress(
        f"{comparison.name}: {len(comparison.variants)} variants", comparison.ticks, quiet
    ) as on_ticks:
        results = comparison.run(on_ticks)
    rows = [table.Row(one.variant.label, one.run, one.scorecard, one.outcomes) for one in results.variants]
    console.print(table.render(results.name, rows))
    _list(console, results.files, record)
    raise typer.Exit(_exit_code_of_all(results))


def _exit_code_of_all(results: "Results") -> int:
    """Say on stderr which variants did not reach their end, and return the worst of it."""
    diverged = [one for one in results.variants if one.run.divergence]
    for one in diverged:
        _complain(f'error: variant "{one.variant.label}" {one.run.divergence}')
    if results.interrupted:
        ticks, planned = (
            sum(of(one.run) for one in results.variants) for of in (len, lambda run: run.planned)
        )
        _complain(f"interrupted at tick {ticks} of {planned}, of all variants together")
        return EXIT_INTERRUPTED
    return EXIT_DIVERGED if diverged else 0


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


def _compile(work: "Job | Comparison") -> None:
    try:
        with _notice("compiling the control law (once; kept for the next time) ..."):
            work.compile()
    except KeyboardInterrupt:
        _complain("interrupted before the first tick")
        raise typer.Exit(EXIT_INTERRUPTED) from None


@contextmanager
def _progress(what: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Yield a function that moves a bar on by some ticks; there is none unless a terminal can show it."""
    screen = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
        console=screen, transient=True, disable=quiet or not screen.is_terminal,
    ) as progress:  # fmt: skip
        bar = progress.add_task(what, total=total)
        yield lambda ticks: progress.update(bar, advance=ticks)


def _list(console: Console, files: Sequence[Path], record: bool) -> None:
    for path in files:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True)
    if record:
        console.print(f"look at it: python -m rmrc replay {files[0]}", soft_wrap=True)


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
