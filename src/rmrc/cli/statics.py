"""The verb `statics`: what drives and links bear under a wrench, and whether the physics says the same."""

from enum import StrEnum
from typing import Annotated

import typer

from rmrc.cli.console import (
    EXIT_DIVERGED,
    EXIT_INTERRUPTED,
    EXIT_MISSED,
    complain,
    output,
    print_json,
    progress,
)
from rmrc.cli.questions import AsJson, Keyframe, Length, Model, Positions, Site, configuration, wrench_of


class Frame(StrEnum):
    """Along whose axes a wrench is given."""

    WORLD = "world"
    SITE = "site"


Wrench = Annotated[
    str,
    typer.Option(
        metavar="fx,fy,fz,nx,ny,nz",
        help="What acts on the arm at the site: force in N and moment in N·m, or a force alone.",
        show_default=False,
    ),
]
Axes = Annotated[Frame, typer.Option("--frame", help="Along whose axes the wrench is given.")]
At = Annotated[
    str | None,
    typer.Option("--at", metavar="SITE", help="Tell the wrench at this other site of the same body as well."),
]
Gravity = Annotated[
    bool,
    typer.Option(
        "--gravity/--no-gravity",
        help="Whether the drives bear the arm's weight as well; default: no.",
        show_default=False,
    ),
]
Hold = Annotated[
    float | None,
    typer.Option(
        "--hold",
        metavar="SECONDS",
        help="Hold it in the physics until all is still, so long at most, and read the actuators.",
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
    frame: Axes = Frame.WORLD,
    at: At = None,
    gravity: Gravity = False,
    hold: Hold = None,
    length: Length = 1.0,
    as_json: AsJson = False,
) -> None:
    """Tell what drives and links bear while a wrench acts on an arm, and which wrenches cost nothing."""
    from rmrc import arm as arms
    from rmrc.analysis.statics import report
    from rmrc.analysis.statics.hold import most_ticks
    from rmrc.analysis.statics.statics import statics as ask

    acts = wrench_of(wrench)
    arm = arms.load(model, site)
    positions = configuration(arm, q, keyframe)
    try:
        with progress("hold", most_ticks(hold or 0.0), as_json or hold is None) as on_ticks:
            found = ask(
                arm, acts, positions, frame=frame.value, at=at, gravity=gravity, hold=hold, length=length,
                on_ticks=on_ticks,
            )  # fmt: skip
    except KeyboardInterrupt:
        complain("interrupted" if hold is None else "interrupted while holding")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    held = found.held
    if as_json:
        print_json(report.facts(found.balance, found.costs, length, held, found.elsewhere))
    else:
        console = output()
        for part in report.render(found.balance, found.costs, gravity, held, found.elsewhere):
            console.print(part, highlight=False)
    if held is not None and held.run.divergence:
        complain(f"error: {held.run.divergence}")
        raise typer.Exit(EXIT_DIVERGED)
    if held is not None and not held.agrees:
        raise typer.Exit(EXIT_MISSED)
