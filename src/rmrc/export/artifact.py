"""The artifact that pages embed: `law.wasm`, all methods that a world with the ideal plant may call.

`tools/law_wasm.py` builds it. It ends with a digest of the sources that went in, so that a test finds out
when these have changed since.
"""

import hashlib
import inspect
import io
import tokenize
from pathlib import Path
from typing import Any

from rmrc.export.image import CAPACITY
from rmrc.export.objects import NOTHING, globals_of, name_of, object_file, program
from rmrc.law import (
    active_set,
    damping,
    inverses,
    jerk,
    joint_motion,
    law,
    limits,
    metric,
    nullspace,
    policies,
    svd,
)
from rmrc.law.compiling import Method
from rmrc.law.record import world_type
from rmrc.plants import ideal, stages
from rmrc.simulation import reference, ticks

FILE = Path(__file__).with_name("law.wasm")

_MODULES = (
    *(active_set, damping, inverses, jerk, joint_motion, law, limits, metric, nullspace, policies),
    *(svd, ideal, stages, reference, ticks),
)
# What means something in a compiled function; comments and texts do not.
_TOKENS = tokenize.NAME, tokenize.NUMBER, tokenize.OP


def methods() -> dict[str, Method]:
    """Return the methods by their names."""
    values = [value for module in _MODULES for value in vars(module).values()]
    return {name_of(value): value for value in values if isinstance(value, Method)}


def wasm_object() -> bytes:
    """Return the methods as an object, which is yet to be linked with the mathematical functions of C."""
    names = [*methods(), NOTHING]
    return object_file(program(methods().values(), CAPACITY), "wasm32-unknown-unknown", names)


def digest() -> bytes:
    """Return a digest of all functions that the methods call, their constants, and the record of a world."""
    waiting: list[Any] = [method.function for method in methods().values()]
    texts = dict[str, str]()
    while waiting:
        function = waiting.pop()
        name = f"{function.__module__}.{function.__name__}"
        if name in texts:
            continue
        tokens = tokenize.generate_tokens(io.StringIO(inspect.getsource(function)).readline)
        words = [token.string for token in tokens if token.type in _TOKENS]
        for used in sorted(globals_of(function)):
            value = function.__globals__.get(used)
            if hasattr(value, "py_func"):
                waiting.append(value.py_func)
            elif isinstance(value, int | float):
                words.append(f"{used} = {value!r}")
        texts[name] = " ".join(words)
    record = str(world_type(CAPACITY).descr)
    return hashlib.sha256("\n".join([record, *(texts[name] for name in sorted(texts))]).encode()).digest()
