"""Pydantic's errors as messages: the key, the requirement, the value, and the way out."""

import re
from collections.abc import Callable
from typing import Any, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from rmrc.scenario import aliases
from rmrc.scenario.control import ControlSection
from rmrc.scenario.keys import SourceMap
from rmrc.scenario.plant import PlantSection, uneven
from rmrc.scenario.reading import Document
from rmrc.scenario.sections import Sections
from rmrc.scenario.units import instead
from rmrc.scenario.values import Section, is_spelled_as_number, seconds
from rmrc.scenario.wording import brief, listed, show
from rmrc.support.errors import did_you_mean
from rmrc.support.problems import Key, Problem

# Pydantic names the option of a union that it chose; files do not.
_TAGS = {"<text>", "<list>", "<one>"}


def translate(error: ValidationError, document: Document) -> list[Problem]:
    """Return pydantic's errors without those that only follow from known problems."""
    hidden = document.hidden
    found = [_problem(detail, document.sources) for detail in error.errors(include_url=False)]
    found = [one for one in found if not any(one.key[:depth] in hidden for depth in range(len(one.key) + 1))]
    return found + _uneven_period(document, hidden | {one.key for one in found})


def _problem(detail: ErrorDetails, sources: SourceMap) -> Problem:
    loc, is_unknown = detail["loc"], detail["type"] == "extra_forbidden"
    # An unknown key or a metric may be spelled like a tag; no tag is that high up, or that deep down.
    end = len(loc) - is_unknown
    key: Key = tuple(step for i, step in enumerate(loc) if i not in range(2, end) or step not in _TAGS)
    key = detail.get("ctx", {}).get("key") or key
    problem = sources.problem(key, _message(detail, key))
    place = sources.find(key).key if is_unknown else None
    return problem._replace(origin=place) if place else problem


def _uneven_period(document: Document, wrong: frozenset[Key]) -> list[Problem]:
    """Compare the period with the timestep, which pydantic only does if all sections are valid."""
    keys = (("plant", "kind"), ("control", "period"), ("plant", "timestep"))
    if any(key[:depth] in wrong for key in keys for depth in (1, 2)):
        return []
    defaults = {"plant": PlantSection(), "control": ControlSection()}
    data = document.value
    problem = uneven(*(seconds(data.get(a, {}).get(b, getattr(defaults[a], b))) for a, b in keys))
    return [document.sources.problem(("control", "period"), problem)] if problem else []


def _message(detail: ErrorDetails, key: Key) -> str:
    kind, value = detail["type"], detail["input"]
    if kind in _WHOLE:
        return _WHOLE[kind](detail, key)
    want = _WANTS.get(kind, "cannot be used").format(**detail.get("ctx", {}))
    return f"{want}, got {show(value)}{_way(kind, value, key)}"


def _way(kind: str, value: object, key: Key) -> str:
    """Return the correct spelling, if the value and its key determine it."""
    if kind in ("string_type", "path_type") and isinstance(value, bool | int | float):
        return "; put it in quotes"
    if kind in ("model_type", "dict_type"):
        return _write(aliases.mapping(key, value))
    if kind == "tuple_type":
        return _write(aliases.listing(key, value, _has_texts(key)))
    if kind == "bool_type" and isinstance(value, str | int):
        words = {"true": "true yes on 1", "false": "false no off 0"}
        said = next((word for word, same in words.items() if str(value).strip().lower() in same.split()), "")
        return _write(f"{said}{' without quotes' * isinstance(value, str)}" if said else "")
    return ""


def _write(text: str) -> str:
    return f"; write {text}" if text else ""


def _has_texts(key: Key) -> bool:
    """Return whether the items of a list are texts."""
    return aliases.dotted(key) in ("task.axes", "arm.joints", "control.nullspace.secondary.axes")


def _fields_at(key: Key) -> dict[str, FieldInfo]:
    """Return the fields below a key, by name."""
    fields = _fields(Sections)
    for above, step in zip(("", *key), key, strict=False):
        if isinstance(step, str) and above != "expect":  # neither an item nor a metric
            fields = _fields(fields[step].annotation)
    return fields


