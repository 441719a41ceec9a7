"""Holds a verdict against the columns that it is about: every word that says something is recomputed by numpy."""

import math
import re

import numpy as np

from rmrc.scenario.choices import Status

CAUSES = {
    "damping": Status.DAMPED, "slowing down": Status.SLOWED, "stopping": Status.STOPPED,
    "keeping out": Status.KEPT_OUT, "the rate limit": Status.RATE_LIMITED,
    "the acceleration limit": Status.ACCELERATION_LIMITED, "the jerk limit": Status.JERK_LIMITED,
    "a joint limit": Status.POSITION_LIMITED,
}  # fmt: skip
AMOUNT = r"(inf|nan|[\d,.]+(?:e[+-]\d+)?)"
SENTENCE = re.compile(
    rf"(?P<place>Came to a|Came near a|Met no) singularity \(κ (?:at most )?(?P<kappa>{AMOUNT})\)"
    rf"(?P<end> and diverged at \S+ s(?: at .+?)?| and went \d+% of its path)?: "
    rf"(?:(?P<causes>.+?) kept )?(?P<joint>\S+?)'s commands (?:at|peaked at) "
    rf"(?P<rate>{AMOUNT})(?: of (?P<limit>{AMOUNT}))? (?P<unit>m|rad)/s"
    rf"(?P<errors>, with at most .+? of error)"
    rf"(?:; (?P<who>the plain inverse|its baseline, the plain inverse,|its baseline) (?P<did>would ask for|commanded) (?P<other>{AMOUNT}) "
    rf"(?:m|rad)/s(?P<other_end> and diverged at \S+ s)?)?\."
)


def is_told(text, value):
    """Say whether a text gives a number to three digits."""
    return math.isclose(float(text.replace(",", "")), value, rel_tol=5.1e-3, abs_tol=1e-300)


def has(run, status):
    return (run["status"].astype(int) & status) != 0


def denied(sentence, run):
    """Return what of a verdict the columns do not bear out."""
    found = SENTENCE.fullmatch(sentence)
    if found is None:
        return ["it is no such sentence"]
    kappa, singular, sent = run["condition"].max(), has(run, Status.SINGULAR), np.abs(run["qdot_cmd"])
    joint, plain, end = run.joints.index(found["joint"]), np.abs(run["qdot_plain"]), found["end"] or ""
    limit = run.rate_limit[joint] if run.rate_limit else math.inf
    place = "Came to a" if singular.any() else "Came near a" if kappa >= 17 else "Met no"
    share = re.search(r"(\d+)%", end)
    claims = {
        "place": found["place"] == place, "κ": is_told(found["kappa"], kappa),
        "divergence": ("diverged" in end) == (run.divergence is not None),
        "end": run.divergence is not None or bool(share) != (run.completed == 1.0),
        "share": not share or 0 <= 100 * run.completed - int(share[1]) < 1,
        "unit": found["unit"] == run.joint_unit(joint), "rate": is_told(found["rate"], sent[:, joint].max()),
        "limit": is_told(found["limit"], limit) if found["limit"] else not math.isfinite(limit),
        "kept": not found["causes"] or plain[:, joint].max() > sent[:, joint].max(),
    }  # fmt: skip
    for cause in filter(None, re.split(r" and ", found["causes"] or "")):
        claims[cause] = cause == "others" or has(run, CAUSES[cause]).any()
    for size, unit in re.findall(rf"{AMOUNT} (mm|deg)", found["errors"]):
        axes = ("x", "y", "z") if unit == "mm" else ("", "", "", "rx", "ry", "rz")
        rows = [i for i, axis in enumerate(axes) if axis in run.axes]
        error = np.linalg.norm(run["pose_error"][:, rows], axis=1).max()
        claims[f"error in {unit}"] = is_told(size, error * (1e3 if unit == "mm" else 180 / math.pi))
    if found["who"]:
        other, asks = run.baseline or run, found["did"] == "would ask for"
        largest = np.abs(other["qdot_plain" if asks else "qdot_cmd"]).max()
        is_plain = np.allclose(other["qdot_cmd"], other["qdot_plain"], rtol=1e-9, atol=1e-12)
        claims["other rate"] = is_told(found["other"], largest)
        claims["who"] = largest > sent.max() if asks else ("plain" in found["who"]) == is_plain
        claims["other's end"] = bool(found["other_end"]) == (not asks and other.divergence is not None)
    return [name for name, holds in claims.items() if not holds]
