"""Encoders that are off: how far the tip comes to lie beside its target."""

import numpy as np

from project import ROOT
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

STANFORD = (
    "arm.model=models/stanford.xml", "arm.site=tool", "arm.start=home", "task.axes=[x, y, z, rx, ry, rz]",
)  # fmt: skip
# Whitney's arm: at rest, the law sees no error but rounding.
EXACT = (
    "plant.kind=ideal", "control.inverse.method=inverse", "control.period=0.02", "control.feedback=50",
    "control.limits.on_excess=none", "target.limits={velocity: 1, acceleration: 10, jerk: 100}",
    "target.path=[{line: {by: [0.05, 0.05]}}, {hold: {for: 0.2}}]",
)  # fmt: skip


# Encoders that are off ---------------------------------------------------------------------------

BASE = "{name: test, arm: {model: '', site: tip}, target: {path: []}}"
DEVIATION = "arm.encoder.deviation=[1.0e-3, 0.5e-3, 0.4e-3, 1.0e-3, 2.0e-3, 1.0e-3]"


def test_each_tip_ends_beside_its_target_by_its_jacobian_times_its_offsets(monkeypatch):
    monkeypatch.chdir(ROOT)
    right, off = (prepare(loads(BASE, overrides=[*STANFORD, *EXACT, *more])) for more in ((), (DEVIATION,)))
    worlds = [prepare(off.scenario.set({"arm.encoder.seed": seed})) for seed in range(20)]
    exact, *runs = Simulation([right, *worlds]).run()
    errors = np.array([run["pose_error"][-1] for run in runs])
    offsets = np.array([world.hardware.encoders.offset for world in worlds])
    J = right.arm.jacobian(exact["q"][-1])
    # The law brings q + δ to where q is wanted, so the error is k(q) − k(q − δ) = J δ up to half the second
    # derivatives, none of which is longer than the arm: at most 2.4 m, or 1 for the rotation.
    bound = 0.5 * 2.4 * np.abs(offsets).sum(axis=1) ** 2
    assert (np.abs(errors - offsets @ J.T).max(axis=1) <= bound).all()
    assert bound.max() < 0.05 * np.abs(errors).max()  # which says something
