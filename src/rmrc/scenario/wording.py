"""Show values, foreign texts and similar names in messages: on one line, printable and short."""

import json
import math
from pathlib import Path

import yaml

from rmrc.support.errors import did_you_mean
from rmrc.support.text import shortened, visible


def show(value: object) -> str:
    """Return a value as YAML would write it on one line."""
    if value is None:
        return "nothing"
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    try:
        return brief(json.dumps(value, ensure_ascii=False, default=repr))
    except ValueError:  # Python writes 4300 digits at most
        return "a huge integer"


def inline(value: object) -> str:
    """Return a value as YAML on one line, which is read back to an equal value."""
    text = yaml.safe_dump(value, default_flow_style=True, width=math.inf, allow_unicode=True, sort_keys=False)
    return text.strip().removesuffix("...").strip()


def block(value: object, width: int = 100) -> str:
    """Return a value as readable YAML: one line per key, with the innermost values on one line."""
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True, default_flow_style=None, width=width)


def brief(text: str) -> str:
    """Return a printable text of about 80 characters at most, which says how many it has if it is longer."""
    return shortened(visible(text))


def nearby(path: Path, *suffixes: str) -> str:
    """Suggest a file beside one that does not exist."""
    try:
        names = sorted(entry.name for entry in path.parent.iterdir() if entry.suffix in suffixes)
    except (OSError, ValueError):  # a NUL
        return ""
    return did_you_mean(path.name, names)
