"""The command line: verbs and exit codes, nothing else.

  0  all went well
  1  a check failed: an expectation missed, a goal not reached, a wrench not
     held, no setting within the limits, an error in a model, an unstable loop,
     or a log that identifies no delay
  2  bad input, or output that cannot be written; one line says why
  3  a world diverged; the data up to there are kept
 70  an internal error, with a traceback
129  SIGHUP; the data up to there are kept
130  Ctrl-C; the data up to there are kept
141  the reader closed the pipe
143  SIGTERM; the data up to there are kept
"""

import sys
import traceback
from importlib.metadata import PackageNotFoundError, metadata
from typing import Annotated, NoReturn

import typer

import rmrc
from rmrc.cli import (
    check,
    examples,
    identify,
    ik,
    inspect,
    margins,
    new,
    plot,
    render,
    report,
    scenarios,
    statics,
    streams,
    sweep,
    tune,
    workspace,
)
from rmrc.cli.console import (
    EXIT_INPUT,
    EXIT_INTERNAL,
    EXIT_INTERRUPTED,
    EXIT_MISSED,
    EXIT_PIPE,
    complain,
    named_by_signal,
    warnings_in_lines,
)
from rmrc.cli.mistakes import ENVIRONMENT, UsageError, usage
from rmrc.support.errors import RmrcError, ScenarioError
from rmrc.support.interruption import signal_that_came, stops_like_ctrl_c
from rmrc.support.invocation import command
from rmrc.support.legible import visible
from rmrc.support.notices import heard_by

EPILOG = """docs/textbook.md lists the command for each section, example and exercise of a course.

\b
Exit codes:
    0  all went well
    1  a check failed: an expectation missed, a goal
       not reached, a wrench not held, no setting within
       the limits, an error in a model, an unstable loop,
       or a log that identifies no delay
    2  bad input, or output that cannot be written
    3  a world diverged; the data up to there are kept
   70  an internal error, with a traceback
  129  SIGHUP; the data up to there are kept
  130  Ctrl-C; the data up to there are kept
  141  the reader closed the pipe
  143  SIGTERM; the data up to there are kept"""

app = typer.Typer(
    name="rmrc",
    help="Resolved motion rate control in MuJoCo: arms near their singularities.",
    epilog=EPILOG,
    add_completion=False,
    rich_markup_mode=None,  # rich would read [m] and [kg] in a help text as markup, and break words
    pretty_exceptions_enable=False,  # a traceback is for developers, and only for bugs
    context_settings={"max_content_width": 100},
)
for verb in (
    scenarios.run,
    scenarios.compare,
    sweep.sweep,
    tune.tune,
    margins.margins,
    scenarios.replay,
    plot.plot,
    report.report,
    render.render,
    scenarios.schema,
    check.check,
    new.new,
    identify.identify,
    inspect.inspect,
    statics.statics,
    ik.ik,
    workspace.workspace,
    examples.examples,
    examples.init,
):
    # The first paragraph, which the list of verbs would otherwise cut off.
    app.command(short_help=" ".join((verb.__doc__ or "").split("\n\n")[0].split()))(verb)


def main() -> NoReturn:
    """Run the command line; a user's mistake is one line for each problem, and exit code 2."""
    with streams.patient() as output, heard_by(complain), warnings_in_lines():
        with stops_like_ctrl_c():
            code = named_by_signal(_run())
        sys.stdout.flush()
        if code in (0, EXIT_MISSED) and output.is_closed:
            code = EXIT_PIPE
        elif code in (0, EXIT_MISSED) and output.problem:
            complain(f"error: stdout cannot be written: {output.problem}")
            code = EXIT_INPUT
    sys.exit(code)


def _run() -> int:
    """Run the command line and return its exit code, whatever happens."""
    try:
        code = app(standalone_mode=False)
        return code if isinstance(code, int) else 0
    except UsageError as error:
        complain(f"error: {usage(error)}")
    except RmrcError as error:
        for problem in error.problems if isinstance(error, ScenarioError) else [str(error)]:
            complain(f"error: {problem}")
    except MemoryError as error:
        told = f" ({error})" if str(error) else ""
        complain(f"error: not enough memory{told}; ask for less at a time, or add memory")
    except OSError as error:
        if error.filename is None and error.errno not in ENVIRONMENT:  # not about a file: a bug
            return _internal()
        place = "a file cannot be written" if error.filename is None else error.filename
        complain(f"error: {place}: {(error.strerror or str(error)).lower()}")
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except Exception as error:
        # Bindings of C++ turn an interrupt that comes while they convert an argument into these errors.
        if isinstance(error, TypeError | SystemError) and signal_that_came():
            return EXIT_INTERRUPTED
        return _internal()
    return EXIT_INPUT


def _internal() -> int:
    """Print the traceback of an unforeseen error, and where to report it."""
    print(visible(traceback.format_exc(), keep="\n"), end="", file=sys.stderr)
    complain(f"internal error: this is a bug in rmrc {rmrc.__version__}, not in your input")
    complain(
        f"report it{_tracker()} with the lines above, the command, its files, and the output of "
        f"{command('--version')}"
    )
    return EXIT_INTERNAL


def _tracker() -> str:
    """Return where to report bugs, if the package's metadata says so."""
    try:
        urls = metadata("rmrc").get_all("Project-URL") or []
    except PackageNotFoundError:
        urls = []
    named = dict(url.split(", ", 1) for url in urls)
    return "".join(f" at {url}" for name, url in named.items() if name.lower() in ("issues", "bug tracker"))


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"rmrc {rmrc.__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Resolved motion rate control in MuJoCo."""
    if context.invoked_subcommand is None:
        print(context.get_help(), file=sys.stderr)
        raise typer.Exit(EXIT_INPUT)
