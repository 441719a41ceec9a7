"""Pydantic's errors as problems: the key, the requirement, the value, and the way out."""

import re
from collections.abc import Collection
from contextlib import suppress
from typing import Any, TypeVar, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from rmrc.scenario.reading import Document, show
from rmrc.scenario.values import Section, quantity
from rmrc.support.errors import Key, Origin, Problem, ScenarioError, did_you_mean, join

S = TypeVar("S", bound=Section)

# The requirement behind each of pydantic's errors; others have it in pydantic's words.
_WANTS = {
    "string_type": "must be text, in quotes if it looks like a number",
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
    "string_pattern_mismatch": "must have only letters, digits, - and _",
    "too_short": "must have {min_length} or more items",
    "too_long": "must have {max_length} or fewer items",
}

# Other names of choices: no file may use them, but a message then gives ours.
ALIASES = {
    "inv": "inverse", "pinv": "pseudoinverse", "tsvd": "truncated", "jt": "transpose", "dls": "damped",
    "sdls": "selectively_damped", "adaptive": "smallest_singular_value", "rest": "posture", "home": "posture",
    "second_task": "secondary", "proportional": "scale", "saturate": "clamp", "qp": "optimal", "off": "none",
    "time_scaling": "slow", "halt": "stop", "barrier": "keep_out", "kinematic": "ideal", "velocity": "servo",
    "computed_torque": "torque",
}  # fmt: skip

# Other words for keys.
_WORDS = {
    "less": "below", "lt": "below", "max": "below", "greater": "above", "gt": "above", "min": "above",
    "equal": "equals", "tolerance": "within", "gain": "feedback", "kp": "feedback", "speed": "velocity",
    "frequency": "period", "lambda": "damping", "urdf": "model", "mjcf": "model", "tcp": "site",
}  # fmt: skip


def checked(section: type[S], document: Document) -> S:
    """Return the section that a document has.

    Args:
        section: Its class.
        document: The values.

    Raises:
        ScenarioError: Lists all problems at once: those of the file by line, then those of options.
    """
    context = {"folder": document.folder, "root": document.root}
    try:
        return section.model_validate(document.value, context=context, by_alias=True, by_name=False)
    except ValidationError as error:
        details = error.errors(include_url=False)
    problems = [_problem(each, document, section) for each in details if not _counts_valid_items(each)]
    raise ScenarioError(sorted(problems, key=_line))


def _counts_valid_items(detail: ErrorDetails) -> bool:
    """Return whether a list is too short only because pydantic counts its valid items alone."""
    return detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]


def _line(problem: Problem) -> tuple[bool, int, int]:
    origin = problem.origin or Origin()
    return not origin.line, origin.line, origin.column


def _problem(detail: ErrorDetails, document: Document, section: type[Section]) -> Problem:
    is_unknown = detail["type"] == "extra_forbidden"
    key = detail.get("ctx", {}).get("key") or _key(detail, is_unknown)
    problem, place = document.problem(key, _message(detail, key, section)), document.places.get(key)
    if is_unknown and place and problem.origin == place.value:
        return problem._replace(origin=place.key)
    return problem


def _key(detail: ErrorDetails, is_unknown: bool) -> Key:
    """Return the key; pydantic also names options of a union, as `<list>`, and wrong keys, as `[key]`."""
    last = len(detail["loc"]) - 1 if is_unknown else -1
    steps = enumerate(detail["loc"])
    return tuple(step for i, step in steps if i == last or not re.fullmatch(r"<\w+>|\[key\]", str(step)))


def _message(detail: ErrorDetails, key: Key, section: type[Section]) -> str:
    name, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if name == "rule":
        return str(context["text"])
    if name == "missing":
        return f"is required: {_field(key, section).description}"
    if name == "extra_forbidden":
        return f"unknown key; {_way_to_key(str(key[-1]), key[:-1], section)}"
    if name == "literal_error":
        options = re.findall(r"'([^']*)'", context["expected"])
        way = other_name(str(value), options)
        want = ", ".join(f'"{option}"' for option in options)
        return f"must be {'one of ' * (len(options) > 1)}{want}, got {show(value)}{way}"
    want = _WANTS.get(name, re.sub(r"^\w+ should", "must", detail["msg"])).format(**context)
    return f"{want}, got {show(value)}{_way(name, value, key, section)}"


