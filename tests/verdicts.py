"""Holds a verdict against the columns that it is about: every word that says something is recomputed by numpy."""

import math
import re
import textwrap

import numpy as np

from rmrc.scenario.choices import Status

KEEPERS = {
    "damping": Status.DAMPED, "the inverse's filter": Status.DAMPED, "slowing down": Status.SLOWED,
    "stopping": Status.STOPPED, "keeping out": Status.KEPT_OUT, "the rate limit": Status.RATE_LIMITED,
    "the acceleration limit": Status.ACCELERATION_LIMITED, "the jerk limit": Status.JERK_LIMITED,
    "a joint limit": Status.POSITION_LIMITED,
}  # fmt: skip
TIMES = {
    "stuck": Status.STUCK, "in contact": Status.CONTACT, "stopping or stopped": Status.STOPPED,
    "slowed": Status.SLOWED, "held back by joint limits": Status.POSITION_LIMITED,
    "with an actuator at its torque limit": Status.TORQUE_LIMITED,
}  # fmt: skip
AMOUNT = r"(less than 0\.001|infinite|unknown|[\d,.]+(?:e[+-]\d+)?)"
SENTENCE = re.compile(
    rf"(?P<place>Stayed at (?:a singularity|full reach)|(?:Came to full reach|(?:Came to a|Came near a|Met no) singularity) \(κ (?:at most )?(?P<kappa>{AMOUNT})\))"
    rf"(?P<end> and diverged at \S+ s(?: at .+?)?| and went \d+% of its path)?: "
    rf"(?:damped (?P<damped>\d+)% of the time at κ below 20(?P<way> \(lower damping\.below\))?, )?"
    rf"(?:(?P<keepers>.+?) kept )?(?P<joint>\S+?)'s commands (?P<verb>at|peaked at) (?P<rate>{AMOUNT})(?: of (?P<limit>{AMOUNT}))? (?P<unit>m|rad)/s"
    rf"(?P<rest>(?:, with at most .+? of error)?(?:, .+? for .+? s)*)"
    rf"(?:; (?P<who>the plain inverse|the baseline) (?P<did>would ask for|commanded) (?P<other>{AMOUNT}) (?P<other_unit>m|rad)/s(?P<other_end> and diverged at \S+ s)?)?\."
)  # fmt: skip


def is_told(text, value):
    """Say whether a text gives a number to three digits."""
    if text in ("infinite", "unknown"):
        return not math.isfinite(value)
    if text.startswith("less"):
        return 0 < value < 1e-3
    return math.isclose(float(text.replace(",", "")), value, rel_tol=5.1e-3, abs_tol=1e-300)


def has(run, status):
    return (run["status"].astype(int) & status) != 0


def denied(sentence, run):
    """Return what of a verdict the columns do not bear out."""
    found = SENTENCE.fullmatch(sentence)
    if found is None:
        return ["it is no such sentence"]
    kappa, singular, sent = run["condition"].max(), has(run, Status.SINGULAR), np.abs(run["qdot_cmd"])
    places = {
        "Stayed": singular.all(), "Came to": singular.any() and not singular.all(),
        "Came near": kappa >= 17 and not singular.any(), "Met no": kappa < 17 and not singular.any(),
    }  # fmt: skip
    wrong = ["place"] * (
        not next(right for words, right in places.items() if found["place"].startswith(words))
    )
    if "full reach" in found["place"]:
        distance = np.linalg.norm(run["pose"][singular, :3] - run.shoulder, axis=1)
        wrong += ["full reach"] * (not (0.995 * run.reach <= distance).all())
    wrong += ["κ"] * bool(found["kappa"] and not is_told(found["kappa"], kappa))
    end = found["end"] or ""
    wrong += ["divergence"] * (("diverged" in end) != (run.divergence is not None))
    if run.divergence is None:
        share = re.search(r"(\d+)%", end)
        wrong += ["end"] * (bool(share) == (run.completed == 1.0))
        wrong += ["share"] * bool(share and not 0 <= 100 * run.completed - int(share[1]) < 1)
    share = 100 * np.mean((run["damping"] > 0) & (run["condition"] < 20))
    wrong += ["damped"] * (bool(found["damped"]) != bool(share > 50))
    if found["damped"]:
        wrong += ["damped share"] * bool(abs(int(found["damped"]) - share) > 0.5 + 1e-9)
        wrong += ["way"] * (bool(found["way"]) != (run.damping_below > 0))
    joint = run.joints.index(next(name for name in run.joints if name[:20] == found["joint"][:20]))
    wrong += ["unit"] * (found["unit"] != run.joint_unit(joint))
    wrong += ["rate"] * (not is_told(found["rate"], sent[:, joint].max()))
    limit = run.rate_limit[joint] if run.rate_limit else math.inf
    wrong += ["limit"] * (not is_told(found["limit"], limit) if found["limit"] else math.isfinite(limit))
    plain = np.abs(run["qdot_plain"])
    for keeper in filter(None, re.split(r", | and ", found["keepers"] or "")):
        if keeper != "others":
            wrong += [keeper] * (not has(run, KEEPERS[keeper]).any())
            wrong += [f"{keeper} kept it"] * (not plain[:, joint].max() > sent[:, joint].max())
            is_lambda = (run["damping"][has(run, Status.DAMPED)] > 0).any()
            wrong += ["λ"] * (keeper == "damping" and not is_lambda)
    for size, unit in re.findall(rf"{AMOUNT} (mm|deg)", found["rest"]):
        kinds = {"mm": ("xyz", 1e3), "deg": ("rxryrz", 180 / math.pi)}
        rows = [
            i
            for i, axis in enumerate(("x", "y", "z", "rx", "ry", "rz"))
            if axis in run.axes and (i < 3) == (unit == "mm")
        ]
        errors = np.linalg.norm(run["pose_error"][:, rows], axis=1)
        wrong += [f"error in {unit}"] * (not is_told(size, kinds[unit][1] * errors.max()))
    for words, seconds in re.findall(rf", ({'|'.join(TIMES)}) for {AMOUNT} s", found["rest"]):
        wrong += [words] * (not is_told(seconds, run.period * has(run, TIMES[words]).sum()))
    if found["who"]:
        other = run if run.baseline is None else run.baseline
        is_plain = np.allclose(other["qdot_cmd"], other["qdot_plain"], rtol=1e-9, atol=1e-12)
        asks = found["did"] == "would ask for"
        largest = np.abs(other["qdot_plain" if asks else "qdot_cmd"]).max()
        wrong += ["other rate"] * (not is_told(found["other"], largest))
        wrong += ["asks for more"] * (asks and not largest > sent.max())
        wrong += ["who"] * (not asks and (found["who"] == "the plain inverse") != is_plain)
        wrong += ["other's end"] * (bool(found["other_end"]) != (not asks and other.divergence is not None))
    return wrong + ["length"] * (len(textwrap.wrap(sentence, 100)) > 2)
