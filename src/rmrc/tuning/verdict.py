"""A setting and its outcomes, and the best of several."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from rmrc.scenario.choices import INVERSES, POLICIES
from rmrc.tuning.space import Setting
from rmrc.tuning.trials import Outcome, dominates, front, worst

# Errors within this share of the smallest one count as equal, as other scenarios differ by more.
ALIKE = 0.02
# If κ reaches this, a plain inverse is a matter of luck: the arm may come nearer, with higher rates.
SINGULAR = 100.0
# Feedback within this share counts as equal: then the structure decides.
SLOW = 0.1
# A setting is shown as well that exceeds limits by at most this share, with at most this share of the error.
HAIR, LESS = 0.05, 0.1
# A setting ends nearer than another with at most this share of its error at the end, or with this error [m].
NEARER, NEAR = 0.8, 1e-5
# Less feedback counts as this much [1/s].
_NO_FEEDBACK = 1e-9


@dataclass(eq=False)
class Trial:
    """A setting and its runs.

    Attributes:
        setting: The setting.
        outcomes: By the numbers of the worlds, 0 for the scenario itself.
        margin: Outcome with more feedback; None: unknown.
    """

    setting: Setting
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    margin: Outcome | None = None

    @property
    def worst(self) -> Outcome:
        """The worst of its runs."""
        return worst([*self.outcomes.values(), *([self.margin] if self.margin else [])])

    @property
    def nominal(self) -> float:
        """Its largest error on the scenario itself [m]; 0 if it was not run there."""
        return self.outcomes[0].error if 0 in self.outcomes else 0.0

    @property
    def keeps_limits(self) -> bool:
        """Whether all its runs so far kept the limits, and none was ended early."""
        outcome = self.worst
        return outcome.excess <= 0.0 and not outcome.ended

    @property
    def end(self) -> float:
        """The largest error at the end of its runs [m]; angles times task.length."""
        return max(max(outcome.end) for outcome in self.outcomes.values())

    def ends_nearer(self, other: "Trial") -> bool:
        """Whether it ends nearer to the target than another in all its runs so far."""
        pairs = [(self.outcomes[world].end, other.outcomes[world].end) for world in self.outcomes
                 if world in other.outcomes]  # fmt: skip
        return all(
            a <= max(NEARER * b, NEAR) for own, others in pairs for a, b in zip(own, others, strict=True)
        )

    def is_close_to(self, other: "Trial") -> bool:
        """Whether it exceeds limits by a hair's breadth, and has a fraction of another's error."""
        outcome = self.worst
        is_close = 0.0 < outcome.excess <= HAIR and not outcome.ended
        return is_close and outcome.error <= LESS * other.worst.error

    @property
    def is_bounded(self) -> bool:
        """Whether its rates stay bounded if the arm comes nearer to a singularity than in its runs."""
        preference = INVERSES[self.setting.structure.method].preference
        return preference < INVERSES["pseudoinverse"].preference or self.worst.condition < SINGULAR

    @property
    def preference(self) -> tuple[object, ...]:
        """The rank among equal settings: as written, then the simplest policy."""
        structure, policies = self.setting.structure, POLICIES.names
        return (
            not self.setting.is_written, policies.index(structure.at_singularity), structure.on_excess != "",
            INVERSES[structure.method].preference, self.worst.error, self.setting.numbers,
        )  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """The verdict.

    Attributes:
        front: Feasible nondominated settings, by rising peak rate; of settings with equal metrics, the
            preferred one.
        recommended: The best setting; None if nothing is feasible.
        second: The best with another inverse or schedule; None without one.
        better: The best that dominates the setting as written; None if that is on the front.
        nearest: The setting with the smallest excess over the limits, if nothing is feasible.
        close: A setting that exceeds limits a little, with much less error than the best; None: none.
        decided: What decided between the best and the second.
    """

    front: tuple[Trial, ...] = ()
    recommended: Trial | None = None
    second: Trial | None = None
    better: Trial | None = None
    nearest: Trial | None = None
    close: Trial | None = None
    decided: str = ""


def judge(
    feasible: Iterable[Trial], tried: Iterable[Trial], written: Trial, enough: float = math.inf
) -> Verdict:
    """Return the verdict.

    Args:
        feasible: Settings that keep the limits on all worlds.
        tried: All tried settings, at least one.
        written: The setting as written.
        enough: Feedback beyond which more is no better [1/s].
    """
    preferred = sorted(feasible, key=lambda trial: trial.preference)
    recommended = best(preferred, written, enough)
    if recommended is None:
        nearest = min(tried, key=lambda it: (-len(it.outcomes), it.worst.excess, it.worst.error))
        return Verdict(nearest=nearest)
    points = {trial.worst.point: trial for trial in reversed(preferred)}
    chosen = [list(points.values())[i] for i in front(list(points))]
    inverse = recommended.setting.structure.inverse
    second = best(
        (trial for trial in preferred if trial.setting.structure.inverse != inverse), written, enough
    )
    better = [trial for trial in preferred if dominates(trial.worst.point, written.worst.point)]
    return Verdict(
        front=tuple(chosen),
        recommended=recommended,
        second=second,
        better=recommended if recommended in better else best(better, written, enough),
        close=min(
            (trial for trial in tried if trial.is_close_to(recommended)),
            key=lambda trial: trial.worst.error,
            default=None,
        ),
        decided=next((why for why, some in _rounds(preferred, written, enough) if second not in some), ""),
    )


def best(trials: Iterable[Trial], written: Trial | None = None, enough: float = math.inf) -> Trial | None:
    """Return the setting with the smallest error on all worlds; of nearly equal ones, see `_rounds`.

    A setting that is unbounded near a singularity only counts if there is no other.

    Args:
        trials: The settings.
        written: The setting as written.
        enough: Feedback beyond which more is no better [1/s].
    """
    *_, (_, alike) = _rounds(trials, written, enough)
    return min(alike, key=lambda trial: (trial.worst.error, trial.worst.time), default=None)


def _rounds(
    trials: Iterable[Trial], written: Trial | None, enough: float
) -> Iterator[tuple[str, list[Trial]]]:
    """Yield what decides, in turn, and the settings that remain."""
    able = sorted(trials, key=lambda trial: trial.preference)
    able = [trial for trial in able if trial.is_bounded] or able
    yield "bounded rates", able
    able = _least(able, lambda trial: trial.worst.error, ALIKE)
    yield "error", able
    if written:  # which may have more feedback, that loads show at the end
        able = [trial for trial in able if trial.ends_nearer(written)] or able
        yield "end", able
    able = _least(able, lambda trial: trial.nominal, ALIKE)
    yield "nominal error", able
    able = _least(able, lambda trial: 1.0 / max(min(trial.setting.feedback, enough), _NO_FEEDBACK), SLOW)
    yield "feedback", able
    settings = {trial: (trial.setting.structure, trial.setting.is_written) for trial in able}
    yield "simplicity", [trial for trial in able if settings[trial] == settings[able[0]]]


def _least(trials: Sequence[Trial], figure: Callable[[Trial], float], share: float) -> list[Trial]:
    """Return those with the smallest metric, or more by at most a share."""
    most = min(map(figure, trials), default=0.0) * (1.0 + share)
    return [trial for trial in trials if figure(trial) <= most]
