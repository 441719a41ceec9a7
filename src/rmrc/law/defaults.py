"""The numbers of a law that come from its arm where nobody gives them: see `rmrc.arm.geometry`."""

from rmrc.arm.geometry import damping_below, damping_maximum
from rmrc.law.task import Task
from rmrc.scenario import ControlSection
from rmrc.scenario.choices import DAMPING_BELOW, read_by


def fitted(control: ControlSection, task: Task, length: float | None) -> tuple[ControlSection, str]:
    """Return a control section with the numbers that fit the arm where it has none.

    Args:
        control: The control section.
        task: The task, with its length.
        length: The length as it was given [m]; None if the task has that of its arm.

    Returns:
        The section, and those numbers that came from the arm and matter, in a line; "" if there are none.
    """
    texts = [f"length {task.length:g} m"] if length is None and task.length != 1.0 else []
    inverse, damping, why = control.inverse, control.inverse.damping, ""
    below = damping.below
    if below is None:
        usual = task.usual_sigma
        below = damping_below(usual) if usual > 0.0 else float(DAMPING_BELOW.null or 0.0)
        why = "" if usual > 0.0 else "; the joints do not move the task"
    numbers = {"maximum": damping.maximum or damping_maximum(below), "below": below}
    read = {each.key for each in read_by(inverse.method, damping.schedule)}
    new = [name for name in numbers if getattr(damping, name) is None and f"inverse.damping.{name}" in read]
    if new:
        texts.append(f"damping {', '.join(f'{name} {numbers[name]:g}' for name in new)}{why}")
    inverse = inverse.model_copy(update={"damping": damping.model_copy(update=numbers)})
    assumed = f"from the arm: {', '.join(texts)}" if texts else ""
    return control.model_copy(update={"inverse": inverse}), assumed
