"""The page about scenarios in CI: its commands leave what it says, its loop goes on after a failure."""

import os
import re
import shlex
import subprocess
from xml.etree import ElementTree

import pytest

from project import ROOT

PAGE = (ROOT / "docs/scenarios_under_test.md").read_text("utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.usefixtures("undrawn")
def test_its_commands_leave_the_files_that_they_name(rmrc, tmp_path):
    for folder in ("scenarios", "models"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    commands = [shlex.split(block) for block in blocks("sh")]
    assert [words[1] for words in commands] == ["run", "compare"]
    for words in commands:
        assert rmrc(*words[1:]) == (0, "", "")
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
@pytest.mark.parametrize(("names", "status"), [("abc", 1), ("c", 0)])
def test_its_loop_runs_all_and_fails_if_any_does(tmp_path, names, status):
    (loop,) = blocks("bash")
    (tmp_path / "scenarios").mkdir()
    for name in names:
        (tmp_path / f"scenarios/{name}.yaml").touch()
    (tmp_path / "rmrc").write_text(STUB)
    (tmp_path / "rmrc").chmod(0o755)
    env = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    assert subprocess.run(["bash", "-c", loop], cwd=tmp_path, env=env, check=False).returncode == status
    calls = (tmp_path / "calls").read_text().splitlines()
    assert [line.split()[1] for line in calls if line.startswith("run")] == [
        f"scenarios/{n}.yaml" for n in names
    ]
    reported = [line for line in calls if line.startswith("report")]
    assert reported == [f"report ci/{name}/of_its_own.npz --quiet" for name in names if name != "b"]
    assert all(f"--junit ci/{n}.xml --summary ci/{n}.md" in " ".join(calls) for n in names)
