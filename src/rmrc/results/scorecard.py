"""The scorecard, a run in metrics; and the verdict, a run in one sentence, with warnings of a line each.

A metric has one flat name with dots, such as `joint_rate.peak` or `joint_rate.shoulder.peak`. Equal ticks
give equal metrics; only `wall_time` and `speed` differ from one execution to the next.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rmrc.results.columns import Recorded
from rmrc.results.metrics import metrics
from rmrc.scenario.choices import Status
from rmrc.support.errors import did_you_mean
from rmrc.support.text import brief, visible

# Other words at the end of a metric.
_WORDS = {"max": "peak", "maximum": "max", "peak": "max", "mean": "rms", "final": "end", "last": "end"}


class Figure(NamedTuple):
    """One metric.

    Attributes:
        value: A number (NaN: undefined for this run), or the name of a joint.
        unit: SI, `1` for a plain number, "" for a name.
        meaning: A short description.
    """

    value: float | str
    unit: str
    meaning: str


@brief
@dataclass(frozen=True, eq=False)
class Scorecard(Mapping[str, Figure]):
    """The metrics of one run by name, in the order of display.

    Attributes:
        name: Name of the scenario.
        joints: Names of the joints in the names of metrics.
        figures: By flat name.
    """

    name: str
    joints: tuple[str, ...]
    figures: Mapping[str, Figure]

    def __getitem__(self, name: str) -> Figure:
        """Return a metric by its flat name.

        Raises:
            KeyError: There is none; it names the nearest.
        """
        if name not in self.figures:
            raise KeyError(f'no metric "{name}"{nearest(name, self.figures)}')
        return self.figures[name]

    def __contains__(self, name: object) -> bool:
        """Return whether there is such a metric."""
        return name in self.figures

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.figures)

    def __len__(self) -> int:
        """Return the number of metrics."""
        return len(self.figures)

    def nested(self) -> dict[str, object]:
        """Return the values as dicts within dicts, ready for strict JSON.

        A name is split at its dots, except where the part before a dot is a metric itself (a joint
        may be called `peak`). JSON has neither NaN nor infinity: an undefined number or name
        becomes None, an infinite number the text "inf" or "-inf", which `float` reads.
        """
        tree: dict[str, object] = {}
        for name, figure in self.figures.items():
            branch, start, parts = tree, 0, name.split(".")
            for end in range(1, len(parts)):
                if ".".join(parts[:end]) not in self.figures:
                    key, start = ".".join(parts[start:end]), end
                    branch = branch.setdefault(key, {})  # type: ignore[assignment]
            branch[".".join(parts[start:])] = json_value(figure.value)
        return tree


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the metric that a name is likely to mean, as the end of a message, or how metrics begin."""
    group, _, last = name.rpartition(".")
    known, word = list(names), f"{group}.{_WORDS.get(last, last)}"
    groups = ", ".join(dict.fromkeys(each.partition(".")[0] for each in known))
    if word in known:
        return f'; did you mean "{word}"?'
    return did_you_mean(name, known) or f"; metrics begin with {groups}"


def scorecard(run: Recorded) -> Scorecard:
    """Return the metrics of a run of any length, even 0."""
    with np.errstate(all="ignore"):  # of infinite values, differences are NaN
        named = {name: Figure(value, unit, meaning) for name, value, unit, meaning in metrics(run)}
    return Scorecard(run.name, run.joints, named)


def json_value(value: float | str) -> float | str | None:
    """Return a value for strict JSON, as in `Scorecard.nested`."""
    if isinstance(value, str):
        return value or None
    return None if math.isnan(value) else str(value) if math.isinf(value) else value


# κ from which an arm counts as near a singularity: MoveIt Servo begins to slow down there. From 100 on it is
# SINGULAR.
NEAR = 17.0
# Rates that differ by less count as the same.
MORE = 1.05

# The cause of a reduced rate, by the status at the tick.
_CAUSES = {
    Status.DAMPED: "damping",
    Status.SLOWED: "slowing down",
    Status.STOPPED: "stopping",
    Status.KEPT_OUT: "keeping out",
    Status.RATE_LIMITED: "the rate limit",
    Status.ACCELERATION_LIMITED: "the acceleration limit",
    Status.JERK_LIMITED: "the jerk limit",
    Status.POSITION_LIMITED: "a joint limit",
}

SLIP_CURE = "write no solref and solimp there, or stiffer ones"
# Events that may be unintended: the group of their metrics, the status, and the remedy.
_EVENTS = (
    ("stuck.", "STUCK", "start in another posture (arm.start), or move the path into reach"),
    ("contact.", "CONTACT", "move the path or arm.start, or exclude the pair if its shapes are inexact"),
    ("torque_limited.", "TORQUE_LIMITED", "lower target.limits or control.limits"),
    ("slip.", "SLIPPED", SLIP_CURE),
)


