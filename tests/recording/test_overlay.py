"""The recording of a comparison: every column of every variant, and all arms in one picture."""

import contextlib
import re
from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from layouts import last_layout
from rerun.chunk import RrdReader

from project import ROOT, mostly_long
from rmrc.recording.comparison import THICKER, Overlay
from rmrc.recording.shapes import shapes_of
from rmrc.recording.single import RecordingError, read_columns
from rmrc.results.columns import COLUMNS, Divergence
from rmrc.scenario import loads
from rmrc.scenario.choices import Status
from rmrc.show.palette import distinct
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

TEXT = f"""
name: planar
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
control: {{inverse: {{damping: {{maximum: 0.3, below: 0.8}}}}}}
target: {{path: [{{line: {{by: [0.2, 0.0]}}}}]}}
"""
LABELS = ("inverse", "damped, 0.3/2")  # the second needs to be escaped
METHODS = ("inverse", "damped")


def prepared_of(*overrides):
    return prepare(loads(TEXT, overrides=overrides))


@pytest.fixture(scope="module")
def compared():
    """(label and world of each variant, runs)."""
    worlds = [prepared_of(f"control.inverse.method={method}") for method in METHODS]
    return list(zip(LABELS, worlds, strict=True)), Simulation(worlds).run()


def rows(run, first, last):
    return replace(run, columns={name: values[first:last].copy() for name, values in run.columns.items()})


def record(path, variants, runs, size=300):
    with Overlay(path, "planar", variants) as overlay:
        for first in range(0, max(map(len, runs)), size):
            for i, run in enumerate(runs):
                overlay.write(i, rows(run, first, first + size))
        overlay.finish("| variant |")


