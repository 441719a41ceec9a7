"""Why a log does not determine delay and lag of a joint, what to log instead, and other observations."""

from collections.abc import Iterator

import numpy as np

from rmrc.analysis.identify.fit import EARLIEST, Fitted, Interval, Samples
from rmrc.analysis.identify.response import Array

# If a fit explains less of a joint's motion, the joint does not follow its commands.
EXPLAINED = 0.95
# Delay and lag are determined if their sum is known within a period, or this share of it.
SHARE = 0.1
# A gain that is off by more is reported; a weaker response counts as none.
OFF, WEAK = 0.02, 0.1
# A residual above this multiple of the noise is reported, and so is a motion above it.
POOR, MOVED = 3.0, 20.0
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
    if not np.ptp(samples.position):
        return f"it {_still(samples)}"
    return ""


def untold(fitted: Fitted, noise: Interval, step: float, period: float, longest: float) -> str:
    """Return why delay and lag of a joint are not determined, or "".

    Args:
        fitted: Its fit.
        noise: Noise of its positions.
        step: Their resolution.
        period: Period of its commands [s].
        longest: Largest delay of the search [s].
    """
    moved, total = float(np.ptp(fitted.samples.position)), fitted.total
    floor = max(noise.value, step, 1e-12)
    if abs(fitted.gain.value) < WEAK and np.ptp(fitted.samples.commands.travel) > MOVED * floor:
        return f"it {_still(fitted.samples)}"
    if fitted.explained < EXPLAINED and moved > MOVED * floor:
        return f"the fit explains {100 * fitted.explained:.0f} % of its motion: {_cause(fitted, floor)}"
    if not -EARLIEST < total.value < 2.0 * longest or fitted.best.delay >= longest - period:
        return f"it responds later than {longest:g} s, or not at all: give --longest, or check the columns"
    if total.half > max(period, SHARE * abs(total.value)) or fitted.explained < EXPLAINED:
        return (
            f"the sum of delay and lag is uncertain by {1e3 * total.half:.2g} ms: it moves {moved:.2g} with "
            f"a noise of {floor:.2g}; move it farther, with sharper starts and stops, or for longer"
        )
    return ""


def odd(fitted: Fitted, noise: Interval, step: float, period: float) -> Iterator[str]:
    """Yield observations about a joint whose delay and lag are determined."""
    gain, lag, total = fitted.gain, fitted.lag, fitted.total
    if gain.value < 0.0:
        yield "moves against its commands: the sign of one of the columns is inverted"
    for size, first, second in ((DEGREES, "positions", "commands"), (1.0 / DEGREES, "commands", "positions")):
        if abs(abs(gain.value) / size - 1.0) < 0.05:
            yield f"moves {gain.value:.4g} times its commands: {first} are in degrees and {second} are not?"
            break
    else:
        if abs(abs(gain.value) - 1.0) > OFF and not gain.low <= 1.0 <= gain.high:
            yield f"does {gain.value:.4g} times its commanded rates: a scenario has no such gain"
    if total.high < -period / 2.0:
        yield (
            f"responds {-1e3 * total.value:.3g} ms before its commands: stamp position and command "
            "by one clock; a delay of 0 is written"
        )
    elif lag.low == 0.0 and lag.high > 0.1 * abs(total.value) and lag.high > 0.1 * period:
        yield (
            f"delay and lag are hard to separate; their sum is {1e3 * total.value:.4g} ± "
            f"{1e3 * total.half:.2g} ms: sharper starts and stops would separate them"
        )
    rms = float(np.sqrt(np.mean(fitted.residual**2)))
    floor = float(np.hypot(noise.value, step / np.sqrt(12.0)))
    if rms > POOR * floor and rms > 1e-6 * np.ptp(fitted.samples.position):
        yield (
            f"is {rms:.2g} rms off the fit, where its noise is {floor:.2g}: delay and lag do not explain "
            "all of its motion; resonance, friction or the actuator's own loop may"
        )
    if fitted.outliers:
        yield f"{fitted.outliers:,} isolated outliers of the position ignored"


def _still(samples: Samples) -> str:
    asked = float(np.ptp(samples.commands.travel))
    return (
        f"moves {np.ptp(samples.position):.2g} where its commands ask for {asked:.2g}: switch its actuator "
        "on, move it off its stop, or check its columns"
    )


def _cause(fitted: Fitted, floor: float) -> str:
    """Return why a joint does not follow, if the cause is visible."""
    found = fitted.samples
    asked, _ = found.commands.lagged(fitted.best.lag).at(found.time - fitted.best.delay)
    first, last = _longest_stand(found.position, 4.0 * floor)
    way = float(np.ptp(asked[first : last + 1]))
    if way > MOVED * floor and way > 0.02 * np.ptp(found.position):
        return (
            f"it stands at {found.position[first]:.4g} from {found.time[first]:.4g} s to "
            f"{found.time[last]:.4g} s while commanded on by {way:.2g}; log it away from that limit"
        )
    return "something else moves or holds it; log it alone, away from its limits, in rate mode"


def _longest_stand(position: Array, room: float) -> tuple[int, int]:
    """Return the first and last row of the longest stretch within a range."""
    best, first, low, high = (0, 0), 0, position[0], position[0]
    for i, value in enumerate(position.tolist()):
        low, high = min(low, value), max(high, value)
        if high - low > room:
            first, low, high = i, value, value
        if i - first > best[1] - best[0]:
            best = first, i
    return best
