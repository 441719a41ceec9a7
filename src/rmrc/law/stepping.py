"""A law that Python steps: the input, memory, watchdog and output that `Controller` and `Law` share."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from numbers import Real
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.law.command import Command
from rmrc.law.compiling import Array, Method
from rmrc.law.joint_motion import POSITION_TARGET, RATE_TARGET, move_joints
from rmrc.law.limits import by_joint
from rmrc.law.measurement import CHAIN_ALONE
from rmrc.law.record import POSE, TWIST, new_worlds, reset
from rmrc.law.settings import TaskLaw, link
from rmrc.law.step import LARGEST, OVERDUE, PLACED, RATES, REFUSED, STOPPED, TIMED, step
from rmrc.support.errors import QuestionError
from rmrc.support.text import shortened

# The most periods that are braked when no step came in time: any arm is at rest by then.
MOST_LATE = 1_000_000
# The part of a period by which clocks may differ.
ON_TIME = 1e-6
# The bits of the arguments of a step.
BITS = {
    "q": PLACED, "qdot": RATES, "pose": POSE, "twist": TWIST,
    "q_target": POSITION_TARGET, "qdot_target": RATE_TARGET,
}  # fmt: skip
POSES = "(7,), (6,) or (4, 4)"
# What `reset` makes anew, with addresses in this process.
REMADE = {
    "_worlds", "_methods", "_steps", "_places", "_given", "_shadow", "command",
    "_second", "_data", "_are_fresh",
}  # fmt: skip


class SteppedLaw:
    """A law that Python steps, for one world or a batch of worlds.

    Attributes:
        joints: Names of the n joints.
        period: Time from one step to the next [s].
        command: Result of the last step; the next one overwrites it.
    """

    command: Command

    def __init__(
        self, joints: Sequence[str], period: float, watchdog: float | None, clock: Callable[[], float]
    ) -> None:
        """Keep the constants; `_renew` makes the records."""
        self.joints, self.period, self._clock = tuple(joints), period, clock
        self._watchdog = _checked_time(watchdog)
        self._shadow: _Shadow | None = None
        self._refused: dict[int, str] = {}  # worlds whose input is not usable, and why

    # Records --------------------------------------------------------------------------------------

    def _renew(self, laws: Sequence[TaskLaw], axes: int, is_single: bool) -> None:
        """Make the records of worlds anew, and the views through which steps write.

        Args:
            laws: The law of each world.
            axes: Number of axes of the chain.
            is_single: Whether arrays have no axis of worlds.
        """
        n = len(self.joints)
        self._worlds = worlds = new_worlds(len(laws), n, axes)
        for world, law in zip(worlds, laws, strict=True):
            law.write(world)
        self._methods = laws[0].methods | {"move_joints": move_joints, "by_joint": by_joint}
        self._is_single, self._steps = is_single, list[Callable[[], None]]()
        self.command = Command(worlds, self.joints, is_single)
        state, input_ = worlds["state"], worlds["input"]
        self._places: dict[str, tuple[Array, Sequence[tuple[int, ...]]]] = {}
        for name in ("q", "qdot"):
            self._place(name, state[name][:, :n])
            self._place(f"{name}_target", input_[f"{name}_target"][:, :n])
        self._place("dt", input_["dt"])
        self._given, self._last_given = input_["given"], 0

    def _place(self, name: str, values: Array) -> None:
        """Have `_take` write an argument of all worlds here, (w, ...); worlds may share it."""
        shapes = [values.shape, values.shape[1:]]
        self._places[name] = values, shapes[1:] if self._is_single else shapes

    def warm_up(self) -> None:
        """Compile the law (seconds) or load its machine code (tenths), before the first step does."""
        link(self._worlds, self._methods, late=())  # as a step must not take seconds
        self._steps = _steps(self._worlds)

    def beginning(self) -> tuple[np.void, Mapping[str, Method]]:
        """Return a copy of the first world's record before any step, and the methods that it calls."""
        self._forget()
        return self._worlds[:1].copy()[0], self._methods

    def _forget(self) -> None:
        """Forget all steps."""
        reset(self._worlds)
        input_, tick = self._worlds["input"], self._worlds["tick"]
        tick["qdot_cmd"], tick["status"], self.command.refusal = 0.0, 0, ""
        input_["q_cmd"] = input_["called"] = math.nan
        input_["returning"] = 0.0
        self._watch()

    def reset(self, q: ArrayLike | None = None) -> None:
        """Forget all steps; from positions, (n,) or (w, n), make the records anew."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy goes on from, in this or another process."""
        state = {name: value for name, value in vars(self).items() if name not in REMADE}
        return {"state": state, "worlds": self._worlds.copy(), "refusal": self.command.refusal}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Make records of its own with what was saved, except the addresses."""
        vars(self).update(saved["state"])
        worlds, n = saved["worlds"], len(self.joints)
        self.reset(np.zeros(n if self._is_single else (len(worlds), n)))
        vars(self).update(saved["state"])
        for name in set(worlds.dtype.names) - {"methods", "engine"}:
            self._worlds[name] = worlds[name]
        sites = self._worlds["input"]["sites"]
        sites[sites > 0] = CHAIN_ALONE  # no data are read yet
        self.command.refusal = saved["refusal"]
        self._watch()

    # Steps ----------------------------------------------------------------------------------------

    def _take(self, name: str, values: Any, row: int | None = None) -> Array:
        """Write an argument of a step where the law reads it; return where that is.

        Args:
            name: Its name.
            values: Its values.
            row: The world whose values they are; None: all worlds.

        Raises:
            QuestionError: It is not an array of the right shape.
        """
        place, shapes = self._places[name]
        if row is not None:
            place, shapes = place[row : row + 1], shapes[1:]
        numbers = taken = as_numbers(name, values)
        if name == "pose" and numbers.shape not in shapes:
            taken = self._quaternion_pose(numbers)
        if taken.shape not in shapes:
            forms = POSES if name == "pose" else " or ".join(map(str, shapes))
            advice = "" if self._is_single else f"; reset made a batch of {len(self._worlds)}"
            if self._is_single and numbers.shape[1:] == place.shape[1:]:
                advice = "; reset makes a batch"
            got = None if values is None else numbers.shape
            raise QuestionError(f"{name} must be {forms}, got {got}{advice}")
        place[...] = taken
        return place

    def _quaternion_pose(self, pose: Array) -> Array:
        """Return poses as [p, quat w x y z], (..., 7), from the other forms that a law takes."""
        return pose

    def _take_each(self, name: str, values: Any) -> None:
        """Write an argument of a step; of a batch, rows that are not usable are refused alone.

        Raises:
            QuestionError: No row is usable.
        """
        try:
            self._take(name, values)
        except QuestionError:
            is_rows = isinstance(values, Sequence) or (isinstance(values, np.ndarray) and values.ndim > 0)
            if self._is_single or not is_rows or len(values) != len(self._worlds):
                raise
            refused = {}
            for w, row in enumerate(values):
                try:
                    self._take(name, row, w)
                except QuestionError as why:
                    refused[w] = f"arm {w}: {why}"
            if len(refused) == len(self._worlds):
                raise
            self._refused |= refused

    def _take_all(self, **arguments: Any) -> int:
        """Write the arguments that are not None; return their bits.

        Raises:
            QuestionError: One of them is not usable.
        """
        bits = 0
        for name, values in arguments.items():
            if values is not None:
                self._take_each(name, values)
                bits |= BITS[name]
        return bits

    def _take_time(self, dt: ArrayLike | None) -> None:
        """Write the time since the last step, the first argument of each; None: one period.

        Raises:
            QuestionError: It is not a number.
        """
        self._timed = 0
        if self._refused:
            self._refused = {}
        if dt is not None:
            if isinstance(dt, float):
                self._places["dt"][0].fill(dt)
            else:
                self._take("dt", dt)
            self._timed = TIMED

    def _refuse(self, why: QuestionError) -> Command:
        """Brake because the input is not usable."""
        self.command.refusal, self._refused = str(why), {}
        return self._finish(REFUSED)

    def _finish(self, bits: int) -> Command:
        """Call the law, once the records hold all input, whose bits these are."""
        given = bits | self._timed
        if given != self._last_given:
            self._given[:] = self._last_given = given
            if not given & RATES:  # rates of an earlier step are not measurements any more
                self._worlds["state"]["qdot"] = math.nan
        if self._refused:
            self.command.refusal = "; ".join(dict.fromkeys(self._refused.values()))
            self._given[list(self._refused)], self._last_given = REFUSED | self._timed, -1
        if self._watchdog is not None:
            self._look_at_the_clock(self._watchdog)
        if not self._steps:
            self.warm_up()
        for call in self._steps:
            call()
        if self._shadow is not None:
            self._shadow.publish()
        return self.command

    # Watchdog -------------------------------------------------------------------------------------

    @property
    def watchdog(self) -> float | None:
        """Time after which a step is overdue [s]; None: steps may come at any time.

        A command holds for this time after its step. From then on, it is braked by one period for each period
        that passes: `command_at` returns the command to send meanwhile. The next step starts from there, and
        reports OVERDUE. No thread is started.

        Raises:
            QuestionError: The value is not a positive time.
        """
        return self._watchdog

    @watchdog.setter
    def watchdog(self, seconds: float | None) -> None:
        self._watchdog = _checked_time(seconds)
        self._watch()

    def _watch(self) -> None:
        is_watched = self._watchdog is not None
        self._shadow = _Shadow(self._worlds, self.joints, self._is_single) if is_watched else None

    def _periods_late(self, watchdog: float, gap: float) -> int:
        """Return the number of periods for which to brake a command of this age."""
        over = (gap - watchdog) / self.period - ON_TIME
        return min(MOST_LATE, math.ceil(over)) if over > 0.0 else 0  # NaN is not late

    def _look_at_the_clock(self, watchdog: float) -> None:
        """Have the law brake for the periods without a step."""
        now, input_ = self._clock(), self._worlds["input"]
        if late := self._periods_late(watchdog, now - input_["called"].item(0)):
            input_["late"] = late
        input_["called"] = now

    def command_at(self, time: float | None = None) -> Command:
        """Return the command to send at a time: the last command, or a braked one if a step is overdue.

        One other thread than that of `step` may call it, such as that of a driver that sends at a fixed rate.
        The law does not change.

        Args:
            time: Time by the clock of the controller [s]; None: now.

        Returns:
            Views that the next call overwrites.

        Raises:
            QuestionError: There is no watchdog.
        """
        shadow, watchdog = self._shadow, self._watchdog
        if shadow is None or watchdog is None:
            raise QuestionError(
                "command_at needs a watchdog: set it to the time after which a step is overdue"
            )
        called = shadow.read()
        now = self._clock() if time is None else time
        return shadow.braked(self._periods_late(watchdog, now - called))


class _Shadow:
    """A copy of the records as the last step left them, for another thread to read during a step.

    The bytes are copied in one operation, which Python's lock does not interrupt.
    """

    def __init__(self, worlds: NDArray[np.void], joints: Sequence[str], is_single: bool) -> None:
        self._worlds = worlds.copy()
        self._source, self._copy = _bytes(worlds), _bytes(self._worlds)
        self._published = memoryview(bytearray(self._source))
        self._steps = list[Callable[[], None]]()
        self.command = Command(self._worlds, joints, is_single)

    def publish(self) -> None:
        self._published[:] = self._source

    def read(self) -> float:
        self._copy[:] = self._published
        return float(self._worlds["input"]["called"].item(0))

    def braked(self, periods: int) -> Command:
        input_ = self._worlds["input"]
        if periods:
            self._steps = self._steps or _steps(self._worlds)
            input_["given"], input_["late"], input_["sites"] = REFUSED, periods, CHAIN_ALONE
            for call in self._steps:
                call()
            self._worlds["tick"]["status"] = OVERDUE | STOPPED
        return self.command


def _bytes(worlds: NDArray[np.void]) -> memoryview:
    return memoryview(cast(Any, worlds.view(np.uint8)))


def _steps(worlds: NDArray[np.void]) -> list[Callable[[], None]]:
    """Return calls that step each world, compiled or loaded now if necessary."""
    entry = step.entry(worlds["limits"]["rate"].shape[-1])
    return [partial(entry, worlds.ctypes.data + w * worlds.itemsize) for w in range(len(worlds))]


def _checked_time(seconds: float | None) -> float | None:
    if seconds is None:
        return None
    if not isinstance(seconds, Real) or not 0.0 < seconds < math.inf:
        raise QuestionError(f"watchdog must be > 0 and finite [s], or None, got {seconds}")
    return seconds


def started(q: ArrayLike, n: int, others: str = "") -> Array:
    """Return the initial joint positions, (n,) or (w, n).

    Args:
        q: The positions.
        n: Number of joints.
        others: All forms that the caller takes, in words.

    Raises:
        QuestionError: They have another shape, or are not finite or too large.
    """
    values = as_numbers("q", q)
    if values.ndim not in (1, 2) or values.shape[-1] != n or not values.size:
        raise QuestionError(f"q must be {others or f'({n},)'} or (w, {n}), got {values.shape}")
    if not (np.abs(values) <= LARGEST).all():
        raise QuestionError(f"q must be finite, within {LARGEST:g}, got {shortened(str(values.tolist()))}")
    return values


def as_numbers(name: str, values: Any) -> Array:
    """Return values of any array-like type as numbers.

    Raises:
        QuestionError: They are no real numbers.
    """
    if isinstance(values, np.ndarray) and values.dtype.char == "d":
        return values
    try:
        numbers = np.asarray(values)
        if numbers.dtype.kind != "c":
            return numbers.astype(np.float64)
    except Exception:  # any error of an object that is no array
        raise QuestionError(f"{name} must be numbers, got {type(values).__name__}") from None
    raise QuestionError(f"{name} must be real, got complex numbers")
