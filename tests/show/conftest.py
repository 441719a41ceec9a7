"""The runs that the tests of pictures and pages share."""

import pytest

import rmrc
from project import ROOT, undrawn


@pytest.fixture(scope="session")
def left(tmp_path_factory):
    """Return the folder with what `run` left of an inverse that blows up, and `compare` of this and a damped one."""
    folder = tmp_path_factory.mktemp("left")
    scenario = ROOT / "scenarios/blow_up.yaml"
    with undrawn():
        rmrc.run(scenario, out=folder, record=False)
        rmrc.compare(scenario, {"control.inverse.method": ["inverse", "damped"]}, out=folder, record=False)
    return folder


@pytest.fixture(scope="session")
def compared(left):
    """Return the two runs by label."""
    return rmrc.read_runs(left / "blow_up.compare.npz")
