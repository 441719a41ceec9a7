"""Why a log does not determine delay and lag of a joint, what to log instead, and other observations."""

import numpy as np

from rmrc.analysis.identify.cause import POOR
from rmrc.analysis.identify.fit import Fitted, Samples, fit_lag
from rmrc.analysis.identify.noise import Noise

# If a fit explains less of a joint's motion, the joint does not follow its commands.
EXPLAINED = 0.95
# Delay and lag are determined if their sum is known within a period, or this share of it.
SHARE = 0.1
# A gain that is off by more is reported; a weaker response counts as none; so does less motion per noise.
OFF, WEAK, MOVED = 0.02, 0.1, 20.0
# A lag without a delay explains the positions as well if its variance is this multiple.
NEAR = 1.1
# 180/pi, to 5 %: one of the columns is in degrees.
DEGREES = 57.3


def unfit(samples: Samples | None) -> str:
    """Return why the log of a joint cannot be fitted, or ""."""
    if samples is None:
        return "fewer than 30 rows have its position and command: log 10 s or more"
    rate = samples.commands.rate
    if not np.ptp(rate):
        driven = "gets no commands" if not rate[0] else f"moves at {rate[0]:.4g} throughout"
        return f"it {driven}: command starts and stops"
    return "" if np.ptp(samples.position) else _still(samples)


def untold(fitted: Fitted, noise: Noise, cause: str, longest: float) -> str:  # noqa: PLR0911
    """Return why delay and lag of a joint are not determined, or ""."""
    sent, time, position = fitted.samples
    total, delay, moved = fitted.total, fitted.delay, float(np.ptp(position))
    floor = max(noise.value.value, noise.resolution, 1e-12)
    if abs(fitted.gain.value) < WEAK and np.ptp(sent.response(0.0).travel) > MOVED * floor:
        return _still(fitted.samples)
    if total.value >= 2.0 * longest or delay.value >= longest - sent.period:
        return f"it responds later than {longest:g} s, or not at all: give --longest, or check the columns"
    if cause == "drift":
        growth, span = fitted.cause.drift, float(np.ptp(time))
        return (
            f"positions and commands drift apart by {1e3 * growth * span:.3g} ms over {span:.3g} s "
            f"({1e6 * growth:.3g} ppm): of two clocks, or paired by index with rows lost; stamp both "
            "by one clock"
        )
    if cause in ("limit", "backlash") and fitted.rms > POOR * noise.total:
        return f"it {_named(fitted, cause)}"
    if fitted.explained < EXPLAINED and moved > MOVED * floor:
        return f"the fit explains {100 * fitted.explained:.0f} % of its motion: {_hindrance(fitted, floor)}"
    if total.high < 0.0 or (delay.high < 0.0 and fit_lag(fitted, 0.0)[1] > NEAR * fitted.variance):
        return (
            f"it begins to respond {-1e3 * delay.value:.3g} ms before its commands: these are logged later "
            f"than commanded, or {_between(sent.period)}; stamp both by one clock, and log every command"
        )
    if total.half > max(sent.period, SHARE * abs(total.value)) or fitted.explained < EXPLAINED:
        return (
            f"the sum of delay and lag is uncertain by {1e3 * total.half:.2g} ms: it moves {moved:.2g} with "
            f"a noise of {floor:.2g}; move it farther, with sharper starts and stops, or for longer"
        )
    return ""


def observations(fitted: Fitted, noise: Noise, cause: str) -> list[str]:
    """Return observations about a joint whose delay and lag are determined."""
    gain, lag, total, notes = fitted.gain, fitted.lag, fitted.total, list[str]()
    period, size = fitted.samples.commands.period, abs(gain.value)
    if gain.value < 0.0:
        notes.append("moves against its commands: the sign of one of the columns is inverted")
    if min(abs(size / DEGREES - 1.0), abs(size * DEGREES - 1.0)) < 0.05:
        first, second = ("positions", "commands") if size > 1.0 else ("commands", "positions")
        notes.append(
            f"moves {gain.value:.4g} times its commands: {first} are in degrees and {second} are not?"
        )
    elif abs(size - 1.0) > OFF and not gain.low <= 1.0 <= gain.high:
        notes.append(f"does {gain.value:.4g} times its commanded rates: a scenario has no such gain")
    if fitted.delay.high < 0.0 or (lag.low == 0.0 and lag.high > 0.1 * max(abs(total.value), period)):
        notes.append(
            f"delay and lag are hard to separate; their sum is {1e3 * total.value:.4g} ± "
            f"{1e3 * total.half:.2g} ms: sharper starts and stops would separate them"
        )
    if cause == "unknown":
        notes.append(
            f"is {fitted.rms:.2g} rms off the fit, where its noise is {noise.total:.2g}: delay and lag do "
            "not explain all of its motion; resonance, friction, backlash or the actuator's own loop may, or "
            f"{_between(period)}"
        )
    elif cause:
        notes.append(_named(fitted, cause))
    if fitted.outliers:
        notes.append(f"{fitted.outliers:,} isolated outliers of the position ignored")
    return notes


def _between(period: float) -> str:
    return f"the log is slower than the loop, which biases the delay by up to {-500.0 * period:.3g} ms"


def _named(fitted: Fitted, cause: str) -> str:
    """Return what a joint has besides delay and lag."""
    if cause == "backlash":
        return f"has a backlash of about {abs(fitted.play):.2g}: its positions lag behind at each reversal"
    return (
        f"limits its acceleration to about {1.0 / fitted.cause.limit:.3g}: large changes of the rate lag, "
        "small ones do not; log slower changes, and set control.limits.acceleration below it"
    )


def _still(samples: Samples) -> str:
    return (
        f"it moves {np.ptp(samples.position):.2g} where its commands ask for "
        f"{np.ptp(samples.commands.response(0.0).travel):.2g}: switch its actuator on, move it off its stop, "
        "or check its columns"
    )


def _hindrance(fitted: Fitted, floor: float) -> str:
    """Return why a joint does not follow, if that is visible."""
    sent, time, position = fitted.samples
    asked = sent.response(fitted.lag.value).at(time - fitted.delay.value)[0]
    moves = np.flatnonzero(np.abs(np.diff(position)) > 4.0 * floor)
    edges = np.concatenate([[-1], moves, [len(position) - 1]])
    i = int(np.argmax(np.diff(edges)))
    first, last = int(edges[i]) + 1, int(edges[i + 1])
    way = float(np.ptp(asked[first : last + 1]))
    if way > MOVED * floor and way > 0.02 * np.ptp(position):
        return (
            f"it stands at {position[first]:.4g} from {time[first]:.4g} s to {time[last]:.4g} s while "
            f"commanded on by {way:.2g}; log it away from that limit"
        )
    return "something else moves or holds it; log it alone, away from its limits, in rate mode"
