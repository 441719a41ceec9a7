"""Whether numba can compile with fewer steps than by itself: its version, and the function at hand."""

from collections.abc import Iterator
from contextlib import contextmanager

from numba import __version__

# Versions of numba with whose results `rmrc.law.shortcuts` was compared.
IS_KNOWN = __version__.startswith("0.68.")


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
