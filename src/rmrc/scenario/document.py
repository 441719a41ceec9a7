"""Documents: YAML texts as plain values with their places, and their check against a section."""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, TypeVar

from pydantic import ValidationError

from rmrc.scenario.keys import in_order
from rmrc.scenario.reading import Document, TextError, parse, read
from rmrc.scenario.values import Section
from rmrc.scenario.wording import show
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Origin, Problem

S = TypeVar("S", bound=Section)
Words: TypeAlias = Callable[[ValidationError, Document], list[Problem]]
"""Puts pydantic's errors about a document in words."""


def read_document(source: str, text: str | None = None) -> Document:
    """Return the values of a YAML text, which is a mapping.

    Args:
        source: Its file, or its name in messages.
        text: The text; None: that of the file.

    Raises:
        ScenarioError: It cannot be read, or is not a mapping.
    """
    try:
        document = parse(read(source) if text is None else text, source)
    except TextError as error:
        raise ScenarioError([Problem((), str(error), Origin(source, *error.mark))]) from None
    if not isinstance(document.value, dict):
        wrong = document.sources.problem((), f"must be a mapping of keys, got {show(document.value)}")
        raise ScenarioError(in_order(document.problems) or [wrong])
    return document


def checked(
    section: type[S], document: Document, words: Words, context: Mapping[str, Any] | None = None
) -> S:
    """Return the section that a document has.

    Args:
        section: Its class.
        document: The values.
        words: For the errors.
        context: Where the files are; None: they are not checked.

    Raises:
        ScenarioError: Lists all problems at once.
    """
    problems = document.problems
    try:
        content = section.model_validate(document.value, context=context, by_alias=True, by_name=False)
    except ValidationError as error:
        problems = problems + words(error, document)
    if problems:
        raise ScenarioError(in_order(problems))
    return content
