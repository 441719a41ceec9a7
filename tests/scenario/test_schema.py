"""Sections: defaults, the round trip, the schema and its JSON Schema, and the record of choices."""

import json
import math
import pickle
import re
from operator import attrgetter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_texts import FULL, MINIMAL, full_scenarios, problems

from rmrc.scenario import Scenario, draft_of, json_schema, load, loads, schema_rows
from rmrc.scenario.choices import CHOICES, INVERSES, PARAMETERS, Scales, record_fields, write_choices
from rmrc.support.errors import ScenarioError
from wording import says


def test_defaults_and_segments_are_those_of_the_contract():
    scenario, path = loads(MINIMAL), loads(FULL).target.path
    assert (scenario.arm.start, scenario.task.axes) == ("home", ("x", "y", "z", "rx", "ry", "rz"))
    assert (scenario.control.period, scenario.control.inverse.method) == (0.001, "damped")
    assert (scenario.plant.kind, scenario.plant.timestep, scenario.expect) == ("servo", None, {})
    assert [path[i].name for i in (0, 2, 5, 12, 13, 16, 17, 18)] == [
        "line", "arc", "turn", "tilt", "set", "configurations", "file", "hold",
    ]  # fmt: skip
    assert path[0].line.turn.angle == math.radians(30) and path[2].arc.angle == -2 * math.pi
    assert path[13].set.duration == 0.5 and path[16].configurations == ("home", (0.1, math.radians(10)))


def test_axes_are_kept_in_row_order_and_their_values_follow_them():
    texts = [
        "task={axes: [rz, x], weights: [5, 7]}",
        "control.nullspace.secondary={axes: [rz, x], to: [10 deg, 0.5]}",
    ]
    scenario = loads(MINIMAL, overrides=texts)
    second = scenario.control.nullspace.secondary
    assert (scenario.task.axes, scenario.task.weights) == (("x", "rz"), (7.0, 5.0))
    assert (second.axes, second.to) == (("x", "rz"), (0.5, math.radians(10)))
    assert scenario.set({"task.weights": [1, 2]}).task.weights == (2.0, 1.0)  # as they were written


def test_files_start_at_the_folder_of_the_scenario_or_below_a_root_that_they_moved_to(folder):
    (folder / "here/pkg").mkdir(parents=True)
    text = MINIMAL.replace("arm.xml, site: tip", "../arm.xml, packages: {a: pkg}")
    more = "sweep: {vary: {'target.path[0]': [{file: {path: a.csv}}, {hold: {for: 1}}], expect.profile: [ur5e, own.yaml]}}"
    (folder / "here/x.yaml").write_text(f"{text}{more}\n")
    scenario = load("here/x.yaml")
    assert (scenario.arm.model, scenario.arm.packages) == (folder / "arm.xml", {"a": folder / "here/pkg"})
    draft, root = draft_of("here/x.yaml"), folder / "there"
    named = [folder / one for one in ("arm.xml", "here/pkg", "here/a.csv", "here/own.yaml")]
    assert sorted(draft.files()) == sorted(named)
    moved = draft.moved(root)
    with pytest.raises(ScenarioError, match=rf'no such file "{root}'):
        moved.scenario()
    for path in named:
        there = root / path.relative_to(path.anchor)
        there.parent.mkdir(parents=True, exist_ok=True)
        there.mkdir(exist_ok=True) if path.name == "pkg" else there.write_text("<mujoco/>")
    assert moved.scenario().arm.model == root / scenario.arm.model.relative_to("/")
    assert moved.files() == draft.files()
    (folder / "here/pkg").rmdir()
    with pytest.raises(ScenarioError, match=r'arm\.packages\.a: no such folder ".*here/pkg"'):
        load("here/x.yaml")


@pytest.mark.parametrize(
    ("period", "timestep", "kind", "is_whole"),
    [
        ("0.003", "0.001", "servo", True), ("0.1", "1.0e-4", "torque", True), ("0.0015", "0.001", "ideal", True),
        ("0.0333", "0.001", "servo", False), ("0.001", "0.002", "servo", False),
        ("1.0e+300", "1.0e-300", "servo", False),
    ],
)  # fmt: skip
def test_a_period_is_a_whole_number_of_steps_where_there_are_steps(period, timestep, kind, is_whole):
    texts = [f"control.period={period}", f"plant.timestep={timestep}", f"plant.kind={kind}"]
    if is_whole:
        assert loads(MINIMAL, overrides=texts).control.period == float(period)
    else:
        wanted = f"--set control.period: … plant.timestep … {float(period)} and {float(timestep)}; write plant.timestep: null"
        assert problems(MINIMAL, *texts) == [says(wanted)]


# Round trip: each draws a few values of a section that the whole of FULL does not have
numbers, positive = st.floats(-1e6, 1e6), st.floats(1e-6, 1e6)
tricky = st.sampled_from(
    ["1e-3", "010", "yes", "null", "2020-01-01", "=", "<<", "~", "0x1", "a: b", "é\u2028"]
)
vectors = st.lists(numbers, min_size=2, max_size=3)


