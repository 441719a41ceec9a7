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
        sampler: independent samples, or the Sobol sequence, which covers the range more evenly
        samples: samples for each combination of `vary`; powers of 2 suit Sobol best
        repeat: runs per sample, each with other encoder errors, jitter and losses
        seed: seed of samples, from which arm.encoder.seed and plant.seed count; null: from their own
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


_BASELINE = "value in a second run of `rmrc run`, for comparison"
Baseline = dict[Annotated[str, _key_but(*_FIXED, "expect")], Annotated[Any, Field(description=_BASELINE)]]


class TuneSection(Section):
    """Uncertainty about the robot, over which `rmrc tune` finds robust settings.

    Attributes:
        delay: dead time of commands, or its range; null: as in `plant`, or assumed without data of the robot
        lag: time constant of the actuators, as `delay`
        noise: standard deviation of the encoders' noise, for slides over task.length, as `delay`
        calibration: largest relative error of link lengths and of joint zeros (slides over task.length);
            null: none
    """

    delay: Range | None = key(None, "s")
    lag: Range | None = key(None, "s")
    noise: AngleRange | None = key(None, "rad")
    calibration: NotNegative | None = key(None, "1 or rad")
