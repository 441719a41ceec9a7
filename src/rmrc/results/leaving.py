"""Output files of a verb are checked before it runs."""

import errno
import os
from collections.abc import Iterable
from pathlib import Path


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
