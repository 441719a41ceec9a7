"""The verbs before a first run: `check`, `new`, `identify`, `schema` and `examples`."""

import sys
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from rmrc import scenario as scenarios
from rmrc.cli import options
from rmrc.cli.console import print_json, show, working
from rmrc.cli.options import File, Texts
from rmrc.support import shipped
from rmrc.support.errors import QuestionError
from rmrc.support.text import command, quoted


def check(
    model: options.Model,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    joints: options.Joints = None,
    junit: options.Junit = None,
    summary: options.Summary = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Lint a model: report errors, missing data and assumptions.

    Checks the frame, limits, home, size and contacts, and one second of motion on each plant, compared with
    the ideal one. Exit code 1: the model has an error.
    """
    with working("checking the model"):
        from rmrc.analysis.check import check as ask
        from rmrc.analysis.check import report
        from rmrc.results import expectations
        from rmrc.show.sheets import as_markdown

        with expectations.files(model.stem, junit, summary) as results:
            frame = options.frame_of(site, body, package)
            answer = report(ask(model, **frame, joints=options.joints_of(joints)))
            results.suites = [expectations.Suite(model.stem, answer.cases, verdict=answer.problem)]
            results.figures = "\n\n".join(map(as_markdown, answer.sheets))
    show(answer, as_json, quiet, [junit, summary])


STDOUT = Path("-")


def new(
    model: options.Model,
    output: options.Output = None,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    joints: options.Joints = None,
    length: options.Length = None,
    plant: Annotated[str, Option(help="Plant: ideal, servo, torque or model.")] = "servo",
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
        from rmrc.analysis.new import new as make
        from rmrc.analysis.new import report

        arm = options.read_arm(model, site, body, package, joints)
        path = output or Path(f"{model.stem}.yaml")
        made = make(arm, length=length, plant=plant, out=None if path == STDOUT else path, force=force)
    if path == STDOUT:
        print(made.text, end="")
    hint = f"run it: {command('run', path)}"
    show(report(made), as_json, quiet or path == STDOUT, [path], hint)


def identify(
    log: Annotated[
        Path,
        Argument(help="The log: CSV, Parquet or a run's .npz, with t, and q and qdot_cmd of each joint."),
    ],
    columns: Annotated[
        Texts, Option(metavar="KIND=NAME", help="Column of t, q or qdot_cmd; repeatable.")
    ] = None,
    degrees: Annotated[
        bool, Option("--degrees", help="Angles are in degrees; default: rad, unless joints exceed 15.")
    ] = False,
    out: options.Out = Path("recordings"),
    output: options.Picture = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Estimate delay, lag and noise of each joint from a log of commands and positions.

    Prints a plant and arm.encoder block to paste into a scenario. Writes the block to NAME.identify.yaml, and
    a plot of the fit and the data to .png. `--columns` names the column of t, or those of q or qdot_cmd:
    A,B,C, or a pattern with * for the joint; a unit may follow, as in "t=stamp ms". Exit code 1: the log
    identifies no joint's delay; a message says what to log instead.
    """
    pairs = dict[str, str]()
    for text in columns or ():
        kind, mark, name = (part.strip() for part in text.partition("="))
        if not (mark and kind and name):
            raise QuestionError(f"--columns must be KIND=NAME, such as t=stamp, got {quoted(text)}")
        pairs[kind] = name
    with working("identifying"):
        from rmrc.analysis.identify import identify as ask
        from rmrc.analysis.identify_report import report
        from rmrc.support.files import refuse_unwritable, write_text

        picture, block = output or out / f"{log.stem}.identify.png", out / f"{log.stem}.identify.yaml"
        refuse_unwritable([picture, block])
        answer = report(ask(log, columns=pairs, degrees=degrees))
        files = options.draw(answer, picture)
        if answer.block:
            write_text(block, answer.block)
            files.append(block)
    show(answer, as_json, quiet, files)


# With which the README and the documentation begin.
EXAMPLE = "approach_singularity"


def schema(
    as_json: Annotated[bool, Option("--json", help="Print JSON Schema, for editors.")] = False,
) -> None:
    """Print the keys of a scenario with type, unit, default and meaning."""
    from rmrc.show.sheets import Report, Sheet

    if as_json:
        print_json(scenarios.json_schema())
    elif sys.stdout.isatty():
        rows = [(row.key, " ".join(filter(None, row[1:]))) for row in scenarios.schema_rows()]
        show(Report([Sheet("", ("key", "type, unit, default, meaning"), rows, frozenset({0, 1}))], {}), False)
    else:  # a line for each key, to be searched
        print(*("  ".join(filter(None, row)) for row in scenarios.schema_rows()), sep="\n")


def examples(
    copy: Annotated[File, Option(metavar="FOLDER", help="Copy them into this folder, for editing.")] = None,
    as_json: options.AsJson = False,
) -> None:
    """List the shipped scenarios and models, or copy them; every verb accepts their bare names."""
    from rmrc.show.sheets import Report, Sheet

    if shipped.root() is None:
        raise QuestionError(
            "this installation has no scenarios and models; install rmrc from its wheel or from a clone"
        )
    files, hint = list[Path](), f"run one: {command('run', EXAMPLE)}; copy all: examples --copy FOLDER"
    if copy is not None:
        taken = next((path for path in (copy / name for name in shipped.SUFFIX) if path.exists()), None)
        if copy.is_file() or taken:
            raise QuestionError(
                f"{taken or copy}: already exists and is never overwritten; give another folder"
            )
        files = shipped.copy_out(copy)
        hint = f"run one: {command('run', copy / 'scenarios' / f'{EXAMPLE}.yaml')}"
    facts = {
        folder: [
            {"name": name, "about": shipped.about(file), "path": str(file)}
            for name, file in shipped.shipped(folder).items()
        ]
        for folder in shipped.SUFFIX
    }
    sheets = [
        Sheet(folder.capitalize(), ("name", "about"), [(it["name"], it["about"]) for it in items],
              frozenset({0, 1}))
        for folder, items in facts.items()
    ]  # fmt: skip
    show(Report([] if files else sheets, facts), as_json, files=files, hint=hint)
