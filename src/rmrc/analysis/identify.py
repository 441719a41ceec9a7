"""Delay, lag, noise and resolution of an arm, joint by joint, from a log of its commands and positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rmrc.analysis.identify_fit import (
    LATEST,
    POOR,
    STAMP,
    Cause,
    Fitted,
    Interval,
    Noise,
    explained,
    fit,
    noise_of,
)
from rmrc.analysis.identify_log import Log, Source, read_log
from rmrc.analysis.identify_response import Samples
from rmrc.support.text import brief

# If a fit explains less of a joint's motion, the joint does not follow its commands.
EXPLAINED = 0.95
# Delay and lag are determined if their sum is known within a period, or this share of it.
SHARE = 0.1
# A gain that is off by more is reported; a weaker response counts as none; so does less motion per noise.
OFF, WEAK, MOVED = 0.02, 0.1, 20.0
# A lag below this share of a period is none.
NO_LAG = 0.02


class Joint(NamedTuple):
    """The result for a joint.

    Attributes:
        name: Or number.
        trouble: Why delay and lag are not determined, and what to log instead; "" if they are.
        notes: Other observations about it.
        fit: None without a possible fit.
        noise: Noise of its positions; None without a fit.
        cause: What it has besides delay and lag.
    """

    name: str
    trouble: str
    notes: tuple[str, ...] = ()
    fit: Fitted | None = None
    noise: Noise | None = None
    cause: Cause = Cause("")


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


def identify(log: Source, *, columns: Mapping[str, str] | None = None, degrees: bool = False) -> Identified:
    """Identify delay, lag and noise of an arm from a log; the function behind `rmrc identify`.

    Args:
        log: A CSV, Parquet or npz file with the columns t, q and qdot_cmd of each joint; a run; or arrays by
            name, (R,) or (R, n).
        columns: Names of columns in the log by t, q and qdot_cmd: a name, names with commas between them, or
            a name with `*` in place of the joint; a unit may follow, as in `{"t": "stamp ms"}`.
        degrees: Whether angles are in degrees where the names of columns give no unit. They are as well if
            positions exceed 15.

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
    read, notes = read_log(log, columns or {}, degrees), list[str]()
    is_regular = _is_regular(read)
    time = read.clock.regular if is_regular and read.clock.regular is not None else read.time
    joints = tuple(_joint(name, read.samples(j, time)) for j, name in enumerate(read.joints))
    sound = {joint.name: joint.fit for joint in joints if joint.fit and not joint.trouble}
    jitters = [joint.noise.jitter for joint in joints if joint.noise and joint.noise.jitter]
    if is_regular:
        away = 1e3 * (read.time - time)
        notes.append(f"stamps jitter by {np.std(away):.2g} ms, {np.abs(away).max():.2g} ms at most")
    elif jitters:
        notes.append(f"stamps jitter by {1e3 * np.median(jitters):.2g} ms; the encoders' noise is without it")
    if not sound:
        return Identified(read, joints, None, (), tuple(notes))
    is_lagged = any(each.lag.low > NO_LAG * read.clock.period for each in sound.values())
    delays = [each.delay if is_lagged else each.total for each in sound.values()]
    delay = _mean([each for each in delays if each.high >= 0.0] or [Interval(0.0, -STAMP, STAMP)])
    delay = Interval(*(max(bound, 0.0) for bound in delay))
    lags = {name: max(each.total.value - delay.value, 0.0) * is_lagged for name, each in sound.items()}
    middle = float(np.median(list(lags.values())))
    lag = tuple(lags.get(name, middle) for name in read.joints)
    return Identified(read, joints, delay, lag, tuple(notes))


def _is_regular(log: Log) -> bool:
    """Return whether regular times explain the positions of the quickest joint better than the stamps."""
    regular, quickest = log.clock.regular, int(np.argmax(np.nanstd(log.rates, axis=0)))
    if regular is None or np.std(log.time - regular) < 1e-3 * log.clock.period:
        return False
    samples = [log.samples(quickest, time) for time in (log.time, regular)]
    stamped, even = [fit(each) if each else None for each in samples]
    return bool(stamped and even and even.rms < stamped.rms)


