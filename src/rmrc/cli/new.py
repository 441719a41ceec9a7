"""The verb `new`: write a first scenario for an arm, ready to run."""

from pathlib import Path
from typing import Annotated

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import show, working
from rmrc.support.errors import QuestionError
from rmrc.support.invocation import command

STDOUT = Path("-")


def new(
    model: options.Model,
    output: options.Output = None,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    joints: options.Joints = None,
    length: options.Length = None,
    plant: Annotated[str, Option(help="Plant of the scenario: ideal, servo or torque.")] = "servo",
    force: Annotated[bool, Option("--force", help="Overwrite the file.")] = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Write a first scenario for an arm, ready to run.

    A path through its nearest singularity and back, scaled to the arm. Takes limits from the model, or
    assumes them and says so. Derives length, damping and speed from the arm. Runs the scenario before writing
    it, and sets its expectations from that run. Writes MODEL.yaml in this folder, or FILE; `-o -` prints it.
    Exit code 1: bodies are within each other.
    """
    if output == STDOUT and as_json:
        raise QuestionError("give -o - or --json, not both: stdout takes either the scenario or the report")
    with working("trying moves"):
        from rmrc.analysis.new.new import new as make
        from rmrc.analysis.new.new import report

        arm = options.read_arm(model, site, body, package, joints)
        path = output or Path(f"{model.stem}.yaml")
        made = make(arm, length=length, plant=plant, out=None if path == STDOUT else path, force=force)
    if path == STDOUT:
        print(made.text, end="")
    hint = f"run it: {command('run', path)}"
    show(report(made), as_json, quiet or path == STDOUT, [path], hint)
