"""JUnit XML, which CI shows as tests: one suite per run, one case per expectation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from rmrc.results.expectations import Outcome
from rmrc.results.facts import versions
from rmrc.support.files import written_whole
from rmrc.support.legible import visible

# The case beside the expectations: whether there was a run, and whether it was complete.
RUN = "run"


@dataclass(frozen=True)
class Case:
    """A check, as CI counts it.

    Attributes:
        name: It stays the same from one version to the next.
        ok: Whether the check passed.
        text: The result.
    """

    name: str
    ok: bool
    text: str

    def __str__(self) -> str:
        """Return one line."""
        return f"{self.name}: {self.text}"


@dataclass(frozen=True)
class Suite:
    """A run, as CI counts it.

    Attributes:
        name: Name of the scenario, with the label of a variant.
        outcomes: Outcomes of the expectations that count, or of the checks.
        error: Why there was no run, or no complete one; "": it is complete.
        told: The verdict, in a sentence.
        seconds: Its duration.
    """

    name: str
    outcomes: Sequence[Outcome | Case] = ()
    error: str = ""
    told: str = ""
    seconds: float = 0.0

    @property
    def missed(self) -> list[Outcome | Case]:
        """The expectations that were not met."""
        return [one for one in self.outcomes if not one.ok]


def save(path: Path, name: str, suites: Sequence[Suite]) -> None:
    """Write runs as JUnit XML, atomically.

    The elements and attributes are those of the schema of Jenkins' xUnit plugin (`junit-10.xsd`), which
    GitLab and the actions of GitHub read as well.

    Args:
        path: Path of the file; its folder is created if missing.
        name: Name of the whole set.
        suites: One for each run.
    """
    root = ElementTree.Element("testsuites", _counts(name, suites))
    for suite in suites:
        element = ElementTree.SubElement(root, "testsuite", _counts(suite.name, [suite]))
        properties = ElementTree.SubElement(element, "properties")
        for library, number in versions().items():
            ElementTree.SubElement(properties, "property", name=library, value=number)
        case = _case(element, suite.name, RUN, suite.seconds)
        if suite.error:
            _add(case, "error", suite.error)
        if suite.told:
            ElementTree.SubElement(case, "system-out").text = visible(suite.told)
        for one in suite.outcomes:
            case = _case(element, suite.name, one.name, 0.0)
            if not one.ok:
                _add(case, "failure", str(one))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, "unicode")
    with written_whole(path) as temporary:
        temporary.write_text(f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n', "utf-8")


def _counts(name: str, suites: Sequence[Suite]) -> dict[str, str]:
    """Return the attributes of some suites."""
    return {
        "name": visible(name),
        "tests": str(sum(1 + len(one.outcomes) for one in suites)),
        "failures": str(sum(len(one.missed) for one in suites)),
        "errors": str(sum(bool(one.error) for one in suites)),
        "time": f"{math.fsum(one.seconds for one in suites):.3f}",
    }


def _case(suite: ElementTree.Element, of: str, name: str, seconds: float) -> ElementTree.Element:
    attributes = {"classname": visible(of), "name": visible(name), "time": f"{seconds:.3f}"}
    return ElementTree.SubElement(suite, "testcase", attributes)


def _add(case: ElementTree.Element, kind: str, text: str) -> None:
    """Add a failure: its first line, which lists show, and its whole text."""
    text = visible(text, keep="\n")
    found = ElementTree.SubElement(case, kind, type=kind, message=text.partition("\n")[0])
    found.text = text
