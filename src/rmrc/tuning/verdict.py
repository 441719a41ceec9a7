"""A setting and its outcomes, and the best of several."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from rmrc.scenario.choices import INVERSES, POLICIES
from rmrc.tuning.front import dominates, front
from rmrc.tuning.space import Setting
from rmrc.tuning.trials import Outcome, worst

# Errors within this share of the smallest one count as equal, as other scenarios differ by more.
ALIKE = 0.02
# If κ reaches this, a plain inverse is a matter of luck: the arm may come nearer, with higher rates.
SINGULAR = 100.0
# Feedback within this share counts as equal: then the structure decides.
SLOW = 0.1


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
    def keeps_limits(self) -> bool:
        """Whether all its runs so far kept the limits, and none was ended early."""
        outcome = self.worst
        return outcome.excess <= 0.0 and not outcome.ended

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
    """

    front: tuple[Trial, ...] = ()
    recommended: Trial | None = None
    second: Trial | None = None
    better: Trial | None = None
    nearest: Trial | None = None


def judge(feasible: Iterable[Trial], tried: Iterable[Trial], own: Trial) -> Verdict:
    """Return the verdict.

    Args:
        feasible: Settings that keep the limits on all worlds.
        tried: All tried settings, at least one.
        own: The setting as written.
    """
    preferred = sorted(feasible, key=lambda trial: trial.preference)
    recommended = best(preferred)
    if recommended is None:
        nearest = min(tried, key=lambda it: (-len(it.outcomes), it.worst.excess, it.worst.error))
        return Verdict(nearest=nearest)
    points = {trial.worst.point: trial for trial in reversed(preferred)}
    chosen = [list(points.values())[i] for i in front(list(points))]
    inverse = recommended.setting.structure.inverse
    rivals = [trial for trial in preferred if trial.setting.structure.inverse != inverse]
    better = [trial for trial in preferred if dominates(trial.worst.point, own.worst.point)]
    dominating = recommended if recommended in better else best(better)
    return Verdict(tuple(chosen), recommended, best(rivals), dominating)


def best(trials: Iterable[Trial]) -> Trial | None:
    """Return the setting with the smallest error; of nearly equal errors, the smoothest; None of none.

    Of equally smooth settings, the one with the lowest feedback; then the preferred structure, and its
    smallest error. A setting that is unbounded near a singularity only counts if there is no other.
    """
    able = sorted(trials, key=lambda trial: trial.preference)
    alike = _least([trial for trial in able if trial.is_bounded] or able, lambda it: it.worst.error, ALIKE)
    alike = _least(alike, lambda trial: trial.worst.roughness, ALIKE)
    alike = _least(alike, lambda trial: trial.setting.feedback, SLOW)
    settings = {trial: (trial.setting.structure, trial.setting.is_written) for trial in alike}
    alike = [trial for trial in alike if settings[trial] == settings[alike[0]]]
    return min(alike, key=lambda trial: (trial.worst.error, trial.worst.time), default=None)


def _least(trials: Sequence[Trial], figure: Callable[[Trial], float], share: float) -> list[Trial]:
    """Return those with the smallest metric, or more by at most a share."""
    most = min(map(figure, trials), default=0.0) * (1.0 + share)
    return [trial for trial in trials if figure(trial) <= most]