@given(tricky, vectors, st.lists(st.sampled_from(["x", "y", "rx", "rz"]), min_size=1, unique=True), positive)
def test_a_scenario_reads_back_from_its_yaml_equal(text, vector, axes, number):
    scenario = Scenario.model_validate({
        "name": "generated", "arm": {"model": __file__, "site": text, "joints": [text]},
        "task": {"axes": axes, "weights": [2.0 + i for i in range(len(axes))]},
        "target": {"path": [{"line": {"to": vector}}, {"set": {"by": vector, "for": number}}]},
        "control": {"feedback": number, "limits": {"rate": [number]}}, "plant": {"kind": "ideal"},
        "expect": {text: {"equals": number, "within": number}},
    })  # fmt: skip
    assert loads(scenario.to_yaml()) == scenario
    assert Scenario.model_validate(json.loads(json.dumps(scenario.model_dump(mode="json")))) == scenario


def test_a_scenario_is_frozen_and_its_places_are_no_part_of_it_but_survive_the_way_to_a_worker():
    scenario = loads(FULL, "x.yaml")
    assert loads(scenario.to_yaml()) == scenario == loads("# a comment\n" + FULL)
    assert scenario != loads(FULL, overrides=["control.feedback=1"])  # negative control
    back = pickle.loads(pickle.dumps(scenario))
    assert back == scenario
    assert back.locate("arm.start[1]") == "x.yaml:3:50: arm.start[1]"
    with pytest.raises(ValueError, match="frozen"):
        scenario.control.feedback = 1.0


def as_row(key):
    """Return the key under which the schema lists a key of FULL."""
    key = re.sub(r"(target\.path)\[\d+\]", r"\1[]", key)
    key = re.sub(r"^expect\..*\.(\w+)$", r"expect.<metric>.\1", key)
    key = re.sub(r"^(arm|plant)\.stretch\..*", r"\1.stretch.<body>", key)
    key = re.sub(r"^arm\.packages\..*", "arm.packages.<package>", key)
    key = re.sub(r"^(baseline|sweep\.vary|sweep\.draw)\..*$", r"\1.<key>", key)
    return re.sub(r"(\[\d+\])+$", "", key)


def leaves(value, key=""):
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for i, inner in enumerate(value):
            yield from leaves(inner, f"{key}[{i}]")
    else:
        yield as_row(key)


def test_the_schema_lists_every_key_once_with_meaning_and_numbers_with_unit():
    rows = schema_rows()
    assert [row.key for row in rows] == list(dict.fromkeys(row.key for row in rows))
    values = [one.model_dump(mode="json") for one in full_scenarios()]
    # each of these is null but where it excludes the others
    absent = {"arm.tool", "look"}
    assert {row.key for row in rows} == {key for value in values for key in leaves(value)} - absent
    assert all(row.meaning for row in rows)
    assert [row.key for row in rows if re.search("number|angle", row.type) and not row.unit] == []


def properties(schema, root):
    """Walk a JSON Schema to the name of every property in it, and what it may be."""
    for part in [schema, *root["$defs"].values()]:
        yield from part.get("properties", {}).items()


def test_the_json_schema_has_every_key_with_its_choices_and_bounds_and_knows_no_other():
    schema = json_schema()
    known = dict(properties(schema, schema))
    names = {row.key.rpartition(".")[2].removesuffix("[]") for row in schema_rows()}
    assert {name for name in names if not name.startswith("<")} <= known.keys()
    assert schema["required"] == ["name", "arm", "target"]
    assert all(
        part["additionalProperties"] is False for part in schema["$defs"].values() if "properties" in part
    )
    assert known["method"]["enum"] == list(INVERSES.names)
    assert known["period"]["anyOf"][0] == {"exclusiveMinimum": 0, "type": "number"}


@pytest.mark.parametrize("each", [one for one in PARAMETERS if one.range], ids=lambda each: each.field)
def test_what_is_searched_is_a_key_s_value_and_grows_with_the_scales(each):
    scales = Scales(sigma=2.0, manipulability=3.0, start=0.5, slowest=0.1, fastest=4.0)
    low, high = each.range(scales)
    assert low < high
    for number in (low, high):
        loads(MINIMAL.replace("arm.xml", __file__)).set({f"control.{each.key}": number})
    wider = each.range(Scales(*(10 * scale for scale in scales)))
    factor = 1 if each.key == "inverse.gamma" else 10  # which is relative to σ₁
    assert wider == pytest.approx((factor * low, factor * high), rel=1e-12)


@pytest.mark.parametrize("text", [FULL, MINIMAL], ids=["full", "minimal"])
def test_the_record_has_what_the_scenario_says(text):
    kinds = [(name, kind, (3,) if each else ()) for name, kind, each in record_fields()]
    control, world = loads(text).control, np.zeros(1, np.dtype([*kinds, ("other", float)]))
    world["other"] = 7.0
    write_choices(world, control)
    assert world["other"][0] == 7.0
    for choices in CHOICES:
        assert choices.names[world[choices.field][0]] == attrgetter(choices.key)(control)
    for each in PARAMETERS:
        value, got = attrgetter(each.key)(control), world[each.field][0]
        if isinstance(value, tuple):
            assert got[: len(value)].tolist() == list(value)
        else:
            np.testing.assert_array_equal(got, each.null if value is None else value)
