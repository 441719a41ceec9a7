"""Variants of a scenario: values that a sweep gives to its keys, and its uncertainty for `rmrc tune`."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from rmrc.scenario.keys import split
from rmrc.scenario.values import AngleRange, Bounds, NotNegative, Range, Section, Seed, Values, key, rule

# Nobody can read a sweep over more keys than this, and the Sobol sequence here has this many dimensions.
MOST_DRAWN = 20

# Keys that no variant changes.
_OF_A_FILE = ("name", "look", "baseline", "sweep", "tune")

_Whole = Annotated[int, Field(strict=True, ge=1)]


def _check_keys(names: Iterable[str], place: tuple[str, ...], fixed: tuple[str, ...]) -> None:
    """Refuse names that are no keys, and keys that a variant cannot change.

    Args:
        names: Keys of the variant.
        place: Key of the mapping that has them.
        fixed: The sections that it cannot change.
    """
    for name in names:
        try:
            section = split(name)[0]
        except ValueError:
            raise rule("is not a key such as control.feedback or arm.start[1]", (*place, name)) from None
        if section in fixed:
            raise rule(f"cannot be changed here: {section} is of the scenario as a whole", (*place, name))


class SweepSection(Section):
    """Variants for `rmrc sweep`: a grid, samples between bounds, repeats.

    Attributes:
        vary: values of keys; the sweep runs every combination
        draw: bounds of keys that are drawn uniformly
        sampler: sampling method: independent samples, or the Sobol sequence, which covers the range more
            evenly
        samples: number of samples for each combination of `vary`; Sobol samples are most even for powers of 2
        repeat: number of runs per sample, each with different encoder offsets, noise, jitter and losses
        seed: seed of the samples; each run's arm.encoder.seed and plant.seed count from it; null: from their
            own values
    """

    vary: dict[str, Values] = key({})
    draw: dict[str, Bounds] = key({}, max_length=MOST_DRAWN)
    sampler: Literal["random", "sobol"] = "random"
    samples: _Whole = 64
    repeat: _Whole = 1
    seed: Seed | None = None

    @model_validator(mode="after")
    def _each_key_once(self) -> Self:
        for place, names in (("vary", self.vary), ("draw", self.draw)):
            _check_keys(names, ("sweep", place), _OF_A_FILE)
            for name in names.keys() & {"arm.encoder.seed", "plant.seed"}:
                text = "cannot be varied: the sweep sets it for each run; use sweep.repeat and sweep.seed"
                raise rule(text, ("sweep", place, name))
        for name in self.draw.keys() & self.vary.keys():
            raise rule("must be in vary or in draw, got both", ("sweep", "draw", name))
        return self


def _check_baseline(values: dict[str, Any]) -> dict[str, Any]:
    _check_keys(values, ("baseline",), ("expect", *_OF_A_FILE))
    return values


Baseline = Annotated[
    dict[str, Annotated[Any, Field(description="value of the key, as `--set` gives it, in the baseline: a "
        "second run that `rmrc run` makes for comparison, such as the plain inverse without limits; other "
        "verbs ignore it")]],
    AfterValidator(_check_baseline),
]  # fmt: skip


class TuneSection(Section):
    """Uncertainty about the robot, over which `rmrc tune` finds robust settings.

    Attributes:
        delay: dead time of its commands, one value or a range; null: as in `plant`, or assumed if the
            scenario has no data of the robot
        lag: time constant of its actuators; range and null as for `delay`
        noise: standard deviation of its encoders' white noise, for slides divided by task.length; range and
            null as for `delay`
        calibration: calibration error: largest deviation, to either side, of its link lengths (relative) and
            of its joint zeros (for slides divided by task.length); null: none
    """

    delay: Range | None = key(None, "s")
    lag: Range | None = key(None, "s")
    noise: AngleRange | None = key(None, "rad")
    calibration: NotNegative | None = key(None, "1 or rad")
