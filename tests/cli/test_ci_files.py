"""JUnit XML and summaries: what CI reads of runs that went well, missed, diverged, or never began."""

import os
import re
from xml.etree import ElementTree

import pytest

from project import ROOT
from rmrc.analysis.check import CODES
from rmrc.results.run import Run
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{hold: {{for: 0.05}}}}]}}
expect:
  position_error.max: {{below: 0.1}}
  duration: {{equals: 0.05, within: 0.002}}
"""

# What junit-10.xsd of Jenkins' xUnit plugin, which is narrower than what GitLab and GitHub read, allows of what is used.
ATTRIBUTES = {
    "testsuites": {"name", "time", "tests", "failures", "errors"},
    "testsuite": {"name", "time", "tests", "failures", "errors", "timestamp", "file"},
    "testcase": {"name", "time", "classname"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
    "system-out": set(),
}


def read(path):
    """Return the root of a tree that the schema allows, and that counts what is in it."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == "testsuites"
    for element in root.iter():
        assert set(element.keys()) <= ATTRIBUTES[element.tag], element.tag
        assert re.fullmatch(r"\d*\.\d{3}", element.get("time", ".000"))
        for name, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error")):
            assert int(element.get(name, -1)) in (-1, len(list(element.iter(tag))))
    return root


def told(root):
    """Return what each case says: nothing, a failure or an error."""
    return {
        case.get("name"): next(((one.tag, one.text) for one in case if one.tag in ("failure", "error")), None)
        for case in root.iter("testcase")
    }


@pytest.fixture
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(TEXT)
    return tmp_path


ASKED = ("--no-record", "--quiet", "--junit", "ci/a.xml", "--summary", "ci/a.md")


def test_a_case_for_each_expectation_and_one_for_the_run(rmrc, quick):
    code, out, err = rmrc("run", "quick.yaml", "--no-record", "--junit", "ci/a.xml", "--summary", "ci/a.md")
    assert (code, err) == (0, "") and "wrote ci/a.xml\nwrote ci/a.md\n" in out
    root, run = read("ci/a.xml"), Run.read(quick / "recordings/quick.npz")
    assert told(root) == {"run": None, "position_error.max": None, "duration": None}
    assert root.find(".//system-out").text == run.verdict
    assert float(root.get("time")) == pytest.approx(run.wall_time, abs=5.1e-4)
    lines = (quick / "ci/a.md").read_text("utf-8").splitlines()
    assert lines[0] == "### ✅ quick: 2 of 2 checks passed"
    assert any(line.startswith("- ok: duration: expected 0.05 ") for line in lines)
    assert "<details><summary>Metrics</summary>" in lines and "## Errors" in lines


@pytest.mark.usefixtures("quick")
def test_a_divergence_is_an_error(rmrc):
    code, _, err = rmrc("run", "quick.yaml", "--set", "plant.wrench=[0, 1.0e+15, 0, 0, 0, 0]", *ASKED)
    assert code == 3
    assert told(read("ci/a.xml"))["run"] == ("error", err.splitlines()[-1].partition("quick ")[2])


def test_a_refusal_is_an_error_with_all_its_lines(rmrc, quick):
    code, _, err = rmrc("run", "quick.yaml", "--set", "control.period=-1", "--set", "task.length=0", *ASKED)
    lines = [line.removeprefix("rmrc: error: ") for line in err.splitlines()]
    assert code == 2 and len(lines) == 2
    assert told(read("ci/a.xml")) == {"run": ("error", "\n".join(lines))}
    assert "❌ quick: 1 of 1 runs incomplete" in (quick / "ci/a.md").read_text("utf-8")


def test_each_variant_of_a_comparison_is_a_suite_and_the_exit_code_stays(rmrc, quick):
    varied = ("--vary", "control.feedback=5,10", "--set", "expect.duration.equals=0.2")
    code, _, _ = rmrc("compare", "quick.yaml", *varied, *ASKED)
    root = read("ci/a.xml")
    assert code == 0
    assert [one.get("name") for one in root] == ["quick feedback=5", "quick feedback=10"]
    assert [one.get("failures") for one in (root, *root)] == ["2", "1", "1"]
    assert "#### quick feedback=10\n" in (quick / "ci/a.md").read_text("utf-8")


def test_the_summary_of_a_step_of_github_is_added_to(rmrc, quick, monkeypatch):
    step = quick / "step_summary_1"
    step.write_text("what was said before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(step))
    for _ in range(2):
        assert rmrc("run", "quick.yaml", "--no-record", "--quiet", "--summary", str(step))[0] == 0
    text = step.read_text("utf-8")
    assert text.startswith("what was said before\n") and text.count("### ✅ quick") == 2


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--junit", "quick.yaml"), "--junit quick.yaml: … .xml"),
        (("--summary", "quick.yaml"), "--summary quick.yaml: … .md … $GITHUB_STEP_SUMMARY"),
        (("--junit", "arm.xml"), "--junit arm.xml: … not JUnit XML… new …"),
    ],
)
def test_a_file_that_is_something_else_stays(rmrc, quick, monkeypatch, options, line):
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    (quick / "arm.xml").write_text("<mujoco/>")
    assert rmrc("run", "quick.yaml", *options) == (2, "", says(f"rmrc: error: {line}\n"))
    assert (quick / "arm.xml").read_text() == "<mujoco/>" and (quick / "quick.yaml").read_text() == TEXT
    assert sorted(os.listdir(quick)) == ["arm.xml", "quick.yaml"]


WARNED, BROKEN = f"{ROOT}/models/planar_2link.xml", "home.xml"


def test_check_leaves_a_case_for_each_code_and_fails_on_an_error_alone(rmrc, quick):
    text = (ROOT / "models/planar_2link.xml").read_text("utf-8").replace("common/", f"{ROOT}/models/common/")
    (quick / BROKEN).write_text(re.sub(r'(<joint name="elbow"[^>]*range=")[^"]*"', r'\g<1>100 120"', text))
    for model, code in ((WARNED, 0), (BROKEN, 1)):
        assert rmrc("check", model, "--junit", "ci/a.xml", "--summary", "ci/a.md", "--json")[0] == code
        cases = told(read("ci/a.xml"))
        assert cases.keys() == {"run", *CODES}
        failed = {name for name, what in cases.items() if what is not None}
        assert failed == ({"home-outside-limits"} if code else set())
        first, *lines = (quick / "ci/a.md").read_text("utf-8").splitlines()
        assert first.startswith("### ❌" if code else "### ✅")
        assert f"{len(CODES) - len(failed)} of {len(CODES)} checks passed" in first
        assert sum(line.startswith("- MISSED: home-outside-limits: error: ") for line in lines) == len(failed)
