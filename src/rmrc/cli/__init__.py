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

import io
import itertools
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable
from typing import Annotated, Any, NoReturn, TypeAlias

import typer

import rmrc
from rmrc.cli import arms, console, models, pictures, run, search
from rmrc.cli.console import complain
from rmrc.support.errors import RmrcError, ScenarioError, file_problem, heard_by
from rmrc.support.process import signal_that_came, stops_like_ctrl_c
from rmrc.support.text import command, shortened, visible

# The error of the command line's library for a wrong option or argument; it only exports this subclass of it.
UsageError: Any = typer.BadParameter.__mro__[1]

# The verbs that most people need first, and the others by what they are about.
Verbs: TypeAlias = tuple[Callable[..., None], ...]
FIRST: Verbs = (run.run, run.compare, search.tune, models.check, models.new, pictures.replay)
OTHERS: dict[str, Verbs] = {
    "runs": (search.sweep, search.margins, pictures.plot, pictures.report, pictures.render, pictures.explore),
    "arms": (arms.inspect, arms.ik, arms.statics, arms.workspace, models.identify),
    "files": (pictures.export, models.examples, models.schema),
}
MORE = "\n".join(f"  {about:7}{', '.join(verb.__name__ for verb in some)}" for about, some in OTHERS.items())
# Large libraries that only pictures and recordings need, and their packages.
REMOVABLE = {"matplotlib": "matplotlib", "rerun": "rerun-sdk"}
EPILOG = f"""\b
More commands:
{MORE}

\b
Exit codes: 0 well, 1 a check failed, 2 bad input, 3 diverged, 130 Ctrl-C;
docs/commands.md lists all of them, and all options."""

app = typer.Typer(
    name="rmrc",
    help="Resolved motion rate control in MuJoCo: arms near their singularities.",
    epilog=EPILOG,
    add_completion=False,
    rich_markup_mode=None,  # rich would read [m] and [kg] in a help text as markup, and break words
    pretty_exceptions_enable=False,  # a traceback is for developers, and only for bugs
    context_settings={"max_content_width": 100},
)
for _verb in (*FIRST, *itertools.chain(*OTHERS.values())):
    app.command(short_help=(_verb.__doc__ or "").partition("\n")[0], hidden=_verb not in FIRST)(_verb)


def main() -> NoReturn:
    """Run the command line; a user's mistake is one line for each problem, and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # no encoding of a terminal is an error
            stream.reconfigure(errors="backslashreplace")
    with heard_by(complain), console.warnings_in_lines(), stops_like_ctrl_c():
        try:
            code = int(app(standalone_mode=False) or 0)
            if code == console.EXIT_INTERRUPTED:  # of typer, after Ctrl-C
                raise console.InterruptedVerb("interrupted")
            sys.stdout.flush()
        except SystemExit:  # of typer and rich, which end so when the reader closes the pipe
            code = console.EXIT_PIPE
        except Exception as error:
            code = _code_of(error)
    sys.exit(code)


def _code_of(error: Exception) -> int:
    """Report an error in one line for each problem, and return the exit code."""
    if isinstance(error, console.InterruptedVerb) or signal_that_came():  # some libraries raise other errors
        complain(str(error) if isinstance(error, console.InterruptedVerb) else "interrupted")
        return 128 + (signal_that_came() or signal.SIGINT)
    if isinstance(error, OSError) and not isinstance(error, RmrcError) and error.filename is None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what stdout holds is lost
    if isinstance(error, BrokenPipeError):
        return console.EXIT_PIPE
    problems = _problems(error)
    for problem in problems:
        complain(f"error: {problem}")
    if problems:
        return console.EXIT_INPUT
    print(visible(traceback.format_exc(), keep="\n"), end="", file=sys.stderr)
    complain(f"internal error: this is a bug in rmrc {rmrc.__version__}, not in your input")
    complain("report it with the lines above, the command and its files")
    return console.EXIT_INTERNAL


def _problems(error: Exception) -> list[str]:
    """Return what a user or the machine did wrong, a line each; nothing for a bug."""
    if isinstance(error, RmrcError):
        return list(map(str, error.problems)) if isinstance(error, ScenarioError) else [str(error)]
    if isinstance(error, UsageError):
        text = " ".join(error.format_message().split()).removesuffix(".").replace("Value error, ", "")
        text = re.sub(r"'([^']*)'", lambda match: f"'{shortened(match[1])}'", text)
        verbs = [error.ctx.info_name] if error.ctx is not None and error.ctx.parent is not None else []
        return [f"{text}; see {command(*verbs, '--help')}"]
    if isinstance(error, ModuleNotFoundError) and error.name in REMOVABLE:
        return [f"{error.name} is not installed; pip install {REMOVABLE[error.name]}"]
    if isinstance(error, MemoryError):
        return [f"not enough memory ({error}); ask for less at a time, or add memory"]
    return [file_problem(error)] if isinstance(error, OSError) else []


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
        raise typer.Exit(console.EXIT_INPUT)
