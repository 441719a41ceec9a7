"""Files that appear atomically."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` on success, remove it otherwise.

    A reader, or a second run of the same name, never sees half a file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(8)}{path.suffix}")
    # Not mkstemp: its mode 0600 would hide results from a group, and the umask, which `touch`
    # obeys, cannot be read without changing it under the other threads.
    with _about(path, temporary):
        temporary.touch(exist_ok=False)
    try:
        with _about(path, temporary):
            yield temporary
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def _about(path: Path, temporary: Path) -> Iterator[None]:
    """Have errors name the requested file, not its temporary one, or none, as for a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename not in (None, str(temporary), temporary):
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
