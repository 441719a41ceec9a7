"""The record of a run: columns over time, each with unit and meaning, and the facts about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.law.task import WORLD_VIEW, View
from rmrc.scenario.profile import Profile
from rmrc.support.errors import did_you_mean


class Column(NamedTuple):
    """The description of a column.

    Attributes:
        unit: SI; `joint` stands for rad or m, by the kind of each joint.
        meaning: A short description.
        width: `n` joints, `k` = min(m, n) singular values, `nq` positions of the model, a number of rows, or
            "" for a scalar.
    """

    unit: str
    meaning: str
    width: str = ""


_POSE_ERROR = "[p_ref − p; log(R_ref Rᵀ)] of the true pose, along task.frame; of a free axis, its tilt"

COLUMNS: Mapping[str, Column] = {
    "time": Column("s", "simulated time of the control tick"),
    "q": Column("joint", "true joint positions", "n"),
    "q_believed": Column("joint", "joint positions used by the law", "n"),
    "qpos": Column("rad, m or quat w x y z", "positions of all the model's joints", "nq"),
    "qdot": Column("joint/s", "true joint rates", "n"),
    "qdot_cmd": Column("joint/s", "commanded joint rates", "n"),
    "qdot_arrived": Column("joint/s", "joint rates that the plant gets, mean of the tick", "n"),
    "qdot_plain": Column("joint/s", "joint rates of the plain inverse, without limits", "n"),
    "pose": Column("m, quat w x y z", "true pose of the site in the world", "7"),
    "pose_ref": Column("m, quat w x y z", "pose wanted", "7"),
    "twist_ref": Column("m/s, rad/s", "reference twist, [v; ω] along world axes", "6"),
    "pose_error": Column("m, rad", _POSE_ERROR, "6"),
    "sigma": Column("1", "singular values of the scaled task Jacobian, descending", "k"),
    "gain": Column("1", "filter g(σ) of the inverse", "k"),
    "damping": Column("1", "λ, in the units of σ"),
    "manipulability": Column("1", "w, the product of the singular values"),
    "condition": Column("1", "κ, the largest over the smallest singular value"),
    "u_min": Column("1", "scaled task direction of the smallest singular value, along task.frame", "6"),
    "v_min": Column("1", "scaled joint motion of the smallest singular value", "n"),
    "tau": Column("N·m or N", "actuator torques of the last step; 0 for the ideal plant", "n"),
    "tau_gravity": Column("N·m or N", "torque or force of gravity compensation at each joint", "n"),
    "path_time": Column("s", "time along the path; behind `time` where it is slowed"),
    "path_rate": Column("1", "ṡ, the pace along the path"),
    "secondary_error": Column("m, rad", "norm of the second task's error, or NaN"),
    "secondary_sigma": Column("1", "smallest singular value left to the second task, or NaN"),
    "slip": Column("rad or m", "largest distance of a follower from its equality, or NaN"),
    "status": Column("bits", "statuses of the tick, a sum of their bits"),
}


def widths(n: int, k: int, nq: int) -> dict[str, int]:
    """Return how many numbers a tick has in each column.

    Args:
        n: Number of joints.
        k: Number of singular values.
        nq: Number of the model's positions.
    """
    sizes = {"": 1, "n": n, "k": k, "nq": nq, "6": 6, "7": 7}
    return {name: sizes[column.width] for name, column in COLUMNS.items()}


def no_ticks(n: int, k: int, nq: int) -> dict[str, NDArray[np.generic]]:
    """Return the columns of a run without ticks; arguments as in `widths`."""
    sizes = widths(n, k, nq)
    return {name: np.empty((0, sizes[name]) if column.width else 0) for name, column in COLUMNS.items()}


@dataclass(frozen=True)
class Divergence:
    """The point at which a state stopped being finite.

    Attributes:
        tick: First control tick that could not be recorded.
        time: Its time [s].
        joint: Name of the joint, or "" if it is not known.
        reason: The observation.
    """

    tick: int
    time: float
    joint: str
    reason: str

    def __str__(self) -> str:
        """Return one line for a message."""
        where = f' at joint "{self.joint}"' if self.joint else ""
        return f"diverged at tick {self.tick} ({self.time:.4f} s){where}: {self.reason}"


@dataclass(frozen=True, eq=False)
class Recorded:
    """The columns of a run, and the facts about it.

    What only metrics and pictures need, from `weights` on, is in neither `repr` nor `dir`.

    Attributes:
        name: Name of the scenario.
        joints: Names, n of them.
        is_slide: Which joints slide, (n,).
        axes: Task axes that count.
        length: Characteristic length L of the task [m].
        period: Control period [s].
        columns: Arrays by the names of COLUMNS, time first: (T,) or (T, width).
        planned: Ticks of the path; a run has fewer if it was cut short, and more if it was slowed.
        divergence: Where it diverged, or None.
        wall_time: Seconds that the stepping of this world took.
        rate_limit: Rate limit of each joint [rad/s or m/s], infinite without one; none: not known.
        torque_limit: Torque limit of each joint [N·m or N], infinite without one; none: no joint has one.
        weights: Task weights, one per axis; none: all 1.
        view: The frame of the task axes.
        touching: The two bodies of the first contact; none: there was no contact.
        resting: Pairs of bodies that touch from the start, which is no contact while it lasts.
        chatter_floor: Acceleration of each joint above which a change of sign counts as chatter [rad/s² or
            m/s²]; none: `rmrc.results.metrics.CHATTER_FLOOR` for all.
        profile: The profile that the commands are checked against, or None.
        damping_below: ε, below which damping begins, in the units of σ; 0 where damping depends on something
            else.
        screws: [ω; v at the world's origin] of each axis of the chain with all joints at 0, outward, per unit
            of the joint that moves it, (ℓ, 6) [rad, m]; none: not known.
        leaders: Number of the joint that moves each axis, (ℓ,).
        joint_scale: Diagonal of S_q, by which the law scales joint rates, (n,); none: not known.
    """

    # of `rmrc.results.run`, which writes and reads the facts as JSON
    __pydantic_config__: ClassVar = {"ser_json_inf_nan": "strings", "arbitrary_types_allowed": True}

    name: str
    joints: tuple[str, ...]
    is_slide: tuple[bool, ...]
    axes: tuple[str, ...]
    length: float
    period: float
    columns: Mapping[str, NDArray[np.generic]]
    planned: int
    divergence: Divergence | None = None
    wall_time: float = 0.0
    rate_limit: tuple[float, ...] = ()
    torque_limit: tuple[float, ...] = ()
    weights: tuple[float, ...] = field(default_factory=tuple, repr=False)
    view: View = field(default_factory=lambda: WORLD_VIEW, repr=False)
    touching: tuple[str, ...] = field(default_factory=tuple, repr=False)
    resting: tuple[tuple[str, ...], ...] = field(default_factory=tuple, repr=False)
    chatter_floor: tuple[float, ...] = field(default_factory=tuple, repr=False)
    profile: Profile | None = field(default_factory=lambda: None, repr=False)
    damping_below: float = field(default_factory=float, repr=False)
    screws: tuple[tuple[float, ...], ...] = field(default_factory=tuple, repr=False)
    leaders: tuple[int, ...] = field(default_factory=tuple, repr=False)
    joint_scale: tuple[float, ...] = field(default_factory=tuple, repr=False)

    def __dir__(self) -> list[str]:
        """Return the names of what a user needs."""
        hidden = {each.name for each in fields(self) if not each.repr}
        return [name for name in super().__dir__() if name not in hidden]

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """Return a column by name.

        Raises:
            KeyError: There is none; it names the nearest.
        """
        if column not in self.columns:
            metric = f'; a metric is run.scorecard["{column}"]' if "." in column else ""
            hint = metric or did_you_mean(column, self.columns) or f"; it has {', '.join(self.columns)}"
            raise KeyError(f'no column "{column}"{hint}')
        return self.columns[column]  # type: ignore[return-value]

    def __len__(self) -> int:
        """Return the number of ticks recorded."""
        return len(self.columns["time"])

    @property
    def completed(self) -> float:
        """Share of the path that was recorded; 1: all of it."""
        if not len(self):
            return 0.0
        return (round(float(self["path_time"][-1]) / self.period, 6) + 1.0) / self.planned

    @property
    def is_complete(self) -> bool:
        """Whether the path was recorded to its end."""
        return self.completed == 1.0

    def joint_unit(self, j: int) -> str:
        """Return `m` for a sliding joint, else `rad`."""
        return "m" if self.is_slide[j] else "rad"
