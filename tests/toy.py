"""A copy of the package in a folder of its own, in which something is added the way CONTRIBUTING says.

What is added is text, put beside a line that is there once: so a recipe that needs more files than it says fails.
"""

import os
import shutil
import subprocess
import sys

from project import ROOT


class Copy:
    """The package, copied, with its own machine code.

    Attributes:
        folder: The folder that it is in, and from which it is called.
    """

    def __init__(self, folder):
        self.folder = folder
        # bytecode of what is not changed is as good here, and saves half a second a process
        shutil.copytree(ROOT / "src/rmrc", folder / "rmrc", ignore=shutil.ignore_patterns("*.nbi", "*.nbc"))
        shutil.copytree(ROOT / "models", folder / "models")

    def add(self, module, text, before):
        """Put a text before the only line of a module that begins as `before` does, which may be indented."""
        path = self.folder / "rmrc" / module
        lines = path.read_text("utf-8").splitlines(keepends=True)
        (place,) = (i for i, line in enumerate(lines) if line.lstrip().startswith(before))
        path.write_text("".join([*lines[:place], text, *lines[place:]]), "utf-8")

    def replace(self, module, old, new):
        """Replace the only place of a text in a module."""
        path = self.folder / "rmrc" / module
        text = path.read_text("utf-8")
        assert text.count(old) == 1
        path.write_text(text.replace(old, new), "utf-8")

    def python(self, code):
        """Return what a process with this package did with a program."""
        return self._run("-c", code)

    def rmrc(self, *arguments):
        """Return what a verb printed, which must not fail."""
        ended = self._run("-m", "rmrc", *arguments)
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def _run(self, *arguments):
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=self.folder,
            env=environment | {"PYTHONPATH": str(self.folder), "COLUMNS": "200"},
            capture_output=True,
            text=True,
            check=False,
        )
