"""`--set KEY=VALUE`, or one of `--vary`: one value put into plain data before it is checked."""

from dataclasses import replace
from typing import Any

from rmrc.scenario.keys import Key, Mistake, join
from rmrc.scenario.reading import Document, TextError, parse, plain_number
from rmrc.scenario.sections import listed_default, parse_key
from rmrc.scenario.wording import brief, show


def override(document: Document, text: str, option: str = "--set") -> Document:
    """Return a document with one `KEY=VALUE` of an option; what is wrong with it joins the mistakes.

    It shares what is not on the way to the value with the document that is given, which stays as it is.
    """
    name, equals, value = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        wrong = "must be KEY=VALUE, for example control.feedback=10"
        return _with(document, Mistake((), wrong, f"{option} {brief(text)}"))
    try:
        parsed, found = plain_number(value), list[Mistake]()
        if parsed is None:
            inner = parse(value if value.strip() else "null", key=key)
            parsed, found = inner.value, inner.mistakes
        values = _put(document.value, key, parsed)
    except TextError as error:
        return _with(document, Mistake(key, str(error), f"{option} {join(key)}", hides=True))
    mistakes = [mistake._replace(mark=f"{option} {join(key)}") for mistake in found]
    return Document(values, document.origin.overridden(key, option), document.mistakes + mistakes)


def _with(document: Document, mistake: Mistake) -> Document:
    return replace(document, mistakes=[*document.mistakes, mistake])


def _put(node: Any, key: Key, value: object, depth: int = 0) -> Any:
    """Return plain data with one value set deep in it, and the mappings that lead there."""
    if depth == len(key):
        return value
    step, above = key[depth], join(key[:depth])
    if isinstance(step, str) and not isinstance(node, dict):
        raise TextError(f"{above} is {show(node)}, not a mapping")
    if isinstance(step, int) and not isinstance(node, list):
        raise TextError(f"{above} is {show(node)}, not a list")
    if isinstance(step, int) and step >= len(node):
        raise TextError(f"{above} has {len(node)} item{'s' * (len(node) != 1)}, counted from 0")
    below = node.get(step) if isinstance(node, dict) else node[step]
    if below is None and isinstance(node, dict) and isinstance((*key, 0)[depth + 1], str):
        below = {}
    if below is None and isinstance(node, dict) and step not in node:  # an item of what was not written
        below = listed_default(key[: depth + 1])
    changed = node.copy()
    changed[step] = _put(below, key, value, depth + 1)
    return changed