def _way_to_key(name: str, above: Key, section: type[Section]) -> str:
    """Return where an unknown key belongs, or what to write instead of it below the keys above."""
    known = fields_at(section, above)
    word = _WORDS.get(name, "")
    for depth in reversed(range(len(above))):
        if name in fields_at(section, above[:depth]):
            return f"it is a key of {join(above[:depth]) or 'the whole scenario'}: indent it less"
    head, mark, rest = re.split(r"([.: ]|$)", name, maxsplit=1)
    if head in known:
        if mark == ".":
            return f"only --set takes dots; write {head}: {{{rest}: ...}}"
        missing = "a colon" if mark == " " else "a space after the colon"
        return f"write {missing}: {head}: {rest}"
    if word in known:
        return f"write {word}; the keys are {', '.join(known)}"
    if inner := below(name, known):
        return f"it is a key of {' or '.join(join((*above, place)) for place in inner[:4])}: put it there"
    return did_you_mean(name, known).removeprefix("; ") or f"the keys are {', '.join(known)}"


def below(name: str, known: dict[str, FieldInfo]) -> list[str]:
    """Return the sections that have a key: the highest below some keys."""
    inner = {key: fields(field.annotation) for key, field in known.items()}
    nearest = [key for key, names in inner.items() if name in names]
    return nearest or [f"{key}.{place}" for key, names in inner.items() for place in below(name, names)]


def other_name(name: str, options: Collection[str]) -> str:
    """Return the choice that a name is likely to mean, as the end of a message, or ""."""
    alias = ALIASES.get(name.lower(), "")
    return f"; write {alias}" if alias in options else did_you_mean(name, options)


def _way(name: str, value: object, key: Key, section: type[Section]) -> str:
    """Return the correct spelling, if it follows from the value and its key."""
    text = value if isinstance(value, str) else ""
    if name == "float_type" and text:
        extra = _field(key, section).json_schema_extra
        unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
        for option in unit.split(" or "):
            with suppress(ValueError):
                return f"; write {quantity(text.replace(',', '.'), option)[0]:.6g}{unit and f', in {unit}'}"
        example = "60 deg" if "rad" in unit.split() else "1.0e-3"
        return f"; write one such as {example}{unit and f', in {unit}'}"
    if name == "tuple_type" and isinstance(value, dict):
        return "; begin each item with a dash"
    if name != "model_type":
        return ""
    known = fields_at(section, key)
    match = re.fullmatch(r"(\w+)\s*[:=\s]\s*(.+)", text)
    fits = match is not None and match[1] in known
    return f"; write {match[1]}: {match[2]}" if match and fits else f"; its keys are {', '.join(known)}"


def _field(key: Key, section: type[Section]) -> FieldInfo:
    """Return the field of a key, or of the list or mapping that it is an item of."""
    while str(key[-1]) not in fields_at(section, key[:-1]):
        key = key[:-1]
    return fields_at(section, key[:-1])[str(key[-1])]


def fields(kind: Any) -> dict[str, FieldInfo]:
    """Return the keys of a section, or of all the sections in a type."""
    if isinstance(kind, type) and issubclass(kind, Section):
        return {field.alias or name: field for name, field in kind.model_fields.items()}
    return {name: field for inner in get_args(kind) for name, field in fields(inner).items()}


def fields_at(kind: Any, key: Key) -> dict[str, FieldInfo]:
    """Return the keys below a key of a section."""
    known = fields(kind)
    for step in key:  # the index of an item and the name of a metric lead nowhere else
        known = fields(known[step].annotation) if step in known else known
    return known
