"""The line of numbers beside the picture: distance from the singularity, its rates, and the active limits."""

import math

import numpy as np
from numpy.typing import NDArray

from rmrc.recording.events import FREE, words
from rmrc.recording.plots import spell
from rmrc.results.run import Run
from rmrc.simulation.prepare import Prepared

# Number of letters of a line in a window of 1280 points.
LETTERS = 74


def lines(prepared: Prepared, part: Run, rows: NDArray[np.int64]) -> list[str]:
    """Return the text at some ticks of a block, as Markdown.

    A singularity asks for rates of about speed / σ_min: the speed is that of the wanted twist along
    u_min, both scaled as the law does.

    Args:
        prepared: The world.
        part: A block of its run.
        rows: Ticks of the block, (F,).
    """
    task, joints = prepared.task, prepared.arm.joints
    twist = task.turned(part["twist_ref"][rows], part["pose"][rows])[:, task.rows] * task.row_scale
    speed = np.abs((part["u_min"][rows][:, task.rows] * twist).sum(axis=1)).round(9)  # at rest 0, not 4e-30
    sigma, damping, condition = part["sigma"][rows, -1], part["damping"][rows], part["condition"][rows]
    rates, limit = np.abs(part["qdot_cmd"][rows]), prepared.law.rate_limit
    share = rates / limit if np.isfinite(limit).all() else rates
    most = share.argmax(axis=1)
    texts = []
    for i, row in enumerate(rows):
        j = int(most[i])
        unit = "m/s" if prepared.arm.is_slide[j] else "rad/s"
        of = f" of {spell(limit[j])}" if math.isfinite(limit[j]) else ""
        status = words(int(part.columns["status"][row]))
        acting = "nothing limits" if status == FREE else f"**{status}**"
        asked = _number(float(f"{speed[i] / sigma[i]:.2g}")) if sigma[i] > 0 else "∞"
        rate = f"{rates[i, j]:.2f}" if rates[i, j] < 1000 else spell(rates[i, j])
        fastest = f"fastest: {joints[j]} {rate}{of} {unit} · rate ≈ speed/σ = "
        share_of = f"{speed[i]:.2g}/{sigma[i]:.2g} = "
        is_short = len(fastest + share_of + asked) <= LETTERS
        texts.append(
            f"σ_min **{sigma[i]:.3g}** · κ {_number(condition[i])} · λ {damping[i]:.2g} · {acting}\n\n"
            f"{fastest}{share_of * is_short}{asked}"
        )
    return texts


def _number(value: float) -> str:
    return f"{value:,.3g}" if value < 1000 else f"{value:,.0f}" if value < 1e9 else "∞"
