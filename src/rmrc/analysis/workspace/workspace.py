"""The poses that the site of an arm can reach, how well it moves there, and where it loses a direction."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.subject import Model, Packages, Subject, numbers, subject
from rmrc.analysis.survey import jacobians, survey
from rmrc.analysis.workspace.folds import covering
from rmrc.analysis.workspace.footprint import CELL, NODE, refuse_excess
from rmrc.analysis.workspace.reach import Workspace
from rmrc.analysis.workspace.search import Search, steps_of_grid
from rmrc.analysis.workspace.slices import Slice, choose_slice
from rmrc.arm import Arm
from rmrc.law.task import Array, Task, choose
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import AXES


def workspace(
    model: Model,
    plane: str | None = None,
    q: ArrayLike | None = None,
    *,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    through: ArrayLike | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    cells: int = 200,
    samples: int = 1_000_000,
    worst: bool = False,
    on_samples: Callable[[int], None] | None = None,
) -> Workspace:
    """Find the reachable set of the site in a slice, with and without joint limits, and its singularities.

    The function behind `rmrc workspace`; `joint_map` is the one behind its option `--over`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        plane: `xy`, `xz`, `yz`, or `rz`: distance from the first axis and height; None: the plane of a
            planar arm, or else `rz` if the first joint turns, or else `xz`.
        q: Positions, (n,) [rad or m], of joints that do not move the site; None: the keyframe.
        keyframe: Joint positions by name; None: the start of a scenario, or else `home`.
        site: The site in question; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame is in question, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        through: A point of the plane, (3,) [m]; None: the site at q.
        axes: Rows of the twist whose singular values are taken; None: those of a scenario, or else the linear
            ones that can move.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows
            they are, or else `world`.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        cells: Number of cells along the longer side.
        samples: Random configurations, with limits and as many without, for an arm that is no surface.
        worst: Whether to keep the worst of the postures that reach a cell instead of the best.
        on_samples: Called with the number of configurations examined since the last call.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: The arm has no such slice, slides without limits, or the cells do not fit into
            memory.

    Example:
        >>> found = workspace("models/planar_6_3.xml", cells=60)
        >>> round(found.free.area / np.pi)
        72
    """
    asked = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    asked.arm.require_open()
    arm, home = asked.arm, asked.q
    point = None if through is None else numbers("through", through, ("x", "y", "z"))
    part = choose_slice(arm, plane, home, point)
    refuse_excess(cells, NODE * steps_of_grid(cells) ** 2 if part.is_surface else CELL * cells**2)
    task = _task(arm, part, asked)
    work = Search(arm, task, part, home, worst, on_samples or (lambda _: None))
    free_range, own_range = _ranges(arm, part)
    if part.is_surface:
        return work.follow_surface(free_range, own_range, cells)
    return work.sampled(free_range, own_range, cells, samples)


def compile_for(arm: Arm) -> None:
    """Compile the functions for workspaces, or load them; the first time takes seconds."""
    task = Task(arm, np.arange(3))
    survey(task, np.zeros((1, arm.n)))
    covering(np.zeros((2, 2, 2)), np.zeros(2), 1.0, (1, 1))
    jacobians(task, np.zeros((1, arm.n)))


def expected(part: Slice, cells: int, samples: int) -> int:
    """Return about how many configurations `workspace` examines, for a progress bar."""
    return 2 * steps_of_grid(cells) ** 2 if part.is_surface else 2 * samples


def _task(arm: Arm, part: Slice, asked: Subject) -> Task:
    """Return the task of some axes, or of the linear ones: for a planar arm the two largest."""
    if asked.axes is not None:
        return asked.task
    rows = part.rows if asked.frame == "world" else np.arange(3)
    return choose(arm, [AXES[row] for row in rows], asked.length, asked.frame)


def _ranges(arm: Arm, part: Slice) -> tuple[Array, Array]:
    """Return lower and upper position of each joint without and with limits, both (n, 2)."""
    turns = arm.comes_round
    for joint in part.joints:
        if not turns[joint] and not np.isfinite(arm.position_limit[joint]).all():
            raise QuestionError(
                f'{arm.path}: joint "{arm.joints[joint]}" slides without limits, so that the site '
                "can be anywhere; give it a range in the model"
            )
    full = np.array([-np.pi, np.pi])
    own = arm.position_limit.copy()
    # A hinge with more than a turn, or with one end, reaches the same as a full turn.
    own[turns & ~(own[:, 1] - own[:, 0] < 2.0 * np.pi)] = full
    free = np.where(turns[:, None], full, own)
    return free, own
