"""The result of a log: a table, JSON, a picture, and the block of a scenario to paste."""

from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rmrc.analysis.identify import Identified
from rmrc.scenario import block as as_yaml
from rmrc.show import figures
from rmrc.show.sheets import UNDEFINED, Report, Sheet, number, plain
from rmrc.support.text import visible

# Lines of the block fit a terminal with this many columns.
WIDTH = 60
TIMES = ("delay", "lag", "total")
# The picture shows this many times delay and lag, at least so many periods, and so many points of a residual.
SPANS, PERIODS, POINTS = 8.0, 40.0, 4000


def report(answer: Identified) -> Report:
    """Return the report of a log; its condition is met if a joint determines its delay.

    Args:
        answer: The result of `identify`.
    """
    log, values = answer.log, _values(answer)
    notes = [
        f"{joint.name}: {text}" for joint in answer.joints for text in (joint.trouble, *joint.notes) if text
    ]
    sheets = [
        Sheet(log.name, ("", ""), list(values["facts"].items()), frozenset({0, 1})),
        Sheet(
            "Delay and lag in ms, with 95 %; noise and resolution in rad or m",
            ("joint", "delay", "±", "lag", "±", "both", "±", "gain", "noise", "resolution"),
            [_row(joint) for joint in values["joints"]],
            notes=(*notes, *answer.notes),
        ),
    ]
    problem = f"{log.name}: the log identifies no joint's delay; the table says what to log instead"
    draw = partial(draw_fits, answer) if any(joint.fit for joint in answer.joints) else None
    met = answer.delay is not None
    return Report(sheets, plain(values), draw, met, "" if met else problem, block(answer))


def _values(answer: Identified) -> dict[str, Any]:
    """Return the result as JSON has it; delay, lag and gain only of joints that determine them."""
    log, joints = answer.log, []
    for joint in answer.joints:
        fit, noise = joint.fit, joint.noise
        values: dict[str, Any] = {"name": joint.name, "trouble": joint.trouble or None, "notes": joint.notes}
        values["cause"] = joint.cause._asdict() if joint.cause.name else None
        if fit and noise:
            values |= {"noise": noise.value, "resolution": noise.resolution or None, "jitter": noise.jitter}
        if fit and not joint.trouble:
            names = TIMES if fit.delay.high >= 0.0 else ("total",)
            values |= {name: getattr(fit, name)._asdict() for name in (*names, "gain")}
        joints.append(values)
    period, duration = log.clock.period, float(log.time[-1] - log.time[0])
    head = (
        f"{duration:.4g} s, {len(joints)} joints, a command every {1e3 * period:.4g} ms; if the loop is "
        f"faster than the log, delays are up to {500.0 * period:.3g} ms longer than below"
    )
    return {
        "log": log.name, "duration": duration, "period": period, "facts": {"duration": head, **log.facts},
        "delay": answer.delay and answer.delay._asdict(), "lag": answer.lag, "joints": joints,
        "notes": answer.notes, "block": block(answer) or None,
    }  # fmt: skip


def _row(joint: dict[str, Any]) -> tuple[str, ...]:
    """Return the cells of a joint in the table."""
    cells = [joint["name"]]
    for each in (joint.get(name) for name in TIMES):
        half = each and 500.0 * (each["high"] - each["low"])
        cells += [f"{1e3 * each['value']:.3f}", f"{half:.3f}"] if each else [UNDEFINED] * 2
    values = joint.get("gain", {}).get("value"), joint.get("noise"), joint.get("resolution")
    return (*cells, *(UNDEFINED if value is None else number(value) for value in values))


def block(answer: Identified) -> str:
    """Return `plant` and `arm.encoder` as YAML, "" where no joint determines its delay.

    Args:
        answer: The result of `identify`.
    """
    if answer.delay is None:
        return ""
    sound = [None if joint.trouble else joint.noise for joint in answer.joints]
    lacking = [joint.name for joint in answer.joints if joint.trouble]
    values = np.array([(each.value, each.resolution) if each else (np.nan,) * 2 for each in sound])
    encoder = np.where(np.isnan(values), np.nanmedian(values, axis=0), values).T
    value, low, high = (round(bound, 6) for bound in answer.delay)
    texts = [f"From {answer.log.name} by rmrc identify, in SI units. Joints: {', '.join(answer.log.joints)}."]
    if lacking:
        texts.append(f"Not identified from the log, and taken from the others: {', '.join(lacking)}.")
    texts.append(
        "The delay is the sum of command and measurement delay: a log cannot separate them, and only "
        f"their sum affects a loop. With 95 % it is from {low:g} to {high:g} s."
    )
    plant = {"delay": value} | ({"lag": [round(lag, 6) for lag in answer.lag]} if any(answer.lag) else {})
    lists = {
        key: [float(f"{each:.3g}") for each in values]
        for key, values in zip(("noise", "resolution"), encoder.tolist(), strict=True)
        if any(values)
    }
    lines = [line for text in texts for line in wrap(f"# {visible(text)}", WIDTH, subsequent_indent="# ")]
    content = {"plant": plant} | ({"arm": {"encoder": lists}} if lists else {})
    return "\n".join(lines) + "\n" + as_yaml(content, WIDTH)


def draw_fits(answer: Identified, path: Path) -> None:
    """Draw for each joint the positions and the fit where the command changes most, and the residual.

    Args:
        answer: The result of `identify`.
        path: File to write atomically, in the format of the suffix: `.png`, `.svg` or `.pdf`.
    """
    fits = [(joint, joint.fit) for joint in answer.joints if joint.fit]
    picture = Figure(figsize=(12.0, 1.2 + 2.6 * len(fits)), layout="constrained")
    panels = picture.subplots(len(fits), 2, squeeze=False)
    for (left, right), (joint, fit) in zip(panels, fits, strict=True):
        sent, time, position = fit.samples
        wide = max(SPANS * abs(fit.total.value), PERIODS * sent.period)
        change = np.abs(
            np.interp(time + wide / SPANS, sent.time, sent.rate) - np.interp(time, sent.time, sent.rate)
        )
        begin = time[np.argmax(change)] - 0.25 * wide
        rows = (time >= begin) & (time <= begin + wide)
        shown, curve = time[rows], (position - fit.residual)[rows]
        wanted = fit.gain.value * sent.answer(shown)[0]
        left.plot(shown, wanted - wanted[0], "--", color="0.45", label="commanded rates, integrated")
        left.plot(shown, curve - curve[0], color="#e06c00", label="the same with delay and lag")
        left.plot(shown, position[rows] - curve[0], "o", color="#2f7fe8", markersize=3.2, label="positions")
        times = f"delay {1e3 * fit.delay.value:.4g} ms, lag {1e3 * fit.lag.value:.4g} ms"
        title = f"{joint.name}: {'not identified' if joint.trouble else times}"
        left.set_title(figures.plain(title), loc="left", fontsize=10)
        every = -(-len(time) // POINTS)
        right.plot(time[::every], fit.residual[::every], ".", color="#2f7fe8", markersize=2.0)
        right.set_title("residual of the fit", loc="left", fontsize=10)
    for axes in panels.flat:
        axes.set(xlabel="time [s]", ylabel="[rad or m]")
        axes.grid(color="0.9", linewidth=0.8)
    picture.legend(
        *panels[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3, frameon=False
    )
    figures.save(picture, [path])
