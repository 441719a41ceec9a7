"""Pydantic's errors as problems: the key, the requirement, the value, and the way out."""

import re
from typing import Any, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from rmrc.scenario.choices import CHOICES, PLANTS, Choice
from rmrc.scenario.keys import SourceMap
from rmrc.scenario.units import instead
from rmrc.scenario.values import fields_at
from rmrc.scenario.wording import show
from rmrc.support.errors import did_you_mean
from rmrc.support.problems import Key, Problem

# The requirement behind each of pydantic's errors; others have it in pydantic's words.
_WANTS = {
    "string_type": "must be text",
    "path_type": "must be text",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number without a dot",
    "float_type": "must be a number",
    "tuple_type": "must be a list in brackets",
    "model_type": "must be a mapping",
    "dict_type": "must be a mapping",
    "greater_than": "must be > {gt:g}",
    "greater_than_equal": "must be >= {ge:g}",
    "less_than": "must be < {lt:g}",
    "less_than_equal": "must be <= {le:g}",
    "too_short": "must have {min_length} or more items",
    "too_long": "must have {max_length} or fewer items",
}


def translate(error: ValidationError, sources: SourceMap, kind: Any) -> list[Problem]:
    """Return pydantic's errors as problems.

    Args:
        error: Of the values.
        sources: The places of the values.
        kind: The section that refused them.
    """
    problems = []
    for detail in error.errors(include_url=False):
        name, context = detail["type"], detail.get("ctx", {})
        if name == "too_short" and len(detail["input"]) >= context["min_length"]:
            continue  # pydantic counts the valid items only
        key = context.get("key") or _key(detail)
        problem = sources.problem(key, _message(detail, key, kind))
        if name == "extra_forbidden" and key in sources.places:
            problem = problem._replace(origin=sources.places[key].key)
        problems.append(problem)
    return problems


def _key(detail: ErrorDetails) -> Key:
    """Return the key; pydantic also names the option of a union, as `<list>`, which files do not."""
    unknown = len(detail["loc"]) - 1 if detail["type"] == "extra_forbidden" else -1
    steps = enumerate(detail["loc"])
    return tuple(step for i, step in steps if i == unknown or not re.fullmatch(r"<\w+>", str(step)))


def _message(detail: ErrorDetails, key: Key, kind: Any) -> str:
    name, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if name == "rule":
        return str(context["text"])
    if name == "missing":
        return f"is required: {_field(key, kind).description}"
    if name == "extra_forbidden":
        names = list(fields_at(kind, key[:-1]))
        return "unknown key" + (did_you_mean(str(key[-1]), names) or f"; the keys are {', '.join(names)}")
    if name == "literal_error":
        options = re.findall(r"'([^']*)'", context["expected"])
        want = ", ".join(f'"{option}"' for option in options)
        return f"must be {'one of ' * (len(options) > 1)}{want}, got {show(value)}{_option(value, options)}"
    want = _WANTS.get(name, re.sub(r"^\w+ should", "must", detail["msg"])).format(**context)
    return f"{want}, got {show(value)}{_way(name, value, key, kind)}"


def _field(key: Key, kind: Any) -> FieldInfo:
    """Return the field of a key, or of the list or mapping that it is an item of."""
    while str(key[-1]) not in fields_at(kind, key[:-1]):
        key = key[:-1]
    return fields_at(kind, key[:-1])[str(key[-1])]


def _option(value: object, options: list[str]) -> str:
    """Return the choice that another text most likely means."""
    choices: list[Choice] = [*PLANTS.options, *(choice for group in CHOICES for choice in group.options)]
    for choice in choices:
        if choice.name in options and str(value).lower() in choice.others.split():
            return f"; write {choice.name}"
    return did_you_mean(str(value), options)


def _way(name: str, value: object, key: Key, kind: Any) -> str:
    """Return the correct spelling, if it follows from the value and its key."""
    if name in ("string_type", "path_type") and isinstance(value, bool | int | float):
        return "; put it in quotes"
    if name == "float_type" and isinstance(value, str):
        extra = _field(key, kind).json_schema_extra
        return instead(value, str(extra.get("unit", "")) if isinstance(extra, dict) else "")
    if name == "model_type":
        names = fields_at(kind, key)
        choice = next((name for name, field in names.items() if value in get_args(field.annotation)), "")
        return f"; write {{{choice}: {value}}}" if choice else f"; its keys are {', '.join(names)}"
    return ""
