"""The kinematics and statics of the source notes: one function per equation, numpy only.

This is an independent implementation: nothing here uses MuJoCo, so its results can check the simulation.
Arrays in, arrays out, over any leading axes; rad and m.

Each function is also an attribute of the package. The modules load on first use:

    >>> from rmrc import textbook
    >>> float(textbook.planar_rp_determinant([0.0, 0.5]))
    -1.5
"""

import importlib
import pkgutil
from typing import Any

_MODULES = tuple(module.name for module in pkgutil.iter_modules(__path__))


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    for module in () if name.startswith("_") else _MODULES:
        found = getattr(importlib.import_module(f"{__name__}.{module}"), name, None)
        if str(getattr(found, "__module__", "")).startswith(f"{__name__}."):
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
