"""What runs leave for CI: JUnit XML, and a summary in Markdown; also where nothing could be run."""

import os
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from rmrc.results import junit
from rmrc.results.junit import RUN, Suite
from rmrc.results.leaving import refuse_unwritable
from rmrc.show.report import Report
from rmrc.show.sheets import Sheet, as_markdown, escaped
from rmrc.study.study import Ran
from rmrc.support.errors import QuestionError, RmrcError, ScenarioError
from rmrc.support.files import written_whole
from rmrc.support.legible import visible

# The file of a step of GitHub Actions, whose end is the summary of that step.
STEP = "GITHUB_STEP_SUMMARY"
# What is counted, and what those that are well are.
EXPECTATION, CHECK = ("expectation", "met"), ("check", "passed")


def suite(name: str, one: Ran, failures: Sequence[str]) -> Suite:
    """Return a run as CI counts it.

    Args:
        name: Of the run.
        one: What came of it.
        failures: Why files of it could not be written, a line each.
    """
    run, error = one.run, "\n".join(failures)
    if run.divergence:
        error = str(run.divergence)
    elif one.interrupted:
        error = f"interrupted at tick {len(run)} of {run.planned}"
    return Suite(name, one.outcomes, error, run.verdict, run.wall_time)


class Files:
    """The files for CI of a verb, as a context: without `write`, they say why it came to nothing.

    Attributes:
        paths: Of those that are asked for.
    """

    def __init__(self, name: str, xml: Path | None, summary: Path | None) -> None:
        """Refuse files that cannot be written, or that are something else.

        Args:
            name: Of the scenario.
            xml: JUnit XML; None: none.
            summary: In Markdown, and added to the end of the file if it is that of a step of GitHub Actions;
                None: none.

        Raises:
            QuestionError: A file has another suffix, or is there and no such file.
            OSError: It cannot be written.
        """
        self._name, self._xml, self._summary, self._is_written = name, xml, summary, False
        self._adds = summary is not None and str(summary) == os.environ.get(STEP)
        self.paths = [path for path in (xml, summary) if path is not None]
        if xml is not None and xml.suffix != ".xml":
            raise QuestionError(f"--junit {visible(str(xml))}: must end in .xml")
        if xml is not None and xml.is_file() and b"<testsuites" not in xml.read_bytes()[:200]:
            raise QuestionError(
                f"--junit {visible(str(xml))}: is there, and is no JUnit XML; give another file"
            )
        if summary is not None and summary.suffix != ".md" and not self._adds:
            raise QuestionError(f"--summary {visible(str(summary))}: must end in .md, or be ${STEP}")
        refuse_unwritable(self.paths)

    def __enter__(self) -> Self:
        """Begin."""
        self._began = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        """Write why there was no run."""
        if error is not None and not self._is_written:
            told = "ended before there was a result"
            if isinstance(error, ScenarioError):
                told = "\n".join(map(str, error.problems))
            elif isinstance(error, RmrcError | OSError):
                told = str(error)
            self.write(self._name, [Suite(self._name, error=told)])

    def write_answer(self, name: str, report: Report, error: str = "") -> None:
        """Write the files of an answer that is no run: what was checked, and its tables.

        Args:
            name: Of what was asked about.
            report: The answer.
            error: Why it is not whole; "": it is.

        Raises:
            OSError: A file cannot be written.
        """
        one = Suite(name, report.cases, error, report.problem, time.perf_counter() - self._began)
        self.write(name, [one], "\n\n".join(map(as_markdown, report.sheets)), CHECK)

    def write(
        self, name: str, suites: Sequence[Suite], figures: str = "", counted: tuple[str, str] = EXPECTATION
    ) -> None:
        """Write the files.

        Args:
            name: Of all runs together.
            suites: One for each run.
            figures: Their figures, in Markdown.
            counted: What their outcomes are, and what those that are well are.

        Raises:
            OSError: A file cannot be written.
        """
        self._is_written = True
        if self._xml is not None:
            junit.save(self._xml, name, suites)
        if self._summary is None:
            return
        text = markdown(name, suites, figures, counted)
        if self._adds:  # what other steps and other commands of this step have said stays
            with self._summary.open("a", encoding="utf-8") as file:
                file.write(f"{text}\n")
        else:
            with written_whole(self._summary) as temporary:
                temporary.write_text(text, "utf-8")


def markdown(name: str, suites: Sequence[Suite], figures: str, counted: tuple[str, str] = EXPECTATION) -> str:
    """Return the summary: how it went in a line, what each run comes to, its expectations, its figures.

    Args:
        name: Of all runs together.
        suites: One for each run.
        figures: Their figures, in Markdown; "": none.
        counted: What their outcomes are, and what those that are well are.
    """
    what, well = counted
    outcomes = [outcome for one in suites for outcome in one.outcomes]
    met, errors = sum(one.ok for one in outcomes), sum(bool(one.error) for one in suites)
    words = [f"{met} of {len(outcomes)} {what}s {well}"] if outcomes else []
    words += [f"{errors} of {len(suites)} runs without an end"] if errors and len(suites) > 1 else []
    words += ["no run to its end"] if errors and len(suites) == 1 else []
    passed = not errors and met == len(outcomes)
    blocks = [
        f"### {'✅' if passed else '❌'} {escaped(visible(name))}: {', '.join(words) or 'ran to its end'}"
    ]
    for one in suites:
        blocks += [f"#### {escaped(visible(one.name))}"] if len(suites) > 1 else []
        blocks += [escaped(visible(one.told))] if one.told else []
        rows = [("ERROR", f"{RUN}: {line}") for line in visible(one.error, keep="\n").splitlines()]
        rows += [("ok" if outcome.ok else "MISSED", visible(str(outcome))) for outcome in one.outcomes]
        blocks += [as_markdown(Sheet("", ("", what), rows, frozenset({0, 1})))] if rows else []
    if figures:
        blocks.append(f"<details><summary>Figures</summary>\n\n{figures.strip()}\n\n</details>")
    return "\n\n".join(blocks) + "\n"
