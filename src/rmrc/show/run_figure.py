"""The figure of one run: how an arm crossed a singularity, joint by joint."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.results.run import Run
from rmrc.show.axes import (
    APART,
    CLIPPED,
    DOTTED,
    FAR,
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
    error_units,
    frame_path,
    grouped,
    in_words,
    legend,
    name_lanes,
    off,
    on_paper,
    paints,
    path_plane,
    power,
    rate_unit,
    scale_by_decades,
    statuses,
    thinned,
    torque_unit,
)  # fmt: skip
from rmrc.show.figures import DASHES, plain
from rmrc.show.palette import GREEN, MAGENTA
from rmrc.show.shadows import shadows

# The rates of the plain inverse are drawn if they exceed this multiple of the peak; below it, the curves
# coincide.
PLAIN_MORE = 1.05
# The factor by which the plot is then higher.
ROOM = 1.35
# The share of the plot's height that one more written line takes.
LINE = 0.25


def figure(run: Run, names: Sequence[str], width: float) -> Figure:
    """Return the plot of a run, in the sizes of letters of the context.

    Args:
        run: The run, with at least one tick.
        names: Names of the panels, from the top; none: all for which the run has data.
        width: Width of the figure [in].
    """
    chosen = names or [name for name in NAMES if applies(name, run)]
    lanes = [in_words(flag) for flag in statuses(run)]
    panels = [
        Panel(name, partial(_DRAW[name], run=run), lanes if name == "status" else ()) for name in chosen
    ]
    return arranged(panels, max(float(run["time"][-1]), run.period), width)


def _draw_path(axes: Axes, run: Run) -> int:
    """Draw the wanted and the actual path, on the two world axes of the largest extents."""
    wanted, taken = run["pose_ref"][:, :3], run["pose"][:, :3]
    time, outlines, is_shadow = shadows(run, *path_plane([wanted, taken])[:2])
    first, second = frame_path(axes, [wanted, taken, *outlines])
    (blue,), green = paints(1), on_paper(GREEN)
    for i, outline in enumerate(outlines):
        axes.fill(
            *outline[:, [first, second]].T, facecolor=f"{green}30", edgecolor=green, linewidth=0.7,
            label=None if i else f"velocity ellips{'oid, shadow' if is_shadow else 'e'}, {time:g} s",
        )  # fmt: skip
    draw_wanted(axes, wanted, first, second)
    axes.plot(taken[:, first], taken[:, second], color=blue, linewidth=1.1, label="actual")
    closest = int(np.argmin(run["sigma"][:, -1]))
    axes.plot(*taken[0, [first, second]], "o", color=blue, markersize=4, label="start")
    axes.plot(
        *taken[closest, [first, second]], "D", color="black", markersize=4, markerfacecolor="none",
        label=r"smallest $\sigma_{\min}$",
    )  # fmt: skip
    return legend(axes, 2)


def draw_rates(axes: Axes, run: Run) -> int:
    """Draw measured and commanded rates against their limits; a peak beyond the plot is written."""
    colors, limit = paints(len(run.joints)), np.array(run.rate_limit or [math.inf] * len(run.joints))
    for j, (name, paint) in enumerate(zip(run.joints, colors, strict=True)):
        dashes = (0, DASHES[j % len(DASHES)])
        axes.plot(*thinned(run["time"], run["qdot"][:, j]), color=paint, linestyle=dashes, label=plain(name))
        axes.plot(*thinned(run["time"], run["qdot_cmd"][:, j]), color=paint, linewidth=0.5, alpha=0.6)
    known = sorted(set(limit[np.isfinite(limit)].tolist()))
    both = np.abs(np.hstack([run["qdot"], run["qdot_cmd"]]))
    peak, told = float(both.max()), []
    _draw_limits(axes, np.where(limit < FAR * peak, limit, math.inf), colors)
    if is_far := bool(known) and known[0] >= FAR * peak:
        told.append(f"limit{'s from' * (len(known) > 1)} {grouped(known[0])} {rate_unit(run)} ↑")
    if known and peak > CLIPPED * known[-1]:
        axes.set_ylim(-CLIPPED * known[-1], CLIPPED * known[-1])
        j = int(both.max(axis=0).argmax()) % len(run.joints)
        told.append(f"peak {grouped(peak)} {run.joint_unit(j)}/s ↑ ({plain(run.joints[j])})")
    elif not known and peak > APART * max(float(np.median(both.max(axis=1))), 1e-12):
        axes.set_yscale("symlog", linthresh=power(float(np.median(both.max(axis=1)))))
    told += _draw_plain(axes, run, colors, peak)
    told += _draw_baseline(axes, run, is_roomy=bool(told))
    lines = len(told) - (not is_far or len(told) > 1)
    if told and lines and axes.get_yscale() == "linear":  # room for each text that has none yet
        low, high = axes.get_ylim()
        axes.set_ylim(low, low + (high - low) / (1.0 - LINE * lines))
    if told:
        axes.text(
            0.99, 0.96, "\n".join(told), transform=axes.transAxes, va="top", ha="right",
            fontsize=mpl.rcParams["legend.fontsize"],
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 1.0},
        )  # fmt: skip
    axes.set_ylabel(rf"rate $\dot q$ [{rate_unit(run)}]")
    return legend(axes, 4)


def _draw_plain(axes: Axes, run: Run, colors: Sequence[str], peak: float) -> list[str]:
    """Draw the rates of the plain inverse where they exceed the command; return their peak in words."""
    rates = run.columns.get("qdot_plain")
    if rates is None or not np.isfinite(rates).any():  # an older file without this column
        return []
    if float(np.nan_to_num(np.abs(rates), nan=0.0, posinf=0.0).max()) <= PLAIN_MORE * peak:
        return []
    return _draw_beside(axes, run, "qdot_plain", colors, (r"plain $J^{-1}$", "asks"))


def _draw_baseline(axes: Axes, run: Run, is_roomy: bool) -> list[str]:
    """Draw the commands of a run's baseline, if it has one; return their peak in words."""
    if run.baseline is None or not len(run.baseline):
        return []
    return _draw_beside(
        axes, run.baseline, "qdot_cmd", [GRAY] * len(run.joints), ("baseline", "commands"), (4, 2), is_roomy
    )


