"""The face: verbs and exit codes, nothing else.

0  all went well                        3  a world diverged; what it recorded is kept
1  an expectation was not met, a      130  Ctrl-C; what was recorded is kept
   goal not reached, a wrench not held,
   nothing keeps the limits
2  bad input, one line says what
"""

import sys
from typing import Annotated, NoReturn

import typer

import rmrc
from rmrc.cli import ik, inspect, scenarios, statics, sweep, tune, workspace
from rmrc.cli.console import EXIT_INPUT, complain
from rmrc.errors import RmrcError

app = typer.Typer(
    name="rmrc",
    help="Resolved motion rate control in MuJoCo: what an arm does near its singularities.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,  # a trace is for us, and only for bugs
)
for verb in (
    scenarios.run,
    scenarios.compare,
    sweep.sweep,
    tune.tune,
    scenarios.replay,
    scenarios.schema,
    inspect.inspect,
    statics.statics,
    ik.ik,
    workspace.workspace,
):
    app.command()(verb)


def main() -> NoReturn:
    """Run the command line; a user's mistake is one line for each problem, and exit code 2."""
    try:
        app(standalone_mode=True)
    except RmrcError as error:
        for line in str(error).splitlines():
            complain(f"error: {line}")
        sys.exit(EXIT_INPUT)
    except OSError as error:
        if error.filename is None:  # not about a file: a bug
            raise
        complain(f"error: {error.filename}: {(error.strerror or '').lower()}")
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
