"""CI files of runs: JUnit XML and a Markdown summary, also for failed runs."""

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

# The file of a step of GitHub Actions; text appended to it becomes the summary of that step.
STEP = "GITHUB_STEP_SUMMARY"
# Noun for the outcomes, and adjective for the good ones.
EXPECTATION, CHECK = ("expectation", "met"), ("check", "passed")


def suite(name: str, one: Ran, failures: Sequence[str]) -> Suite:
    """Return a run as a JUnit suite.

    Args:
        name: Name of the run.
        one: Its result.
        failures: Reasons why its files could not be written, one line each.
    """
    run, error = one.run, "\n".join(failures)
    if run.divergence:
        error = str(run.divergence)
    elif one.interrupted:
        error = f"interrupted at tick {len(run)} of {run.planned}"
    return Suite(name, one.outcomes, error, run.verdict, run.wall_time)


class Files:
    """The CI files of a verb, as a context manager; without a call of `write`, they report the failure.

    Attributes:
        paths: Paths of those that are asked for.
    """

    def __init__(self, name: str, xml: Path | None, summary: Path | None) -> None:
        """Refuse files that cannot be written, or of another kind.

        Args:
            name: Name of the scenario.
            xml: File of JUnit XML; None: none.
            summary: Markdown file; appended to if it is the step summary of GitHub Actions; None: none.

        Raises:
            QuestionError: A file has another suffix, or exists with other contents.
            OSError: It cannot be written.
        """
        self._name, self._xml, self._summary, self._is_written = name, xml, summary, False
        self._adds = summary is not None and str(summary) == os.environ.get(STEP)
        self.paths = [path for path in (xml, summary) if path is not None]
        if xml is not None and xml.suffix != ".xml":
            raise QuestionError(f"--junit {visible(str(xml))}: must end in .xml")
        if xml is not None and xml.is_file() and b"<testsuites" not in xml.read_bytes()[:200]:
            raise QuestionError(
                f"--junit {visible(str(xml))}: exists and is not JUnit XML; give another file"
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
        """Write the reason of a failed run."""
        if error is not None and not self._is_written:
            told = "ended before the first result"
            if isinstance(error, ScenarioError):
                told = "\n".join(map(str, error.problems))
            elif isinstance(error, RmrcError | OSError):
                told = str(error)
            self.write(self._name, [Suite(self._name, error=told)])

    def write_answer(self, name: str, report: Report, error: str = "") -> None:
        """Write the files of an answer without a run: its checks and tables.

        Args:
            name: Name of the subject.
            report: The answer.
            error: Reason why it is incomplete; "": it is complete.

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
            name: Common name of all runs.
            suites: One suite per run.
            figures: Their metrics, in Markdown.
            counted: Nouns for the outcomes, and for the good ones.

        Raises:
            OSError: A file cannot be written.
        """
        self._is_written = True
        if self._xml is not None:
            junit.save(self._xml, name, suites)
        if self._summary is None:
            return
        text = markdown(name, suites, figures, counted)
        if self._adds:  # texts of other steps and other commands of this step stay
            with self._summary.open("a", encoding="utf-8") as file:
                file.write(f"{text}\n")
        else:
            with written_whole(self._summary) as temporary:
                temporary.write_text(text, "utf-8")


def markdown(name: str, suites: Sequence[Suite], figures: str, counted: tuple[str, str] = EXPECTATION) -> str:
    """Return the summary: a result line, then each run with its expectations and metrics.

    Args:
        name: Common name of all runs.
        suites: One suite per run.
        figures: Their metrics, in Markdown; "": none.
        counted: Nouns for the outcomes, and for the good ones.
    """
    what, well = counted
    outcomes = [outcome for one in suites for outcome in one.outcomes]
    met, errors = sum(one.ok for one in outcomes), sum(bool(one.error) for one in suites)
    words = [f"{met} of {len(outcomes)} {what}s {well}"] if outcomes else []
    words += [f"{errors} of {len(suites)} runs incomplete"] if errors and len(suites) > 1 else []
    words += ["run incomplete"] if errors and len(suites) == 1 else []
    passed = not errors and met == len(outcomes)
    blocks = [
        f"### {'✅' if passed else '❌'} {escaped(visible(name))}: {', '.join(words) or 'run complete'}"
    ]
    for one in suites:
        blocks += [f"#### {escaped(visible(one.name))}"] if len(suites) > 1 else []
        blocks += [escaped(visible(one.told))] if one.told else []
        rows = [("ERROR", f"{RUN}: {line}") for line in visible(one.error, keep="\n").splitlines()]
        rows += [("ok" if outcome.ok else "MISSED", visible(str(outcome))) for outcome in one.outcomes]
        blocks += [as_markdown(Sheet("", ("", what), rows, frozenset({0, 1})))] if rows else []
    if figures:
        blocks.append(f"<details><summary>Metrics</summary>\n\n{figures.strip()}\n\n</details>")
    return "\n\n".join(blocks) + "\n"
