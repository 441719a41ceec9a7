"""A figure with runs side by side: one curve per run, the first one solid and bold."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.results.run import Run
from rmrc.show.axes import (
    APART,
    DOTTED,
    GRAY,
    NAMES,
    SPANS,
    Array,
    Panel,
    applies,
    arranged,
    decades,
    draw_spans,
    draw_wanted,
    error_rows,
    frame_path,
    in_words,
    legend,
    name_lanes,
    paints,
    rate_unit,
    scale_by_decades,
    statuses,
    thinned,
    torque_unit,
)  # fmt: skip
from rmrc.show.figures import DASHES, plain

Runs = Mapping[str, Run]


def figure(runs: Runs, names: Sequence[str], width: float) -> Figure:
    """Return the figure of several runs, in the sizes of letters of the context.

    Args:
        runs: By label, each of one tick at least.
        names: Names of the panels, from the top; none: all for which any run has data.
        width: Width of the figure [in].
    """
    chosen = names or [name for name in NAMES if any(applies(name, run) for run in runs.values())]
    lanes = [f"{plain(label)}: {in_words(flag)}" for label, run in runs.items() for flag in statuses(run)]
    panels = [
        Panel(name, partial(_DRAW[name], runs=runs), lanes if name == "status" else ()) for name in chosen
    ]
    end = max(max(float(run["time"][-1]), run.period) for run in runs.values())
    return arranged(panels, end, width)


def _draw_path(axes: Axes, runs: Runs) -> int:
    """Draw the wanted path and the actual paths."""
    (reference, *_), taken = runs.values(), [run["pose"][:, :3] for run in runs.values()]
    wanted = reference["pose_ref"][:, :3]
    first, second = frame_path(axes, [wanted, *taken])
    draw_wanted(axes, wanted, first, second)
    for style, positions in zip(_styles(runs), taken, strict=True):
        axes.plot(positions[:, first], positions[:, second], **style)
    return legend(axes, 2)


def _draw_rates(axes: Axes, runs: Runs) -> int:
    """Draw the largest commanded rate of any joint, or its share of the limits if these differ."""
    limits = {run.rate_limit for run in runs.values()}
    bounds = {limit for one in limits for limit in one} or {math.inf}
    is_share = len(bounds) > 1 and math.inf not in bounds and all(limits)
    curves = [
        (np.abs(run["qdot_cmd"]) / (run.rate_limit if is_share else 1.0)).max(axis=1) for run in runs.values()
    ]
    bound = 1.0 if is_share else bounds.pop() if len(bounds) == 1 else math.inf
    _draw_curves(axes, runs, curves, bound)
    unit = "share of the limit" if is_share else rate_unit(next(iter(runs.values())))
    axes.set_ylabel(rf"largest $|\dot q|$ [{unit}]")
    return legend(axes, 3)


def _draw_sigma(axes: Axes, runs: Runs) -> int:
    """Draw the smallest singular value of each run, and its damping with thin lines."""
    scale_by_decades(axes)
    shown = []
    for style, run in zip(_styles(runs), runs.values(), strict=True):
        axes.plot(*thinned(run["time"], run["sigma"][:, -1]), **style)
        damping = np.where(run["damping"] > 0.0, run["damping"], np.nan)
        axes.plot(*thinned(run["time"], damping), color=style["color"], linewidth=0.7, linestyle=DOTTED)
        shown += [run["sigma"][:, -1], run["damping"]]
    values = np.concatenate(shown)
    if (values > 0.0).any():
        axes.set_ylim(decades(values[values > 0.0]))
    axes.set_ylabel(r"$\sigma_{\min}$, dotted $\lambda$ [1]")
    return legend(axes, 3)


def _draw_error(axes: Axes, runs: Runs) -> int:
    """Draw the norm of the position error of each run, and with thin lines that of the rotation error."""
    moved, turned = error_rows(next(iter(runs.values())))
    rows = moved or turned
    _draw_curves(
        axes, runs, [1e3 * np.linalg.norm(run["pose_error"][:, rows], axis=1) for run in runs.values()]
    )
    if moved and turned:
        for style, run in zip(_styles(runs), runs.values(), strict=True):
            off = 1e3 * np.linalg.norm(run["pose_error"][:, turned], axis=1)
            axes.plot(*thinned(run["time"], off), color=style["color"], linewidth=0.7, linestyle=DOTTED)
            low, high = axes.get_ylim()  # set by the logarithmic scale of the positions
            if axes.get_yscale() == "log" and off.max() > high:
                axes.set_ylim(decades(np.array([low, off.max()])))
    axes.set_ylabel(f"error [{'mm, dotted mrad' if moved and turned else 'mm' if moved else 'mrad'}]")
    return legend(axes, 3)


def _draw_torque(axes: Axes, runs: Runs) -> int:
    """Draw the largest actuator torque of any joint."""
    _draw_curves(axes, runs, [np.abs(run["tau"]).max(axis=1) for run in runs.values()])
    axes.set_ylabel(rf"largest $|\tau|$ [{torque_unit(next(iter(runs.values())))}]")
    return legend(axes, 3)


def _draw_pace(axes: Axes, runs: Runs) -> int:
    """Draw the pace along the path."""
    for style, run in zip(_styles(runs), runs.values(), strict=True):
        axes.plot(*thinned(run["time"], run["path_rate"]), **style)
    axes.set_ylim(-0.05, 1.1)
    axes.set_ylabel(r"pace $\dot s$ [1]")
    return legend(axes, 3)


def _draw_status(axes: Axes, runs: Runs) -> int:
    """Draw the times of each status of each run, in the color of the run, with one lane per status."""
    names: list[str] = []
    for style, (label, run) in zip(_styles(runs), runs.items(), strict=True):
        for flag in statuses(run):
            draw_spans(axes, run, flag, len(names), style["color"])
            names.append(f"{plain(label)}: {in_words(flag)}")
    name_lanes(axes, names)
    return 0


def _draw_filter(axes: Axes, runs: Runs) -> int:
    """Draw the gain that each inverse gave each direction, over its singular value."""
    shown = []
    for style, run in zip(_styles(runs), runs.values(), strict=True):
        sigma, gain = run["sigma"].ravel(), run["gain"].ravel()
        rows = np.flatnonzero((sigma > 0.0) & (gain > 0.0))
        rows = rows[np.argsort(sigma[rows], kind="stable")][:: max(1, len(rows) // (2 * SPANS))]
        axes.plot(sigma[rows], gain[rows], ".", color=style["color"], markersize=2.0, label=style["label"])
        shown.append(np.stack([sigma[rows], gain[rows]]))
    sigma, gain = np.hstack(shown)
    if len(sigma):
        ends = np.array([sigma.min(), sigma.max()])
        axes.plot(ends, 1.0 / ends, "--", color=GRAY, label=r"$1/\sigma$")
        scale_by_decades(axes, "xy")
        axes.set_xlim(decades(sigma))
        axes.set_ylim(decades(gain))
    axes.set_xlabel(r"$\sigma$ [1]")
    axes.set_ylabel(r"gain $g(\sigma)$ [1]")
    return legend(axes, 2)


def _draw_curves(axes: Axes, runs: Runs, curves: Sequence[Array], bound: float = math.inf) -> None:
    """Draw a curve of each run, which is never negative, and a bound of all."""
    for style, run, values in zip(_styles(runs), runs.values(), curves, strict=True):
        axes.plot(*thinned(run["time"], values), **style)
    if math.isfinite(bound):
        axes.axhline(bound, color="black", linewidth=0.8, linestyle=DOTTED, label="limit")
    peaks = [float(values.max()) for values in curves]
    if max(peaks) > APART * max(min(peaks), 1e-12):
        scale_by_decades(axes)
        low = min(float(np.median(values[values > 0.0])) for values in curves if (values > 0.0).any())
        axes.set_ylim(decades(np.array([low, max(peaks)])))


def _styles(runs: Runs) -> list[dict[str, Any]]:
    """Return the style of the curve of each run."""
    return [
        {
            "color": color, "linestyle": (0, DASHES[i % len(DASHES)]), "linewidth": 1.2 if i else 2.0,
            "label": plain(label),
        }
        for i, (color, label) in enumerate(zip(paints(len(runs)), runs, strict=True))
    ]  # fmt: skip


_DRAW: dict[str, Callable[..., int]] = {
    "path": _draw_path, "rates": _draw_rates, "sigma": _draw_sigma, "error": _draw_error,
    "torque": _draw_torque, "pace": _draw_pace, "status": _draw_status, "g": _draw_filter,
}  # fmt: skip
