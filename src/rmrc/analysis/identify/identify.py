"""Delay, lag, noise and resolution of an arm, joint by joint, from a log of its commands and positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rmrc.analysis.identify.fit import Fitted, Interval, Samples, fit, fit_lag
from rmrc.analysis.identify.log import Log, Source, read_log
from rmrc.analysis.identify.noise import resolution, white_noise
from rmrc.analysis.identify.verdict import odd, unfit, untold
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError

# Longer than the delay or lag of any known arm [s].
LONGEST = 0.5
# A lag below this many periods is none.
NONE = 0.02


@dataclass(frozen=True, eq=False)
class Joint:
    """The result for a joint.

    Attributes:
        name: Or number.
        fit: None without a possible fit.
        noise: Standard deviation of its positions' white noise; None without a fit [rad or m].
        resolution: Resolution of its positions; 0: none is visible [rad or m].
        trouble: Why delay and lag are not determined, and what to log instead; "" if they are.
        notes: Other observations about it.
    """

    name: str
    fit: Fitted | None
    noise: Interval | None
    resolution: float
    trouble: str
    notes: tuple[str, ...]


@brief
@dataclass(frozen=True, eq=False)
class Identified:
    """The result of `identify`.

    Attributes:
        log: As it was read.
        joints: One for each joint of the log.
        delay: Common delay of all joints; None if no joint determines it [s].
        lag: Lag of each joint with that delay; for an undetermined one the median of the others, (n,) [s].
        notes: Other observations about the log as a whole.
    """

    log: Log
    joints: tuple[Joint, ...]
    delay: Interval | None
    lag: tuple[float, ...]
    notes: tuple[str, ...]

    @property
    def is_told(self) -> bool:
        """Whether any joint determines delay and lag."""
        return self.delay is not None


def identify(
    log: Source,
    *,
    columns: Mapping[str, str] | None = None,
    degrees: bool = False,
    longest: float = LONGEST,
) -> Identified:
    """Identify delay, lag and noise of an arm from a log; the function behind `rmrc identify`.

    Args:
        log: A CSV, Parquet or npz file with the columns t, q and qdot_cmd of each joint; a run; or arrays by
            name, (R,) or (R, n).
        columns: Names of columns in the log by t, q and qdot_cmd: a name, names with commas between them, or
            a name with `*` in place of the joint; a unit may follow, as in `{"t": "stamp ms"}`.
        degrees: Whether angles are in degrees where the names of columns give no unit.
        longest: Largest delay, and largest lag, of the search [s].

    Returns: The estimates. A joint without an estimate is no error: it says why, and what to log.

    Raises:
        QuestionError: It is no log, or lacks columns or rows.
        OSError: It cannot be read.

    Example:
        >>> t = np.arange(0.0, 10.0, 0.01)
        >>> rate = np.sign(np.sin(2.0 * t))
        >>> travel = 0.01 * np.concatenate([[0.0], np.cumsum(rate)[:-1]])
        >>> found = identify({"t": t, "q": np.interp(t - 0.03, t, travel), "qdot_cmd": rate})
        >>> round(found.delay.value, 4), found.lag
        (0.03, (0.0,))
    """
    if not 0.0 < longest <= 10.0:
        raise QuestionError(f"longest must be above 0 and at most 10 s, got {longest:g}")
    read = read_log(log, columns or {}, degrees)
    joints = tuple(
        _joint(name, samples, read.period, longest)
        for name, samples in zip(read.joints, read.samples, strict=True)
    )
    told = {joint.name: joint.fit for joint in joints if joint.fit is not None and not joint.trouble}
    if not told:
        return Identified(read, joints, None, (), ())
    if all(
        one.lag.low <= NONE * read.period for one in told.values()
    ):  # the data need no lag; the interval is the worse of the two
        delay, lags = _together([one.total for one in told.values()]), dict.fromkeys(told, 0.0)
    else:
        delay = _together([one.delay for one in told.values()])
        lags = {name: fit_lag(one, max(delay.value, 0.0), longest) for name, one in told.items()}
    middle = float(np.median(list(lags.values())))
    apart = [
        f"{name} by {1e3 * (one.delay.value - delay.value):.2g} ms"
        for name, one in told.items()
        if abs(one.delay.value - delay.value) > one.delay.half + read.period
    ]
    notes = (
        (f"one delay is written for all joints; their own delays differ: {', '.join(apart)}",)
        if apart
        else ()
    )
    return Identified(read, joints, delay, tuple(lags.get(name, middle) for name in read.joints), notes)


def _joint(name: str, samples: Samples | None, period: float, longest: float) -> Joint:
    """Return the result for a joint."""
    trouble = unfit(samples)
    if trouble or samples is None:
        return Joint(name, None, None, 0.0, trouble, ())
    step = resolution(samples.position)
    found = fit(samples, longest, step)
    if found is None:
        return Joint(name, None, None, step, "its log is shorter than its response: log 10 s or more", ())
    noise = white_noise(found.residual, step)
    trouble = untold(found, noise, step, period, longest)
    return Joint(name, found, noise, step, trouble, () if trouble else tuple(odd(found, noise, step, period)))


def _together(each: Sequence[Interval]) -> Interval:
    """Return the mean of intervals by their widths, wider where they contradict each other."""
    half = np.maximum([one.half for one in each], 1e-9)
    values = np.array([one.value for one in each])
    mean = float(np.sum(values / half**2) / np.sum(1.0 / half**2))
    excess = np.sum(((values - mean) / half) ** 2) / max(len(each) - 1, 1)
    spread = float(np.sqrt(max(excess, 1.0) / np.sum(1.0 / half**2)))
    return Interval(mean, mean - spread, mean + spread)
