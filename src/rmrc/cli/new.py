"""The verb `new`: write a first scenario for an arm, ready to run."""

from pathlib import Path
from typing import Annotated

import typer

from rmrc.cli.console import notice, output, print_line
from rmrc.cli.options import AsJson, Body, Joints, Length, Model, Packages, Quiet, Site, read_arm
from rmrc.cli.reports import show
from rmrc.support.errors import QuestionError
from rmrc.support.invocation import command

STDOUT = Path("-")

Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", help="File, or - for stdout; default: the model's name, in this folder."),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite the file.")]
Plant = Annotated[str, typer.Option(help="Plant that executes the rates: plant.kind of the scenario.")]


def new(
    model: Model,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    joints: Joints = None,
    length: Length = None,
    plant: Plant = "servo",
    out: Out = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a first scenario for an arm: a path through its nearest singularity and back, scaled to the arm.

    Takes limits from the model, or assumes them and says so. Derives length, damping and speed from the arm.
    Runs the scenario before writing it, and sets its expectations from that run. Exit code 1: bodies are
    within each other.
    """
    if out == STDOUT and as_json:
        raise QuestionError("give -o - or --json, not both: stdout takes either the scenario or the report")
    with notice("trying moves ..."):
        from rmrc.analysis.new.new import new as make
        from rmrc.analysis.new.new import report

        path = Path(f"{model.stem}.yaml") if out is None else out
        arm = read_arm(model, site, body, package, joints)
        made = make(arm, length=length, plant=plant, out=None if path == STDOUT else path, force=force)
    if path == STDOUT:
        print(made.text, end="")
    show(report(made), as_json, quiet or path == STDOUT, [path])
    if not as_json and path != STDOUT:
        print_line(output(quiet), f"run it: {command('run', path)}")
