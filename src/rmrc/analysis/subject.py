"""The subject of a question: an arm, from a file, a scenario or loaded, and its joint positions."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from rmrc.arm import Arm, load, load_asked
from rmrc.law.task import Array, Task, choose
from rmrc.scenario import Frame, Scenario
from rmrc.support import shipped
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.spatial import AXES, ORIGIN, quat_to_matrix
from rmrc.support.text import shortened

Model: TypeAlias = Arm | Scenario | str | os.PathLike[str]
"""An arm, an MJCF file, the name of a shipped one, or a scenario, which also has start, axes and length."""

Packages: TypeAlias = Mapping[str, str | os.PathLike[str]]
"""Folders of the packages that a URDF names, by their names."""


# The default, `world`, comes first.
FRAMES: tuple[Frame, ...] = get_args(Frame)


@dataclass(frozen=True, eq=False)
class Subject:
    """An arm at joint positions.

    Attributes:
        arm: The arm, with the site in question.
        q: Joint positions, (n,) [rad or m].
        axes: Rows of the twist that count; None: those that fit the question.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of the arm.
        frame: Frame of the rows: `world`, `base`, or `site`, which turns with the site.
    """

    arm: Arm
    q: Array
    axes: Sequence[str] | None
    length: float | None
    frame: Frame = "world"

    @cached_property
    def task(self) -> Task:
        """The rows that count; without `axes`, those that the arm can move independently of each other."""
        return choose(self.arm, self.axes, self.length, self.frame)


def subject(
    model: Model,
    q: ArrayLike | None = None,
    keyframe: str | None = None,
    site: str | None = None,
    axes: Sequence[str] | None = None,
    length: float | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    task_frame: str | None = None,
) -> Subject:
    """Return the arm of a model, at joint positions.

    Args:
        model: An arm, an MJCF file, or a scenario.
        q: Joint positions, (n,) [rad or m]; None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.tree`.
        axes: Of x y z rx ry rz; None: those of a scenario, or else the question chooses.
        length: Characteristic length [m]; None: that of a scenario, or else of the arm.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows
            they are, or else `world`.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: The arm or scenario has another site, q does not fit it, or axes or length are
            unusable.

    Example:
        >>> found = subject("models/planar_3link.xml", [0.0, 1.0, 0.5], site="wrist")
        >>> found.arm.joints, found.q.tolist(), found.task.axes
        (('shoulder', 'elbow', 'wrist'), [0.0, 1.0, 0.5], ('x', 'y', 'rz'))
    """
    if q is not None and keyframe is not None:
        raise QuestionError("give q or keyframe, not both")
    arm = read_arm(model, site, body, packages)
    start: str | Sequence[float] = "home"
    if isinstance(model, Scenario):
        start = model.arm.start
        if axes is None:
            axes, task_frame = model.task.axes, task_frame or model.task.frame
        length = model.task.length if length is None else length
    qpos = arm.configuration(start if keyframe is None else keyframe)
    if q is None or isinstance(model, Scenario):
        arm = arm.at(qpos)
    positions = qpos[arm.wiring.qpos] if q is None else numbers("q", q, arm.joints)
    if axes is not None and not (len(axes) and {*axes} <= {*AXES}):
        wrong = [axis for axis in axes if axis not in AXES]
        problem = f'no row "{wrong[0]}"' if wrong else "not one row"
        raise QuestionError(f"axes: {problem}; choose from {' '.join(AXES)}")
    if length is not None and not (np.isfinite(length) and length > 0.0):
        raise QuestionError(f"length must be > 0 and finite, got {length:g}")
    return Subject(arm, positions, axes, length, frame_named("task frame", task_frame or "world"))


def read_arm(
    model: Model,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    joints: Sequence[str] | None = None,
) -> Arm:
    """Return the arm of a model.

    Args:
        model: An arm, an MJCF or URDF file, or a scenario.
        site: The site in question; None: that of the arm or scenario, or else of the hand.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names.
        joints: The joints to actuate; None: those of the arm or scenario, or else all on the chain.

    Raises:
        ModelError: See `rmrc.arm.load`.
        QuestionError: Both a site and a body are given, or an arm or scenario that has others.
    """
    if site is not None and body is not None:
        raise QuestionError("give site or body, not both")
    folders = {name: Path(folder) for name, folder in (packages or {}).items()}
    if not isinstance(model, Arm | Scenario):
        return load(shipped.found(model, "models"), site, joints, body=body, packages=folders)
    arm = model if isinstance(model, Arm) else load_asked(model.arm)
    if isinstance(model, Scenario) and model.arm.stretch:
        arm = arm.stretched(model.arm.stretch)
    of_body = arm.frame[1] if arm.frame and arm.frame[0] == "body" else None
    wanted = {"site": site, "body": body, "joints": joints and tuple(joints), "packages": folders}
    has = {"site": arm.site, "body": of_body, "joints": arm.joints, "packages": dict(arm.packages)}
    for name, value in wanted.items():
        if value and value != has[name]:
            known, text = (f'"{one}"' if isinstance(one, str) else one for one in (has[name], value))
            raise QuestionError(f"the arm has {name} {known}, got {text}; load it with these settings")
    return arm


def numbers(what: str, values: ArrayLike, names: Sequence[str]) -> Array:
    """Return finite numbers, one for each name, (len(names),).

    Raises:
        QuestionError: Their number is wrong, or one is no number or not finite.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise QuestionError(f"{what} must be numbers, got {shortened(repr(values))}") from None
    if array.shape != (len(names),):
        raise QuestionError(
            f"{what} must have {len(names)} value{'s' * (len(names) != 1)}, "
            f"one for each of {', '.join(names)}, got shape {array.shape}"
        )
    if not np.isfinite(array).all():
        raise QuestionError(f"{what} must be finite, got {array.tolist()}")
    return array


def frame_named(what: str, name: str) -> Frame:
    """Return the frame of a name; raise a problem if there is none."""
    if name not in FRAMES:
        hint = did_you_mean(name, FRAMES)
        raise QuestionError(f'{what}: no frame "{name}"{hint}; choose from {" ".join(FRAMES)}')
    return FRAMES[FRAMES.index(name)]


def axes_of(arm: Arm, q: Array, frame: str) -> Array:
    """Return the axes of a frame in the world as columns, (3, 3); base is the body that carries the arm.

    Raises:
        QuestionError: There is no such frame.
    """
    poses = {"world": ORIGIN, "base": arm.base_at(q), "site": arm.pose(q)}
    return quat_to_matrix(poses[frame_named("frame", frame)][3:])