def _draw_beside(
    axes: Axes, run: Run, column: str, colors: Sequence[str], words: tuple[str, str],
    dash: tuple[float, float] = (2, 1.5), is_roomy: bool = False,
) -> list[str]:  # fmt: skip
    """Draw rates beside those of the run, dashed; return their peak in words if it is beyond the plot.

    The plot keeps the height that its other curves need: a peak beyond them is written, not drawn.
    """
    asked = np.nan_to_num(np.abs(run[column]), nan=0.0, posinf=0.0)
    most, (low, high), (name, does) = float(asked.max()), axes.get_ylim(), words
    for j, paint in enumerate(colors):
        time, values = thinned(run["time"], run[column][:, j])
        axes.plot(
            time, values, color=paint, linewidth=0.9, linestyle=(0, dash), alpha=0.75, zorder=1.5,
            label=None if j else name,
        )  # fmt: skip
    room = ROOM if most > high and not is_roomy else 1.0
    axes.set_ylim(room * low, room * high)
    if most <= room * high:
        return []
    j = int(asked.max(axis=0).argmax())
    return [rf"{name} {does} {grouped(most)} {run.joint_unit(j)}/s ↑ ({plain(run.joints[j])})"]


def _draw_sigma(axes: Axes, run: Run) -> int:
    """Draw the smallest singular value, the damping, and where damping begins, on a logarithmic scale."""
    time = run["time"]
    sigma, damping = run["sigma"][:, -1], run["damping"]
    axes.plot(*thinned(time, sigma), color=on_paper(GREEN), label=r"$\sigma_{\min}$")
    shown = [sigma[sigma > 0.0]]
    if (damping > 0.0).any():
        axes.plot(
            *thinned(time, np.where(damping > 0.0, damping, np.nan)), color=on_paper(MAGENTA),
            linestyle=(0, DASHES[1]), label=r"$\lambda$",
        )  # fmt: skip
        shown.append(damping[damping > 0.0])
    if run.damping_below > 0.0:
        axes.axhline(run.damping_below, color="black", linewidth=0.7, linestyle=DOTTED,
                     label=r"$\varepsilon$")  # fmt: skip
        shown.append(np.array([run.damping_below]))
    scale_by_decades(axes)
    if len(positive := np.concatenate(shown)):
        axes.set_ylim(decades(positive))
    axes.set_ylabel(r"$\sigma$, $\lambda$ [1]" if len(shown) > 1 else r"$\sigma$ [1]")
    return legend(axes, 4)


