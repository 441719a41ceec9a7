"""Variants of a scenario: values that a sweep gives to its keys, and its uncertainty for `rmrc tune`."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from rmrc.scenario.reading import split
from rmrc.scenario.values import AngleRange, Bounds, NotNegative, Range, Section, Seed, Values, key, rule

# Nobody can read a sweep over more keys than this, and the Sobol sequence here has this many dimensions.
MOST_DRAWN = 20

# Keys that no variant changes.
_FIXED = ("name", "look", "baseline", "sweep", "tune")

_Whole = Annotated[int, Field(strict=True, ge=1)]


def _key_but(*fixed: str) -> AfterValidator:
    """Return the check of a text that is a key: not one of some keys, nor below one of some sections."""

    def check(name: str) -> str:
        try:
            section = str(split(name)[0])
        except ValueError as error:
            raise rule(str(error).removeprefix(f"{name!r} ")) from None
        if section in fixed or name in fixed:
            way = "; use sweep.repeat and sweep.seed" if name.endswith("seed") else ""
            raise rule(f"cannot be changed here, as it is of the whole{way}")
        return name

    return AfterValidator(check)


_Varied = Annotated[str, _key_but(*_FIXED, "arm.encoder.seed", "plant.seed")]


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

    vary: dict[_Varied, Values] = key({})
    draw: dict[_Varied, Bounds] = key({}, max_length=MOST_DRAWN)
    sampler: Literal["random", "sobol"] = "random"
    samples: _Whole = 64
    repeat: _Whole = 1
    seed: Seed | None = None

    @model_validator(mode="after")
    def _each_key_once(self) -> Self:
        for name in self.draw.keys() & self.vary.keys():
            raise rule("must be in vary or in draw, got both", ("sweep", "draw", name))
        return self


_BASELINE = "value of the key, as `--set` gives it, in a second run that `rmrc run` makes for comparison"
Baseline = dict[Annotated[str, _key_but(*_FIXED, "expect")], Annotated[Any, Field(description=_BASELINE)]]


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