def warnings(card: Scorecard, expected: Collection[str]) -> Iterator[str]:
    """Yield standstill, contacts, actuators at their limit and slips of a run, a line each with the remedy.

    Args:
        card: Scorecard of the run.
        expected: Names of metrics that the scenario expects; what they measure is left out.
    """
    for group, status, cure in _EVENTS:
        duration = f"status_time.{status}"
        if card[duration].value and not any(name.startswith((group, duration)) for name in expected):
            values = {name: figure.value for name, figure in card.items() if name.startswith(group)}
            shown = [f"{name} {x if isinstance(x, str) else f'{x:.3g}'}" for name, x in values.items()]
            yield f"{card.name}: {status}: {', '.join(shown)}; {cure}, or expect it: expect: {{{group}...}}"


def verdict(run: Recorded, card: Scorecard, baseline: Recorded | None = None) -> str:
    """Return the verdict on a run: its end, its rates, its error, and what its baseline commanded.

    Args:
        run: The run so far.
        card: Its metrics.
        baseline: The run of its baseline, if it has one.
    """
    if not len(run):
        return f"{'Diverged' if run.divergence else 'Ended'} before the first tick was recorded."
    known = (("position_error.max", 1e3, "mm"), ("orientation_error.max", math.degrees(1.0), "deg"))
    errors = [f"{_amount(scale * float(card[m].value))} {unit}" for m, scale, unit in known if m in card]
    error = f"with at most {' and '.join(errors)} of error"
    return f"{_place(run)}: {_rates(run)}, {error}{_other(run, baseline)}."


def _place(run: Recorded) -> str:
    """Return how near to a singularity it came, and whether it is complete."""
    condition = float(run["condition"].max())
    is_singular = np.any(run.columns["status"].astype(np.int64) & Status.SINGULAR)
    place = "Came to a" if is_singular else "Came near a" if condition >= NEAR else "Met no"
    end = "" if run.is_complete else f" and went {math.floor(100.0 * run.completed)}% of its path"
    if run.divergence:
        end = _divergence(run) + (f" at {visible(run.divergence.joint)}" if run.divergence.joint else "")
    most = "at most " if place == "Met no" else ""
    return f"{place} singularity (κ {most}{_amount(condition)}){end}"


def _rates(run: Recorded) -> str:
    """Return the causes that kept the joint with the largest plain rate below it, or the largest rate."""
    limit = np.array(run.rate_limit or (math.inf,) * len(run.joints))
    scale = np.where(np.isfinite(limit), limit, 1.0)
    plain, commands = np.abs(run["qdot_plain"]), np.abs(run["qdot_cmd"])
    with np.errstate(over="ignore"):  # of a limit near 0
        j = int((plain.max(axis=0) / scale).argmax())
    peak, causes = commands.max(axis=0), list[str]()
    if plain[:, j].max() > MORE * peak[j]:
        ticks = [plain[:, j].argmax(), commands[:, j].argmax()]
        status = np.bitwise_or.reduce(run.columns["status"][ticks].astype(np.int64))
        causes = [cause for one, cause in _CAUSES.items() if status & one]
    if not causes:
        j = int((peak / scale).argmax())
    of = f" of {_amount(limit[j])}" if math.isfinite(limit[j]) else ""
    kept, did = (f"{' and '.join(causes)} kept ", "at") if causes else ("", "peaked at")
    commands_of = f"{kept}{visible(run.joints[j])}'s commands"
    return f"{commands_of} {did} {_amount(peak[j])}{of} {run.joint_unit(j)}/s"


def _other(run: Recorded, baseline: Recorded | None) -> str:
    """Return the largest rate that a baseline commanded, or of the plain inverse if that is larger."""
    if baseline is None:
        (plain, text), (peak, _) = _peak(run, "qdot_plain"), _peak(run, "qdot_cmd")
        return f"; the plain inverse would ask for {text}" if plain > MORE * peak else ""
    is_plain = np.allclose(baseline["qdot_cmd"], baseline["qdot_plain"], rtol=1e-9, atol=1e-12)
    name = "its baseline, the plain inverse," if is_plain else "its baseline"
    return f"; {name} commanded {_peak(baseline, 'qdot_cmd')[1]}{_divergence(baseline)}"


def _divergence(run: Recorded) -> str:
    return f" and diverged at {_amount(run.divergence.time)} s" if run.divergence else ""


def _peak(run: Recorded, column: str) -> tuple[float, str]:
    """Return the largest rate, over all joints and ticks, and it with the unit of its joint."""
    peaks = np.abs(run[column]).max(axis=0, initial=0.0)
    j = int(peaks.argmax())
    return float(peaks[j]), f"{_amount(peaks[j])} {run.joint_unit(j)}/s"


def _amount(value: float) -> str:
    """Return three digits, or a whole number up to a million with commas."""
    return f"{value:,.0f}" if 999.5 <= value < 1e6 else f"{value:.3g}"
