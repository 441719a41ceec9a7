"""A parcel: all inputs of a study as bytes, for machines without its files; packing and unpacking."""

import hashlib
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from rmrc.arm import files
from rmrc.scenario import Draft
from rmrc.study.study import Study
from rmrc.support.problems import Problem


@dataclass(frozen=True, eq=False)
class Parcel:
    """A scenario with its files.

    Attributes:
        draft: Draft of the scenario.
        models: Digest of each file that it names, with those that it depends on, by its path.
        files: All files, by their paths.
        folders: Folders of packages.
    """

    draft: Draft
    models: Mapping[Path, str]
    files: Mapping[Path, bytes]
    folders: Sequence[Path] = ()

    @cached_property
    def digest(self) -> str:
        """Identifier of the parcel."""
        facts = [self.draft.document, sorted(self.models.items())]
        return hashlib.sha256(repr(facts).encode()).hexdigest()


def pack(draft: Draft) -> Parcel:
    """Return the parcel of a valid scenario.

    Args:
        draft: Draft of the scenario.

    Raises:
        OSError: A file cannot be read.
    """
    packages, named = draft.scenario().arm.packages, draft.files()
    needed = {path: files(path, packages) for path in named if path.is_file()}
    contents = {file: file.read_bytes() for some in needed.values() for file in some}
    models = {path: _digest(path, some, contents) for path, some in needed.items()}
    return Parcel(draft, models, contents, [path for path in named if path.is_dir()])


def _digest(model: Path, some: Sequence[Path], contents: Mapping[Path, bytes]) -> str:
    """Return a hash of files and of their locations relative to the model."""
    facts = [(os.path.relpath(file, model.parent), hashlib.sha256(contents[file]).digest()) for file in some]
    return hashlib.sha256(repr(sorted(facts)).encode()).hexdigest()


class Unpacked:
    """A parcel unpacked into a temporary folder of its own."""

    def __init__(self, parcel: Parcel, parent: str | None = None) -> None:
        """Write the files.

        Args:
            parcel: The parcel.
            parent: Parent of the new folder; None: the folder of temporary files.
        """
        self.folder = Path(tempfile.mkdtemp(prefix="rmrc-", dir=parent)).resolve()
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        for path, data in parcel.files.items():
            file = Path(self.folder, *path.parts[1:])
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        for path in parcel.folders:
            Path(self.folder, *path.parts[1:]).mkdir(parents=True, exist_ok=True)
        self.study = Study(parcel.draft.moved(self.folder))

    def told(self, problem: Problem) -> Problem:
        """Return a problem with the original paths of the files."""
        return problem._replace(text=problem.text.replace(str(self.folder), ""))
