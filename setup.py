"""Builds the package; all else is said in pyproject.toml."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

# Where `rmrc.support.shipped` looks in an installed package; in a clone it finds them where they are.
EXAMPLES = {"models": ("*.xml",), "scenarios": ("*.yaml", "*.csv")}


class BuildWithExamples(build_py):
    """Puts the models and scenarios of the repository into the package."""

    def run(self) -> None:
        """Copy the modules, and the examples beside them."""
        super().run()
        if self.editable_mode:
            return
        # A build folder that is used again must not ship what is gone.
        shutil.rmtree(Path(self.build_lib, "rmrc/_examples"), ignore_errors=True)
        for source, built in self._examples().items():
            built.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, built)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Return all files that are built."""
        return [*super().get_outputs(include_bytecode), *map(str, self._examples().values())]

    def get_source_files(self) -> list[str]:
        """Return all files that are needed to build, for a source distribution."""
        return [*super().get_source_files(), *map(str, self._examples())]

    def _examples(self) -> dict[Path, Path]:
        """Return where each file goes."""
        package = Path(self.build_lib, "rmrc/_examples")
        return {
            file: package / file
            for folder, patterns in EXAMPLES.items()
            for pattern in patterns
            for file in sorted(Path(folder).rglob(pattern))
        }


setup(cmdclass={"build_py": BuildWithExamples})
