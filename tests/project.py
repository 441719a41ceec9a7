"""Where the project lies, and what its verbs tell."""

import re
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from rmrc.support.errors import COMPILING

ROOT = Path(__file__).parent.parent


def mostly_long(cases, every, slow=()):
    """Return cases to parametrize a test by, a tuple of arguments or one: one of `every`; the others, and slow ones, are `long`."""
    return [
        case
        if i % every == 0 and case not in slow
        else pytest.param(*(case if isinstance(case, tuple) else [case]), marks=pytest.mark.long)
        for i, case in enumerate(cases)
    ]


def examples(few, many, **more):
    """Return settings of a property: how many examples it has in the ordinary suite, and how many in the profile `many`."""
    is_ordinary = settings.default.max_examples <= settings.get_profile("rmrc").max_examples
    return settings(max_examples=few if is_ordinary else many, **more)


@contextmanager
def undrawn():
    """Leave pictures empty, each of which takes longer than most verbs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rmrc.show.figures._write", lambda *_: None)
        yield


def told(err):
    """Return what a verb said but for what a busy machine makes it say: it compiles or loads the law."""
    compiling = ".*".join(map(re.escape, COMPILING.split("{}")))
    return re.sub(rf"^rmrc: (?:{compiling})\n", "", err, flags=re.MULTILINE)
