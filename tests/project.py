"""Where the project lies, and what its verbs tell."""

import re
from pathlib import Path

import pytest

from rmrc.support.notices import COMPILING, READING

ROOT = Path(__file__).parent.parent


def mostly_long(cases, every):
    """Return cases to parametrize a test by, a tuple of arguments or one: one of `every`; the others are `long`."""
    return [
        case
        if i % every == 0
        else pytest.param(*(case if isinstance(case, tuple) else [case]), marks=pytest.mark.long)
        for i, case in enumerate(cases)
    ]


def told(err):
    """Return what a verb said but for what a busy machine makes it say: it compiles or loads the law, or reads a model."""
    compiling = ".*".join(map(re.escape, COMPILING.split("{}")))
    return re.sub(rf"^rmrc: (?:{compiling}|{re.escape(READING)})\n", "", err, flags=re.MULTILINE)
