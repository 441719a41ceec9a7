import re
from functools import cache

import pytest
import yaml
from scenario_texts import EXAMPLE, FULL, MINIMAL, full_number_keys, full_scenarios, number_keys

from project import mostly_long
from rmrc import scenario as package
from rmrc.scenario import json_schema, loads, schema_rows
from rmrc.scenario.choices import INVERSES
from rmrc.scenario.sections import DERIVED
from rmrc.support.errors import ScenarioError


def as_row(key):
    """Return the key under which the schema lists a key of FULL."""
    key = re.sub(r"(target\.path)\[\d+\]", r"\1[]", key)
    key = re.sub(r"^expect\..*\.(\w+)$", r"expect.<metric>.\1", key)
    key = re.sub(r"^(arm|plant)\.stretch\..*", r"\1.stretch.<body>", key)
    key = re.sub(r"^arm\.packages\..*", "arm.packages.<package>", key)
    key = re.sub(r"^baseline\..*", "baseline.<key>", key)
    key = re.sub(r"^(sweep\.(?:vary|draw))\..*$", r"\1.<key>", key)
    return re.sub(r"(\[\d+\])+$", "", key)


def test_the_walk_over_numbers_reaches_every_number_of_the_schema():
    listed = {row.key for row in schema_rows() if re.search("number|angle", row.type)}
    assert {as_row(key) for key in full_number_keys()} <= listed
    values = [one.model_dump(mode="json") for one in full_scenarios()]
    assert {as_row(key) for value in values for key in number_keys(value)} == listed
    assert len(listed) > 35  # negative control: an empty walk over an empty schema would agree


def test_the_schema_lists_every_key_once_with_meaning_and_numbers_with_unit():
    def leaves(value, key=""):
        if isinstance(value, dict):
            for name, inner in value.items():
                yield from leaves(inner, f"{key}.{name}".removeprefix("."))
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for i, inner in enumerate(value):
                yield from leaves(inner, f"{key}[{i}]")
        else:
            yield as_row(key)

    rows = schema_rows()
    assert [row.key for row in rows] == list(dict.fromkeys(row.key for row in rows))
    values = [one.model_dump(mode="json") for one in full_scenarios()]
    # each of these is null but where it excludes the others
    assert {row.key for row in rows} == {key for value in values for key in leaves(value)} - {
        "arm.tool",
        "look",
    }
    assert all(row.meaning for row in rows)
    assert [row.key for row in rows if re.search("number|angle", row.type) and not row.unit] == []


def test_the_full_scenario_of_these_tests_uses_every_field():
    """Keeps the test above honest: FULL and the schema are both held against the classes."""
    sections = {
        kind
        for kind in (getattr(package, name) for name in dir(package))
        if isinstance(kind, type) and issubclass(kind, package.Section)
    } | set(DERIVED.values())
    seen = {kind: set() for kind in sections}

    def visit(value):
        if isinstance(value, package.Section):
            for name in type(value).model_fields:
                inner = getattr(value, name)
                if inner is not None:
                    seen[type(value)].add(name)
                visit(inner)
        elif isinstance(value, tuple | dict):
            for inner in value.values() if isinstance(value, dict) else value:
                visit(inner)

    for one in full_scenarios():
        visit(one)
    assert {kind: names for kind, names in seen.items() if names} == {
        kind: set(kind.model_fields) for kind in sections if kind.model_fields
    }


def test_rows_of_the_schema_read_as_a_table():
    rows = {row.key: row for row in schema_rows()}
    assert tuple(rows["control.inverse.damping.maximum"]) == (
        "control.inverse.damping.maximum",
        "number > 0",
        "as σ",
        "from the arm",
        "λ_max, the largest damping (λ, not λ²); null: `below`/√2, so that no gain exceeds 1/`below`",
    )
    kinds = {
        "name": "text",
        "arm.model": "path",
        "arm.start": "text or list of angles",
        "arm.encoder.offset": "angle or list of angles",
        "arm.encoder.deviation": "angle >= 0 or list of angles >= 0",
        "arm.encoder.seed": "integer >= 0",
        "task.axes": "list of (x | y | z | rx | ry | rz)",
        "control.inverse.method": " | ".join(INVERSES.names),
        "control.slow.longest": "number >= 1, <= 1000",
        "control.inverse.tolerance": "number > 0, < 1",
        "control.feedforward": "true | false",
        "control.limits.rate": "number > 0 or list of numbers > 0",
        "target.path[].line.to": "list of 2 or 3 numbers",
        "target.path[].line.turn.axis": "x | y | z or list of 3 numbers",
        "plant.kv": "number > 0 or list of numbers > 0",
        "plant.payload": "number >= 0",
        "plant.gravity": "list of 3 numbers",
        "arm.stretch.<body>": "number > 0",
        "plant.stretch.<body>": "number > 0",
        "plant.friction.coulomb": "number >= 0 or list of numbers >= 0",
        "plant.joint_offset": "angle or list of angles",
        "arm.encoder.delay": "number >= 0",
        "control.state": "measured | integrated",
        "arm.packages.<package>": "path",
        "arm.tool.rpy": "list of 3 angles",
        "arm.tool.inertia": "list of 3 numbers > 0",
        "arm.base": "fixed | free",
        "plant.wrench": "list of 6 numbers",
        "plant.loss": "number >= 0, < 1",
        "plant.lag": "number >= 0 or list of numbers >= 0",
        "plant.resonance.frequency": "number > 0",
    }
    assert {key: rows[key].type for key in kinds} == kinds
    assert rows["arm.model"].default == "required"
    assert rows["arm.site"].default == rows["arm.tool.rpy"].default == "null"
    assert rows["control.inverse.tolerance"].default == "1.0e-06"
    for key in ("task.length", "control.inverse.damping.below", "control.inverse.damping.maximum"):
        assert rows[key].default == "from the arm" and rows[key].type == "number > 0"
    assert rows["task.weights"].default == rows["plant.kv"].default == "null"
    assert rows["target.path[].hold.for"].unit == "s"


