"""The motion of a new scenario, and its results: a table and JSON."""

from typing import Any

from rmrc.analysis.new.new import New
from rmrc.analysis.new.text import listed_positions
from rmrc.show.report import Report, plain
from rmrc.show.sheets import UNDEFINED, Sheet, number

# Metrics of each plant that are shown, with their names in words.
FIGURES = {
    "duration": "duration [s]", "position_error.max": "largest position error [m]",
    "orientation_error.max": "largest orientation error [rad]", "sigma.min": "smallest sigma [1]",
    "joint_rate.peak": "largest joint rate [rad/s or m/s]", "status_time.DAMPED": "time DAMPED [s]",
    "status_time.RATE_LIMITED": "time RATE_LIMITED [s]",
}  # fmt: skip


def report(made: New) -> Report:
    """Return the report of a new scenario.

    Args:
        made: The result of `new`.

    Example:
        >>> from rmrc.analysis.new.new import new
        >>> report(new("planar_2link")).json["damping"]["below"] > 0.0
        True
    """
    arm, scales, move = made.arm, made.scales, made.move
    singular = move.nearest
    control, target = made.scenario.control, made.scenario.target.limits
    damping = control.inverse.damping
    most, below = damping.maximum or 0.0, damping.below or 0.0
    figures: dict[str, dict[str, Any]] = {
        plant: {name: card[name].value for name in FIGURES if name in card}
        for plant, card in made.scorecards.items()
    }
    near = listed_positions(scales, move.nearest.q)
    assumed = [name for name, one in zip(arm.joints, scales.is_assumed, strict=True) if one]
    values = {
        "model": arm.path.name, "site": arm.site, "joints": arm.joints, "axes": scales.task.axes,
        "length": scales.task.length, "start": move.start, "start_is_home": move.is_home, "move": move.how,
        "singularity": {"q": singular.q, "sigma": singular.sigma, "is_singular": singular.is_singular},
        "rate": scales.rate, "rate_assumed": assumed,
        "damping": {"maximum": damping.maximum, "below": damping.below},
        "faults": made.faults, "velocity": target.velocity,
        "angular_velocity": target.angular_velocity, "plants": figures,
    }  # fmt: skip
    rows = [
        (
            "move",
            f"{move.how} the nearest singularity, at {near}"
            if move.how != "aside"
            else "aside; no singularity found",
        ),
        ("start", "home" if move.is_home else listed_positions(scales, move.start)),
        ("task", f"{' '.join(scales.task.axes)}, 1 rad counts as {number(scales.task.length)} m"),
        ("damping", f"up to {number(most)} where sigma_min is below {number(below)}"),
        ("speed", f"{number(target.velocity)} m/s, {number(target.angular_velocity)} rad/s"),
        ("rate limits", f"assumed: {', '.join(assumed)}" if assumed else "the model's"),
    ]
    if made.faults:
        rows.append(("faults", ", ".join(made.faults)))
    what = Sheet(f"{arm.path.name}, site {arm.site}", ("", ""), rows, frozenset({0, 1}))
    table = [
        (word, *(number(float(one[name])) if name in one else UNDEFINED for one in figures.values()))
        for name, word in FIGURES.items()
    ]
    return Report([what, Sheet("Results on each plant", ("", *figures), table)], plain(values))
