"""Pages for users of robots: what they declare is what the program has, and their log and their loop for CI work."""

import os
import re
import runpy
import subprocess

import pytest

from pages import blocks
from project import ROOT
from rmrc.analysis.check import CODES
from rmrc.scenario import loads
from rmrc.scenario.profile import SHIPPED, load_profile


def fenced(page, language):
    return [text for name, text in blocks((ROOT / f"docs/{page}.md").read_text("utf-8")) if name == language]


def test_the_sample_of_a_log_is_what_the_program_of_its_page_logs(capsys):
    runpy.run_path(str(ROOT / "examples/log_an_arm.py"), run_name="__main__")
    head, *rows = capsys.readouterr().out.splitlines()
    there, *sample = (ROOT / "scenarios/arm_log.csv").read_text("utf-8").splitlines()
    assert head == there and len(rows) == len(sample) == 1250
    for row, kept in zip(rows, sample, strict=True):  # a machine's sine may round otherwise, by a resolution
        assert [*map(float, row.split(","))] == pytest.approx([*map(float, kept.split(","))], abs=1e-4)


def test_the_profiles_of_the_page_are_those_of_the_files(tmp_path):
    keys, own = fenced("profiles", "yaml")
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
    (loop,) = fenced("scenarios_under_test", "bash")
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


def test_the_table_of_findings_is_what_is_declared():
    page = (ROOT / "docs/my_robot.md").read_text("utf-8")
    assert dict(re.findall(r"^\| `([a-z-]+)` \| (\w+) \| .+ \|$", page, re.MULTILINE)) == CODES


def test_the_readme_shows_on_its_first_screen_how_a_users_own_file_is_run():
    screen = "\n".join((ROOT / "README.md").read_text("utf-8").splitlines()[:40])
    at = [screen.index(f"rmrc {verb} my.") for verb in ("check", "new", "run")]
    assert at == sorted(at) and "docs/my_robot.md" in screen
