"""The expectations of a scenario about the metrics of its run, and files for CI: JUnit XML, Markdown."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from rmrc.results.columns import no_ticks
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, json_value, nearest
from rmrc.scenario import Check, Scenario
from rmrc.scenario.sections import PROFILE
from rmrc.support.errors import QuestionError, RmrcError, ScenarioError, file_problem
from rmrc.support.files import refuse_unwritable, write_text
from rmrc.support.spatial import AXES
from rmrc.support.text import escaped, visible


@dataclass(frozen=True)
class Case:
    """The outcome of a check.

    Attributes:
        name: It stays the same from one version to the next.
        ok: Whether the check passed.
        text: The result.
    """

    name: str
    ok: bool
    text: str

    def __str__(self) -> str:
        """Return one line: `joint_rate.peak: expected below 3 rad/s, got 3.21, 0.21 too high`."""
        return f"{self.name}: {self.text}"


@dataclass(frozen=True)
class Outcome(Case):
    """The outcome of one expectation; an undefined value is never ok.

    Attributes:
        value: Value of the metric.
        wanted: In words, with the unit: `below 3 rad/s`.
        missed_by: Distance to the nearest value allowed: positive if the value is too high,
            negative if too low, 0 if it is allowed or exactly at a strict bound, NaN if undefined.
    """

    value: float
    wanted: str
    missed_by: float

    def facts(self) -> dict[str, object]:
        """Return the attributes and the line as a dict for strict JSON, as in `Scorecard.nested`."""
        return {**{name: json_value(value) for name, value in vars(self).items()}, "text": str(self)}


@lru_cache(maxsize=16)  # used again for each of thousands of variants
def blank(joints: tuple[str, ...], axes: tuple[str, ...]) -> Scorecard:
    """Return the scorecard of a run without ticks: all its metrics, without values.

    Args:
        joints: Names of the joints.
        axes: Task axes that count.
    """
    n = len(joints)
    run = Run(
        name="", joints=joints, is_slide=(False,) * n, axes=axes, length=1.0, period=1.0, planned=1,
        columns=no_ticks(n, 1, n),
    )  # fmt: skip
    return run.scorecard


def refuse_unknown(scenario: Scenario, joints: Sequence[str]) -> None:
    """Refuse a scenario that expects metrics that its run will not have, or that are not numbers.

    Args:
        scenario: Its `expect` and task are read.
        joints: Names of the joints.

    Raises:
        ScenarioError: All names that are refused, each with its place in the scenario.
    """
    card, problems = blank(tuple(joints), scenario.task.axes), []
    for name in scenario.expect:
        if name not in card and name != PROFILE:
            is_other = name in blank(tuple(joints), AXES)
            why = "needs other axes in task.axes" if is_other else f"no such metric{nearest(name, card)}"
            problems.append((name, why))
        elif name in card and isinstance(card[name].value, str):
            problems.append((name, "is the name of something; an expectation needs a number"))
    if problems:
        raise ScenarioError(scenario.problem(f"expect.{name}", why) for name, why in problems)


def check(card: Scorecard, expect: Mapping[str, Check | str]) -> list[Outcome]:
    """Compare metrics with their expectations.

    `below` and `above` are strict: the bound itself is a miss. `equals` allows `within` on both
    sides, the ends included. An undefined metric (NaN) never passes.

    Args:
        card: The scorecard.
        expect: Checks by name of metric; for `profile` the profile that the run was checked against.

    Returns:
        One outcome per check, in the order of `expect`.
    """
    return [
        _accepted(card, wanted) if isinstance(wanted, str) else _outcome(name, card[name], wanted)
        for name, wanted in expect.items()
    ]


def _accepted(card: Scorecard, profile: str) -> Outcome:
    """Return whether a profile accepts all commands, and the first violation."""
    parts = ("refused", "first_condition", "first_joint", "first_time")
    count, condition, joint, time = (card[f"profile.{part}"].value for part in parts)
    wanted = f"commands that {Path(profile).stem} accepts"
    text = f"expected {wanted}, got {count:g} of {card['ticks'].value} refused"
    if condition:
        text += f', the first for the {condition} of "{joint}" at {time:.6g} s'
    return Outcome(PROFILE, count == 0.0, text, float(count), wanted, float(count))


def _outcome(name: str, figure: Figure, check: Check) -> Outcome:
    value = float(figure.value)
    bounds = (("above", check.above), ("below", check.below))
    words, misses = [f"{word} {bound:.12g}" for word, bound in bounds if bound is not None], []
    # `not value < bound` instead of `value >= bound`: NaN must miss.
    if check.above is not None and not value > check.above:
        misses.append(value - check.above)
    if check.below is not None and not value < check.below:
        misses.append(value - check.below)
    if check.equals is not None and check.within is not None:
        words.append(f"{check.equals:.12g} within {check.within:.12g}")
        off = value - check.equals
        misses += [off - math.copysign(check.within, off)] * (not abs(off) <= check.within)
    miss, wanted = max(misses, key=abs, default=0.0), " and ".join(words)
    wanted += "" if figure.unit == "1" else f" {figure.unit}"
    text = f"expected {wanted}, got {value:.6g}"
    if math.isnan(value):
        text = f"expected {wanted}, but it is undefined for this run"
    elif misses:
        text += f", {abs(miss):.3g} too {'high' if miss > 0 else 'low'}" if miss else ", exactly the bound"
    return Outcome(name, not misses, text, value, wanted, miss)


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
        reason = str(error) if isinstance(error, RmrcError) else "ended before the first result"
        reason = file_problem(error) if isinstance(error, OSError) else reason
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
