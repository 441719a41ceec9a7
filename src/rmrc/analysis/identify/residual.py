"""What a fit leaves: noise and resolution of encoders, jitter of stamps, and causes beside delay and lag.

These causes are a largest acceleration, a backlash, and two clocks that drift apart.
"""

from typing import NamedTuple

import numpy as np

from rmrc.analysis.identify.fit import LATEST, STAMP, STRETCHES, Fitted, fit
from rmrc.analysis.identify.response import Array, Commands, Samples

# A residual above this multiple of the noise has a cause; it is named if it leaves less than this share of
# the excess.
POOR, NAMED = 2.0, 0.25
# A cause is looked for in so many commands, or rows.
STRETCH = 4000


class Noise(NamedTuple):
    """Noise of the positions of a joint.

    Attributes:
        value: Standard deviation of the white noise of its encoder [rad or m].
        resolution: Step of its positions; 0: none is visible [rad or m].
        jitter: Standard deviation of the time at which they are read [s].
        total: Standard deviation of all these together, in the mean [rad or m].
    """

    value: float
    resolution: float
    jitter: float
    total: float


class Cause(NamedTuple):
    """What a joint has besides delay and lag.

    Attributes:
        name: `"limit"`, a largest acceleration; `"backlash"`; `"drift"`, of two clocks; `"unknown"`; or `""`.
        size: The acceleration [rad/s² or m/s²]; the width [rad or m]; the growth of the delay [s/s]; or 0.
    """

    name: str
    size: float = 0.0


def resolution(position: Array) -> float:
    """Return the step that divides all differences of positions; 0 if none is visible.

    Args:
        position: (N,) [rad or m].

    Example:
        >>> round(resolution(0.25 * np.arange(20) ** 2 % 7), 9)
        0.25
    """
    values = np.unique(position)
    steps = np.diff(values)
    steps = steps[steps > 1e-12 * max(float(np.abs(values).max()), 1e-6)]  # smaller ones are rounding
    if len(steps) < 4:
        return 0.0
    unit = float(steps.min())
    for units in (1.5, 5.0, 15.0, 50.0):  # a file with few digits rounds each step
        near = steps[steps < units * unit]
        whole = np.maximum(np.round(near / unit), 1.0)
        unit = float(near @ whole / (whole @ whole))
    agreement = abs(complex(np.exp(2j * np.pi * near / unit).mean()))
    return unit if len(near) >= 4 and agreement > 0.95 else 0.0


def noise_of(fitted: Fitted) -> Noise:
    """Return the noise of the positions of a fit.

    Second differences of the residual cancel smooth parts. Their mean square is 6 σ² + τ² (w₋² + 4 w² + w₊²)
    with the rates w and a jitter τ of the times.
    """
    step = resolution(fitted.samples.position)
    steps, squares = np.diff(fitted.samples.time), fitted.rate**2
    near = np.maximum(steps[1:], steps[:-1]) < 1.5 * np.median(steps)  # without gaps
    second = np.diff(fitted.residual, 2)[near] ** 2
    grown = (squares[:-2] + 4.0 * squares[1:-1] + squares[2:])[near]
    # a joint that moves by less than its resolution repeats its reading, whatever the noise
    pace = np.median(steps) * np.sqrt(grown / 6.0)
    moving = pace >= step if (pace >= step).sum() > 0.1 * len(pace) else pace >= 0.0
    columns = np.column_stack([np.full(moving.sum(), 6.0), grown[moving]])
    second, weight = second[moving], np.ones(moving.sum())
    for _ in range(8):
        scaled = columns * weight[:, None]
        square, jitter = np.linalg.lstsq(scaled.T @ columns, scaled.T @ second, rcond=None)[0]
        square, jitter = max(square, 0.0), max(jitter, 0.0)
        weight = 1.0 / np.maximum(columns @ (square, jitter), 1e-3 * second.mean() + 1e-300) ** 2
    if jitter * grown.mean() < 3.0 * square or jitter < (0.5 * STAMP) ** 2:
        square, jitter = float(second.mean()) / 6.0, 0.0
    rounding = step**2 / 12.0
    total = float(np.sqrt(max(square, rounding) + jitter * squares.mean()))
    return Noise(float(np.sqrt(max(square - rounding, 0.0))), step, float(np.sqrt(jitter)), total)


def explained(samples: Samples, plain: Fitted, noise: Noise) -> tuple[Fitted, Cause]:
    """Return the fit with what explains a residual above the noise, and its cause.

    Args:
        samples: Samples of the joint.
        plain: The fit of delay and lag.
        noise: Its noise.
    """
    part = _stretch(samples)
    sharpest = float(np.max(np.abs(np.diff(part.commands.rate)) / np.diff(part.commands.time)))
    growth = _drift(samples)
    corrected = samples._replace(time=samples.time - growth * (samples.time - np.mean(samples.time)))
    fits = {
        "limit": fit(part, "limit", [each / sharpest for each in (1.5, 5.0, 20.0)]),
        "backlash": fit(part, "backlash", [each * plain.rms for each in (2.0, 6.0)]),
        "drift": fit(corrected, "drift", [1e-6], LATEST),
    }
    name, fitted = min(fits.items(), key=lambda item: item[1].rms if item[1] else np.inf)
    if not fitted or fitted.rms**2 - noise.total**2 > NAMED * (plain.rms**2 - noise.total**2):
        return plain, Cause("unknown")
    sizes = {"limit": 1.0 / max(fitted.size, 1e-9), "backlash": fitted.size, "drift": growth + fitted.size}
    return fitted, Cause(name, sizes[name])


def _drift(samples: Samples) -> float:
    """Return the growth of the delay from stretch to stretch of a log [s/s]."""
    rows = np.array_split(np.arange(0, len(samples.time), -(-len(samples.time) // STRETCH)), STRETCHES)
    parts = [Samples(samples.commands, samples.time[part], samples.position[part]) for part in rows]
    fits = [each for part in parts if (each := fit(part, earliest=LATEST))]
    if len(fits) < 3:
        return 0.0
    times, totals = np.array([(np.mean(each.samples.time), each.total.value) for each in fits]).T
    first, second = np.triu_indices(len(fits), 1)
    return float(np.median((totals[second] - totals[first]) / (times[second] - times[first])))


def _stretch(samples: Samples) -> Samples:
    """Return the part of a long log in which the commands change most."""
    sent = samples.commands
    if len(sent.time) <= STRETCH:
        return samples
    changes = np.concatenate([[0.0], np.cumsum(np.diff(sent.rate, append=sent.rate[-1]) ** 2)])
    first = int(np.argmax(changes[STRETCH:] - changes[:-STRETCH]))
    commands = Commands(*(values[first : first + STRETCH] for values in (sent.time, sent.rate, sent.until)))
    rows = (samples.time >= commands.time[0]) & (samples.time <= commands.until[-1])
    return Samples(commands, samples.time[rows], samples.position[rows])
