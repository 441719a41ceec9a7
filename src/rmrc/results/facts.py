"""The facts of a result as a JSON file: its numbers, its input, and the versions that made it."""

import json
import platform
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from rmrc.support.files import write_text

# The libraries that determine the bits and the appearance of a result.
LIBRARIES = ("rmrc", "mujoco", "numba", "numpy", "ruckig", "rerun-sdk")


@cache
def versions() -> dict[str, str]:
    """Return the versions of the software that determines the bits of a result."""
    versions = {"python": platform.python_version()}
    for library in LIBRARIES:
        with suppress(metadata.PackageNotFoundError):  # a worker of a sweep needs no rerun
            versions[library] = metadata.version(library)
    return versions


def save(path: Path, facts: Mapping[str, Any]) -> None:
    """Write facts atomically.

    Args:
        path: Path of the file; its folder is created if missing.
        facts: Strict JSON.
    """
    text = json.dumps(facts, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(path, f"{text}\n")
