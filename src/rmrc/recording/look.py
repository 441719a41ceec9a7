"""The instant at which a scenario asks to look."""

from collections.abc import Mapping

import numpy as np

from rmrc.results.run import Run
from rmrc.scenario.sections import LookSection
from rmrc.show.panels import Panel

# Roles of the curves that count.
ROLES = ("measured", "commanded")
# Panels of the quantities that have another name.
ERRORS = ("error", "turn_error")
PANELS = {"rotation": ("turn_error",), "status": ("rates",), "error": ERRORS, "path": ERRORS}


def instants(look: LookSection | None, panel: Panel, runs: Mapping[str, Run]) -> dict[str, int]:
    """Return the tick of each run to look at in a panel: the one that is asked for, or the worst one.

    A run that ended before it has none, and so has any other panel.

    Args:
        look: What the scenario asks for.
        panel: The panel.
        runs: The runs by the labels of their curves.
    """
    if look is None or panel.name not in PANELS.get(look.quantity, (look.quantity,)):
        return {}
    if look.at is not None:
        lasting = {label: run for label, run in runs.items() if look.at <= run["time"][-1] + run.period}
        return {label: int(np.abs(run["time"] - look.at).argmin()) for label, run in lasting.items()}
    found = dict[str, int]()
    for label, run in runs.items():
        curves = [curve for curve in panel.curves if curve.run == label and curve.role in ROLES]
        sizes = np.abs(np.nan_to_num([curve.values for curve in curves])).max(axis=0)
        if look.quantity in ("sigma", "pace"):
            sizes = -curves[0].values
        found[label] = int((run["status"] != 0 if look.quantity == "status" else sizes).argmax())
    return found
