"""The verb `check`: whether a model is ready to be driven."""

from typing import Annotated

import typer

from rmrc.cli.console import notice
from rmrc.cli.options import AsJson, Body, Joints, Model, Packages, Site, asked, joints_of
from rmrc.cli.reports import show

Seed = Annotated[int, typer.Option(help="Of the second of motion.", min=0)]


def check(
    model: Model,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    joints: Joints = None,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Check a model as a linter would: what must be mended, what is missing, what is assumed.

    Chain, actuators, limits, home and the nearest singularity, contacts, J by four routes, and a second of
    motion on each plant. Exit code 1: something must be mended.
    """
    with notice("checking the model ..."):
        from rmrc.analysis.check.check import check as ask
        from rmrc.analysis.check.report import report

        found = ask(model, **asked(site, body, package), joints=joints_of(joints), seed=seed)
    show(report(found), as_json)
