"""Pages for users of robots: their commands, run in order as they stand, print what the pages say."""

import os
import re
import runpy
import shlex
import shutil
import subprocess
from xml.etree import ElementTree

import pytest

from project import ROOT
from rmrc.scenario import loads
from rmrc.scenario.profile import SHIPPED, load_profile


def blocks(page, language=None):
    """Return the fenced blocks of a page: each its language and text, or the texts of one language."""
    text = (ROOT / f"docs/{page}.md").read_text("utf-8")
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return fenced if language is None else [text for name, text in fenced if name == language]


def commands(page):
    """Return the words of each command of a page, and the lines of the block that follows, if it has no language."""
    fenced = [*blocks(page), ("", "")]
    return [
        (shlex.split(text), fenced[i + 1][1].splitlines() if not fenced[i + 1][0] else [])
        for i, (language, text) in enumerate(fenced)
        if language == "sh" and text.startswith("rmrc")
    ]


def words(text):
    """Return a text without its breaks, numbers rounded: the last digit is that of a machine.

    How many commands of a run through a singularity are refused depends on the last digits of sines.
    """
    text = re.sub(r"-?\d+\.\d+(e-?\d+)?(?=\s|$)", lambda number: f"{float(number[0]):.2g}", text)
    return re.sub(r"got [1-9]\d* of", "got … of", " ".join(text.split()))


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("page", "verbs", "codes"),
    [
        ("profiles", ["run"], [1, 0]),
        ("from_simulation_to_your_robot", ["identify", "run"], [0, 0]),
        pytest.param("from_simulation_to_your_robot", ["margins", "tune"], [0, 0], marks=pytest.mark.long),
    ],
)
def test_the_commands_of_a_page_print_what_it_says(rmrc, tmp_path, page, verbs, codes):
    for folder in ("models", "scenarios"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / "loop.yaml").write_text(blocks(page, "yaml")[0], "utf-8")
    chosen = [(command, lines) for command, lines in commands(page) if command[1] in verbs]
    for (command, lines), wanted in zip(chosen, codes, strict=True):
        code, out, err = rmrc(*command[1:])
        printed = words(out + err)
        assert code == wanted and lines
        assert [line for line in lines if words(line) not in printed] == []


def test_the_sample_of_a_log_is_what_the_program_of_its_page_logs(capsys):
    command = blocks("from_simulation_to_your_robot", "sh")[0]
    program, file = re.fullmatch(r"python (\S+) > (\S+)\n", command).groups()
    runpy.run_path(str(ROOT / program), run_name="__main__")
    head, *rows = capsys.readouterr().out.splitlines()
    there, *sample = (ROOT / file).read_text("utf-8").splitlines()
    assert head == there and len(rows) == len(sample) == 1250
    for row, kept in zip(rows, sample, strict=True):  # a machine's sine may round otherwise, by a resolution
        assert [*map(float, row.split(","))] == pytest.approx([*map(float, kept.split(","))], abs=1e-4)


def test_the_python_of_a_page_prints_what_it_says(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    (program,) = blocks("from_simulation_to_your_robot", "python")
    exec(compile(program, "page", "exec"), {})
    assert capsys.readouterr().out.splitlines() == re.findall(r"# (.+)$", program, re.MULTILINE)


def test_the_profiles_of_the_page_are_those_of_the_files(tmp_path):
    keys, own = blocks("profiles", "yaml")
    text = f"name: x\narm: {{model: {ROOT}/models/fr3.xml}}\ntarget: {{path: [{{hold: {{for: 1}}}}]}}\n{keys}"
    assert loads(text).control.limits.acceleration == (9.999,) * 7
    (tmp_path / "own.yaml").write_text(own)
    assert load_profile(str(tmp_path / "own.yaml")).loop.delay.value == (0.006, 0.012)
    page = (ROOT / "docs/profiles.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| [\d.-]+ \| ([^|]+) \|", page, re.MULTILINE)
    assert [name for name, _, _ in rows] == list(SHIPPED)
    for name, robot, rates in rows:
        profile = load_profile(name)
        assert (robot, rates) == (
            profile.robot,
            ", ".join(f"{rate:.4g}" for rate in dict.fromkeys(profile.rate.value)),
        )


@pytest.mark.usefixtures("undrawn")
def test_the_commands_for_ci_leave_the_files_that_they_name(rmrc, tmp_path):
    for folder in ("scenarios", "models"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    for command, _ in commands("scenarios_under_test"):
        assert rmrc(*command[1:]) == (0, "", "")
    suites = [len(ElementTree.parse(path).getroot()) for path in sorted(tmp_path.glob("ci/*.xml"))]
    assert suites == [1, 2]
    assert (tmp_path / "ci/approach_singularity.md").read_text("utf-8").startswith("### ✅")


STUB = """#!/bin/sh
echo "$*" >> calls
[ "$1" = run ] || exit 0
name=$(basename "$2" .yaml)
mkdir "ci/$name"
[ "$name" = b ] || touch "ci/$name/of_its_own.npz" "ci/$name/of_its_own.json"
[ "$name" = c ] || exit 3
"""


@pytest.mark.skipif(os.name != "posix", reason="a shell")
def test_the_loop_for_ci_runs_all_and_fails_if_any_does(tmp_path):
    (loop,) = blocks("scenarios_under_test", "bash")
    (tmp_path / "scenarios").mkdir()
    for name in "abc":
        (tmp_path / f"scenarios/{name}.yaml").touch()
    (tmp_path / "rmrc").write_text(STUB)
    (tmp_path / "rmrc").chmod(0o755)
    env = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    assert subprocess.run(["bash", "-c", loop], cwd=tmp_path, env=env, check=False).returncode == 1
    calls = (tmp_path / "calls").read_text().splitlines()
    assert [line.split()[1] for line in calls if line[:3] == "run"] == [f"scenarios/{n}.yaml" for n in "abc"]
    assert [line for line in calls if line[:3] == "rep"] == [
        f"report ci/{n}/of_its_own.npz --quiet" for n in "ac"
    ]
