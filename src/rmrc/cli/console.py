"""Exit codes and output to a terminal or a pipe, shared by the verbs."""

import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console, ConsoleOptions, RenderableType
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
from rich.segment import Segment
from rich.text import Text

from rmrc.support import legible
from rmrc.support.interruption import signal_that_came

EXIT_MISSED, EXIT_INPUT, EXIT_DIVERGED, EXIT_INTERNAL, EXIT_INTERRUPTED, EXIT_PIPE = 1, 2, 3, 70, 130, 141
EXIT_TERMINATED, EXIT_HUNG_UP = 143, 129

# The widest table needs this many columns; a pipe has no width.
PIPE_WIDTH = 100
# Below some 28 columns rich goes round in circles where a column is not wrapped, and a table is unreadable.
LEAST_WIDTH = 40


class _Screen(Console):
    """A console that takes every text as it is: nothing in it is markup, an emoji or a control character."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            if segment.control:  # a control code of the console itself
                yield segment
            else:
                yield Segment(legible.visible(segment.text, keep="\n"), segment.style)


def output(quiet: bool = False, pipe: int = PIPE_WIDTH) -> Console:
    """Return the console of stdout: as wide as its terminal or COLUMNS, or else as the tables need.

    Args:
        quiet: Whether to print nothing.
        pipe: Columns where there is no terminal.
    """
    is_known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit()
    screen = _Screen(quiet=quiet, width=None if is_known else pipe)
    screen.width = max(screen.width, LEAST_WIDTH)
    return screen


def print_line(console: Console, text: str) -> None:
    """Print a line that is not wrapped, so that a path or a command in it can be copied."""
    console.print(legible.visible(text), highlight=False, soft_wrap=True)


def print_json(facts: object, **options: Any) -> None:
    """Print JSON: letters as they are if the encoding has all of them, or else with JSON's escapes."""
    is_unicode = (sys.stdout.encoding or "utf-8").lower().startswith("utf")
    text = json.dumps(facts, indent=2, ensure_ascii=False, **options)
    if not (is_unicode and text.replace("\n", "").isprintable()):
        text = json.dumps(facts, indent=2, **options)
    print(text)


_said: list[str] = []  # warnings of this verb


def complain(text: str) -> None:
    """Print an error on stderr, in one line."""
    _said.append(text)
    print(f"rmrc: {legible.line(text)}", file=sys.stderr, flush=True)


def warn(texts: Iterable[str]) -> None:
    """Print on stderr, once each, warnings about valid requests that are probably mistakes."""
    for text in dict.fromkeys(texts):
        complain(f"warning: {text}")


@contextmanager
def warnings_in_lines() -> Iterator[None]:
    """Show each Python warning once, as one line."""
    shown: set[str] = set()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        text = " ".join(str(message).split())
        if text not in shown:
            shown.add(text)
            complain(f"warning: {text}")

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def named_by_signal(code: int) -> int:
    """Return the exit code of a verb; after an interruption, print a line and return the signal's code."""
    is_said = any(text.startswith("interrupted") for text in _said)
    _said.clear()
    if code != EXIT_INTERRUPTED:
        return code
    if not is_said:
        complain("interrupted")
    codes = {signal.SIGTERM: EXIT_TERMINATED, getattr(signal, "SIGHUP", None): EXIT_HUNG_UP}
    return codes.get(signal_that_came(), EXIT_INTERRUPTED)


@contextmanager
def interruption(told: str) -> Iterator[None]:
    """Print a message on stderr when Ctrl-C arrives, and exit.

    Raises:
        typer.Exit: Ctrl-C arrived.
    """
    try:
        yield
    except KeyboardInterrupt:
        complain(told)
        raise typer.Exit(EXIT_INTERRUPTED) from None


@contextmanager
def notice(text: str) -> Iterator[None]:
    """Print a notice if the body takes longer than a second."""
    timer = threading.Timer(1.0, lambda: complain(text))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class _Rate(ProgressColumn):
    """The number of steps per second."""

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
    """Yield a function that advances a progress bar; the bar appears only in a terminal.

    Args:
        what: Label before the bar.
        total: Steps in all.
        quiet: Whether to show nothing.
        done: Steps done earlier.
        unit: Unit of a step; if given, the bar also shows the rate and the remaining time.
    """
    screen = _Screen(stderr=True)
    more = [_Rate(unit), TimeRemainingColumn()] if unit else []
    with Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(),
        TimeElapsedColumn(), *more,
        console=screen, transient=True, disable=quiet or not screen.is_terminal,
    ) as bars:  # fmt: skip
        bar = bars.add_task(legible.visible(what), total=total, completed=done)
        yield lambda steps: bars.update(bar, advance=steps)
