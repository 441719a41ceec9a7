"""The task of a scenario: the controlled components of the site's motion."""

from typing import Self, get_args

from pydantic import model_validator

from rmrc.scenario.values import Axes, Axis, Frame, Positive, Section, Weights, key, rule
from rmrc.support.problems import Key


def pair_with_axes(section: Section, name: str, place: Key) -> None:
    """Sort the axes of a section in the order of twist rows, and the values of a key beside them.

    Args:
        section: It is still being made, so its promise to be frozen does not hold yet.
        name: Key of the list with one value for each of its `axes`, or null.
        place: Key of the section.

    Raises:
        PydanticCustomError: There is not one value for each axis.
    """
    fields = section.__dict__
    axes, values = fields["axes"], fields[name]
    if values is not None and len(values) != len(axes):
        counts = f"got {len(values)} for the {len(axes)} axes {', '.join(axes)}"
        raise rule(f"must have one value for each of axes, {counts}", (*place, name))
    order = sorted(range(len(axes)), key=lambda i: get_args(Axis).index(axes[i]))
    fields["axes"] = tuple(axes[i] for i in order)
    fields[name] = values and tuple(values[i] for i in order)


class TaskSection(Section):
    """The task: controlled components of the site's motion, and their weights.

    Attributes:
        axes: controlled rows of the twist, along the axes of `frame`
        frame: frame of the task rows: world; base, the body that carries the first joint; site, the
            controlled site as it rotates
        length: characteristic length: divides the linear rows, to make them comparable with angles; null: the
            rms distance of the site from the hinges' axes, or 1 where it would only change the unit of σ
        weights: task weights W_x, one per axis in the order of `axes`; null: all 1
    """

    axes: Axes = get_args(Axis)
    frame: Frame = "world"
    length: Positive | None = key(None, "m", schema={"derived": "from the arm"})
    weights: Weights | None = key(None, "1")

    @model_validator(mode="after")
    def _in_row_order(self) -> Self:
        pair_with_axes(self, "weights", ("task",))
        return self
