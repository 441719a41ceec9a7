"""The recording of every shipped scenario: what each view draws, and that the viewer can draw it."""

import time
from contextlib import contextmanager
from pathlib import Path

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


@contextmanager
def headless(path, log):
    """A native viewer without a window, as `replay` opens one, on a recording; skipped without a driver."""
    if not list(Path("/usr/share/vulkan/icd.d").glob("*.json")):
        pytest.skip("there is no Vulkan driver here; `.ci/run browser` installs one")
    from rmrc.recording.viewer import _free_port
    from rmrc.recording.viewer_process import Events, Program

    port, events = _free_port(), Events()
    options = ["--headless", "--window-size", "1280x720", "--bind", "127.0.0.1", "--port", str(port)]
    with Program([*options, "--hide-welcome-screen", str(path)], events, stderr=log) as program:
        yield port, program, events


def looked_at(path, at, tmp_path):
    """The state of the viewer once it stands still at a time, and has drawn it."""
    from rerun.experimental import ViewerClient

    from rmrc.recording.viewer import _go_to

    with (tmp_path / "log").open("wb") as log, headless(path, log) as (port, program, events):
        _go_to(at, port, program, events)
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        client.take_screenshot()
        time.sleep(0.5)
        client.take_screenshot()
        return client.get_state()


@pytest.mark.browser
def test_the_viewer_draws_every_view_at_the_time_that_it_is_told(left, tmp_path):
    run, path = left
    at = round(0.6 * float(run["time"][-1]), 3)
    state = looked_at(path, at, tmp_path)
    assert len(state.views) >= 6
    assert [(view.name, report.summary) for view in state.views for report in view.reports] == []
    (recording,) = state.recordings
    assert recording.current_time * 1e-9 == pytest.approx(at, abs=1e-9)  # and it stands there
