"""The verb `check`: find whether a model is ready to be simulated and controlled."""

from typing import Annotated

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import show, working


def check(
    model: options.Model,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    joints: options.Joints = None,
    seed: Annotated[int, Option(help="Seed of the one-second motion.", callback=options.within(0, 1e9))] = 0,
    junit: options.Junit = None,
    summary: options.Summary = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Lint a model: report errors, missing data and assumptions.

    Checks the chain, actuators, limits, home and the nearest singularity, contacts, and one second of motion
    on each plant, compared with the ideal one. Exit code 1: the model has an error.
    """
    with working("checking the model"):
        from rmrc.analysis.check.check import check as ask
        from rmrc.analysis.check.check import report
        from rmrc.results import ci
        from rmrc.show.sheets import as_markdown

        with ci.files(model.stem, junit, summary) as results:
            frame = options.frame_of(site, body, package)
            answer = report(ask(model, **frame, joints=options.joints_of(joints), seed=seed))
            results.suites = [ci.Suite(model.stem, answer.cases, verdict=answer.problem)]
            results.figures = "\n\n".join(map(as_markdown, answer.sheets))
    show(answer, as_json, quiet, options.written(junit, summary))
