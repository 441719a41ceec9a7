"""Verbs about what comes with the package: examples, init."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import EXIT_INPUT, complain, output, print_line
from rmrc.cli.options import AsJson
from rmrc.cli.reports import show
from rmrc.support import shipped
from rmrc.support.errors import QuestionError
from rmrc.support.invocation import command

# What the hints are about: what README and docs begin with.
SCENARIO, MODEL = "approach_singularity", "planar_2link"


def examples(as_json: AsJson = False) -> None:
    """List the scenarios and models that come with the program; a verb takes them by their bare names."""
    from rmrc.show.report import Report
    from rmrc.show.sheets import Sheet

    _refuse_nothing()
    found = {
        folder: [
            {"name": name, "about": shipped.about(file), "path": str(file)}
            for name, file in shipped.shipped(folder).items()
        ]
        for folder in shipped.SUFFIX
    }
    tables = [
        Sheet(
            folder.capitalize(),
            ("name", "about"),
            [(one["name"], one["about"]) for one in files],
            left=frozenset({0, 1}),
        )
        for folder, files in found.items()
    ]
    show(Report(tables, found), as_json)
    if as_json:
        return
    console = output()
    for what, words in {
        "run one": ("run", SCENARIO),
        "ask about one": ("inspect", MODEL),
        "copy all": ("init", "FOLDER"),
    }.items():
        print_line(console, f"{what}: {command(*words)}")


def init(
    folder: Annotated[Path, typer.Argument(help="Where `scenarios` and `models` go; made if it is missing.")],
) -> None:
    """Copy the scenarios and models that come with the program into a folder, to be changed there.

    Nothing is overwritten, and both are there whole or not at all.
    """
    _refuse_nothing()
    if folder.exists() and not folder.is_dir():
        problems = [f"{folder}: is a file; give a folder"]
    else:
        there = [folder / name for name in shipped.SUFFIX if (folder / name).exists()]
        problems = [
            f"{path}: is there already, and nothing is overwritten; give another folder" for path in there
        ]
    for problem in problems:
        complain(f"error: {problem}")
    if problems:
        raise typer.Exit(EXIT_INPUT)
    console = output()
    for path in shipped.copy_out(folder):
        print_line(console, f"wrote {path}")
    print_line(console, f"run one: {command('run', folder / 'scenarios' / f'{SCENARIO}.yaml')}")


def _refuse_nothing() -> None:
    """Refuse what needs the shipped files where the package came without them.

    Raises:
        QuestionError: It did.
    """
    if shipped.root() is None:
        raise QuestionError(
            "this installation came without scenarios and models; install rmrc from its wheel or from a clone"
        )
