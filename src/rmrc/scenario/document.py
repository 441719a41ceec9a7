"""Documents: YAML texts as plain values with their places, and their check against a section."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from rmrc.scenario.keys import in_order
from rmrc.scenario.messages import translate
from rmrc.scenario.reading import Document, TextError, parse, read
from rmrc.scenario.values import Section
from rmrc.scenario.wording import show
from rmrc.support.errors import ScenarioError

S = TypeVar("S", bound=Section)


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
        raise ScenarioError([error.problem(source)]) from None
    if not isinstance(document.value, dict):
        raise ScenarioError([document.sources.problem((), f"must be a mapping, got {show(document.value)}")])
    return document


def checked(section: type[S], document: Document, context: Mapping[str, Any] | None = None) -> S:
    """Return the section that a document has.

    Args:
        section: Its class.
        document: The values.
        context: Where the files are; None: they are not checked.

    Raises:
        ScenarioError: Lists all problems at once.
    """
    try:
        return section.model_validate(document.value, context=context, by_alias=True, by_name=False)
    except ValidationError as error:
        raise ScenarioError(in_order(translate(error, document.sources, section))) from None
