"""The tree of errors; every branch is also the matching builtin exception.

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
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from rmrc.support.problems import Origin, Problem


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
