"""The keys of a scenario for people (rows of a table) and for editors (JSON Schema)."""

import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from rmrc.scenario.reading import inline, show
from rmrc.scenario.sections import Sections

# Mappings whose keys are names: the kind of name, and the default of an absent one.
_NAMES = {
    "expect": ("metric", None), "arm.packages": ("package", None),
    "arm.stretch": ("body", 1), "plant.stretch": ("body", 1),
}  # fmt: skip
_SIGNS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
_WORDS = {"string": "text", "boolean": "true | false", "any": "value", "object": "mapping"}


class SchemaRow(NamedTuple):
    """One key of a scenario, as `rmrc schema` prints it."""

    key: str
    type: str
    unit: str
    default: str
    meaning: str


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a scenario, with units, for editors."""
    schema = Sections.model_json_schema(by_alias=True, mode="validation")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


@cache  # it takes a twentieth of a second
def schema_rows() -> tuple[SchemaRow, ...]:
    """Return every key of a scenario, in the order of the file.

    `[]` in a key stands for an item of a list, `<metric>`, `<package>`, `<body>` and `<key>` for the name
    of one.
    """
    schema = json_schema()
    return tuple(_rows("", schema, schema["$defs"], required=True))


def _rows(key: str, schema: dict[str, Any], defs: dict[str, Any], *, required: bool) -> Iterator[SchemaRow]:
    below = _resolve(schema, defs)
    named = below.get("additionalProperties")
    items = below.get("items", {})
    for name, inner in below.get("properties", {}).items():
        needed = name in below.get("required", ())
        yield from _rows(f"{key}.{name}".removeprefix("."), inner, defs, required=needed)
    if isinstance(named, dict):
        name, default = _NAMES.get(key, ("key", None))
        shared = {part: schema[part] for part in ("description", "unit") if part in schema}
        named = {**shared, "default": default, **named}
        yield from _rows(f"{key}.<{name}>", named, defs, required=False)
    elif "$ref" in items:
        yield from _rows(f"{key}[]", items, defs, required=False)
    elif "properties" not in below:
        standard = "required" if required else schema.get("derived") or inline(schema.get("default"))
        yield SchemaRow(key, _type(schema), schema.get("unit", ""), standard, schema["description"])


def _resolve(schema: dict[str, Any], defs: dict[str, Any]) -> dict[str, Any]:
    """Follow a reference, also through "or null" and "or a text"."""
    for option in (schema, *schema.get("anyOf", ()), *schema.get("oneOf", ())):
        if "$ref" in option:
            return dict(defs[option["$ref"].rpartition("/")[2]])
    return schema


def _type(schema: dict[str, Any]) -> str:
    """Return the type of a value in words."""
    options = schema.get("anyOf", schema.get("oneOf"))
    if schema.get("title", "")[:1].islower():  # a title of our own
        return str(schema["title"])
    if options:
        each = {"items": options[0], "minItems": 1, "type": "array"}
        present = [option for option in options if option.get("type") != "null"]
        return " or ".join("one per joint" if option == each else _type(option) for option in present)
    if "enum" in schema or "const" in schema:
        return " | ".join(schema.get("enum", [schema.get("const")]))
    name = schema.get("type", "any")
    if name == "array":
        low, high = schema["minItems"], schema.get("maxItems")
        count = "" if high is None else f"{low} " if low == high else f"{low} or {high} "
        item = re.sub("^(number|angle)", r"\1s", _type(schema["items"])) if schema["items"] else "values"
        return f"list of {count}({item})" if "|" in item or " or " in item else f"list of {count}{item}"
    if name in ("number", "integer"):
        bounds = [f"{sign} {show(schema[bound])}" for bound, sign in _SIGNS.items() if bound in schema]
        return f"{name} {', '.join(bounds)}".strip()
    return "path" if schema.get("format") == "path" else _WORDS[name]
