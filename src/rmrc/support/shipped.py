"""The scenarios and models that come with the package, known by their bare names."""

import os
import re
import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Literal

from rmrc.support.errors import did_you_mean

Folder = Literal["scenarios", "models"]
MOTION = ".csv"  # files that scenarios follow, beside them
SUFFIX: Mapping[Folder, str] = {"scenarios": ".yaml", "models": ".xml"}

# Least number of characters of a file's subject: fewer do not describe it.
_LEAST = 40


@cache
def root() -> Path | None:
    """Return the folder with `scenarios` and `models`: in the package, or in the clone around it."""
    package = Path(__file__).resolve().parents[1]
    clone = package.parents[1]
    if (package / "_examples").is_dir():
        return package / "_examples"
    return clone if package.parent.name == "src" and (clone / "scenarios").is_dir() else None


def shipped(folder: Folder) -> dict[str, Path]:
    """Return the files of a kind by their bare names, sorted; none if the package came without them."""
    top = root()
    files = () if top is None else sorted((top / folder).glob(f"*{SUFFIX[folder]}"))
    return {file.stem: file for file in files}


def found(path: str | os.PathLike[str], folder: Folder) -> Path:
    """Return the file that a path names: a bare name without a file here is that of a shipped one.

    Args:
        path: Such as `blow_up`; a path with a folder or a suffix stays as it is.
        folder: Kind of the file.
    """
    name = os.fspath(path)
    if os.sep in name or Path(name).suffix or os.path.lexists(name):
        return Path(name)
    return shipped(folder).get(name, Path(name))


def suggestion(path: Path, folder: Folder) -> str:
    """Suggest the bare name of a shipped file for a path without a file, to append to a message, or nothing.

    Args:
        path: A path without a file. In another folder its name must be that of a shipped file.
        folder: Kind of the file.
    """
    names = shipped(folder)
    if path.parent != Path() and (path.suffix != SUFFIX[folder] or path.stem not in names):
        return ""
    return did_you_mean(path.stem, names)


def about(file: Path) -> str:
    """Return the beginning of a shipped file's first comment: a clause, or several if the first is short."""
    end = "-->" if file.suffix == ".xml" else "\nname:"
    lines = file.read_text("utf-8").partition(end)[0].removeprefix("<!--").splitlines()
    text = " ".join(line.strip("# ") for line in lines).strip()
    clause = re.match(rf".{{{_LEAST},}}?[^A-Z](?=[.:;] |[.]$)", text)
    return re.sub(r" \([^)]*$", "", clause[0] if clause else text.rstrip("."))


def copy_out(folder: Path) -> list[Path]:
    """Copy the shipped scenarios and models into a folder.

    Args:
        folder: Made if it is missing.

    Returns:
        The two folders that were made in it.

    Raises:
        OSError: One of them already exists, or cannot be written.
    """
    copies = []
    for name, suffix in SUFFIX.items():
        source = (root() or Path()) / name
        (folder / name).mkdir(parents=True)
        for file in sorted(file for file in source.rglob("*") if file.suffix in (suffix, MOTION)):
            copy = folder / name / file.relative_to(source)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
        copies.append(folder / name)
    return copies
