"""The tree of errors, each also the matching builtin exception; and notices to a user during the work.

    RmrcError
    ├── ScenarioError    (ValueError)       a scenario is wrong; all its problems at once
    ├── ModelError       (ValueError)       a model cannot be loaded, or lacks a named part
    ├── TargetError      (ValueError)       a target path cannot be timed
    ├── QuestionError    (ValueError)       a question does not fit its model
    ├── ClusterError     (ConnectionError)  machines that should run a sweep cannot, or are lost
    └── DivergenceError  (ArithmeticError)  the simulated state stopped being finite

ModelWarning (UserWarning) is a message of MuJoCo about a model that it accepts.
A singularity is not an error: it is a status, recorded at every control tick.
Messages are one line: the thing, the value, the bound and the way out.

A notice tells that something takes long, and why. It needs a listener, such as the command line.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from rmrc.support.text import shortened, visible

# Problems -----------------------------------------------------------------------------------------
#
# The problem of a value: its key, text, origin and owner.

Key = tuple[str | int, ...]  # the steps from the root of a scenario to a value


class Origin(NamedTuple):
    """The place where a value was given; all empty for a value given in Python.

    Attributes:
        source: A file, or an option such as `--set control.feedback`.
        line: Line of the file, from 1; 0 for none.
        column: Column of the line, from 1.
        key: The key that the source stands for, which messages do not repeat.
    """

    source: str = ""
    line: int = 0
    column: int = 0
    key: str = ""

    def of(self, name: str) -> str:
        """Return the beginning of messages about a key: source, line, column, and the key unless it is there.

        Args:
            name: The key, by `join`.

        >>> Origin("x.yaml", 7, 13).of("control.feedback")
        'x.yaml:7:13: control.feedback'
        >>> Origin("--set control", key="control").of("control.feedback")
        '--set control: control.feedback'
        >>> Origin("--vary arm.start", key="sweep.vary.arm.start").of("sweep.vary.arm.start[1]")
        '--vary arm.start[1]'
        """
        place = [self.line, self.column] if self.line else []
        where = ":".join([visible(self.source), *map(str, place)])
        rest = name.removeprefix(self.key)
        has_other_name = not self.source.endswith(self.key)
        is_below = name != rest and rest[:1] in ("[", ".") and has_other_name
        if self.key and (name == self.key or is_below):
            return f"{where}{rest}"
        return ": ".join(part for part in (where, name) if part)


class Problem(NamedTuple):
    """One problem; `str()` is the line that reports it.

    Attributes:
        key: Key of the value; () for a problem of the whole.
        text: The requirement, the value and the remedy.
        origin: Place where the value was given, if known.
        who: Name of its scenario among several; "" for the only one, or all.
    """

    key: Key
    text: str
    origin: Origin | None = None
    who: str = ""

    def __str__(self) -> str:
        """Return `WHO: ORIGIN: KEY: TEXT`, without empty parts."""
        place = (self.origin or Origin()).of(join(self.key))
        return visible(": ".join(part for part in (self.who, place, self.text) if part))


def join(key: Key) -> str:
    """Return a key as it is written: `arm.start[1]`."""
    parts = (f"[{step}]" if isinstance(step, int) else f".{shortened(visible(step))}" for step in key)
    return "".join(parts).removeprefix(".")


# The errors ---------------------------------------------------------------------------------------


class RmrcError(Exception):
    """Any error that rmrc reports in its own words; catch this to catch them all."""


class ScenarioError(RmrcError, ValueError):
    """A scenario cannot be used; `str()` lists all its problems, one per line.

    Attributes:
        problems: Each with its key, its text, and the place where the value was given.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Keep the problems."""
        self.problems: tuple[Problem, ...] = tuple(problems)
        super().__init__(self.problems)

    @classmethod
    def about(cls, source: object, text: str) -> ScenarioError:
        """Return an error with one problem of a file or an option as a whole.

        Args:
            source: Its name.
            text: The problem.
        """
        return cls([Problem((), text, Origin(str(source)))])

    def __str__(self) -> str:
        """Return all problems, one per line."""
        return "\n".join(map(str, self.problems))


class ModelError(RmrcError, ValueError):
    """A model cannot be loaded, or lacks a part that the scenario names.

    Attributes:
        about: Unknown names: `model`, `site`, `joints` or `start`.
    """

    def __init__(self, message: str, about: str = "model") -> None:
        """Keep the message and its subject."""
        self.about = about
        super().__init__(message)


class ModelWarning(UserWarning):
    """A model is accepted with a message about it, of MuJoCo or about what its actuators take."""


class TargetError(RmrcError, ValueError):
    """A target path cannot be timed or followed as written."""


class QuestionError(RmrcError, ValueError):
    """A question does not fit its model: a wrong number of values, an unknown name."""


class ClusterError(RmrcError, ConnectionError):
    """The machines that should run a sweep cannot, or are lost; existing rows are kept."""


class DivergenceError(RmrcError, ArithmeticError):
    """The simulated state stopped being finite; the record until then is kept."""


def did_you_mean(name: str, options: Iterable[str]) -> str:
    """Return a suggestion to append to a message, or an empty text if no option is near.

    Args:
        name: The text as written.
        options: Valid names.

    Returns:
        `'; did you mean "velocity"?'` for the nearest option, else `''`.
    """
    near = difflib.get_close_matches(name, list(options), n=1)
    return f'; did you mean "{near[0]}"?' if near else ""


# Notices ------------------------------------------------------------------------------------------

# Sent by `rmrc.law.compiling` while it compiles, with the name of the compiled part.
COMPILING = "compiling {} ({}) ..."
KEPT, NOT_KEPT = "once; kept for the next time", "this time and each other time; it cannot be kept"

_listeners: list[Callable[[str, str], None]] = []


def file_problem(error: OSError) -> str:
    """Return what the machine refused, in a line."""
    return f"{error.filename or 'output'}: {(error.strerror or str(error)).lower()}"


def tell(text: str, once: str = "") -> None:
    """Send a notice to the present listener.

    Args:
        text: A line.
        once: Its subject; only the first notice about it is heard. Default: the line itself.
    """
    for listener in tuple(_listeners):
        listener(text, once or text)


def tell_assumed(notes: Iterable[str]) -> None:
    """Send assumptions, each once: `rmrc.arm.tree` has notes that are warnings."""
    for note in notes:
        tell(f"{getattr(note, 'level', 'note')}: {note}")


@contextmanager
def heard_by(listener: Callable[[str], None]) -> Iterator[None]:
    """Have a function called with the notices, once for each subject.

    Args:
        listener: Called with a line; threads may call it.
    """
    said = set[str]()

    def once(text: str, about: str) -> None:
        if about not in said:
            said.add(about)
            listener(text)

    _listeners.append(once)
    try:
        yield
    finally:
        _listeners.remove(once)
