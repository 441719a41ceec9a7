"""The common part of `Controller` and `Law`: records of worlds, one compiled call per period, a watchdog."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.law.command import Command
from rmrc.law.jit import Array, machine_code
from rmrc.law.record import MEMORY, Writer, records, tick_type
from rmrc.law.step import OVERDUE, STOPPED, Given, step
from rmrc.support.errors import QuestionError

RATES, REFUSED = int(Given.RATES), int(Given.REFUSED)
# The most periods that are braked when no step came in time: any arm is at rest by then.
MOST_LATE = 1_000_000
# The part of a period by which clocks may differ.
ON_TIME = 1e-6
# Placeholders for MuJoCo's data where nothing reads them.
NOTHING = np.zeros((1, 3)), np.zeros((1, 4)), np.zeros((1, 3)), np.zeros((1, 3))


class Loop:
    """A law that Python steps, for one world or a batch of worlds.

    Attributes:
        joints: Names of the n joints.
        period: Time from one step to the next [s].
        command: Result of the last step; the next one overwrites it.
    """

    command: Command

    def __init__(self, joints: Sequence[str], rows: int, period: float, clock: Callable[[], float]) -> None:
        """Keep the constants: names, rows of the given twist, the period."""
        self._rows = rows
        self.joints, self.period, self._clock = tuple(joints), period, clock
        self._watchdog: float | None = None
        self._shadow: _Shadow | None = None

    # Records --------------------------------------------------------------------------------------

    def _renew(self, writers: Sequence[Sequence[Writer]], axes: int, is_one: bool) -> None:
        """Make the records of worlds anew, and the views through which steps write."""
        n = len(self.joints)
        self._worlds = worlds = records(n, *writers, axes=axes)
        self._ticks = ticks = np.zeros(len(worlds), tick_type(n))
        worlds["called"] = math.nan
        self._is_one, self._given = is_one, 0
        self._codes, self._late, self._called = worlds["given"], worlds["late"], worlds["called"]
        self.command = Command(worlds, ticks, self.joints, is_one)
        self._put = {
            name: _entrance(values[:, :size], is_one)
            for name, values, size in (
                ("q", worlds["q"], n), ("qdot", worlds["qdot"], n), ("q_target", worlds["q_target"], n),
                ("qdot_target", worlds["qdot_target"], n), ("pose", ticks["pose_ref"], 7),
                ("vector", worlds["given_vector"], 6), ("twist", ticks["twist_ref"], self._rows),
            )
        } | {"matrix": _Rows(worlds["given_matrix"])}  # fmt: skip
        self._q, self._qdot, self._twist = self._put["q"], self._put["qdot"], self._put["twist"]
        self._matrix = self._put["matrix"]
        self._watch()
        self._point_at(NOTHING)

    def _point_at(self, *places: tuple[Array, ...]) -> None:
        """Have steps read these fields of MuJoCo's data: one set for all worlds, or one for each."""
        self._places = places
        self._act: Callable[[], None] = self._load_and_act

    def _load_and_act(self) -> None:
        self.warm_up()
        self._act()

    def warm_up(self) -> None:
        """Compile the law (seconds) or load its machine code (tenths), before the first step does."""
        calls, each = [], len(self._places) > 1
        for w, arrays in enumerate(self._places):
            which = slice(w, w + 1) if each else slice(None)
            arguments: Any = (self._worlds[which], self._ticks[which], *arrays)
            calls.append(partial(machine_code(step, *arguments), *arguments))
        self._act = partial(_act_in_turn, calls) if each else calls[0]

    def _forget(self) -> None:
        for field in MEMORY:
            self._worlds[field.name] = field.start
        self._worlds["q_cmd"], self._worlds["returning"], self._called[:] = math.nan, 0.0, math.nan

    # Steps ----------------------------------------------------------------------------------------

    def _finish(self, given: int) -> Command:
        """Call the law, once the records hold all input."""
        if given != self._given:
            self._codes[:] = self._given = given
            if not given & RATES:  # rates of an earlier step are not measurements any more
                self._worlds["qdot"] = math.nan
        late = self._watchdog is not None and self._look_at_the_clock()
        self._act()
        if late:
            self._ticks["status"] |= OVERDUE
        if self._shadow is not None:
            self._shadow.publish()
        return self.command

    def _refuse(self, given: str) -> Command:
        """Brake because the input is not usable; the text says why."""
        self.command.refusal = given
        return self._finish(REFUSED)

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
        if seconds is not None and not 0.0 < seconds < math.inf:
            raise QuestionError(f"watchdog must be > 0 and finite [s], or None, got {seconds}")
        self._watchdog = seconds
        self._watch()

    def _watch(self) -> None:
        self._shadow = (
            None if self._watchdog is None else _Shadow(self._worlds, self._ticks, self.joints, self._is_one)
        )

    def _periods_late(self, gap: float) -> int:
        """Return the number of periods for which to brake a command of this age."""
        assert self._watchdog is not None
        over = (gap - self._watchdog) / self.period - ON_TIME
        return min(MOST_LATE, math.ceil(over)) if over > 0.0 else 0  # NaN is not late

    def _look_at_the_clock(self) -> bool:
        """Have the law brake for the periods without a step; return whether this step is overdue."""
        now = self._clock()
        late = self._periods_late(now - self._called.item(0))
        if late > 1:
            self._late[:] = late - 1  # the last of them belongs to this step
        self._called[:] = now
        return late > 0

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
        shadow = self._shadow
        if shadow is None:
            raise QuestionError(
                "command_at needs a watchdog: set it to the time after which a step is overdue"
            )
        called = shadow.read()
        now = self._clock() if time is None else time
        return shadow.braked(self._periods_late(now - called))