def valid(value, schema, root):
    """Say whether a value fits, for the part of JSON Schema that ours uses (no such library here)."""
    known = {"$ref", "$defs", "$schema", "title", "description", "default", "derived", "unit", "format"}
    types = {
        "object": dict, "array": list, "string": str, "number": (int, float),
        "integer": int, "boolean": bool, "null": type(None),
    }  # fmt: skip
    items = value if isinstance(value, list) else []
    keys = value if isinstance(value, dict) else {}
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    rules = {
        "type": lambda t: isinstance(value, types[t]) and (t == "boolean") == isinstance(value, bool),
        "const": lambda c: value == c,
        "enum": lambda options: value in options,
        "anyOf": lambda options: any(valid(value, o, root) for o in options),
        "oneOf": lambda options: sum(valid(value, o, root) for o in options) == 1,
        "properties": lambda p: all(valid(v, p[k], root) for k, v in keys.items() if k in p),
        "additionalProperties": lambda a: all(
            a is not False and valid(v, a, root)
            for k, v in keys.items()
            if k not in schema.get("properties", {})
        ),
        "required": lambda names: all(name in keys for name in names),
        "dependentRequired": lambda d: all(n in keys for k in d if k in keys for n in d[k]),
        "not": lambda s: not valid(value, s, root),
        "maxProperties": lambda n: len(keys) <= n,
        "items": lambda s: all(valid(item, s, root) for item in items),
        "minItems": lambda n: not isinstance(value, list) or len(value) >= n,
        "maxItems": lambda n: not isinstance(value, list) or len(value) <= n,
        "minLength": lambda n: not isinstance(value, str) or len(value) >= n,
        "maxLength": lambda n: not isinstance(value, str) or len(value) <= n,
        "pattern": lambda p: not isinstance(value, str) or bool(re.search(p, value)),
        "minimum": lambda n: not is_number or value >= n,
        "exclusiveMinimum": lambda n: not is_number or value > n,
        "maximum": lambda n: not is_number or value <= n,
        "exclusiveMaximum": lambda n: not is_number or value < n,
    }
    if "$ref" in schema and not valid(value, root["$defs"][schema["$ref"].split("/")[-1]], root):
        return False
    return all(rules[k](s) for k, s in schema.items() if k not in known)


def plain(text):
    return yaml.safe_load(text)


@cache
def described():
    """Return the schema, which takes pydantic a twentieth of a second."""
    return json_schema()


@pytest.mark.parametrize("text", [MINIMAL, EXAMPLE, FULL])
def test_the_json_schema_accepts_what_is_read(text):
    schema = described()
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert valid(plain(text), schema, schema)
    assert valid(loads(text).model_dump(mode="json"), schema, schema)


@pytest.mark.parametrize(
    ("old", "new"),
    mostly_long([
        ("name: full", "nam: full"),
        ("seed: 7", "seed: 7.0"),
        ("seed: 7", "seed: -7"),
        ("deviation: 0.1 deg", "deviation: -0.1"),
        ("deviation: 0.1 deg", "deviation: [-0.1 deg, 0.1]"),
        ("feedback: 3.0", "feedback: -3.0"),
        ("angle: 30 deg", "angle: 30 degrees"),
        ("hold: {for: 0.5}", "hold: {duration: 0.5}"),
        ("hold: {for: 0.5}", "hold: {for: 0.5}\n      turn: {axis: z, angle: 1}"),
        ("line: {to: [1.0, 0.0],", "line: {to: [1.0, 0.0], by: [1.0, 0.0],"),
        ("turn: {axis: [0, 1, 0], angle: 1.0}", "turn: {axis: [0, 1, 0]}"),
        ("wrench: [1, 2, 3, 4, 5, 6]", "wrench: [1, 2, 3, 4, 5]"),
        ("kv: 10.0", "kv: [10.0, 0.0]"),
        ("equals: 0.0, within: 0.001", "equals: 0.0"),
        ("feedforward: false", "feedforward: 0"),
    ], 2),
)  # fmt: skip
def test_the_json_schema_refuses_what_is_refused(old, new):
    assert old in FULL
    text = FULL.replace(old, new)
    schema = described()
    assert not valid(plain(text), schema, schema)
    with pytest.raises(ScenarioError):
        loads(text)


def test_the_json_schema_gives_editors_units_and_meanings():
    damping = described()["$defs"]["DampingSection"]["properties"]["maximum"]
    assert damping["unit"] == "as σ"
    assert damping["description"].startswith("λ_max, the largest damping (λ, not λ²)")
    assert [one.get("exclusiveMinimum") for one in damping["anyOf"]] == [0, None]
