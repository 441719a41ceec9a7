"""Verbs for the shipped scenarios and models: examples, init."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import EXIT_INPUT, complain, output, print_line
from rmrc.cli.options import AsJson
from rmrc.cli.reports import show
from rmrc.support import shipped
from rmrc.support.errors import QuestionError
from rmrc.support.invocation import command

# The examples in the hints: the ones with which the README and the documentation begin.
SCENARIO, MODEL = "approach_singularity", "planar_2link"


def examples(as_json: AsJson = False) -> None:
    """List the shipped scenarios and models; every verb accepts their bare names."""
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
    folder: Annotated[
        Path, typer.Argument(help="Destination of `scenarios` and `models`; created if missing.")
    ],
) -> None:
    """Copy the shipped scenarios and models into a folder, for editing.

    Overwrites nothing.
    """
    _refuse_nothing()
    if folder.exists() and not folder.is_dir():
        problems = [f"{folder}: is a file; give a folder"]
    else:
        there = [folder / name for name in shipped.SUFFIX if (folder / name).exists()]
        problems = [f"{path}: already exists and is never overwritten; give another folder" for path in there]
    for problem in problems:
        complain(f"error: {problem}")
    if problems:
        raise typer.Exit(EXIT_INPUT)
    console = output()
    for path in shipped.copy_out(folder):
        print_line(console, f"wrote {path}")
    print_line(console, f"run one: {command('run', folder / 'scenarios' / f'{SCENARIO}.yaml')}")


def _refuse_nothing() -> None:
    """Refuse if the package was installed without the shipped files.

    Raises:
        QuestionError: They are missing.
    """
    if shipped.root() is None:
        raise QuestionError(
            "this installation has no scenarios and models; install rmrc from its wheel or from a clone"
        )
