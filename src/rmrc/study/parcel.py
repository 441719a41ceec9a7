"""A parcel: all inputs of a study as bytes, for machines without its files; packing and unpacking."""

import hashlib
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from rmrc.arm import files
from rmrc.scenario import Carried, Draft
from rmrc.study.study import Study
from rmrc.support.problems import Problem


@dataclass(frozen=True)
class Model:
    """A model's file among those of a parcel.

    Attributes:
        file: Its place in the parcel.
        digest: Digest of the file and its dependencies, independent of their location.
    """

    file: str
    digest: str


@dataclass(frozen=True, eq=False)
class Parcel:
    """A scenario with its models.

    Attributes:
        draft: Draft of the scenario.
        folder: Original folder of the scenario.
        root: Original common folder of all model files.
        models: Models, recorded motions and profiles that are files, by their names in the scenario.
        files: Files of models and their dependencies, by their paths from the root.
        folders: Folders of packages, by their names in the scenario, as paths from the root.
    """

    draft: Draft
    folder: str
    root: str
    models: Mapping[str, Model]
    files: Mapping[str, bytes]
    folders: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def digest(self) -> str:
        """Identifier of the parcel."""
        facts = [self.draft.document, self.folder, self.root, sorted(self.models.items())]
        return hashlib.sha256(repr(facts).encode()).hexdigest()


def pack(draft: Draft) -> Parcel:
    """Return the parcel of a valid scenario.

    Args:
        draft: Draft of the scenario.

    Raises:
        OSError: A file cannot be read.
    """
    folder = draft.folder.resolve()
    named = {name: (folder / name).resolve() for name in draft.models}
    packages = [{name: (folder / one).resolve() for name, one in some.items()} for some in draft.packages]
    needed = {name: sorted({one for some in (packages or [{}]) for one in files(file, some)})
              for name, file in named.items() if file.is_file()}  # fmt: skip
    for name in (*draft.motions, *draft.profiles):
        named[name] = (folder / name).resolve()
        needed[name] = [named[name]]
    everything = sorted({file for some in needed.values() for file in some})
    contents = {file: file.read_bytes() for file in everything}
    folders = {one: (folder / one).resolve() for some in draft.packages for one in some.values()}
    above = [*(file.parent for file in everything), *folders.values()]
    root = os.path.commonpath(above) if above else str(folder)
    places = {file: file.relative_to(root).as_posix() for file in everything}
    models = {name: Model(places[named[name]], _digest(named[name], some, contents))
              for name, some in needed.items()}  # fmt: skip
    inside = {name: one.relative_to(root).as_posix() for name, one in folders.items()}
    data = {places[file]: data for file, data in contents.items()}
    return Parcel(draft, str(folder), root, models, data, inside)


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

        Raises:
            ValueError: A file would leave the folder.
        """
        self.folder = Path(tempfile.mkdtemp(prefix="rmrc-", dir=parent)).resolve()
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        self._root = parcel.root
        for name, data in parcel.files.items():
            file = self._inside(name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        models = {name: self._inside(model.file) for name, model in parcel.models.items()}
        for name, place in parcel.folders.items():
            models[name] = self._inside(place)
            models[name].mkdir(parents=True, exist_ok=True)
        self.study = Study(parcel.draft.carried(Carried(Path(parcel.folder), models)))

    def _inside(self, name: str) -> Path:
        file = (self.folder / name).resolve()
        if not file.is_relative_to(self.folder):
            raise ValueError(f"a parcel must not write outside its folder, got {name}")
        return file

    def told(self, problem: Problem) -> Problem:
        """Return a problem with the original paths of the files."""
        return problem._replace(text=problem.text.replace(str(self.folder), self._root.rstrip(os.sep)))
