"""The expectations of a scenario: bounds of metrics, and a vendor's limits of commands."""

from typing import Annotated, Any

from pydantic import AfterValidator

from rmrc.scenario.profile import ProfileName
from rmrc.scenario.values import Choice, NotNegative, Number, TextOr, key, rule

# The key in `expect` for a profile instead of a metric.
PROFILE = "profile"


class Check(Choice):
    """Expectation of one metric of the scorecard.

    Attributes:
        below: upper bound: the metric must be less than this
        above: lower bound: the metric must be more than this
        equals: expected value of the metric, to `within`
        within: tolerance: largest deviation from `equals`
    """

    counts = ((("below", "above", "equals"), 1, 3),)
    needs = (("equals", "within"), ("within", "equals"))
    below: Number | None = key(None, "as the metric")
    above: Number | None = key(None, "as the metric")
    equals: Number | None = key(None, "as the metric")
    within: NotNegative | None = key(None, "as the metric")


def _profile_apart(expect: dict[str, Any]) -> dict[str, Any]:
    """Refuse a text in place of a check, and a check in place of a profile."""
    for name, value in expect.items():
        if (name == PROFILE) != isinstance(value, str):
            wanted = "the name of a profile or a file" if name == PROFILE else "a mapping, such as {below: 1}"
            raise rule(f"must be {wanted}", ("expect", name))
    return expect


Expectations = Annotated[dict[str, TextOr[ProfileName, Check]], AfterValidator(_profile_apart)]
"""A check of each metric, by its name, and a profile."""
