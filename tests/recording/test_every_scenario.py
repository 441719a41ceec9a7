"""The recording of every shipped scenario: what each view draws, and that the viewer can draw it."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from layouts import last_layout
from rerun.chunk import RrdReader

import rmrc
from processes import started, wait_for
from project import ROOT
from rmrc.recording.single import read_columns
from rmrc.recording.viewer import _free_port

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


def values(path, entity, component, field):
    """All numbers of a curve, (T, width), and their seconds, in order."""
    found, times = [], []
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}", is_static=False):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            inner = batch.column(component).flatten()
            inner = inner.field(field) if field else inner
            flat = inner if inner.type.num_fields == 0 else inner.flatten()
            found.append(np.asarray(flat.to_numpy(zero_copy_only=False), float).reshape(len(batch), -1))
            times.append(batch.column("sim_time").to_numpy(zero_copy_only=False).astype(np.int64))
    order = np.concatenate(times).argsort(kind="stable")
    return np.concatenate(found)[order], np.concatenate(times)[order] * 1e-9


def drawn(run, name):
    """What a curve that is only drawn has at each tick, from the columns, by the formulas of docs."""
    axes = [("x", "y", "z", "rx", "ry", "rz").index(axis) for axis in run.axes]
    error = run["pose_error"]
    kinds = [rows for rows in ([a for a in axes if a < 3], [a for a in axes if a > 2]) if rows]
    logs = [run["sigma"][:, -1], run["sigma"][:, :-1], run["damping"], run["secondary_sigma"]]
    with np.errstate(divide="ignore"):
        return {
            "error": lambda: np.stack(
                [1e3 * np.sqrt((error[:, rows] ** 2).sum(axis=1)) for rows in kinds], 1
            ),
            "logs": lambda: np.log10(np.maximum(np.column_stack(logs), 1e-6)),
            "plain": lambda: run["qdot_plain"],
            "belief": lambda: 1e3 * (run["q_believed"] - run["q"]),
            "joints": lambda: np.where(run.is_slide, run["q"], np.degrees(run["q"])),
        }[name]()


def test_each_view_draws_the_columns(left):
    """Curves of columns have their bits; what is only drawn is within float32, but for the gaps of dashes."""
    run, path = left
    columns = read_columns(path)
    assert all(columns[name].tobytes() == run.columns[name].tobytes() for name in run.columns)
    layout, checked = last_layout(path), 0
    for entity, table in layout.items():
        if "VisualizerInstruction:component_map" not in table:
            continue
        (source,) = table["VisualizerInstruction:component_map"]
        view = entity.split("/ViewContents/")[0]
        place = entity.removeprefix(f"{view}/ViewContents/overrides/").rpartition("/visualizers")[0]
        place = place or entity.split("overrides/")[-1].split("/visualizer")[0]
        component, field = source["source_component"], (source["selector"] or "").strip(".[]")
        found, times = values(path, place, component, field)
        names = layout[entity].get("SeriesLines:names") or layout[entity].get("SeriesPoints:names")
        assert names is None or len(names) == found.shape[1]
        assert len(found) and times[0] >= 0.0
        checked += 1
        if place == "columns" and field in run.columns:
            assert found.tobytes() == run.columns[field].reshape(len(run), -1).astype(float).tobytes()
        elif place == "columns" and field not in ("turn", "turn_error"):
            there = np.isfinite(found)
            assert there.any() or field == "plain"
            expected = drawn(run, field)[:, : found.shape[1]]
            np.testing.assert_allclose(found[there], expected[there], rtol=1e-5, atol=1e-6)
    assert checked >= 6
    rates = np.abs(run["qdot"]).max()
    assert rates == run.scorecard["joint_rate.peak"].value


def looked_at(path, at):
    """The state of the viewer that `replay` opens, without a window, once it stands still at a time."""
    from rerun.experimental import ViewerClient

    if not list(Path("/usr/share/vulkan/icd.d").glob("*.json")):
        pytest.skip("there is no Vulkan driver here; `.ci/run browser` installs one")
    port = _free_port(None)
    code = f"""
from pathlib import Path
from rmrc.recording import viewer
viewer.RERUN += ("--headless", "--window-size", "1280x720")
viewer.replay(Path({str(path)!r}), at={at}, port={port})
"""

    def state():
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.take_screenshot()  # it has drawn all views
            found = client.get_state()
        except (OSError, RuntimeError):  # it does not listen yet
            return None
        return found if [some.current_time for some in found.recordings] == [round(1e9 * at)] else None

    with started([sys.executable, "-c", code], env={**os.environ, "DISPLAY": ":0"}):
        return wait_for(state, 120)


@pytest.mark.browser
def test_the_viewer_draws_every_view_at_the_time_that_it_is_told(left):
    run, path = left
    at = round(0.6 * float(run["time"][-1]), 3)
    views = looked_at(path, at).views
    assert len(views) >= 6
    assert [(view.name, report.summary) for view in views for report in view.reports] == []
