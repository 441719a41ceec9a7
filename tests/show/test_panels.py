"""What a run shows: curves are its columns, an axis has one rule, and what is beyond it is written."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.scenario.choices import Status
from rmrc.show.panels import BESIDE, CLIP, extremes, lanes, panels, thinned


def changed(run, columns=None, **facts):
    return dataclasses.replace(run, columns=run.columns | (columns or {}), **facts)


def panel_of(runs, name):
    (panel,) = panels(runs, [name])
    return panel


def test_curves_that_name_a_column_are_this_column_and_each_quantity_of_a_joint_is_there(compared):
    run = changed(compared["damped"], {"q_believed": compared["damped"]["q"] + 1e-3})
    sources = set()
    for panel in panels(run, ["rates", "torque", "joints", "belief"]):
        for curve in (curve for curve in panel.curves if curve.source):
            column, j = curve.source
            np.testing.assert_array_equal(curve.values, run[column][:, j])
            np.testing.assert_array_equal(curve.time, run["time"])
            sources.add(curve.source)
    assert sources == {(column, j) for column in ("qdot", "qdot_cmd", "tau", "q") for j in range(2)}
    (sigma, damping) = panel_of(run, "sigma").curves
    np.testing.assert_array_equal(sigma.values, run["sigma"][:, -1])
    np.testing.assert_array_equal(np.nan_to_num(damping.values), run["damping"])


def test_errors_along_and_across_add_up_to_the_error(compared):
    run = compared["inverse"]
    along, across = panel_of(run, "error").curves
    wanted = 1e3 * np.linalg.norm(run["pose_error"][:, :2], axis=1)
    np.testing.assert_allclose(np.hypot(along.values, across.values), wanted, rtol=1e-9, atol=1e-9)
    assert across.values.max() > 10.0  # negative control: the tip does leave the line
    resting = changed(run, {"pose_ref": np.tile(run["pose_ref"][0], (len(run), 1))})
    assert [curve.name for curve in panel_of(resting, "error").curves] == ["position"]  # no path to be along


def test_a_run_beyond_its_limit_leaves_the_axis_and_its_peak_is_written(compared):
    run = compared["inverse"]
    peak = run.scorecard["joint_rate_cmd.peak"].value
    rates = panel_of(run, "rates")
    assert rates.range[1] == pytest.approx(1.05 * CLIP * 5.0)  # the limit of the model
    assert any(f"peak {peak:,.0f}" in text for text in rates.beyond)
    assert {level.value for level in rates.levels} == {5.0, -5.0}
    # Negative control: within three times the limit all is on the axis.
    whole = panel_of(changed(run, rate_limit=(peak, peak)), "rates")
    assert whole.range[1] >= peak and not whole.beyond


def test_the_plain_inverse_is_a_curve_beside_whose_peak_is_written_where_it_exceeds_the_run(compared):
    run = changed(compared["damped"], rate_limit=())
    plain = 1.0 * run["qdot_cmd"]
    plain[100, 1] = -512.0
    rates = panel_of(changed(run, {"qdot_plain": plain}), "rates")
    (curve,) = [curve for curve in rates.curves if curve.role == "plain"]
    np.testing.assert_array_equal(curve.values, plain[:, 1])
    assert rates.beyond == ["plain inverse, elbow: peak 512 ↓"]
    assert rates.peaks[0][1:3] == (run["time"][100], False)
    alone = panel_of(changed(run, {"qdot_plain": run["qdot_cmd"]}), "rates")
    assert alone.range[1] <= rates.range[1] <= BESIDE * alone.range[1]
    assert {curve.role for curve in alone.curves} == {"measured", "commanded"}  # the same curve is not drawn


def test_runs_side_by_side_have_a_curve_each_and_a_logarithmic_axis_where_they_differ_by_far(compared):
    rates = panel_of(compared, "rates")
    assert rates.is_logarithmic and [curve.name for curve in rates.curves] == ["inverse", "damped"]
    for curve, run in zip(rates.curves, compared.values(), strict=True):
        assert curve.values.max() == run.scorecard["joint_rate_cmd.peak"].value <= rates.range[1]
    same = {"first": compared["damped"], "second": compared["damped"]}
    assert not panel_of(same, "rates").is_logarithmic


def test_lanes_are_the_times_of_each_status(compared):
    run = compared["inverse"]
    drawn = {lane.name: lane.spans for lane in lanes(run)}
    for flag in (Status.SINGULAR, Status.TORQUE_LIMITED):
        holds = (run["status"].astype(int) & int(flag)) != 0
        inside = np.zeros(len(run), bool)
        for begin, end in drawn[flag.name.lower().replace("_", " ")]:
            inside |= (run["time"] >= begin - 1e-9) & (run["time"] < end - 1e-9)
        np.testing.assert_array_equal(inside, holds)
    assert "damped: damped" in {lane.name for lane in lanes(compared)}


@given(st.integers(1, 5000), st.integers(1, 500), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_ends_and_the_peaks(count, spans, seed):
    time, values = np.arange(count) * 1e-3, np.random.default_rng(seed).standard_normal(count)
    rows = extremes(values, spans)
    assert len(rows) <= 2 * spans + 2 + -(-count // spans)
    assert (np.diff(rows) > 0).all() and rows[0] == 0
    at, drawn = thinned(time, values, spans)
    assert (drawn == values[rows]).all() and (at == time[rows]).all()
    assert (drawn.min(), drawn.max()) == (values.min(), values.max())
