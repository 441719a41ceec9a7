"""Machine code that need not be compiled: this computer's own, and the code in the package.

Numba keeps code for the processor that compiled it. A wheel may carry code for the third level of x86-64
[psABI], which most processors of the last ten years run; others compile their own. Both round alike: no flag
that would change the order of sums or fuse products is set.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, cast

from llvmlite import binding  # type: ignore[import-untyped]
from numba import config
from numba.core.caching import IndexDataCacheFile
from numba.core.runtime.nrt import rtsys

from rmrc.law.keeping import notice

# The code in a wheel: one folder per room, with a digest of all compiled sources.
SHIPPED = Path(__file__).parents[1] / "_machine_code"
STAMP = "sources"
LEVEL = "x86-64-v3"
NEEDED = (
    "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "sse3", "sse4.1",
    "sse4.2", "ssse3", "xsave",
)  # fmt: skip
FEATURES = ",".join(f"+{name}" for name in NEEDED)


class Kept:
    """A cache of numba's that also knows the package's code. Files that it cannot read are compiled again."""

    def __init__(self, own: Any, sources: str) -> None:
        """Wrap a cache.

        Args:
            own: Cache of a dispatcher.
            sources: Digest of the present sources.
        """
        self._own, self._sources = own, sources

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the cache itself."""
        return getattr(self._own, name)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return machine code, or None if there is none or its file is damaged.

        Numba itself first registers everything that can be compiled, which takes 0.3 s. Machine code needs
        only its runtime.
        """
        rtsys.initialize(target)
        try:
            with self._own._guard_against_spurious_io_errors():
                found = self._own._load_overload(signature, target)
        except Exception:  # any error of unpickling a damaged file
            self._without(self._own.flush)
            found = None
        found = found or self._load_shipped(signature, target)
        if found is None:
            target.refresh()
        return found

    def save_overload(self, *about: Any) -> None:
        """Write machine code, unless the disk is full."""
        self._without(self._own.save_overload, *about)

    def _load_shipped(self, signature: Any, target: Any) -> Any:
        """Return machine code of the package, or None if it has none that serves."""
        own = self._own
        if not (own._enabled and is_served(self._sources)):
            return None
        about, (triple, *_), code = own._index_key(signature, target.codegen())
        files = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            str(SHIPPED / Path(own._py_func.__code__.co_filename).parent.name),
            own._impl.filename_base,
            own._impl.locator.get_source_stamp(),
        )
        try:
            data = files.load((about, (triple, LEVEL, FEATURES), code))  # type: ignore[no-untyped-call]
            return data and own._impl.rebuild(target, data)
        except Exception:  # a damaged file
            return None

    def _without(self, write: Callable[..., object], *about: Any) -> None:
        try:
            write(*about)
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            notice(f"machine code cannot be kept in {self._own.cache_path}: {why}; it is compiled each time")


@cache
def is_served(sources: str) -> bool:
    """Return whether the package has machine code of these sources for this processor."""
    if cast(Any, config).CPU_NAME or cast(Any, config).CPU_FEATURES:  # the user asks for other code
        return False
    try:
        if (SHIPPED / STAMP).read_text() != sources:
            return False
    except OSError:
        return False
    features = binding.get_host_cpu_features()
    return all(features.get(name) for name in NEEDED)
