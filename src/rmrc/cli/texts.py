"""Texts of options, read as values: joint positions, rows of the task, a wrench."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rmrc.cli.options import FARTHEST
from rmrc.scenario.values import angle
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted
from rmrc.support.notices import tell
from rmrc.support.spatial import AXES

if TYPE_CHECKING:
    from rmrc.arm import Arm

# Squares of numbers up to this are finite.
LARGEST = 1e100


def numbers(option: str, text: str, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the numbers of an option, one for each name.

    Raises:
        QuestionError: There are more or fewer, or one is no number, or too large to compute with.
    """
    parts = text.strip().strip("[]").split(",")
    if len(parts) != len(names):
        raise QuestionError(
            f"{option} must have {len(names)} value{'s' * (len(names) != 1)}, "
            f"one for each of {', '.join(names)}, got {len(parts)}: {quoted(text)}"
        )
    values = []
    for name, part in zip(names, parts, strict=True):
        try:
            values.append(angle(part))
        except ValueError as error:
            raise QuestionError(f"{option}, {name}: {error}") from None
        if abs(values[-1]) > FARTHEST:
            raise QuestionError(f"{option}, {name}: must be within ±{FARTHEST:g}, got {quoted(part.strip())}")
    return np.array(values)


def wrench_of(text: str) -> NDArray[np.float64]:
    """Return [f; n], (6,), of the option: six values, or a force alone.

    Raises:
        QuestionError: There are neither 3 nor 6, or one is no number.
    """
    parts = text.strip().strip("[]").split(",")
    if len(parts) not in (3, 6):
        raise QuestionError(
            "--wrench must have 6 values, force fx,fy,fz [N] and moment nx,ny,nz [N·m], or 3, a force alone, "
            f"got {len(parts)}: {quoted(text)}"
        )
    wrench = np.zeros(6)
    for i, (name, part) in enumerate(zip(("fx", "fy", "fz", "nx", "ny", "nz"), parts, strict=False)):
        try:
            wrench[i] = float(part)
        except ValueError:
            wrench[i] = math.nan
        if not abs(wrench[i]) <= LARGEST:
            raise QuestionError(
                f"--wrench, {name}: must be a number within ±{LARGEST:g}, got {quoted(part.strip())}"
            )
    return wrench


def task_axes(text: str | None) -> tuple[str, ...] | None:
    """Return the rows of --axes; None without it, so that `rmrc.law.task.choose` chooses.

    Raises:
        QuestionError: A row does not exist, or the order differs, so that --to would be misread.
    """
    if text is None:
        return None
    rows = tuple(part.strip() for part in text.strip().strip("[]").split(","))
    for row in rows:
        if row not in AXES:
            raise QuestionError(f'--axes: no row "{row}"; choose from {" ".join(AXES)}')
    ordered = tuple(axis for axis in AXES if axis in rows)
    if rows != ordered:
        raise QuestionError(
            f"--axes: rows must be listed once each, in the order {' '.join(AXES)}, got {','.join(rows)}; "
            f"write {','.join(ordered)}"
        )
    return rows


def configuration(arm: Arm, q: str | None, keyframe: str | None) -> tuple[Arm, NDArray[np.float64]]:
    """Return the arm with all joints placed, and its joint positions (n,), from --q, --keyframe or `home`.

    Raises:
        QuestionError: Both are given, or --q does not fit the arm.
        ModelError: There is no such keyframe.
    """
    if q is not None and keyframe is not None:
        raise QuestionError("give --q or --keyframe, not both")
    if q is not None:
        positions = numbers("--q", q, arm.joints)
        _doubt_radians(arm, q, positions)
        return arm, positions
    qpos = arm.configuration("home" if keyframe is None else keyframe)
    return arm.at(qpos), qpos[arm.wiring.qpos]


def _doubt_radians(arm: Arm, text: str, positions: NDArray[np.float64]) -> None:
    """Warn that an angle beyond one turn without a unit was probably meant in degrees."""
    for j, (part, position) in enumerate(zip(text.strip().strip("[]").split(","), positions, strict=True)):
        if not arm.is_slide[j] and abs(position) > math.tau and not part.strip()[-1].isalpha():
            turns = f"{position:.6g} rad are {abs(position) / math.tau:.3g} turns"
            tell(f"warning: --q, {arm.joints[j]}: {turns}; for degrees write {position:.6g} deg")
