"""Holds a verdict against the columns that it is about: the numbers that it gives are computed again by numpy."""

import math
import re

import numpy as np

from rmrc.scenario.choices import Status

AMOUNT = r"(inf|nan|[\d,.]+(?:e[+-]\d+)?)"
SENTENCE = re.compile(
    rf"(Came to a|Came near a|Met no) singularity \(κ (?:at most )?{AMOUNT}\)(.*?): "
    rf"(?:.+? kept )?(\S+?)'s commands (?:at|peaked at) {AMOUNT}(.*)"
)


def is_told(text, value):
    """Say whether a text gives a number to three digits."""
    return math.isclose(float(text.replace(",", "")), value, rel_tol=5.1e-3, abs_tol=1e-300)


def denied(sentence, run):
    """Return what of a verdict the columns do not bear out."""
    place, kappa, end, joint, rate, behind = SENTENCE.match(sentence).groups()
    largest, is_singular = run["condition"].max(), (run["status"].astype(int) & Status.SINGULAR != 0).any()
    share = re.search(r"(\d+)%", end)
    claims = {
        "place": place == ("Came to a" if is_singular else "Came near a" if largest >= 17 else "Met no"),
        "κ": is_told(kappa, largest),
        "rate": is_told(rate, np.abs(run["qdot_cmd"][:, run.joints.index(joint)]).max()),
        "divergence": ("diverged" in end) == (run.divergence is not None),
        "end": run.divergence is not None or bool(share) != (run.completed == 1.0),
        "share": not share or 0 <= 100 * run.completed - int(share[1]) < 1,
    }
    for size, unit in re.findall(rf"{AMOUNT} (mm|deg)", behind):
        axes = ("x", "y", "z") if unit == "mm" else ("", "", "", "rx", "ry", "rz")
        rows = [i for i, axis in enumerate(axes) if axis in run.axes]
        error = np.linalg.norm(run["pose_error"][:, rows], axis=1).max()
        claims[f"error in {unit}"] = is_told(size, error * (1e3 if unit == "mm" else 180 / math.pi))
    return [name for name, holds in claims.items() if not holds]
