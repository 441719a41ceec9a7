"""The result of a log: a table, JSON, a picture, and the block of a scenario to paste."""

from collections.abc import Callable, Sequence
from functools import partial
from textwrap import wrap
from typing import Any

import numpy as np

from rmrc.analysis.identify.identify import Identified, Joint
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.support.legible import visible

# Values of joints that differ by less than this share are written as one: the accuracy of logs of 10 s.
ALIKE = 0.05
# Lines of the block fit a terminal with this many columns.
WIDTH = 60
TIMES = ("delay", "lag", "total")


def report(answer: Identified) -> Report:
    """Return the report of a log; its condition is met if a joint determines its delay.

    Args:
        answer: The result of `identify`.
    """
    from rmrc.analysis.identify.figure import draw_fits

    log, values = answer.log, _values(answer)
    notes = [f"{one.name}: {text}" for one in answer.joints for text in (one.trouble, *one.notes) if text]
    problem = f"{log.name}: the log identifies no joint's delay; the table says what to log instead"
    sheets = [
        Sheet(log.name, ("", ""), list(values["facts"].items()), frozenset({0, 1})),
        Sheet(
            "Delay and lag in ms, with 95 %; noise and resolution in rad or m",
            ("joint", "delay", "±", "lag", "±", "both", "±", "gain", "noise", "resolution"),
            [_row(joint) for joint in values["joints"]],
            notes=(*notes, *answer.notes),
        ),
    ]
    draw = partial(draw_fits, answer) if any(joint.fit for joint in answer.joints) else None
    return Report(
        sheets, plain(values), draw, answer.is_told, "" if answer.is_told else problem, block(answer)
    )


def _values(answer: Identified) -> dict[str, Any]:
    """Return the result as JSON has it."""
    log = answer.log
    facts = {
        "duration": f"{log.duration:.4g} s, {len(log.joints)} joints, a command every "
        f"{1e3 * log.period:.4g} ms; if the loop is faster than the log, delays are up to "
        f"{500.0 * log.period:.3g} ms longer than below"
    }
    return {
        "log": log.name, "duration": log.duration, "period": log.period, "facts": {**facts, **log.facts},
        "told": answer.is_told, "delay": answer.delay and answer.delay._asdict(), "lag": answer.lag,
        "joints": [_joint(joint) for joint in answer.joints], "notes": answer.notes,
        "block": block(answer) or None,
    }  # fmt: skip


def _joint(joint: Joint) -> dict[str, Any]:
    """Return the values of a joint; without delay, lag and gain where these are not determined."""
    values: dict[str, Any] = {"name": joint.name, "trouble": joint.trouble or None, "notes": joint.notes}
    if joint.fit is None or joint.noise is None:
        return values
    values |= {
        "noise": joint.noise.value._asdict(), "resolution": joint.noise.resolution or None,
        "jitter": joint.noise.jitter, "explained": joint.fit.explained, "rows": len(joint.fit.residual),
        "outliers": joint.fit.outliers,
    }  # fmt: skip
    if not joint.trouble:
        names = TIMES if joint.fit.delay.high >= 0.0 else ("total",)
        values |= {name: getattr(joint.fit, name)._asdict() for name in (*names, "gain", "drift")}
    return values


def _row(joint: dict[str, Any]) -> tuple[str, ...]:
    """Return the cells of a joint in the table."""
    cells = [joint["name"]]
    for name in TIMES:
        each = joint.get(name)
        half = each and 500.0 * (each["high"] - each["low"])
        cells += [f"{1e3 * each['value']:.3f}", f"{half:.3f}"] if each else [UNDEFINED] * 2
    for each in (joint.get("gain"), joint.get("noise")):
        cells.append(number(each["value"]) if each else UNDEFINED)
    return (*cells, number(joint["resolution"]) if joint.get("resolution") else UNDEFINED)


def block(answer: Identified) -> str:
    """Return `plant` and `arm.encoder` as YAML, "" where no joint determines its delay.

    Args:
        answer: The result of `identify`.
    """
    if answer.delay is None:
        return ""
    each = [None if one.trouble or not one.noise else (one.noise.value.value, one.noise.resolution)
            for one in answer.joints]  # fmt: skip
    middle = np.median([pair for pair in each if pair], axis=0)
    noise, resolution = np.array([middle if pair is None else pair for pair in each]).T
    lacking = [joint.name for joint in answer.joints if joint.trouble]
    low, high = (_time(bound) for bound in answer.delay[1:])
    texts = [f"From {answer.log.name} by rmrc identify, in SI units. Joints: {', '.join(answer.log.joints)}."]
    if lacking:
        texts.append(f"Not identified from the log, and taken from the others: {', '.join(lacking)}.")
    texts.append(
        "The delay is the sum of command and measurement delay: a log cannot separate them, and only "
        f"their sum affects a loop. With 95 % it is from {low} to {high} s."
    )
    lines = [line for text in texts for line in wrap(f"# {visible(text)}", WIDTH, subsequent_indent="# ")]
    lines += ["plant:", f"  delay: {_time(answer.delay.value)}", *_key("  lag", answer.lag, _time)]
    encoder = [*_key("    noise", noise, _small), *_key("    resolution", resolution, _small)]
    return "\n".join([*lines, *(["arm:", "  encoder:", *encoder] if encoder else [])]) + "\n"


def _key(name: str, values: Sequence[float], text: Callable[[float], str]) -> list[str]:
    """Return the lines of a key: one value if the joints' are alike, no line if all are 0."""
    each = sorted(map(float, values))
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
