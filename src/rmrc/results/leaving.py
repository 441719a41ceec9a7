"""The output files of a verb: checked before the run, and each written independently at the end."""

import errno
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from functools import partial
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
    """Check whether files can be written, before a run.

    Args:
        paths: Paths of the files.
        size: Least size of all together [B].
        way_out: How they take less.

    Raises:
        OutputError: The disk has too little room.
        OSError: A folder cannot be made or written to, or a directory has the name of a file.
    """
    for path in paths:
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        for code, is_wrong in (
            (errno.EISDIR, path.is_dir()),
            (errno.EEXIST, path.exists() and not path.is_file()),  # such as a pipe
            (errno.ENOTDIR, not folder.is_dir()),
            (errno.EACCES, not os.access(folder, os.W_OK | os.X_OK)),
        ):
            if is_wrong:
                raise OSError(code, os.strerror(code), str(path))
        free = shutil.disk_usage(folder).free
        if size > free:
            raise OutputError(
                f"{path}: takes {shown(size)} at least, and the disk has {shown(free)} free; free some "
                f"space, give another folder with --out{way_out}"
            )


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
        except RmrcError as error:
            self.failures.append(str(error))
        except OSError as error:
            self.failures.append(f"{error.filename}: {(error.strerror or str(error)).lower()}")
        else:
            return True
        return False

    def write(self, paths: Sequence[Path], write: Callable[..., None]) -> None:
        """Write a file, or several at once, and keep their paths or the reason of the failure.

        Args:
            paths: Paths of the files.
            write: Takes the paths, and writes the files or raises an OSError.
        """
        if self.attempt(partial(write, *paths)):
            self.files += paths
