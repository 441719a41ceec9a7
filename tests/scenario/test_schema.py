import re
from functools import cache

import pytest
import yaml
from scenario_texts import FULL, MINIMAL, full_scenarios

from rmrc.scenario import json_schema, loads, schema_rows
from rmrc.support.errors import ScenarioError


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


def valid(value, schema, root):
    """Say whether a value fits, for the part of JSON Schema that ours uses (no such library here)."""
    known = {"$ref", "$defs", "$schema", "title", "description", "default", "derived", "unit", "format"}
    types = {
        "object": dict, "array": list, "string": str, "number": (int, float),
        "integer": int, "boolean": bool, "null": type(None),
    }  # fmt: skip
    items = value if isinstance(value, list) else []
    keys = value if isinstance(value, dict) else {}
    number = value if isinstance(value, int | float) and not isinstance(value, bool) else None
    text = value if isinstance(value, str) else None
    rules = {
        "type": lambda t: isinstance(value, types[t]) and (t == "boolean") == isinstance(value, bool),
        "const": lambda c: value == c,
        "enum": lambda options: value in options,
        "anyOf": lambda options: any(valid(value, o, root) for o in options),
        "oneOf": lambda options: sum(valid(value, o, root) for o in options) == 1,
        "not": lambda s: not valid(value, s, root),
        "properties": lambda p: all(valid(v, p[k], root) for k, v in keys.items() if k in p),
        "additionalProperties": lambda a: all(
            a is not False and valid(v, a, root)
            for k, v in keys.items()
            if k not in schema.get("properties", {})
        ),
        "required": lambda names: all(name in keys for name in names),
        "maxProperties": lambda n: len(keys) <= n,
        "items": lambda s: all(valid(item, s, root) for item in items),
        "minItems": lambda n: not isinstance(value, list) or len(value) >= n,
        "maxItems": lambda n: len(items) <= n,
        "minLength": lambda n: text is None or len(text) >= n,
        "maxLength": lambda n: text is None or len(text) <= n,
        "pattern": lambda p: text is None or bool(re.search(p, text)),
        "minimum": lambda n: number is None or number >= n,
        "exclusiveMinimum": lambda n: number is None or number > n,
        "maximum": lambda n: number is None or number <= n,
        "exclusiveMaximum": lambda n: number is None or number < n,
    }
    if "$ref" in schema and not valid(value, root["$defs"][schema["$ref"].split("/")[-1]], root):
        return False
    return all(rules[k](s) for k, s in schema.items() if k not in known)


@cache
def described():
    """Return the schema, which takes pydantic a twentieth of a second."""
    return json_schema()


@pytest.mark.parametrize("text", [MINIMAL, FULL])
def test_the_json_schema_accepts_what_is_read(text):
    assert valid(yaml.safe_load(text), described(), described())
    assert valid(loads(text).model_dump(mode="json"), described(), described())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("name: full", "nam: full"),
        ("seed: 7", "seed: -7"),
        ("angle: 30 deg", "angle: 30 degrees"),
        ("wrench: [1, 2, 3, 4, 5, 6]", "wrench: [1, 2, 3, 4, 5]"),
        ("feedforward: false", "feedforward: 0"),
    ],
)
def test_the_json_schema_refuses_what_is_refused(old, new):
    text = FULL.replace(old, new)
    assert text != FULL
    assert not valid(yaml.safe_load(text), described(), described())
    with pytest.raises(ScenarioError):
        loads(text)


def test_the_json_schema_gives_editors_units_and_meanings():
    damping = described()["$defs"]["DampingSection"]["properties"]["maximum"]
    assert damping["unit"] == "as σ" and damping["description"].startswith("λ_max, the largest damping")
    assert [one.get("exclusiveMinimum") for one in damping["anyOf"]] == [0, None]
