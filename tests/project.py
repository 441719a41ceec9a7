"""Where the project lies, and what its verbs tell."""

from pathlib import Path

from rmrc.cli.console import COMPILING

ROOT = Path(__file__).parent.parent


def told(err):
    """Return what a verb said but for what it says while the law is compiled, or loaded by a busy machine."""
    return err.replace(f"rmrc: {COMPILING}\n", "")
