"""What the verbs print: answers on stdout, one line for each problem on stderr; and the exit codes."""

import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from rmrc.support.errors import tell
from rmrc.support.text import line, visible

if TYPE_CHECKING:  # imports numpy, which a help text does not need
    from rmrc.show.sheets import Report

EXIT_MISSED, EXIT_INPUT, EXIT_DIVERGED, EXIT_INTERNAL, EXIT_INTERRUPTED, EXIT_PIPE = 1, 2, 3, 70, 130, 141

# Columns of a table in a pipe, which has no width; and the least of a terminal.
PIPE_WIDTH, LEAST_WIDTH = 100, 40


class InterruptedVerb(Exception):  # noqa: N818 - not an error
    """Ctrl-C, with how far the verb came."""


def show(
    report: "Report",
    as_json: bool,
    quiet: bool = False,
    files: Sequence[Path | None] = (),
    hint: str = "",
    missed: int = EXIT_MISSED,
) -> None:
    """Print an answer, and report its problem on stderr.

    Args:
        report: The answer.
        as_json: Whether to print JSON instead of tables.
        quiet: Whether to print no tables.
        files: Written files to list, without those that were not asked for.
        hint: The next command.
        missed: Exit code if the answer's condition is not met.

    Raises:
        typer.Exit: The condition is not met.
    """
    paths = [str(file) for file in files if file is not None]
    if as_json:
        print_json(report.json | {"files": paths} if paths else report.json)
    elif not quiet:
        from rmrc.show.tables import render

        is_known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit()
        screen = Console(width=None if is_known else PIPE_WIDTH)
        screen.width = max(screen.width, LEAST_WIDTH)
        screen.print(render(report.sheets))
        texts = (f"\n{report.block}" if report.block else "", *(f"wrote {path}" for path in paths), hint)
        print(*(visible(text, keep="\n") for text in texts if text), sep="\n", end="\n" * any(texts))
    if report.problem:
        complain(report.problem)
    if not report.met:
        raise typer.Exit(missed)


def print_json(facts: Any) -> None:
    """Print strict JSON: letters as they are if the encoding has all of them, or else with JSON's escapes."""
    is_unicode = (sys.stdout.encoding or "").lower().startswith("utf")
    print(json.dumps(facts, indent=2, ensure_ascii=not is_unicode, allow_nan=False))


def complain(text: str) -> None:
    """Print a problem on stderr, in one line."""
    print(f"rmrc: {line(text)}", file=sys.stderr, flush=True)


@contextmanager
def warnings_in_lines() -> Iterator[None]:
    """Tell each Python warning in one line."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: tell(f"warning: {' '.join(str(message).split())}")
        yield


def working(text: str) -> AbstractContextManager[Any]:
    """Show in a terminal that something is going on, such as `reading the model`."""
    return Console(stderr=True).status(text)


@contextmanager
def progress(what: str, total: int, quiet: bool, done: int = 0) -> Iterator[Callable[[int], None]]:
    """Yield a function that advances a progress bar; the bar appears only in a terminal.

    Args:
        what: Label before the bar.
        total: Steps in all.
        quiet: Whether to show nothing.
        done: Steps done earlier.
    """
    screen = Console(stderr=True)
    with Progress(console=screen, transient=True, disable=quiet or not screen.is_terminal) as bars:
        bar = bars.add_task(escape(visible(what)), total=total, completed=done)
        yield lambda steps: bars.update(bar, advance=steps)
