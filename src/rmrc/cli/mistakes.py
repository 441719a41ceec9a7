"""Usage errors, each as one line with a remedy."""

import errno
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from rmrc.cli.kinds import KINDS
from rmrc.support.invocation import command
from rmrc.support.legible import shortened

# The error of the command line's library for a wrong option or argument; it only exports this subclass of it.
UsageError: Any = typer.BadParameter.__mro__[1]

# Errors of the environment, not of the program or of one file: the disk, the machine or a permission.
ENVIRONMENT = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.EMFILE,
    errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.ENODEV, errno.ESTALE,
}  # fmt: skip

# Verbs that take `--set`.
SETTING = ("run", "compare", "sweep", "tune")


def usage(error: Any) -> str:
    """Return the message for a usage error, and the command that shows the help."""
    text = re.sub(r"'([^']*)'", lambda match: f"'{shortened(match[1])}'", error.format_message().strip())
    text = " ".join(text.split()).removesuffix(".")
    context = error.ctx
    verb = context.info_name if context is not None and context.parent is not None else None
    verbs = getattr(context.parent.command, "commands", {}) if verb is not None else {}
    way = _way(getattr(error, "option_name", None), verb, verbs)
    if way:  # more useful than a similar spelling
        text = re.sub(r" \((Possible options|Did you mean)[^()]*\)$", "", text)
    return f"{text}{way}; see {command(*([verb] if verb else []), '--help')}"


def _way(option: str | None, verb: str | None, verbs: Mapping[str, Any]) -> str:
    """Return the most likely intention: an option of another verb, a scenario key, or a verb."""
    if option is not None:
        alike = SETTING if verb in SETTING else verbs
        others = [name for name in alike if any(option in known.opts for known in verbs[name].params)]
        if others:
            return f"; it is an option of {' and '.join(others)}"
        return "; set a key of the scenario by --set KEY=VALUE" if verb in SETTING else ""
    first = sys.argv[1] if len(sys.argv) > 1 else ""
    if verb is None and (kind := next((one for one in KINDS if Path(first).suffix in one.suffixes), None)):
        return f"; give a verb first: {command(kind.verb, first)}" if kind.verb else ""
    return ""
