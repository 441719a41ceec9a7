"""The output files of a verb: checked before the run, and each written independently at the end."""

import errno
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import takewhile
from pathlib import Path

from rmrc.results.columns import widths
from rmrc.support.errors import RmrcError
from rmrc.support.memory import shown


class OutputError(RmrcError, OSError):
    """An output file cannot be written."""


def array_size(ticks: int, joints: int, values: int, positions: int) -> int:
    """Return the size of all columns of a run [B], without compression.

    Args:
        ticks: Ticks of the run.
        joints: Joints of the arm.
        values: Singular values of its task.
        positions: Positions of all joints of the model.
    """
    return 8 * ticks * sum(widths(joints, values, positions).values())


def refuse_unwritable(paths: Iterable[Path], size: int = 0, way_out: str = "") -> None:
    """Check whether files can be written, before a run; nothing is left behind.

    Args:
        paths: Paths of the files.
        size: Least size of all together [B].
        way_out: How they take less.

    Raises:
        OutputError: The disk has too little room.
        OSError: A folder cannot be made or written to, or a directory has the name of a file.
    """
    tried = set[Path]()
    for path in paths:
        if path.is_dir():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if path.parent in tried:
            continue
        tried.add(path.parent)
        with _made(path.parent):
            probe = path.with_name(f".{path.stem}-{secrets.token_hex(8)}")
            try:
                probe.touch(exist_ok=False)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from None
            probe.unlink()
            free = shutil.disk_usage(path.parent).free
        if size > free:
            raise OutputError(
                f"{path}: takes {shown(size)} at least, and the disk has {shown(free)} free; free some "
                f"space, give another folder with --out{way_out}"
            )


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Make a folder with its parents, and remove new empty ones at the end."""
    missing = list(takewhile(lambda one: not one.exists(), (folder, *folder.parents)))
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        with suppress(OSError):  # another process has put something there
            for one in missing:
                one.rmdir()


class Leaving:
    """Writes files; a failure of one does not affect the others.

    Attributes:
        files: The written files.
        failures: Why others were not written, one line each.
    """

    def __init__(self) -> None:
        """Begin without files."""
        self.files: list[Path] = []
        self.failures: list[str] = []

    def attempt(self, write: Callable[[], None]) -> bool:
        """Do a part of the writing; return whether it succeeded, and keep the reason if not.

        Args:
            write: Raises an OSError if it fails.
        """
        try:
            write()
        except OSError as error:
            self.failures.append(_told(error))
            return False
        return True

    def write(
        self, paths: Sequence[Path], write: Callable[..., None], instead_of: Path | None = None
    ) -> None:
        """Write a file, or several at once, and keep their paths or the reason of the failure.

        Args:
            paths: Paths of the files.
            write: Takes the paths, and writes the files or raises an OSError.
            instead_of: A file to give up if the disk has too little room.
        """
        if not self.attempt(partial(write, *paths)):
            if instead_of is None or not instead_of.is_file():
                return
            instead_of.unlink(missing_ok=True)
            told = self.failures.pop()
            if not self.attempt(partial(write, *paths)):
                self.failures[-1] = told
                return
        self.files += paths


def _told(error: OSError) -> str:
    """Return an error on one line, with its file."""
    if isinstance(error, RmrcError):
        return str(error)
    reason = " ".join((error.strerror or str(error)).split()).lower()
    return f"{error.filename}: {reason}" if error.filename else reason
