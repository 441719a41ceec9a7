"""The command of one step: views of the law's records, and texts that are made on request."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law.step import LARGEST, Refused
from rmrc.scenario.choices import Status

Array: TypeAlias = NDArray[np.float64]

# A joint is at a limit when it uses all of it, up to rounding.
AT_LIMIT = 1.0 - 1e-9


class Command:
    """The command of one step. Its arrays are views that the next step overwrites; `copy` keeps them.

    For a batch of w worlds each array has one row per world, and each number is an array (w,).

    Attributes:
        qdot_cmd: Joint rates, (n,) [rad/s or m/s].
        q_cmd: Joint positions for arms that take positions, (n,) [rad or m]: the integral of the rates since
            `reset` or the first step, one period ahead.
        qdot_plain: Rates of the plain inverse, or of the pseudoinverse, without damping and limits, (n,)
            [rad/s or m/s]; NaN where no twist is resolved.
        sigma: Singular values of A, descending, (k,) with k = min(m, n); NaN where nothing is known.
        gain: Gains g(σ) that replace 1/σ, (k,).
        lost_direction: Task direction that is lost first: the left singular vector of the smallest σ, over
            the six rows of a twist along the axes of the task's frame, scaled, (6,).
        lost_motion: Joint motion that belongs to it, scaled, (n,).
        pose: Pose of the site, as the law sees it, [p, quat w x y z], (7,) [m, 1].
        pose_error: Error from the site to its wanted pose, [Δp; rotation vector], along the axes of the
            task's frame, (6,) [m, rad].
    """

    def __init__(
        self,
        worlds: NDArray[np.void],
        ticks: NDArray[np.void],
        joints: Sequence[str],
        is_one: bool,
        problem: str = "",
    ) -> None:
        """Make views of the records of worlds and of their ticks, (w,)."""
        n, k = len(joints), int(worlds["k"][0])
        self._worlds, self._ticks, self._joints, self._is_one = worlds, ticks, tuple(joints), is_one
        self.refusal = problem  # about the call as a whole; the caller of the law sets it

        def seen(values: Array, size: int) -> Array:
            rows: Array = values[:, :size]
            return rows[0] if is_one else rows

        self.qdot_cmd, self.q_cmd = seen(ticks["qdot_cmd"], n), seen(worlds["q_cmd"], n)
        self.qdot_plain = seen(ticks["qdot_plain"], n)
        self.sigma, self.gain = seen(ticks["sigma"], k), seen(ticks["gain"], k)
        self.lost_direction, self.lost_motion = seen(ticks["u_min"], 6), seen(ticks["v_min"], n)
        self.pose, self.pose_error = seen(ticks["pose"], 7), seen(ticks["pose_error"], 6)
        self._status: NDArray[np.int64] = ticks["status"]
        self._numbers = {
            name: ticks[name] for name in ("damping", "path_rate", "manipulability", "condition")
        }

    def copy(self) -> "Command":
        """Return a copy that no step overwrites."""
        return Command(self._worlds.copy(), self._ticks.copy(), self._joints, self._is_one, self.refusal)

    @property
    def status(self) -> Any:
        """The `Status` flags; for a batch their numbers, (w,)."""
        return Status(self._status.item()) if self._is_one else self._status

    @property
    def damping(self) -> Any:
        """Damping λ, in the units of σ."""
        return self._number("damping")

    @property
    def path_rate(self) -> Any:
        """Number of periods by which to advance the reference: 1, less where it is slowed, 0 to wait."""
        return self._number("path_rate")

    @property
    def manipulability(self) -> Any:
        """Product of the singular values."""
        return self._number("manipulability")

    @property
    def condition(self) -> Any:
        """Ratio of the largest to the smallest singular value."""
        return self._number("condition")

    def _number(self, name: str) -> Any:
        values = self._numbers[name]
        return values.item() if self._is_one else values

    @property
    def limited_by(self) -> Any:
        """The limits that act, and their joints: `{"rate": ("elbow",)}`; for a batch one such per world.

        The limits are `rate`, `acceleration`, `jerk` and `position`.
        """
        found = [self._limits(world, tick) for world, tick in zip(self._worlds, self._ticks, strict=True)]
        return found[0] if self._is_one else found

    @property
    def problem(self) -> Any:
        """Why the input is not usable, in words, "" if it is; for a batch one text per world."""
        found = [self._refused(world) for world in self._worlds]
        return found[0] if self._is_one else found

    def __repr__(self) -> str:
        """Return rates and status."""
        return f"Command(qdot_cmd={self.qdot_cmd}, status={self.status!r})"

    def _limits(self, world: np.void, tick: np.void) -> dict[str, tuple[str, ...]]:
        n, status = len(self._joints), Status(int(tick["status"]))
        rate, change = tick["qdot_cmd"][:n], world["change_last"][:n]
        upper, lower = world["rest_upper"][:n], world["rest_lower"][:n]
        q, ends, limit = world["q"][:n], world["position_limit"][:, :n], world["rate_limit"][:n]
        room = np.where(rate > 0.0, ends[1] - q, q - ends[0])
        slack = 1e-9 * np.abs(rate)
        returning = world["returning"][:n] != 0.0
        at_stop = ((rate >= upper - slack) & (upper < limit)) | ((rate <= lower + slack) & (lower > -limit))
        jerk = np.abs(change - world["change_before"][:n]) / world["jerk_step"][:n]
        near = {
            "rate": (Status.RATE_LIMITED, np.abs(rate) / limit),
            "acceleration": (
                Status.ACCELERATION_LIMITED | Status.ACCELERATION_EXCEEDED,
                np.abs(change) / world["change_limit"][:n],
            ),
            "jerk": (
                Status.JERK_LIMITED | Status.JERK_EXCEEDED, np.maximum(jerk, np.abs(world["lag"][:n]) > 0.0),
            ),
            "position": (
                Status.POSITION_LIMITED,
                returning if returning.any() else np.where(at_stop, 1.0, 0.5 / (1.0 + np.maximum(room, 0.0))),
            ),
        }  # fmt: skip
        return {
            name: tuple(self._joints[j] for j in np.flatnonzero(share >= min(AT_LIMIT, share.max())))
            for name, (bits, share) in near.items()
            if status & bits
        }

    def _refused(self, world: np.void) -> str:
        refused, n = Refused(int(world["refused"])), len(self._joints)
        if Refused.CALL in refused:
            return self.refusal
        told = []
        for bit, name, values in (
            (Refused.POSITIONS, "q", world["q"][:n]), (Refused.RATES, "qdot", world["qdot"][:n]),
            (Refused.TARGET, "q_target", world["q_target"][:n]),
            (Refused.TARGET, "qdot_target", world["qdot_target"][:n]),
        ):  # fmt: skip
            bad = [j for j, one in zip(self._joints, values, strict=True) if not abs(one) <= LARGEST]
            if bit in refused and bad:
                told.append(f"{name} of {', '.join(bad)} is {_UNUSABLE}")
        told += [text for bit, text in _WORDS.items() if bit in refused]
        return "; ".join(told)


_UNUSABLE = f"not finite, or beyond {LARGEST:g}"
_WORDS = {
    Refused.KINEMATICS: f"the Jacobian, or the pose of the site, is {_UNUSABLE}",
    Refused.POSE: f"pose is {_UNUSABLE}, or its orientation is no rotation",
    Refused.TWIST: f"twist is {_UNUSABLE}",
    Refused.METRIC: f"M is not positive definite, or {_UNUSABLE}",
}