class _Shadow:
    """A copy of the records as the last step left them, for other threads to read during a step.

    The bytes are copied in one operation, which Python's lock does not interrupt.
    """

    def __init__(
        self, worlds: NDArray[np.void], ticks: NDArray[np.void], joints: Sequence[str], is_one: bool
    ) -> None:
        published = worlds.copy(), ticks.copy()
        self._own = worlds.copy(), ticks.copy()
        self._from, self._to, self._last = _bytes(worlds, ticks), _bytes(*published), _bytes(*self._own)
        self.command = Command(*self._own, joints, is_one)
        self._act: Callable[[], None] | None = None

    def publish(self) -> None:
        for to, source in zip(self._to, self._from, strict=True):
            to[:] = source

    def read(self) -> float:
        for to, source in zip(self._last, self._to, strict=True):
            to[:] = source
        return float(self._own[0]["called"].item(0))

    def braked(self, periods: int) -> Command:
        worlds, ticks = self._own
        if periods:
            if self._act is None:
                arguments: Any = (*self._own, *NOTHING)
                self._act = partial(machine_code(step, *arguments), *arguments)
            worlds["given"], worlds["late"] = REFUSED, periods - 1
            self._act()
            ticks["status"] = OVERDUE | STOPPED
        return self.command


def _bytes(*records: Any) -> list[memoryview]:
    return [memoryview(one.view(np.uint8)) for one in records]


def _act_in_turn(calls: Sequence[Callable[[], None]]) -> None:
    for call in calls:
        call()


class _Rows:
    """Takes the values of all worlds, (w, size), or values that all worlds share, (size,)."""

    def __init__(self, values: Array) -> None:
        self._values, self._shapes = values, (values.shape, values.shape[1:])

    def __setitem__(self, all_of_it: slice, given: NDArray[Any]) -> None:
        if given.shape not in self._shapes or given.dtype.kind == "c":
            raise ValueError
        self._values[...] = given


def _entrance(values: Array, is_one: bool) -> Any:
    """Return a target that takes all values of a row by `[:] =` and refuses other shapes.

    For one world it is a memoryview, which takes a third of the time of an array and only 64-bit numbers.
    """
    return memoryview(values[0]) if is_one else _Rows(values)


def taken(name: str, given: ArrayLike, entrance: Any, shapes: Sequence[tuple[int, ...]]) -> str:
    """Write values of any array-like type where a step reads them; return why that fails, or "".

    Args:
        name: Name of the argument.
        given: Its values.
        entrance: Their target.
        shapes: Shapes that it may have.
    """
    try:
        values = np.asarray(given)
        if values.dtype.kind == "c":
            return f"{name} must be real, got complex numbers"
        values = values.astype(np.float64)
    except Exception:  # any error of an object that is no array
        return f"{name} must be numbers, got {type(given).__name__}"
    if values.shape not in shapes:
        return f"{name} must be {' or '.join(map(str, shapes))}, got {values.shape}"
    entrance[:] = np.ascontiguousarray(values)
    return ""
