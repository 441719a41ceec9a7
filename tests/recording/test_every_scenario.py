"""The recording of every shipped scenario: its columns, and that each plot draws something of them."""

import numpy as np
import pytest

import rmrc
import rrd
from project import ROOT

pytestmark = pytest.mark.long

SCENARIOS = sorted(path.stem for path in (ROOT / "scenarios").glob("*.yaml"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("every")


@pytest.fixture(scope="module", params=SCENARIOS)
def left(request, folder):
    """Run and recording of a scenario."""
    run = rmrc.run(ROOT / "scenarios" / f"{request.param}.yaml", out=folder)
    return run, folder / f"{request.param}.rrd"


def test_each_view_draws_the_columns(left):
    """Curves of columns have their bits; the others are their float32, and are never empty."""
    run, path = left
    columns, drawn = rrd.table(path), rrd.table(path, component="curves")
    assert all(columns[name].tobytes() == run.columns[name].tobytes() for name in run.columns)
    checked = 0
    for _, (low, high), curves in rrd.plots(path).values():
        assert low < high
        for entity, component, selector, names in curves:
            if entity == "columns":
                found = (columns if component == "columns" else drawn)[selector.strip(".[]")]
                assert len(found) == len(run) and np.isfinite(found).any()
                assert found.reshape(len(run), -1).shape[1] == len(names)
                checked += 1
    assert checked >= 4
    assert np.abs(columns["qdot"]).max() == run.scorecard["joint_rate.peak"].value
