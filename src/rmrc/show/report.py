"""An answer in its forms: tables for people, JSON for machines, a picture."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.results.expectations import Case
from rmrc.show.sheets import Sheet, as_markdown


@dataclass(frozen=True, eq=False)
class Report:
    """The presentation of an answer.

    Attributes:
        sheets: Tables without a form, the most general first.
        json: The same for strict JSON, as `plain` returns it.
        draw: Writes the picture to a file, atomically, in the format of its suffix: `.png`, `.svg` or `.pdf`;
            None if there is no picture.
        met: Whether the requested condition is met.
        problem: The reason why it is not met, in one line; "" if the sheets give it.
        block: Lines of a scenario to paste, which are not wrapped; "" for none.
        cases: The checks, as CI counts them.
    """

    sheets: Sequence[Sheet]
    json: Any
    draw: Callable[[Path], None] | None = None
    met: bool = True
    problem: str = ""
    block: str = ""
    cases: Sequence[Case] = ()

    def _repr_markdown_(self) -> str:
        """Return the tables, as a notebook shows them."""
        return "\n\n".join(map(as_markdown, self.sheets))


def plain(value: Any) -> Any:
    """Return dicts, lists, texts and finite numbers of Python; None for a number that is not finite.

    Args:
        value: May have arrays and numbers of numpy, and tuples.

    >>> plain({"q": np.array([1.0, np.inf]), "hits": np.int64(3), "axes": ("x", "y")})
    {'q': [1.0, None], 'hits': 3, 'axes': ['x', 'y']}
    """
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
