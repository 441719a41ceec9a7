"""What the verbs share: exit codes, and how they speak to a terminal or a pipe."""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

EXIT_MISSED, EXIT_INPUT, EXIT_DIVERGED, EXIT_INTERRUPTED = 1, 2, 3, 130

COMPILING = "compiling the control law (once; kept for the next time) ..."

# The widest table needs so many columns, and a pipe has any number.
PIPE_WIDTH = 100


def output(quiet: bool = False) -> Console:
    """Return the console of stdout: as wide as its terminal, or as the tables need in a pipe."""
    return Console(quiet=quiet, width=None if sys.stdout.isatty() else PIPE_WIDTH)


def complain(text: str) -> None:
    """Say on stderr what went wrong."""
    print(f"rmrc: {text}", file=sys.stderr, flush=True)


@contextmanager
def notice(text: str) -> Iterator[None]:
    """Say what takes long, but only if it does."""
    timer = threading.Timer(1.0, lambda: complain(text))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Rate(ProgressColumn):
    """How many steps are done in a second."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self.unit = unit

    def render(self, task: Task) -> Text:
        """Return the rate, or nothing before there is one."""
        return Text(f"{task.speed:.3g} {self.unit}/s" if task.speed else "")


@contextmanager
def progress(
    what: str, total: int, quiet: bool, done: int = 0, unit: str = ""
) -> Iterator[Callable[[int], None]]:
    """Yield a function that moves a bar on by some steps; there is none unless a terminal can show it.

    Args:
        what: Stands before the bar.
        total: Steps in all.
        quiet: Whether to show nothing.
        done: Steps that were done before.
        unit: Of a step; with one, the rate and the time left are shown as well.
    """
    screen = Console(stderr=True)
    more = [_Rate(unit), TimeRemainingColumn()] if unit else []
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), *more,
        console=screen, transient=True, disable=quiet or not screen.is_terminal,
    ) as bars:  # fmt: skip
        bar = bars.add_task(what, total=total, completed=done)
        yield lambda steps: bars.update(bar, advance=steps)