def _joint(name: str, samples: Samples | None) -> Joint:
    """Return the result for a joint."""
    if samples is None:
        return Joint(name, "fewer than 30 rows have its position and command: log 10 s or more")
    sent, time, position = samples
    if not np.ptp(sent.rate):
        return Joint(name, f"its commanded rate is {sent.rate[0]:.4g} throughout: command starts and stops")
    moved, wanted = float(np.ptp(position)), float(np.ptp(sent.answer(time)[0]))
    if moved < WEAK * wanted:
        still = f"it moves {moved:.2g} where its commands ask for {wanted:.2g}"
        return Joint(name, f"{still}: switch its actuator on, move it off its stop, or check its columns")
    fitted, cause = fit(samples), Cause("")
    if fitted is None:
        return Joint(name, "too few of its rows respond to known commands: log 10 s or more, without losses")
    noise = noise_of(fitted)
    if fitted.rms > POOR * noise.total and fitted.rms > 1e-6 * moved:
        fitted, cause = explained(samples, fitted, noise)
        noise = noise_of(fitted)
    trouble = _trouble(fitted, noise, cause)
    return Joint(name, trouble, () if trouble else _notes(fitted, noise, cause), fitted, noise, cause)


def _trouble(fitted: Fitted, noise: Noise, cause: Cause) -> str:
    """Return why delay and lag of a joint are not determined, and what to log instead, or ""."""
    total, moved, span = fitted.total, np.ptp(fitted.samples.position), np.ptp(fitted.samples.time)
    period, floor = fitted.samples.commands.period, max(noise.value, noise.resolution, 1e-12)
    if cause.name == "drift":
        return (
            f"positions and commands drift apart by {1e3 * cause.size * span:.3g} ms over {span:.3g} s "
            f"({1e6 * cause.size:.3g} ppm): of two clocks, or paired by index with rows lost; stamp both by "
            "one clock"
        )
    if cause.name in ("limit", "backlash") and fitted.rms > POOR * noise.total:
        return f"it {_named(fitted, noise, cause)}"
    if fitted.explained < EXPLAINED and moved > MOVED * floor:
        return (
            f"the fit explains {100.0 * fitted.explained:.0f} % of its motion: something else moves or holds "
            f"it, or it responds later than {LATEST:g} s; log it alone, away from its limits, in rate mode"
        )
    if fitted.is_ahead or total.high < 0.0:
        return (
            f"it begins to respond {-1e3 * fitted.delay.value:.3g} ms before its commands: these are logged "
            f"later than commanded, or {_slow(period)}; stamp both by one clock, and log every command"
        )
    if total.half > max(period, SHARE * abs(total.value)) or fitted.explained < EXPLAINED:
        return (
            f"the sum of delay and lag is uncertain by {1e3 * total.half:.2g} ms: it moves {moved:.2g} with "
            f"a noise of {floor:.2g}; move it farther, with sharper starts and stops, or for longer"
        )
    return ""


def _notes(fitted: Fitted, noise: Noise, cause: Cause) -> tuple[str, ...]:
    """Return observations about a joint whose delay and lag are determined."""
    gain, lag, total, notes = fitted.gain, fitted.lag, fitted.total, list[str]()
    if abs(gain.value - 1.0) > OFF and not gain.low <= 1.0 <= gain.high:
        notes.append(
            f"does {gain.value:.4g} times its commanded rates: a scenario has no such gain; is a sign "
            "inverted, or one of the columns in degrees?"
        )
    if fitted.delay.high < 0.0 or (
        lag.low == 0.0 and lag.high > 0.1 * max(total.value, fitted.samples.commands.period)
    ):
        notes.append(
            f"delay and lag are hard to separate; their sum is {1e3 * total.value:.4g} ± "
            f"{1e3 * total.half:.2g} ms: sharper starts and stops would separate them"
        )
    return (*notes, *([_named(fitted, noise, cause)] if cause.name else []))


def _named(fitted: Fitted, noise: Noise, cause: Cause) -> str:
    """Return what a joint has besides delay and lag."""
    if cause.name == "backlash":
        return f"has a backlash of about {cause.size:.2g}: its positions lag behind at each reversal"
    if cause.name == "limit":
        return (
            f"limits its acceleration to about {cause.size:.3g}: large changes of the rate lag, small ones "
            "do not; log slower changes, and set control.limits.acceleration below it"
        )
    return (
        f"is {fitted.rms:.2g} rms off the fit, where its noise is {noise.total:.2g}: delay and lag do not "
        "explain all of its motion; resonance, friction, backlash or the actuator's own loop may, or "
        f"{_slow(fitted.samples.commands.period)}"
    )


def _slow(period: float) -> str:
    return f"the log is slower than the loop, which biases the delay by up to {-500.0 * period:.3g} ms"


def _mean(each: Sequence[Interval]) -> Interval:
    """Return the mean of intervals by their widths, wider where they contradict each other."""
    values, half = np.array([one.value for one in each]), np.array([one.half for one in each])
    mean, error = np.average(values, weights=half**-2), np.sum(half**-2) ** -0.5
    excess = np.sum(((values - mean) / half) ** 2) / max(len(each) - 1, 1)
    spread = max(error * np.sqrt(max(excess, 1.0)), STAMP)
    return Interval(float(mean), float(mean - spread), float(mean + spread))
