"""The verb `check`: find whether a model is ready to be simulated and controlled."""

from rmrc.cli.console import notice
from rmrc.cli.options import AsJson, Body, Joints, Junit, Model, Packages, Site, Summary, asked, joints_of
from rmrc.cli.reports import show


def check(
    model: Model,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    joints: Joints = None,
    as_json: AsJson = False,
    junit: Junit = None,
    summary: Summary = None,
) -> None:
    """Lint a model: report errors, missing data and assumptions.

    Checks the frame, limits, home, size and contacts, and one second of motion on each plant, compared with
    the ideal one. Exit code 1: the model has an error.
    """
    with notice("checking the model ..."):
        from rmrc.analysis.check.check import check as ask
        from rmrc.analysis.check.check import report
        from rmrc.results import ci
        from rmrc.show.sheets import as_markdown

        with ci.files(model.stem, junit, summary) as results:
            answer = report(ask(model, **asked(site, body, package), joints=joints_of(joints)))
            results.suites = [ci.Suite(model.stem, answer.cases, verdict=answer.problem)]
            results.figures = "\n\n".join(map(as_markdown, answer.sheets))
    show(answer, as_json, files=[*filter(None, (junit, summary))])
