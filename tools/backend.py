"""Builds with setuptools; a wheel also needs the libraries of rmrc, as it is compiled ahead."""

import tomllib
from pathlib import Path

from setuptools.build_meta import *  # noqa: F403 - all that is not changed here
from setuptools.build_meta import get_requires_for_build_wheel as _for_wheel


def get_requires_for_build_wheel(config_settings: dict[str, str | list[str]] | None = None) -> list[str]:
    """Return the requirements of building a wheel: an editable install needs no compiling."""
    libraries = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    return [*_for_wheel(config_settings), *libraries]
