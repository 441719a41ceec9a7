"""Delay, lag, noise and resolution of an arm, joint by joint, from a log of its commands and positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rmrc.analysis.identify.cause import POOR, explained
from rmrc.analysis.identify.fit import NO_LAG, STAMP, Fitted, Interval, Samples, fit, fit_lag
from rmrc.analysis.identify.log import Log, Source, read_log
from rmrc.analysis.identify.noise import Noise, noise_of, resolution
from rmrc.analysis.identify.verdict import observations, unfit, untold
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError

# Longer than the delay or lag of any known arm [s].
LONGEST = 0.5


@dataclass(frozen=True, eq=False)
class Joint:
    """The result for a joint.

    Attributes:
        name: Or number.
        fit: None without a possible fit.
        noise: Noise of its positions; None without a fit.
        trouble: Why delay and lag are not determined, and what to log instead; "" if they are.
        notes: Other observations about it.
    """

    name: str
    fit: Fitted | None
    noise: Noise | None
    trouble: str
    notes: tuple[str, ...] = ()


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
    notes, is_regular = list[str](), _is_regular(read, longest)
    if is_regular and read.clock.regular is not None:
        away = 1e3 * (read.time - read.clock.regular)
        notes.append(
            f"stamps jitter by {np.std(away):.2g} ms ({np.abs(away).max():.2g} ms at most), and the arm does "
            "not: rows are taken to be regular"
        )
    joints = tuple(_joint(name, read.samples(j, is_regular), longest) for j, name in enumerate(read.joints))
    jitters = [joint.noise.jitter for joint in joints if joint.noise and not joint.trouble]
    if any(jitters):
        jitter = 1e3 * float(np.median([each for each in jitters if each]))
        notes.append(
            f"stamps jitter by {jitter:.2g} ms, as the residual grows with the rate; the noise is without it"
        )
    fits = {joint.name: joint.fit for joint in joints if joint.fit is not None and not joint.trouble}
    if not fits:
        return Identified(read, joints, None, (), tuple(notes))
    if all(one.lag.low <= NO_LAG * read.period for one in fits.values()):
        # the data need no lag; the interval is the worse of the two
        delay, lags = _together([one.total for one in fits.values()]), dict.fromkeys(fits, 0.0)
    else:
        shown = [one.delay for one in fits.values() if one.delay.high >= 0.0]
        delay = _together(shown or [Interval(0.0, 0.0, 0.0)])
        lags = {name: fit_lag(one, max(delay.value, 0.0))[0] for name, one in fits.items()}
    apart = [
        f"{name} by {1e3 * (one.delay.value - delay.value):.2g} ms"
        for name, one in fits.items()
        if abs(one.delay.value - delay.value) > one.delay.half + read.period
    ]
    if apart:
        notes.append(f"one delay is written for all joints; their own delays differ: {', '.join(apart)}")
    middle = float(np.median(list(lags.values())))
    return Identified(
        read, joints, delay, tuple(lags.get(name, middle) for name in read.joints), tuple(notes)
    )


def _is_regular(log: Log, longest: float) -> bool:
    """Return whether regular times explain the positions of the quickest joint better than the stamps."""
    if log.clock.regular is None or np.std(log.time - log.clock.regular) < 1e-3 * log.period:
        return False
    each = []
    for is_regular in (False, True):
        samples = log.samples(int(np.argmax(np.std(np.nan_to_num(log.rates), axis=0))), is_regular)
        fitted = None if samples is None or not np.ptp(samples.commands.rate) else fit(samples, longest, 0.0)
        each.append(fitted.variance if fitted else np.inf)
    return each[1] < each[0]


def _joint(name: str, samples: Samples | None, longest: float) -> Joint:
    """Return the result for a joint."""
    trouble = unfit(samples)
    if trouble or samples is None:
        return Joint(name, None, None, trouble)
    step = resolution(samples.position)
    fitted, cause = fit(samples, longest, step), ""
    if fitted is None:
        lost = "too few of its rows respond to known commands: log 10 s or more, without losses"
        return Joint(name, None, None, lost)
    noise = noise_of(fitted, step)
    if fitted.rms > POOR * noise.total and fitted.rms > 1e-6 * np.ptp(samples.position):
        fitted, cause = explained(samples, fitted, noise, longest)
        noise = noise_of(fitted, step)
    trouble = untold(fitted, noise, cause, longest)
    return Joint(name, fitted, noise, trouble, () if trouble else tuple(observations(fitted, noise, cause)))


def _together(each: Sequence[Interval]) -> Interval:
    """Return the mean of intervals by their widths, wider where they contradict each other."""
    half = np.maximum([one.half for one in each], 1e-9)
    values = np.array([one.value for one in each])
    mean = float(np.sum(values / half**2) / np.sum(1.0 / half**2))
    excess = np.sum(((values - mean) / half) ** 2) / max(len(each) - 1, 1)
    spread = float(np.sqrt(max(excess, 1.0) / np.sum(1.0 / half**2)))
    spread = max(spread, STAMP)
    return Interval(mean, mean - spread, mean + spread)
