"""The command of one step: views of the law's records, and texts that are made on request."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law import step
from rmrc.law.record import copied
from rmrc.law.step import LARGEST
from rmrc.scenario.choices import Status

Array: TypeAlias = NDArray[np.float64]

# A joint is at a limit when it uses all of it, up to rounding.
AT_LIMIT = 1.0 - 1e-9


def _number(group: str, name: str, meaning: str) -> property:
    """Return a property that reads a number of the records; for a batch it is an array."""

    def read(command: "Command") -> Any:
        values = command._worlds[group][name]
        return values.item() if command._is_single else values

    return property(read, doc=meaning)


class Command:
    """The command of one step. Its arrays are views that the next step overwrites; `copy` keeps them.

    For a batch of w worlds each array has one row per world, and each number is an array (w,).

    Attributes:
        qdot_cmd: Joint rates, (n,) [rad/s or m/s].
        q_cmd: Joint positions for arms that take positions, (n,) [rad or m]: the integral of the rates since
            `reset` or the first step whose input is usable, one period ahead. NaN until then: without
            positions, no command is safe.
        qdot_plain: Rates of the plain inverse, or of the pseudoinverse, without damping and limits, (n,)
            [rad/s or m/s]; NaN where no twist is resolved.
        sigma: Singular values of A, descending, (k,) with k = min(m, n); NaN where nothing is known.
        gain: Gains g(σ) that replace 1/σ, (k,).
        lost_direction: Task direction that is lost first: the left singular vector of the smallest σ, over
            the six rows of a twist along the axes of the task's frame, scaled, (6,).
        lost_motion: Joint motion that belongs to it, scaled, (n,).
        pose: Pose of the site, as the law sees it, [p, quat w x y z], (7,) [m, 1].
        pose_error: Error from the site to its wanted pose, [Δp; rotation vector], along the axes of the
            task's frame, (6,) [m, rad]; if the site is free about one of its axes, the tilt of that axis.
    """

    def __init__(
        self, worlds: NDArray[np.void], joints: Sequence[str], is_single: bool, refusal: str = ""
    ) -> None:
        """Make views of the records of worlds, (w,)."""
        self._worlds, self._joints, self._is_single = worlds, tuple(joints), is_single
        self.refusal = refusal  # about the call as a whole; the caller of the law sets it
        n, k, records = len(joints), int(worlds["k"][0]), worlds[0] if is_single else worlds
        tick, first = records["tick"], records["first"]
        self.qdot_cmd: Array = tick["qdot_cmd"][..., :n]
        self.q_cmd: Array = records["input"]["q_cmd"][..., :n]
        self.qdot_plain: Array = tick["qdot_plain"][..., :n]
        self.sigma: Array = first["sigma"][..., :k]
        self.gain: Array = first["gain"][..., :k]
        self.lost_direction: Array = tick["u_min"]
        self.lost_motion: Array = tick["v_min"][..., :n]
        self.pose: Array = tick["pose"]
        self.pose_error: Array = tick["pose_error"]

    def copy(self) -> "Command":
        """Return a copy that no step overwrites."""
        return Command(copied(self._worlds), self._joints, self._is_single, self.refusal)

    damping = _number("first", "damping", "Damping λ, in the units of σ.")
    path_rate = _number(
        "tick", "path_rate",
        "Number of periods by which to advance the reference: 1, less where it is slowed, 0 to wait.",
    )  # fmt: skip
    manipulability = _number("tick", "manipulability", "Product of the singular values.")
    condition = _number("tick", "condition", "Ratio of the largest to the smallest singular value.")
    _status = _number("tick", "status", "Its number.")

    @property
    def status(self) -> Any:
        """The `Status` flags; for a batch their numbers, (w,)."""
        return Status(self._status) if self._is_single else self._status

    @property
    def limited_by(self) -> Any:
        """The limits that act, and their joints: `{"rate": ("elbow",)}`; for a batch one such per world.

        The limits are `rate`, `acceleration`, `jerk`, `position` and `torque`.
        """
        limits = [self._limits(world) for world in self._worlds]
        return limits[0] if self._is_single else limits

    @property
    def problem(self) -> Any:
        """Why the input is not usable, in words, "" if it is; for a batch one text per world."""
        problems = [self._refused(world) for world in self._worlds]
        return problems[0] if self._is_single else problems

    def __repr__(self) -> str:
        """Return rates and status."""
        return f"Command(qdot_cmd={self.qdot_cmd}, status={self.status!r})"

    def _limits(self, world: np.void) -> dict[str, tuple[str, ...]]:
        n, status = len(self._joints), Status(int(world["tick"]["status"]))
        limits, memory, bounds, input_ = world["limits"], world["memory"], world["bounds"], world["input"]
        rate, change, q = world["tick"]["qdot_cmd"][:n], memory["change"][:n], world["state"]["q"][:n]
        upper, lower, limit = bounds["stop_upper"][:n], bounds["stop_lower"][:n], limits["rate"][:n]
        least, most = input_["range"][:, :n]
        room = np.maximum(np.where(rate > 0.0, most - q, q - least), 0.0)
        slack = 1e-9 * np.abs(rate)
        at_stop = ((rate >= upper - slack) & (upper < limit)) | ((rate <= lower + slack) & (lower > -limit))
        returning = input_["returning"][:n] != 0.0
        jerk = np.abs(change - input_["change_before"][:n]) / limits["jerk_step"][:n]
        stopping = returning if returning.any() else np.where(at_stop, 1.0, 0.5 / (1.0 + room))
        accelerating = Status.ACCELERATION_LIMITED | Status.ACCELERATION_EXCEEDED
        jerking = Status.JERK_LIMITED | Status.JERK_EXCEEDED
        shares = {  # the share of each limit that each joint uses
            "rate": (Status.RATE_LIMITED, np.divide(np.abs(rate), limit, out=np.ones(n), where=limit > 0.0)),
            "acceleration": (accelerating, np.abs(change) / limits["change"][:n]),
            "jerk": (jerking, np.maximum(jerk, np.abs(memory["lag"][:n]) > 0.0)),
            "position": (Status.POSITION_LIMITED, stopping),
            "torque": (Status.TORQUE_LIMITED, np.abs(world["tick"]["tau"][:n]) / limits["torque"][:n]),
        }
        return {
            name: tuple(self._joints[j] for j in np.flatnonzero(share >= min(AT_LIMIT, share.max())))
            for name, (bits, share) in shares.items()
            if status & bits
        }

    def _refused(self, world: np.void) -> str:
        refused, input_, state, texts = int(world["input"]["refused"]), world["input"], world["state"], []
        if refused & step.BAD_CALL:
            return self.refusal
        for bit, name, values in (
            (step.BAD_POSITIONS, "q", state["q"]), (step.BAD_RATES, "qdot", state["qdot"]),
            (step.BAD_TARGET, "q_target", input_["q_target"]),
            (step.BAD_TARGET, "qdot_target", input_["qdot_target"]),
        ):  # fmt: skip
            bad = [j for j, value in zip(self._joints, values, strict=False) if not abs(value) <= LARGEST]
            if bit & refused and bad:
                texts.append(f"{name} of {', '.join(bad)} is {_UNUSABLE}")
        if refused & step.BAD_TIME:
            texts.append(f"dt must be > 0 and finite [s], got {input_['dt']}")
        return "; ".join([*texts, *(text for bit, text in _WORDS.items() if bit & refused)])


_UNUSABLE = f"not finite, or beyond {LARGEST:g}"
_WORDS = {
    step.BAD_KINEMATICS: f"the Jacobian, or the pose of the site, is {_UNUSABLE}",
    step.BAD_POSE: f"pose is {_UNUSABLE}, or its orientation is no rotation",
    step.BAD_TWIST: f"twist is {_UNUSABLE}",
    step.BAD_METRIC: f"M is not positive definite, or {_UNUSABLE}",
}
