"""What else explains the positions of a joint: a largest acceleration, a backlash, or two clocks."""

import numpy as np

from rmrc.analysis.identify.fit import Cause, Fitted, Samples, fit
from rmrc.analysis.identify.noise import Noise
from rmrc.analysis.identify.response import Commands

# A residual above this multiple of the noise has a cause.
POOR = 2.0
# It is named if it leaves less than this share of the excess; it is looked for in so many rows.
NAMED, STRETCH = 0.25, 4000


def explained(samples: Samples, plain: Fitted, noise: Noise, longest: float) -> tuple[Fitted, str]:
    """Return the fit with what explains a residual above the noise, and its name, or "unknown"."""
    part, step = _stretch(samples), noise.resolution
    every, start = -(-len(samples.time) // STRETCH), (plain.delay.value, plain.lag.value)
    thin = Samples(samples.commands, samples.time[::every], samples.position[::every])
    top = float(np.max(np.abs(np.diff(part.commands.rate)) / np.diff(part.commands.time)))
    fits = {
        "limit": fit(part, longest, step, Cause(limit=1.0 / top)),
        "drift": fit(thin, longest, step, Cause(drift=1e-6)),
        "backlash": fit(part, longest, step, Cause(play=1e-9), start),
    }
    for _ in range(3):  # its width is fitted, and then known
        if (loose := fits["backlash"]) is not None:
            start = loose.delay.value, loose.lag.value
            fits["backlash"] = fit(part, longest, step, Cause(play=abs(loose.play) + 1e-9), start)
    excess = {name: each.variance - noise.total**2 for name, each in fits.items() if each is not None}
    name = min(excess, key=lambda name: excess[name], default="unknown")
    fitted = fits.get(name)
    if fitted is None or excess[name] > NAMED * (plain.variance - noise.total**2):
        return plain, "unknown"
    return fitted, name


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