def _draw_error(axes: Axes, run: Run) -> int:
    """Draw the position error along and across the path, and the rotation error."""
    colors, parts = paints(3), off(run)
    for name, (values, i) in parts.items():
        curve = thinned(run["time"], values)
        axes.plot(*curve, color=colors[i], linestyle=(0, DASHES[i]), label=name)
    axes.set_ylabel(f"error [{', '.join(error_units(parts))}]")
    return legend(axes, 3)


def _draw_torque(axes: Axes, run: Run) -> int:
    """Draw the actuator torques against their limits."""
    for j, (name, paint) in enumerate(zip(run.joints, paints(len(run.joints)), strict=True)):
        dashes = (0, DASHES[j % len(DASHES)])
        axes.plot(*thinned(run["time"], run["tau"][:, j]), color=paint, linestyle=dashes, label=plain(name))
    peak = float(np.abs(run["tau"]).max())
    limit = np.array(run.torque_limit or [math.inf] * len(run.joints))
    _draw_limits(axes, np.where(limit < FAR * peak, limit, math.inf), paints(len(run.joints)))
    axes.set_ylabel(rf"torque $\tau$ [{torque_unit(run)}]")
    return legend(axes, 4)


def _draw_pace(axes: Axes, run: Run) -> int:
    """Draw the pace along the path."""
    axes.plot(*thinned(run["time"], run["path_rate"]), color=paints(1)[0])
    axes.set_ylim(-0.05, 1.1)
    axes.set_ylabel(r"pace $\dot s$ [1]")
    axes.grid(color="0.92", linewidth=0.6)
    return 0


def _draw_status(axes: Axes, run: Run) -> int:
    """Draw the times of each status, with one lane per status."""
    flags = statuses(run)
    for lane, flag in enumerate(flags):
        draw_spans(axes, run, flag, lane, "0.4")
    name_lanes(axes, [in_words(flag) for flag in flags])
    return 0


def _draw_filter(axes: Axes, run: Run) -> int:
    """Draw the gain that the inverse gave each direction, over its singular value."""
    sigma, gain = run["sigma"].ravel(), run["gain"].ravel()
    order = np.argsort(sigma, kind="stable")
    sigma, gain = sigma[order], gain[order]
    seen = (sigma > 0.0) & (gain > 0.0)
    if seen.any():
        every = max(1, int(seen.sum()) // (2 * SPANS))
        blue = paints(1)[0]
        axes.plot(
            sigma[seen][::every], gain[seen][::every], ".", color=blue, markersize=2.5, label="of the run"
        )
        ends = np.array([sigma[seen][0], sigma[-1]])
        axes.plot(ends, 1.0 / ends, "--", color=GRAY, label=r"$1/\sigma$")
        scale_by_decades(axes, "xy")
        axes.set_xlim(decades(sigma[seen]))
        axes.set_ylim(decades(gain[seen]))
    axes.set_xlabel(r"$\sigma$ [1]")
    axes.set_ylabel(r"gain $g(\sigma)$ [1]")
    axes.grid(color="0.92", linewidth=0.6)
    return legend(axes, 2)


def _draw_limits(axes: Axes, limit: Array, colors: Sequence[str]) -> None:
    """Draw finite limits of joints, (n,), on both sides: black if all are equal, or else in their colors."""
    finite = np.isfinite(limit)
    is_one = len(set(limit.tolist())) == 1
    for i, j in enumerate(np.flatnonzero(finite)[: 1 if is_one else None]):
        for side in (limit[j], -limit[j]):
            axes.axhline(side, color="black" if is_one else colors[j], linewidth=0.8, linestyle=DOTTED,
                         label="limit" if i == 0 and side > 0 else None)  # fmt: skip


_DRAW: dict[str, Callable[..., int]] = {
    "path": _draw_path, "rates": draw_rates, "sigma": _draw_sigma, "error": _draw_error,
    "torque": _draw_torque, "pace": _draw_pace, "status": _draw_status, "g": _draw_filter,
}  # fmt: skip