@pytest.fixture(scope="module")
def recorded(compared, tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "planar.compare.rrd"
    record(path, *compared)
    return path


def entity(label, rest=""):
    escaped = re.sub(r"([^\w.-])", r"\\\1", label)
    return f"/variants/{escaped}/{rest}"


def stored(path, content):
    """All values that an entity got, by component, in the order of time."""
    found = {}
    for chunk in RrdReader(path).stream().filter(content=content):
        batch = chunk.to_record_batch()
        ticks = batch.column("tick").to_pylist() if "tick" in batch.schema.names else [-1] * len(batch)
        for field, values in zip(batch.schema, batch.columns, strict=True):
            if str(field.type).startswith("list"):
                found.setdefault(field.name, []).extend(zip(ticks, values.to_pylist(), strict=True))
    return {name: [value for _, value in sorted(pairs, key=lambda p: p[0])] for name, pairs in found.items()}


def drawn(path, label):
    """What is only drawn of a variant at every tick, by name, (T,)."""
    found = stored(path, entity(label, "columns"))["columns"]
    return {name: np.array([np.ravel(row[0][name])[0] for row in found]) for name in found[0][0]}


def assert_same_bits(columns, expected):
    assert list(columns) == list(expected) == list(COLUMNS)
    for name, values in expected.items():
        assert (columns[name].dtype, columns[name].shape) == (values.dtype, values.shape)
        assert columns[name].tobytes() == values.tobytes(), name


def test_the_columns_of_each_variant_read_back_bit_for_bit(recorded, compared):
    for label, run in zip(LABELS, compared[1], strict=True):
        assert_same_bits(read_columns(recorded, label), run.columns)
    assert not np.array_equal(read_columns(recorded, LABELS[0])["q"], read_columns(recorded, LABELS[1])["q"])


def test_a_variant_that_is_not_there_or_not_named_is_one_clear_line(recorded):
    names = "; ".join(sorted(LABELS))
    for wanted, what in ((None, "holds variants"), ("x", 'has no columns of the variant "x"')):
        with pytest.raises(RecordingError) as caught:
            read_columns(recorded, wanted)
        text, _, listed = str(caught.value).rpartition("; its variants: ")
        assert (text, "; ".join(sorted(listed.split("; ")))) == (f"{recorded}: {what}", names)


def test_runs_of_different_lengths_and_blocks_in_turn_are_all_kept(compared, tmp_path):
    variants, runs = compared
    runs = [rows(runs[0], 0, 57), rows(runs[1], 0, 431)]
    record(tmp_path / "x.rrd", variants, runs, 50)
    for label, run in zip(LABELS, runs, strict=True):
        assert_same_bits(read_columns(tmp_path / "x.rrd", label), run.columns)
        last = stored(tmp_path / "x.rrd", entity(label, "tip/now"))["Points3D:positions"][-1][0]
        np.testing.assert_allclose(last, run["pose"][-1, :3], atol=1e-6)  # as far as it came


def test_it_appears_whole_and_only_when_finished_and_a_part_can_be_read(compared, tmp_path):
    variants, runs = compared
    path = tmp_path / "x.rrd"
    with contextlib.suppress(ZeroDivisionError), Overlay(path, "planar", variants) as overlay:
        overlay.write(1, rows(runs[1], 0, 40))
        raise ZeroDivisionError
    assert [p.name for p in tmp_path.iterdir()] == ["x.rrd.part"]
    assert_same_bits(read_columns(overlay.part_path, LABELS[1]), rows(runs[1], 0, 40).columns)


def test_each_arm_has_its_color_and_all_but_the_first_are_outlines_around_it(recorded, compared):
    prepared = compared[0][0][1]
    capsules = [shape for shape in shapes_of(prepared.arm) if shape.kind == "capsule"]
    assert capsules
    for shape in capsules:
        body = prepared.arm.model.body(shape.body).name
        drawn = [stored(recorded, entity(label, f"arm/{body}")) for label in LABELS]
        radii = [one["Capsules3D:radii"][0][0] for one in drawn]
        np.testing.assert_allclose(radii, shape.size[0] * np.array([1.0, 1.0 + THICKER]), rtol=1e-6)
        lengths = [one["Capsules3D:lengths"][0][0] for one in drawn]
        np.testing.assert_allclose(lengths, 2.0 * shape.size[1], rtol=1e-6)
        colors = [one["Capsules3D:colors"][0][0] for one in drawn]
        assert colors[0] >> 8 != colors[1] >> 8
        modes = [one["Capsules3D:fill_mode"][0][0] for one in drawn]
        assert modes == [rr.components.FillMode.Solid.value, rr.components.FillMode.MajorWireframe.value]
    for label, color in zip(LABELS, distinct(2), strict=True):
        assert set(map(tuple, stored(recorded, entity(label, "tip/trail"))["LineStrips3D:colors"])) == {
            (color,)
        }


def test_the_curves_are_those_of_the_columns(recorded, compared):
    for label, run in zip(LABELS, compared[1], strict=True):
        expected = {
            "fastest": [max(map(abs, rates)) for rates in run["qdot"].tolist()],
            "fastest_cmd": [max(map(abs, rates)) for rates in run["qdot_cmd"].tolist()],
            "torque": 100.0 * (np.abs(run["tau"]) / compared[0][0][1].arm.torque_limit).max(axis=1),
            "log_sigma_min": np.log10(run["sigma"].min(axis=1)),
            "position": 1e3 * np.hypot(*run["pose_error"][:, :2].T),
        }
        found = drawn(recorded, label)
        for name, values in expected.items():
            np.testing.assert_allclose(found[name], values, rtol=1e-6, atol=1e-12)  # float32
        assert "rotation" not in found  # the task has no rotations


def test_what_has_not_arrived_and_what_the_law_believes_are_drawn_of_those_that_have_it(compared, tmp_path):
    late = prepared_of("plant={delay: 0.02, joint_offset: [0.01, -0.02]}")
    worlds = [compared[0][0][1], late]
    runs = Simulation(worlds).run()
    path = tmp_path / "x.rrd"
    record(path, [("plain", worlds[0]), ("late", late)], runs)
    found = drawn(path, "late")
    commands, ticks = runs[1]["qdot_cmd"], 20
    arrived = np.vstack([np.zeros((ticks, 2)), commands[:-ticks]])
    np.testing.assert_allclose(found["waiting"], np.abs(commands - arrived).max(axis=1), atol=1e-6)
    np.testing.assert_allclose(found["belief"], 20.0, rtol=1e-6)  # mrad
    link = late.arm.model.body(shapes_of(late.arm)[-1].body).name
    true, pale = (
        np.array(stored(path, entity("late", f"{root}/{link}"))["Transform3D:translation"])[0, 0]
        for root in ("arm", "believed")
    )
    np.testing.assert_allclose(pale[:2], [np.cos(np.pi / 3), np.sin(np.pi / 3)], atol=1e-6)
    np.testing.assert_allclose(true[:2], [np.cos(np.pi / 3 + 0.01), np.sin(np.pi / 3 + 0.01)], atol=1e-6)
    assert "pale arm" in stored(path, "/text/legend")["TextDocument:text"][0][0]
    assert not {"waiting", "belief"} & drawn(path, "plain").keys()
    assert not stored(path, entity("plain", f"believed/{link}"))


def test_a_path_of_its_own_is_shown_and_a_shared_one_once(recorded, compared, tmp_path):
    assert len(stored(recorded, "/target/path")["LineStrips3D:strips"]) == 1
    assert not stored(recorded, entity(LABELS[1], "path"))
    other = prepared_of("target.path=[{line: {by: [0.0, 0.3]}}]")
    variants = [compared[0][0], ("other", other)]
    with Overlay(tmp_path / "x.rrd", "planar", variants) as overlay:
        overlay.finish("")
    (strip,) = stored(tmp_path / "x.rrd", entity("other", "path"))["LineStrips3D:strips"][0]
    np.testing.assert_allclose(strip[-1], other.reference.pose[-1, :3], atol=1e-6)


def test_arms_of_different_models_stand_in_one_picture(compared, tmp_path):
    """Three joints and two: each track has the widths of its own arm."""
    three = prepared_of(f"arm.model={ROOT}/models/planar_3link.xml", "arm.start=home")
    worlds = [compared[0][0][1], three]
    runs = Simulation(worlds).run()
    record(tmp_path / "x.rrd", [("two", worlds[0]), ("three", three)], runs)
    for label, run in zip(("two", "three"), runs, strict=True):
        assert_same_bits(read_columns(tmp_path / "x.rrd", label), run.columns)


def test_a_lane_says_what_holds_and_a_divergence_ends_it(compared, tmp_path):
    variants, runs = compared
    run = rows(runs[0], 0, 60)
    status = run.columns["status"]
    status[:] = 0
    status[10:30] = Status.DAMPED
    status[20:30] |= Status.SINGULAR
    path = tmp_path / "x.rrd"
    divergence = Divergence(60, 0.06, "elbow", "not finite")
    with Overlay(path, "planar", variants) as overlay:
        for first in (0, 15, 30, 45):
            overlay.write(0, rows(run, first, first + 15))
        overlay.write(0, replace(rows(run, 0, 0), divergence=divergence))
        overlay.finish("")
    found = []
    for chunk in RrdReader(path).stream().filter(content="/status/inverse", is_static=False):
        batch = chunk.to_record_batch()
        states = [state[0] for state in batch.column("StateChange:state").to_pylist()]
        found += zip(batch.column("tick").to_pylist(), states, strict=True)
    assert sorted(found) == [
        (0, "free"), (10, "damped"), (20, "damped, singular"), (30, "free"), (60, str(divergence)),
    ]  # fmt: skip


def test_table_legend_and_every_scenario_are_inside(recorded, compared):
    assert stored(recorded, "/text/table")["TextDocument:text"] == [["| variant |"]]
    assert "outlines" in stored(recorded, "/text/legend")["TextDocument:text"][0][0]
    text = stored(recorded, "/text/scenario")["TextDocument:text"][0][0]
    yaml = [block.partition("```")[0] for block in text.split("```yaml\n")[1:]]
    assert [loads(block) for block in yaml] == [prepared.scenario for _, prepared in compared[0]]


def test_how_long_each_limit_holds_is_in_a_table(compared, tmp_path):
    variants, runs = compared
    run = rows(runs[0], 0, 101)
    run.columns["status"][:] = 0
    run.columns["status"][10:30] = Status.DAMPED | Status.RATE_LIMITED
    run.columns["status"][50:60] = Status.RATE_LIMITED
    with Overlay(tmp_path / "x.rrd", "planar", variants) as overlay:
        for first in (0, 20, 40, 60, 80, 100):
            overlay.write(0, rows(run, first, first + 20))
        overlay.finish("")
    (text,) = stored(tmp_path / "x.rrd", "/text/limits")["TextDocument:text"][0]
    head, _, first, second = text.splitlines()
    assert [cell.strip() for cell in head.split("|")[1:-1]] == ["variant", "damped [s]", "rate limited [s]"]
    assert [cell.strip() for cell in first.split("|")[1:-1]] == ["inverse", "0.020", "0.030"]
    assert [cell.strip() for cell in second.split("|")[1:-1]] == [LABELS[1], "", ""]


def test_the_layouts_look_only_at_what_is_recorded(recorded):
    known = {chunk.entity_path for chunk in RrdReader(recorded).stream()}
    reader = RrdReader(recorded)
    by_size = sorted(reader.blueprints(), key=lambda entry: len(list(reader.stream(store=entry))))
    entries = by_size[1:]  # the smallest is the picture alone
    assert 1 <= len(entries) <= 2  # of a run that is over; of one that is killed after some blocks
    for entry in entries:
        queries, names = [], []
        for chunk in RrdReader(recorded).stream(store=entry):
            batch = chunk.to_record_batch()
            for field, values in zip(batch.schema, batch.columns, strict=True):
                if field.name == "ViewContents:query":
                    queries += [query for row in values.to_pylist() for query in row]
                if field.name == "ViewBlueprint:display_name":
                    names += [row[0] for row in values.to_pylist()]
        assert {
            "planar: 2 variants", "σ_min, as log₁₀", "Damping λ, as log₁₀", "Position error [mm]",
            "Largest torque [% of its limit]", "Events", "Legend", "Table", "Limits", "Scenario",
        } <= set(names)  # fmt: skip
        assert any(name.startswith("Fastest joint [rad/s]") for name in names)
        paths = [q.lstrip("+ ").removesuffix("/**") for q in queries if "$origin" not in q]
        # an own path is rare
        paths = [path for path in paths if not path.endswith("/path") or path.startswith("/target")]
        missing = [path for path in paths if not any(entity.startswith(path) for entity in known)]
        assert not missing


def test_a_run_longer_than_planned_has_times_as_far_as_it_lasted(compared, tmp_path):
    """Its plots have two numbers only: a lane of times is above those of the variants."""
    prepared, runs = compared
    late = [
        replace(run, columns=run.columns | {"time": run["time"] + 13.0 - run["time"][-1]}) for run in runs
    ]
    found = {}
    for name, variants in (("late", late), ("planned", runs)):
        record(tmp_path / f"{name}.rrd", prepared, variants)
        states = stored(tmp_path / f"{name}.rrd", "/clock")["StateChange:state"]
        found[name] = [text for (text,) in states]
    assert found["late"] == ["0 s", "2 s", "4 s", "6 s", "8 s", "10 s", "12 s"]
    assert found["planned"][-1] == "1 s"  # negative control


@pytest.mark.parametrize(
    "asked", mostly_long(["{quantity: error, at: 0.3}", "{quantity: rates}", "{quantity: sigma}"], 2)
)
def test_what_the_scenario_asks_to_look_at_is_marked_for_each_variant(asked, tmp_path):
    """In the plot at its own value, in the picture where its tip is, and in a picture of that instant."""
    worlds = [prepared_of(f"control.inverse.method={method}", f"look={asked}") for method in METHODS]
    runs = Simulation(worlds).run()
    record(tmp_path / "x.rrd", list(zip(LABELS, worlds, strict=True)), runs)
    for label, run in zip(LABELS, runs, strict=True):
        curve = {
            "rates": np.abs(run["qdot_cmd"]).max(axis=1),
            "error": 1e3 * np.hypot(*run["pose_error"][:, :2].T),
            "sigma": np.log10(run["sigma"][:, -1]),
        }[worlds[0].scenario.look.quantity]
        tick = int((-curve if "sigma" in asked else curve).argmax())
        if "at:" in asked:
            tick = int(np.abs(run["time"] - 0.3).argmin())
        (mark,) = stored(tmp_path / "x.rrd", entity(label, "look"))["look"]
        assert mark[0] == pytest.approx(curve[tick], rel=1e-5)
        (ball,) = stored(tmp_path / "x.rrd", entity(label, "tip/look"))["Points3D:positions"][0]
        np.testing.assert_allclose(ball, run["pose"][tick, :3], atol=1e-6)
    names = [name for name, _ in views(tmp_path / "x.rrd")]
    assert sum(name.startswith("look: ") for name in names) == 1
    tabs = {"error": "Position error [mm]", "rates": "Fastest joint", "sigma": "σ_min"}
    wanted = tabs[worlds[0].scenario.look.quantity]
    (sources,) = [sources for name, sources in views(tmp_path / "x.rrd") if name.startswith(wanted)]
    assert sources.count("look") == len(LABELS)


def views(path):
    """Name of each view of the layout, with the components that it draws."""
    found = last_layout(path)
    for one, table in found.items():
        if "ViewBlueprint:display_name" in table:
            maps = [
                other["VisualizerInstruction:component_map"][0]["source_component"]
                for below, other in found.items()
                if below.startswith(f"{one}/") and "VisualizerInstruction:component_map" in other
            ]
            yield table["ViewBlueprint:display_name"][0], maps
