"""`--set KEY=VALUE`, or one of `--vary`: one value put into plain data before it is checked."""

from typing import Any

from rmrc.scenario.places import Key, Mistake, join
from rmrc.scenario.reading import Document, TextError, parse
from rmrc.scenario.sections import parse_key
from rmrc.scenario.wording import brief, show


def override(document: Document, text: str, option: str = "--set") -> None:
    """Apply one `KEY=VALUE` of an option to a document; what is wrong with it joins the mistakes."""
    name, equals, value = text.partition("=")
    try:
        key = parse_key(name.strip() if equals else "")
    except ValueError:
        wrong = "must be KEY=VALUE, for example control.feedback=10"
        document.mistakes.append(Mistake((), wrong, f"{option} {brief(text)}"))
        return
    try:
        parsed = parse(value if value.strip() else "null", key=key)
        _put(document.value, key, parsed.value)
    except TextError as error:
        document.mistakes.append(Mistake(key, str(error), f"{option} {join(key)}", hides=True))
        return
    document.origin.override(key, option)
    document.mistakes += [mistake._replace(mark=f"{option} {join(key)}") for mistake in parsed.mistakes]


def _put(node: Any, key: Key, value: object) -> None:
    """Set one value deep in plain data, with the mappings that lead to it."""
    for depth, step in enumerate(key):
        above = join(key[:depth])
        if isinstance(step, str) and not isinstance(node, dict):
            raise TextError(f"{above} is {show(node)}, not a mapping")
        if isinstance(step, int) and not isinstance(node, list):
            raise TextError(f"{above} is {show(node)}, not a list")
        if isinstance(step, int) and step >= len(node):
            raise TextError(f"{above} has {len(node)} item{'s' * (len(node) != 1)}, counted from 0")
        if depth == len(key) - 1:
            node[step] = value
        elif isinstance(step, int):
            node = node[step]
        else:
            if node.get(step) is None and isinstance(key[depth + 1], str):
                node[step] = {}
            node = node.get(step)
