"""Short runs of arms that a test writes itself."""

from rmrc.scenario import Scenario
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation


def moved(model, kind, path, *, arm=None, axes=("x", "z"), control=None, limits=None, **plant):
    """Return the prepared scenario and the run of an arm that goes along a path of pieces, and does not diverge."""
    prepared = prepare(Scenario.model_validate({
        "name": "test", "arm": {"model": model, "site": "tip"} | (arm or {}), "task": {"axes": axes},
        "control": {"period": 0.001, "feedback": 10.0} | (control or {}),
        "target": {"path": path, "limits": limits or {}}, "plant": {"kind": kind, **plant},
    }))  # fmt: skip
    (run,) = Simulation([prepared]).run()
    assert run.divergence is None
    return prepared, run
