"""What a run says in words: its statuses, on a strip, and its numbers, in a line beside the picture."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rmrc.recording.stream import Stream
from rmrc.results.run import Run
from rmrc.scenario.choices import Status
from rmrc.show.palette import RED, of_status
from rmrc.show.panels import grouped, in_words
from rmrc.simulation.prepare import Prepared


def words(status: int) -> str:
    """Return a status in words.

    >>> words(Status.DAMPED | Status.RATE_LIMITED), words(0)
    ('damped, rate limited', 'OK')
    """
    return ", ".join(in_words(flag) for flag in Status if flag & status) or "OK"


def write_strip(stream: Stream, path: str, run: Run) -> None:
    """Write the statuses of a run, each as long as it lasts, and a divergence at its end."""
    status = run["status"].astype(np.int64)
    ticks = np.flatnonzero(np.diff(status, prepend=-1))
    time, states = run["time"][ticks], [words(bits) for bits in status[ticks].tolist()]
    colors = {words(bits): of_status(bits) for bits in np.unique(status).tolist()}
    if run.divergence is not None:
        ticks, time = np.append(ticks, len(run)), np.append(time, run.divergence.time)
        states.append(str(run.divergence))
        colors[str(run.divergence)] = RED
    names, tints = list(colors), np.array(list(colors.values()), np.uint32)
    stream.log(path, rr.StateConfiguration(values=names, colors=tints))
    stream.send(path, ticks, time, rr.StateChange.columns(state=states))


def write_numbers(stream: Stream, prepared: Prepared, run: Run, ticks: NDArray[np.int64]) -> None:
    """Write a line of numbers at some ticks, (F,).

    Near a singularity the wanted speed along u_min needs rates of speed / σ_min. Both are scaled as the law
    does.
    """
    task, limit = prepared.task, prepared.law.rate_limit
    twist = task.turned(run["twist_ref"][ticks], run["pose"][ticks])[:, task.rows] * task.row_scale
    speed = np.abs((run["u_min"][ticks][:, task.rows] * twist).sum(axis=1)).round(9)  # at rest 0, not 4e-30
    sigma, rates = run["sigma"][ticks, -1], np.abs(run["qdot_cmd"][ticks])
    fastest = (rates / limit if np.isfinite(limit).all() else rates).argmax(axis=1)
    texts = []
    for i, tick in enumerate(ticks):
        j = fastest[i]
        of = f" of {grouped(limit[j])}" if np.isfinite(limit[j]) else ""
        needed = grouped(float(f"{speed[i] / sigma[i]:.2g}")) if sigma[i] > 0.0 else "∞"
        texts.append(
            f"σ_min **{sigma[i]:.3g}** · κ {grouped(run['condition'][tick])} · "
            f"λ {run['damping'][tick]:.2g} · **{words(int(run['status'][tick]))}**\n\n"
            f"fastest: {run.joints[j]} {grouped(rates[i, j])}{of} {run.joint_unit(j)}/s · "
            f"along the worst direction: speed/σ_min = {needed}"
        )
    stream.log("now", rr.TextDocument.from_fields(media_type="text/markdown"))
    stream.send("now", ticks, run["time"][ticks], rr.TextDocument.columns(text=texts))
