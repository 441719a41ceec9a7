"""The verbs `schema` and `examples`: the keys of a scenario, and what comes with the package."""

import sys
from pathlib import Path
from typing import Annotated

from typer import Option

from rmrc import scenario as scenarios
from rmrc.cli import options
from rmrc.cli.console import print_json, show
from rmrc.cli.options import File
from rmrc.support import shipped
from rmrc.support.errors import QuestionError
from rmrc.support.text import command

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
