"""The keys of a scenario that stand for what was identified, to paste."""

from collections.abc import Sequence

import numpy as np

from rmrc.analysis.identify.identify import Identified

# Values of joints that differ by less than this share are written as one.
ALIKE = 0.02


def block(found: Identified) -> str:
    """Return `plant` and `arm.encoder` as YAML, "" where no joint tells its delay.

    Args:
        found: What `identify` found.
    """
    if found.delay is None:
        return ""
    names = found.log.joints
    told = [(one.noise.value, one.resolution) for one in found.joints if one.noise and not one.trouble]
    lacking = [joint.name for joint in found.joints if joint.trouble]
    low, high = (max(one, 0.0) for one in found.delay[1:])
    lines = [f"# From {found.log.name} by rmrc identify. Joints: {', '.join(names)}."]
    if lacking:
        lines.append(f"# Not told by the log, and taken from the others: {', '.join(lacking)}.")
    lines += [
        "# delay: of command and measurement together; a log does not tell them apart, a loop feels both.",
        "plant:",
        f"  delay: {_time(found.delay.value)}  # s; 95 %: {_time(low)} to {_time(high)}",
    ]
    if any(found.lag):
        lines.append(f"  lag: {_each([_time(lag) for lag in found.lag], found.lag)}  # s")
    middle = np.median(told, axis=0)
    each = [
        middle if one.trouble or one.noise is None else (one.noise.value, one.resolution)
        for one in found.joints
    ]
    noise, step = (list(map(float, values)) for values in zip(*each, strict=True))
    encoder = [
        f"    {key}: {_each([_small(one) for one in values], values)}  # rad, or m of slides"
        for key, values in (("noise", noise), ("resolution", step))
        if any(values)
    ]
    if encoder:
        lines += ["arm:", "  encoder:", *encoder]
    return "\n".join(lines) + "\n"


def _each(texts: Sequence[str], values: Sequence[float]) -> str:
    """Return one text for all values where they are alike, else a list."""
    if max(values) - min(values) <= ALIKE * max(values):
        return texts[int(np.argsort(values)[len(values) // 2])]
    return f"[{', '.join(texts)}]"


def _time(value: float) -> str:
    """Return seconds to a microsecond."""
    return f"{max(round(value, 6), 0.0):.6f}".rstrip("0").removesuffix(".") or "0"


def _small(value: float) -> str:
    """Return three digits as YAML reads a number: with a point."""
    return f"{value:.2e}" if value else "0.0"
