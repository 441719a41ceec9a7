"""The result of a log: tables, JSON, a picture, and the block to paste."""

from functools import partial
from typing import Any

from rmrc.analysis.identify.block import block
from rmrc.analysis.identify.fit import Interval
from rmrc.analysis.identify.identify import Identified, Joint
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number


def report(found: Identified) -> Report:
    """Return the report of a log; its condition is met if a joint determines its delay.

    Args:
        found: The result of `identify`.
    """
    from rmrc.analysis.identify.figure import draw_fits

    log, lines = (
        found.log,
        [f"{one.name}: {text}" for one in found.joints for text in (one.trouble, *one.notes) if text],
    )
    facts = [
        (
            "duration",
            f"{log.duration:.4g} s, {len(log.joints)} joints, a command every {1e3 * log.period:.4g} ms",
        )
    ]
    sheets = [Sheet(log.name, ("", ""), [*facts, *log.facts.items()], frozenset({0, 1}))]
    heads = ("joint", "delay", "±", "lag", "±", "both", "±", "gain", "noise", "resolution")
    title = "Delay and lag in ms, with 95 %; noise and resolution in rad or m"
    rows = [_row(one) for one in found.joints]
    sheets.append(Sheet(title, heads, rows, groups=(2, 2, 2, 1, 2), notes=(*lines, *found.notes)))
    drawn = any(one.fit is not None for one in found.joints)
    problem = (
        ""
        if found.is_told
        else f"{log.name}: the log identifies no joint's delay; the table says what to log instead"
    )
    draw = partial(draw_fits, found) if drawn else None
    return Report(sheets, plain(_values(found)), draw, found.is_told, problem, block(found))


def _row(one: Joint) -> tuple[str, ...]:
    if one.fit is None or one.noise is None:
        return (one.name, *[UNDEFINED] * 9)
    step = number(one.resolution) if one.resolution else UNDEFINED
    if one.trouble:
        return (one.name, *[UNDEFINED] * 7, number(one.noise.value), step)
    times = (
        _ms(value)
        for each in (one.fit.delay, one.fit.lag, one.fit.total)
        for value in (each.value, each.half)
    )
    return (one.name, *times, number(one.fit.gain.value), number(one.noise.value), step)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3f}"


def _values(found: Identified) -> dict[str, Any]:
    log = found.log
    return {
        "log": log.name, "duration": log.duration, "period": log.period, "facts": dict(log.facts),
        "told": found.is_told, "delay": found.delay and _interval(found.delay), "lag": found.lag,
        "joints": [_joint(one) for one in found.joints], "notes": found.notes, "block": block(found) or None,
    }  # fmt: skip


def _joint(one: Joint) -> dict[str, Any]:
    values: dict[str, Any] = {
        "name": one.name, "trouble": one.trouble or None, "notes": one.notes,
        "resolution": one.resolution or None, "noise": one.noise and _interval(one.noise),
    }  # fmt: skip
    if one.fit is not None:
        for name in ("delay", "lag", "total", "gain", "drift"):
            values[name] = _interval(getattr(one.fit, name))
        values |= {
            "explained": one.fit.explained,
            "rows": len(one.fit.residual),
            "outliers": one.fit.outliers,
        }
    return values


def _interval(one: Interval) -> dict[str, float]:
    return one._asdict()
