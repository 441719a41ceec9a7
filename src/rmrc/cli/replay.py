"""The verb `replay`: open a recording."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from rmrc.cli.files import expect
from rmrc.cli.options import Count, Number, within


def replay(
    recording: Annotated[
        Path,
        Argument(
            help="NAME.rrd or NAME.npz of a run, or a folder: then its newest recording.",
            callback=lambda path: path if path.is_dir() else expect(path, "a recording", "a result"),
        ),
    ],
    web: Annotated[bool, Option("--web", help="Serve the viewer to a web browser instead.")] = False,
    at: Annotated[
        Number, Option(callback=within(0.0, 1e9), help="Time to pause at [s]; default: play.")
    ] = None,
    port: Annotated[Count, Option(min=1, max=65535, help="Port of 127.0.0.1; default: a free one.")] = None,
) -> None:
    """Open a recording, in a window or with --web in a browser.

    The rerun viewer runs on this machine only, and without telemetry.
    """
    from rmrc.recording import viewer

    raise typer.Exit(viewer.replay(recording, web, at, port))
