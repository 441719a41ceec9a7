"""Files of runs for CI, also of failed ones: JUnit XML, which it shows as tests, and Markdown."""

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from rmrc.results.expectations import Case
from rmrc.results.run import Run
from rmrc.support.errors import QuestionError, RmrcError
from rmrc.support.files import refuse_unwritable, write_text
from rmrc.support.text import escaped, visible

# The file of a step of GitHub Actions; text appended to it becomes the summary of that step.
STEP = "GITHUB_STEP_SUMMARY"


@dataclass(frozen=True)
class Suite:
    """A run, as CI counts it.

    Attributes:
        name: Name of the scenario, with the label of a variant.
        cases: Outcomes of the expectations that count, or of the checks.
        error: Why there was no run, or no complete one; "": it is complete.
        verdict: The result, in a sentence.
        seconds: Its duration.
    """

    name: str
    cases: Sequence[Case] = ()
    error: str = ""
    verdict: str = ""
    seconds: float = 0.0


def suite(name: str, run: Run, cases: Sequence[Case], interrupted: bool, failures: Sequence[str]) -> Suite:
    """Return a run as a suite.

    Args:
        name: Name of the run.
        run: The run.
        cases: Outcomes of its expectations.
        interrupted: Whether Ctrl-C ended it.
        failures: Reasons why its files could not be written, one line each.
    """
    error = "\n".join(failures)
    if run.divergence or interrupted:
        error = str(run.divergence or f"interrupted at tick {len(run)} of {run.planned}")
    return Suite(name, cases, error, run.verdict, run.wall_time)


@dataclass
class Results:
    """What the files tell.

    Attributes:
        name: Common name of all runs.
        suites: One for each run.
        figures: Their metrics, in Markdown; "": none.
    """

    name: str
    suites: Sequence[Suite] = ()
    figures: str = ""


@contextmanager
def files(name: str, xml: Path | None, summary: Path | None) -> Iterator[Results]:
    """Yield the results of a verb, and write them to its CI files at the end, or else the failure.

    Args:
        name: Name of the scenario.
        xml: File of JUnit XML; None: none.
        summary: Markdown file; appended to if it is the step summary of GitHub Actions; None: none.

    Raises:
        QuestionError: A file has another suffix, or exists with other contents.
        OSError: It cannot be written.
    """
    adds = summary is not None and str(summary) == os.environ.get(STEP)
    if xml and (xml.suffix != ".xml" or (xml.is_file() and b"<testsuites" not in xml.read_bytes()[:200])):
        raise QuestionError(f"--junit {visible(str(xml))}: is not JUnit XML; give a new file in .xml")
    if summary and summary.suffix != ".md" and not adds:
        raise QuestionError(f"--summary {visible(str(summary))}: must end in .md, or be ${STEP}")
    refuse_unwritable(filter(None, (xml, summary)))
    results = Results(name)
    try:
        yield results
    except BaseException as error:
        reason = str(error) if isinstance(error, RmrcError | OSError) else "ended before the first result"
        results.suites = results.suites or [Suite(name, error=reason)]
        raise
    finally:
        if xml:
            write_text(xml, junit(results))
        if summary:  # texts of other commands of this step stay
            before = f"{summary.read_text('utf-8')}\n" if adds and summary.exists() else ""
            write_text(summary, f"{before}{markdown(results)}")


def junit(results: Results) -> str:
    """Return runs as JUnit XML: a case for each run, which an error fails, and one for each check.

    The elements and attributes are those of the schema of Jenkins' xUnit plugin (`junit-10.xsd`), which
    GitLab and the actions of GitHub read as well.
    """
    root = ElementTree.Element("testsuites", _counts(results.name, results.suites))
    for suite in results.suites:
        element = ElementTree.SubElement(root, "testsuite", _counts(suite.name, [suite]))
        cases = [("run", "error", suite.error)]
        cases += [(case.name, "failure", "" if case.ok else str(case)) for case in suite.cases]
        for name, tag, text in cases:
            names = {"classname": visible(suite.name), "name": visible(name)}
            case = ElementTree.SubElement(element, "testcase", names)
            if text:  # its first line, which lists show, and the whole text
                lines = visible(text, keep="\n")
                ElementTree.SubElement(case, tag, type=tag, message=lines.partition("\n")[0]).text = lines
        ElementTree.SubElement(element, "system-out").text = visible(suite.verdict)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


def _counts(name: str, suites: Sequence[Suite]) -> dict[str, str]:
    """Return the attributes of some suites."""
    oks = [case.ok for suite in suites for case in suite.cases]
    return {
        "name": visible(name),
        "tests": str(len(suites) + len(oks)),
        "failures": str(oks.count(False)),
        "errors": str(sum(bool(suite.error) for suite in suites)),
        "time": f"{math.fsum(suite.seconds for suite in suites):.3f}",
    }


def markdown(results: Results) -> str:
    """Return the summary: a result line, then each run with its checks and metrics."""
    oks = [case.ok for suite in results.suites for case in suite.cases]
    errors = sum(bool(suite.error) for suite in results.suites)
    words = [f"{sum(oks)} of {len(oks)} checks passed"] * bool(oks)
    words += [f"{errors} of {len(results.suites)} runs incomplete"] * bool(errors)
    mark = "✅" if all(oks) and not errors else "❌"
    blocks = [f"### {mark} {escaped(visible(results.name))}: {', '.join(words) or 'complete'}"]
    for suite in results.suites:
        blocks += [f"#### {escaped(visible(suite.name))}"] * (len(results.suites) > 1)
        lines = [f"ERROR: run: {line}" for line in suite.error.splitlines()]
        lines += [f"{'ok' if case.ok else 'MISSED'}: {case}" for case in suite.cases]
        blocks.append(escaped(visible(suite.verdict)))
        blocks.append("\n".join(f"- {escaped(visible(line))}" for line in lines))
    if results.figures:
        blocks.append(f"<details><summary>Metrics</summary>\n\n{results.figures.strip()}\n\n</details>")
    return "\n\n".join(filter(None, blocks)) + "\n"
