"""Where the project lies, and what its verbs tell."""

import re
from pathlib import Path

from rmrc.support.notices import COMPILING

ROOT = Path(__file__).parent.parent


def told(err):
    """Return what a verb said but for what it says while the law is compiled, or loaded by a busy machine."""
    notice = ".*".join(map(re.escape, COMPILING.split("{}")))
    return re.sub(rf"^rmrc: {notice}\n", "", err, flags=re.MULTILINE)
