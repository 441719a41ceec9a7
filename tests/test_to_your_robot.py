"""The page from simulation to a robot: its commands print what it says, and its sample is what its program logs."""

import re
import runpy
import shlex
import shutil

import pytest

from project import ROOT

PAGE = (ROOT / "docs/from_simulation_to_your_robot.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
COMMANDS = [
    (text, BLOCKS[i + 1][1] if i + 1 < len(BLOCKS) and not BLOCKS[i + 1][0] else "")
    for i, (kind, text) in enumerate(BLOCKS)
    if kind == "sh"
]
((LOOP),) = (text for kind, text in BLOCKS if kind == "yaml")


def words(line):
    """Return the words of a line, numbers rounded: the last digit is that of a machine."""
    return [
        f"{float(word):.2g}" if re.fullmatch(r"-?\d+\.\d+(e-?\d+)?", word) else word for word in line.split()
    ]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    "verbs", [["identify", "run"], pytest.param(["margins", "tune"], marks=pytest.mark.long)], ids="-".join
)
def test_the_commands_in_their_order_print_what_the_page_says(rmrc, tmp_path, verbs):
    for folder in ("models", "scenarios"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / "loop.yaml").write_text(LOOP, "utf-8")
    commands = [(shlex.split(text), lines) for text, lines in COMMANDS if text.startswith("rmrc")]
    assert [command[1] for command, _ in commands] == ["identify", "run", "margins", "tune"]
    for command, lines in commands:
        if command[1] not in verbs:
            continue
        code, out, _ = rmrc(*command[1:])
        printed = [words(line) for line in out.splitlines()]
        assert code == 0 and lines
        assert [line for line in lines.splitlines() if words(line) not in printed] == []


def test_the_sample_is_what_the_program_logs(capsys):
    program, file = re.fullmatch(r"python (\S+) > (\S+)\n", COMMANDS[0][0]).groups()
    runpy.run_path(str(ROOT / program), run_name="__main__")
    head, *rows = capsys.readouterr().out.splitlines()
    there, *sample = (ROOT / file).read_text("utf-8").splitlines()
    assert head == there and len(rows) == len(sample) == 1250
    # a machine's sine may round otherwise, once in a while, by a resolution
    numbers = [[list(map(float, row.split(","))) for row in table] for table in (rows, sample)]
    assert (
        max(abs(a - b) for one, other in zip(*numbers, strict=True) for a, b in zip(one, other, strict=True))
        < 1e-4
    )


def test_its_python_prints_what_it_says(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    (program,) = (text for kind, text in BLOCKS if kind == "python")
    exec(compile(program, "page", "exec"), {})
    assert capsys.readouterr().out.splitlines() == re.findall(r"# (.+)$", program, re.MULTILINE)
