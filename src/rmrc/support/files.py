"""Files that appear whole, a check that they can, and files of others that may be anything."""

import errno
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rmrc.support.errors import QuestionError, RmrcError
from rmrc.support.text import shortened, visible


@contextmanager
def reading(path: Path, contents: str) -> Iterator[None]:
    """Have whatever fails while a file is read and understood appear as one line.

    Libraries raise errors of many kinds about damaged bytes: Arrow an `OSError`, zip a `NotImplementedError`,
    a decompressor an error of its own.

    Args:
        path: The file. Anything but a regular file is refused, because reading a pipe may never end.
        contents: What it must be, such as `"a log"`.

    Raises:
        OSError: The file is missing, or may not be read.
        QuestionError: It is no regular file, or is something else or damaged.
    """
    name = visible(str(path))
    if path.exists() and not path.is_file():
        raise QuestionError(f"{name}: is not a regular file; give {contents}")
    try:
        yield
    except (RmrcError, ImportError, NameError):  # not about the file
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.filename is not None:
            raise
        reason = shortened(" ".join(str(error).split()) or type(error).__name__)
        raise QuestionError(f"{name}: is not {contents}, or is damaged: {reason}") from None


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` on success, remove it otherwise.

    A reader, or a second run of the same name, never sees half a file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(8)}{path.suffix}")
    # Not mkstemp: its mode 0600 would hide results from a group, and the umask, which `touch`
    # obeys, cannot be read without changing it under the other threads.
    try:
        temporary.touch(exist_ok=False)
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:  # of the requested file, or of none, as for a full disk
        if error.filename not in (None, str(temporary), temporary):
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8, atomically."""
    with written_whole(path) as temporary:
        temporary.write_text(text, "utf-8")


def refuse_unwritable(paths: Iterable[Path]) -> None:
    """Check whether files can be written, before a run.

    Args:
        paths: Paths of the files.

    Raises:
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