def _fields(kind: Any) -> dict[str, FieldInfo]:
    """Return the fields of a section, or of all the sections in a type."""
    if isinstance(kind, type) and issubclass(kind, Section):
        return {field.alias or name: field for name, field in kind.model_fields.items()}
    return {name: field for inner in get_args(kind) for name, field in _fields(inner).items()}


def _required(_: ErrorDetails, key: Key) -> str:
    return f"is required: {_fields_at(key[:-1])[str(key[-1])].description}"


def _unknown(_: ErrorDetails, key: Key) -> str:
    names = list(_fields_at(key[:-1]))
    if ours := aliases.key_called(key):
        return f'unknown key; use "{ours}"'
    if why := aliases.NONE.get(aliases.dotted(key)) or aliases.NONE.get(str(key[-1])):
        return f"unknown key; {why}"
    near = did_you_mean(str(key[-1]), names)
    place = "" if near else aliases.elsewhere(key)
    if key[0] == "expect" and len(key) == 3:
        near = near or f'; write a metric as one key: "{key[1]}.{brief(str(key[2]))}"'
    elif place:
        near = f"; use the key {place}"
    return f"unknown key{near or '; the keys are ' + ', '.join(names)}"


def _no_option(detail: ErrorDetails, key: Key) -> str:
    value, options = detail["input"], re.findall(r"'([^']*)'", str(detail["ctx"]["expected"]))
    want = ", ".join(f'"{option}"' for option in options)
    near = did_you_mean(value, options) if isinstance(value, str) else ""
    if ours := aliases.choice(key, value):
        near = _write(ours)
    elif isinstance(value, str) and (place := _choice_of(value, key)):
        near = f'; "{value}" is a choice of {place}'
    return f"must be {'one of ' * (len(options) > 1)}{want}, got {show(value)}{near}"


def _no_number(detail: ErrorDetails, key: Key) -> str:
    """Show a value that is not a number, and the way out if it looks like one."""
    value = detail["input"]
    if not isinstance(value, str):
        return f"must be a number, got {show(value)}"
    shown = f"must be a number, got the text {show(value)}"
    if not is_spelled_as_number(value):
        return f"{shown}{instead(value, _unit(key))}"
    digits, exponent, power = value.strip().lower().partition("e")
    signed = power if power[:1] in ("+", "-") else f"+{power}"
    dotted = digits if "." in digits else f"{digits}.0"
    needs = ["a dot"] * (dotted != digits) + ["a sign in the exponent"] * (signed != power)
    if not exponent or not needs:
        return f"{shown}: remove the quotes"
    return f"{shown}: YAML 1.1 needs {listed(needs)}, write {dotted}e{signed}"


def _unit(key: Key) -> str:
    """Return the unit of a key, or of the list that it is an item of."""
    while key and isinstance(key[-1], int):
        key = key[:-1]
    field = _fields_at(key[:-1]).get(str(key[-1])) if key else None  # none for a body that is stretched
    extra = field.json_schema_extra if field else None
    return str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else ""


def _choice_of(value: str, key: Key) -> str:
    """Return the other key that accepts a value as its choice, such as the key of the damping schedule."""
    ours = aliases.dotted(key)
    return next((place for place, names in aliases.CHOICES.items() if value in names and place != ours), "")


# Messages for pydantic's errors: some need the value or the key, the others a requirement and the value.
_WHOLE: dict[str, Callable[[ErrorDetails, Key], str]] = {
    "rule": lambda detail, _: str(detail["ctx"]["text"]),
    "missing": _required,
    "extra_forbidden": _unknown,
    "choice": lambda detail, key: (
        f"{detail['msg']}, got {show(detail['input'])}{_write(aliases.mapping(key, detail['input']))}"
    ),
    "literal_error": _no_option,
    "float_type": _no_number,
}
_WANTS = {
    "string_type": "must be text",
    "path_type": "must be text",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number without a dot",
    "tuple_type": "must be a list",
    "model_type": "must be a mapping",
    "dict_type": "must be a mapping",
    "finite_number": "must be finite",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": 'must be made of letters, digits, "_" and "-"',
    "greater_than": "must be > {gt:g}",
    "greater_than_equal": "must be >= {ge:g}",
    "less_than": "must be < {lt:g}",
    "less_than_equal": "must be <= {le:g}",
}
