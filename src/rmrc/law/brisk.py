"""Compiling with fewer steps than numba itself takes, where the version of numba is known."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from numba import __version__

# Versions of numba with whose results `rmrc.law.shortcuts` was compared.
IS_KNOWN = __version__.startswith("0.68.")

_lock = threading.RLock()


class Plain:
    """Whether the function that is compiled now counts no references, so that no variable need be deleted."""

    now = False


@contextmanager
def plainly(is_plain: bool) -> Iterator[None]:
    """Compile a function that counts no references, or one that does."""
    before, Plain.now = Plain.now, is_plain
    try:
        yield
    finally:
        Plain.now = before


@contextmanager
def briskly() -> Iterator[None]:
    """Have numba take shortcuts. One thread at a time compiles here.

    Another version of numba compiles in its own way: its internals are not even imported.
    """
    with _lock:
        if not IS_KNOWN:
            yield
            return
        from rmrc.law.shortcuts import shortened

        with shortened():
            yield
