"""The page about a robot of one's own: its commands print what it says, and its tables are what is declared."""

import re
import shlex
import shutil

import pytest

from project import ROOT
from rmrc.analysis.check.findings import CODES

PAGE = (ROOT / "docs/my_robot.md").read_text("utf-8")
README = (ROOT / "README.md").read_text("utf-8")


def blocks(language):
    """Return the fenced blocks of a language, each with the one that follows it if it has none."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return [
        (text, found[i + 1][1] if i + 1 < len(found) and not found[i + 1][0] else "")
        for i, (kind, text) in enumerate(found)
        if kind == language
    ]


def test_the_commands_in_their_order_print_what_the_page_says(rmrc, tmp_path):
    shutil.copytree(ROOT / "models", tmp_path / "models")
    commands = blocks("sh")
    assert [shlex.split(command)[1] for command, _ in commands] == ["check", "new", "run"]
    for command, lines in commands:
        code, out, _ = rmrc(*shlex.split(command)[1:])
        printed = {" ".join(line.split()) for line in out.splitlines()}
        assert code == 0 and lines
        assert [line for line in lines.splitlines() if " ".join(line.split()) not in printed] == []


def test_its_python_prints_what_it_says(capsys):
    ((program, _),) = blocks("python")
    exec(compile(program, "my_robot.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == re.findall(r"# (.+)$", program, re.MULTILINE)


def test_the_table_of_findings_is_what_is_declared():
    assert dict(re.findall(r"^\| `([a-z-]+)` \| (\w+) \| .+ \|$", PAGE, re.MULTILINE)) == CODES


def test_the_readme_shows_on_its_first_screen_how_a_users_own_file_is_run():
    screen = "\n".join(README.splitlines()[:40])
    at = [screen.index(f"rmrc {verb} my.") for verb in ("check", "new", "run")]
    assert at == sorted(at) and "docs/my_robot.md" in screen


@pytest.mark.parametrize("verb", ["check", "new"])
def test_the_helps_name_what_the_page_names(rmrc, verb):
    code, out, _ = rmrc(verb, "--help")
    assert code == 0
    for option in {"check": ("--site", "--joints", "--json"), "new": ("-o", "--force", "--plant")}[verb]:
        assert option in out and option in PAGE
