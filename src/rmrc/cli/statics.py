"""The verb `statics`: actuator torques and link loads under a wrench, checked in the physics."""

from typing import Annotated, Literal

from typer import Option

from rmrc.cli import options
from rmrc.cli.console import EXIT_DIVERGED, EXIT_MISSED, show, working
from rmrc.cli.options import Number, Text


def statics(
    model: options.Model,
    wrench: Annotated[
        str,
        Option(metavar="fx,fy,fz,nx,ny,nz", help="Wrench on the arm at the site [N, N·m], or a force alone."),
    ],
    q: options.Positions = None,
    keyframe: options.Keyframe = None,
    site: options.Site = None,
    body: options.Body = None,
    package: options.Packages = None,
    frame: Annotated[Literal["world", "site"], Option(help="Frame of the axes of the wrench.")] = "world",
    at: Annotated[Text, Option(metavar="SITE", help="Print the wrench also at this site.")] = None,
    gravity: Annotated[bool, Option(help="Whether the actuators also support the arm's weight.")] = False,
    hold: Annotated[
        Number, Option(callback=options.within(0.2, 1000.0), help="Simulate until it is still [s].")
    ] = None,
    length: options.Length = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute actuator torques and link loads under a wrench, and wrenches that need no torque.

    With --hold, simulates the arm until it is still, for at most this time, and reads its actuators. Another
    site of --at must be of the same body. Exit code 1: the wrench was not held; 3: the simulation diverged.
    """
    with working("holding" if hold else "reading the model"):
        from rmrc.analysis.statics.report import report
        from rmrc.analysis.statics.statics import statics as ask

        acts, arm = (
            options.values("--wrench", wrench, float, 1e100),
            options.read_arm(model, site, body, package),
        )
        found = ask(
            arm, acts or (), options.values("--q", q), keyframe=keyframe, frame=frame, at=at, gravity=gravity,
            hold=hold, length=length,
        )  # fmt: skip
    diverged = found.held is not None and found.held["run"].divergence
    show(report(found), as_json, quiet, missed=EXIT_DIVERGED if diverged else EXIT_MISSED)
