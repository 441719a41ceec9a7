"""The identified delay, lag and noise as keys of a scenario, to paste."""

from collections.abc import Callable, Iterable
from textwrap import wrap

import numpy as np

from rmrc.analysis.identify.identify import Identified
from rmrc.support.legible import visible

# Values of joints that differ by less than this share are written as one: the accuracy of logs of 10 s.
ALIKE = 0.05
# Lines fit a terminal with this many columns.
WIDTH = 60


def block(found: Identified) -> str:
    """Return `plant` and `arm.encoder` as YAML, "" where no joint determines its delay.

    Args:
        found: The result of `identify`.
    """
    if found.delay is None:
        return ""
    names = found.log.joints
    told = [(one.noise.value, one.resolution) for one in found.joints if one.noise and not one.trouble]
    lacking = [joint.name for joint in found.joints if joint.trouble]
    low, high = (max(one, 0.0) for one in found.delay[1:])
    texts = [f"From {found.log.name} by rmrc identify, in SI units. Joints: {', '.join(names)}."]
    if lacking:
        texts.append(f"Not identified from the log, and taken from the others: {', '.join(lacking)}.")
    texts.append(
        "The delay is the sum of command and measurement delay: a log cannot separate them, and only "
        f"their sum affects a loop. With 95 % it is from {_time(low)} to {_time(high)} s."
    )
    values = np.array([
        np.median(told, axis=0) if one.trouble or one.noise is None else (one.noise.value, one.resolution)
        for one in found.joints
    ])  # fmt: skip
    lines = [one for text in texts for one in wrap(f"# {visible(text)}", WIDTH, subsequent_indent="# ")]
    lines += ["plant:", f"  delay: {_time(found.delay.value)}"]
    lines += _key("  lag", found.lag, _time)
    encoder = [*_key("    noise", values[:, 0], _small), *_key("    resolution", values[:, 1], _small)]
    if encoder:
        lines += ["arm:", "  encoder:", *encoder]
    return "\n".join(lines) + "\n"


def _key(name: str, values: Iterable[float], text: Callable[[float], str]) -> list[str]:
    """Return the lines of a key: one value if the joints' are alike, no line if all are 0."""
    each = sorted(values := [float(one) for one in values])
    if not each[-1]:
        return []
    if each[-1] - each[0] <= ALIKE * each[-1]:
        return [f"{name}: {text(each[len(each) // 2])}"]
    indent = " " * (len(name) - len(name.lstrip()) + 2)
    return wrap(f"{name}: [{', '.join(map(text, values))}]", WIDTH, subsequent_indent=indent)


def _time(value: float) -> str:
    """Return seconds to a microsecond."""
    return f"{max(round(value, 6), 0.0):.6f}".rstrip("0").removesuffix(".") or "0"


def _small(value: float) -> str:
    """Return three digits as a number in YAML: with a decimal point."""
    return f"{value:.2e}" if value else "0.0"
