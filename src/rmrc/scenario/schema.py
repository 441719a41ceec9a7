"""The keys of a scenario for people (rows of a table) and for editors (JSON Schema)."""

import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from rmrc.scenario.sections import Sections
from rmrc.scenario.wording import inline, show

# Mappings whose keys are names: the kind of name, and the default of an absent one.
_ABSENT: dict[str, tuple[str, object]] = {
    "expect": ("metric", None),
    "arm.packages": ("package", None),
    "arm.stretch": ("body", 1),
    "plant.stretch": ("body", 1),
    "baseline": ("key", None),
    "sweep.vary": ("key", None),
    "sweep.draw": ("key", None),
}


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


def _rows(key: str, schema: dict[str, Any], kinds: dict[str, Any], *, required: bool) -> Iterator[SchemaRow]:
    below = _resolve(schema, kinds)
    if "properties" in below:
        for name, inner in below["properties"].items():
            needed = name in below.get("required", ())
            yield from _rows(f"{key}.{name}".removeprefix("."), inner, kinds, required=needed)
    if isinstance(below.get("additionalProperties"), dict):
        told = {
            "description": schema["description"],
            "unit": schema.get("unit", ""),
            "default": _ABSENT[key][1],
        }
        inner = {**told, **below["additionalProperties"]}
        yield from _rows(f"{key}.<{_ABSENT[key][0]}>", inner, kinds, required=False)
    elif "properties" in below:
        return
    elif "$ref" in below.get("items", {}):
        yield from _rows(f"{key}[]", below["items"], kinds, required=False)
    else:
        default = "required" if required else schema.get("derived") or inline(schema.get("default"))
        yield SchemaRow(key, _type(schema), schema.get("unit", ""), default, schema["description"])


def _resolve(schema: dict[str, Any], kinds: dict[str, Any]) -> dict[str, Any]:
    """Follow a reference, also through "or null" and "or a text"."""
    for option in (schema, *schema.get("anyOf", ()), *schema.get("oneOf", ())):
        if "$ref" in option:
            resolved: dict[str, Any] = kinds[option["$ref"].rpartition("/")[2]]
            return resolved
    return schema


def _type(schema: dict[str, Any]) -> str:
    """Return the type of a value in words."""
    options = schema.get("anyOf", schema.get("oneOf"))
    if schema.get("title", "")[:1].islower():  # a title of our own
        return str(schema["title"])
    if options:
        return " or ".join(_type(o) for o in options if o.get("type") != "null")
    if "enum" in schema or "const" in schema:
        return " | ".join(schema.get("enum", [schema.get("const")]))
    kind = schema.get("type", "any")
    if kind == "array":
        low, high = schema["minItems"], schema.get("maxItems")
        count = "" if high is None else f"{low} " if low == high else f"{low} or {high} "
        item = re.sub("^(number|angle)", r"\1s", _type(schema["items"])) if schema["items"] else "values"
        return f"list of {count}({item})" if "|" in item or " or " in item else f"list of {count}{item}"
    if kind in ("number", "integer"):
        signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
        bounds = [f"{sign} {show(schema[k])}" for k, sign in signs.items() if k in schema]
        return " ".join([kind, ", ".join(bounds)]).strip()
    words = {"string": "text", "boolean": "true | false", "any": "value"}
    return "path" if schema.get("format") == "path" else words[kind]
