"""Runs of the scenarios that are shipped, each made once for all tests of a process."""

import functools

from project import ROOT
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation


@functools.cache
def shipped(name, *overrides):
    """Return a run of a shipped scenario; nobody may write to it."""
    (run,) = Simulation([prepare(load(ROOT / f"scenarios/{name}.yaml", overrides))]).run()
    return run
