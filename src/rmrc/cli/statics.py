"""The verb `statics`: actuator torques and link loads under a wrench, checked in the physics."""

from typing import Annotated

import typer

from rmrc.cli.console import EXIT_DIVERGED, EXIT_MISSED, interruption, progress
from rmrc.cli.options import AsJson, Body, Keyframe, Model, Packages, Positions, Site, read_arm
from rmrc.cli.reports import show
from rmrc.cli.texts import configuration, wrench_of

Wrench = Annotated[
    str,
    typer.Option(
        metavar="fx,fy,fz,nx,ny,nz",
        help="Wrench on the arm at the site: force in N and moment in N·m, or a force alone.",
        show_default=False,
    ),
]
Axes = Annotated[
    str, typer.Option("--frame", metavar="world|base|site", help="Frame of the axes of the wrench.")
]
At = Annotated[
    str | None,
    typer.Option(metavar="SITE", help="Also print the wrench at this other site of the same body."),
]
Gravity = Annotated[
    bool, typer.Option(help="Whether the actuators also support the arm's weight.", show_default=False)
]
Hold = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Also simulate: hold the arm until it is still, for at most this time, and read the actuators.",
        min=0.2,
        max=1000.0,
    ),
]


def statics(
    model: Model,
    wrench: Wrench,
    q: Positions = None,
    keyframe: Keyframe = None,
    site: Site = None,
    body: Body = None,
    package: Packages = None,
    frame: Axes = "world",
    at: At = None,
    gravity: Gravity = False,
    hold: Hold = None,
    as_json: AsJson = False,
) -> None:
    """Compute actuator torques and link loads under a wrench, and wrenches that need no torque."""
    from rmrc.analysis.statics.report import report
    from rmrc.analysis.statics.statics import PERIOD
    from rmrc.analysis.statics.statics import statics as ask

    acts = wrench_of(wrench)
    arm, positions = configuration(read_arm(model, site, body, package), q, keyframe)
    with (
        interruption("interrupted" if hold is None else "interrupted while holding"),
        progress("hold", round((hold or 0.0) / PERIOD) + 1, as_json or hold is None) as on_ticks,
    ):
        found = ask(arm, acts, positions, frame=frame, at=at, gravity=gravity, hold=hold, on_ticks=on_ticks)
    diverged = found.held is not None and found.held["run"].divergence
    show(report(found), as_json, missed=EXIT_DIVERGED if diverged else EXIT_MISSED)
