"""Builds the package; all else is said in pyproject.toml."""

import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

# Where `rmrc.support.shipped` looks in an installed package; in a clone it finds them where they are.
EXAMPLES = {"models": ("*.xml",), "scenarios": ("*.yaml", "*.csv")}
# Where `rmrc.law.kept` looks.
MACHINE_CODE = "rmrc/_machine_code"


class BuildWithExamples(build_py):
    """Puts the models and scenarios of the repository into the package, and machine code into a wheel."""

    def run(self) -> None:
        """Copy the modules, the examples beside them, and compile."""
        super().run()
        if self.editable_mode:
            return
        # A build folder that is used again must not ship what is gone.
        shutil.rmtree(Path(self.build_lib, "rmrc/_examples"), ignore_errors=True)
        for source, built in self._examples().items():
            built.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, built)
        self._compile()

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Return all files that are built."""
        code = (file for file in Path(self.build_lib, MACHINE_CODE).rglob("*") if file.is_file())
        return [*super().get_outputs(include_bytecode), *map(str, self._examples().values()), *map(str, code)]

    def get_source_files(self) -> list[str]:
        """Return all files that are needed to build, for a source distribution."""
        return [*super().get_source_files(), *map(str, self._examples())]

    def _compile(self) -> None:
        """Have the built package compile itself, where the libraries that it needs are there."""
        folder = Path(self.build_lib, MACHINE_CODE)
        shutil.rmtree(folder, ignore_errors=True)
        if platform.machine() != "x86_64" or importlib.util.find_spec("numba") is None:
            self.announce("no machine code: it is made on x86-64, with the libraries of rmrc", level=3)
            return
        # The metadata beside the sources say the version. A front end may have put the libraries where only
        # its own path leads.
        self.run_command("egg_info")
        own = (str(Path(one).resolve()) for one in (self.build_lib, "src"))
        path = os.pathsep.join([*own, *filter(None, [os.environ.get("PYTHONPATH")])])
        built = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
        subprocess.run([sys.executable, "tools/machine_code.py", str(folder)], env=built, check=True)

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
