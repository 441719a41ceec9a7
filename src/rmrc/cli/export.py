"""The verb `export`: the law of a scenario for other programs."""

from pathlib import Path
from typing import Annotated

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import working
from rmrc.cli.options import File
from rmrc.scenario import load
from rmrc.support.errors import QuestionError
from rmrc.support.text import quoted


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
