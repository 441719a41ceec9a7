"""Where machine code is kept if its usual places cannot be written.

Numba keeps pickles: anybody who can write them can run code as the user who reads them. A folder that others
can create first, such as one among temporary files, is only used if this user owns it and nobody else can
write to it.
"""

import os
import stat
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def own_folder() -> Path | None:
    """Return a folder among temporary files that is this user's alone, made if missing; or None."""
    try:
        parent = Path(tempfile.gettempdir()).resolve(strict=True)
        folder = parent / f"rmrc-{os.getuid()}"
        if not _is_kept_from_others(parent.stat()):
            return None
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()  # of a link, the link itself, which is no folder
    except (AttributeError, OSError):  # no user ids, no such folder, or it cannot be written
        return None
    is_own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    return folder if is_own and not found.st_mode & _OTHERS and os.access(folder, os.W_OK) else None


def _is_kept_from_others(parent: os.stat_result) -> bool:
    """Return whether nobody else, except root, can replace a folder by another."""
    is_sticky = bool(parent.st_mode & stat.S_ISVTX)
    return parent.st_uid in (0, os.getuid()) and (is_sticky or not parent.st_mode & _OTHERS_WRITE)


@contextmanager
def known_home() -> Iterator[None]:
    """Keep a user without a home from getting a cache named `~` in the current folder."""
    before = os.environ.get("XDG_CACHE_HOME")
    if Path(before or os.path.expanduser("~")).is_absolute():
        yield
        return
    os.environ["XDG_CACHE_HOME"] = os.devnull  # a place where nothing can be made
    try:
        yield
    finally:
        if before is None:
            del os.environ["XDG_CACHE_HOME"]
        else:
            os.environ["XDG_CACHE_HOME"] = before


def notice(text: str) -> None:
    """Report once where machine code is, or why it is not kept."""
    warnings.warn(f"{text}; the variable NUMBA_CACHE_DIR names another folder", RuntimeWarning, stacklevel=2)
