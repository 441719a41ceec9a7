"""The Makefile makes every picture of the documents, and its commands are ones that the program knows."""

import re
import runpy
import shlex

import pytest

from project import ROOT

PICTURE = re.compile(r"docs/figures/(\w+\.png)")
LINES = re.findall(r"^\t\$\(PYTHON\) (.+)$", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
# Films and the gallery need OpenGL: tests/test_gallery.py holds them.
COMMANDS = [line for line in LINES if PICTURE.search(line)]
FIGURES = sorted((ROOT / "docs/figures").glob("*.png"))


def test_every_picture_has_its_command_and_every_command_its_picture():
    made = [PICTURE.search(command)[1] for command in COMMANDS]
    assert sorted(made) == [path.name for path in FIGURES]
    assert len(made) >= 4


QUICK = ["--set", "plant.kind=ideal", "--set", "control.period=0.005"]
COARSE = {
    "workspace": ["--cells", "12"],
    "tune": ["--runs", "10", "--perturbed", "0", *QUICK],
    "margins": ["--accuracy", "0.5", *QUICK],
}


@pytest.mark.parametrize(
    "command", [line for line in COMMANDS if not re.search("margins|planar_6_3", line)][::4]
)
def test_commands_of_the_makefile_run(rmrc, tmp_path, monkeypatch, command):
    """Coarser than for the page, and into another folder."""
    arguments = [
        str(ROOT / part)
        if part.startswith(("models/", "scenarios/"))
        else part.replace("docs/figures", str(tmp_path / "out")).replace("build/", f"{tmp_path}/")
        for part in shlex.split(command)
    ]
    if arguments[0].startswith("tools/"):
        monkeypatch.setattr("sys.argv", arguments)
        runpy.run_path(str(ROOT / arguments[0]), run_name="__main__")
    else:
        code, _, err = rmrc(*arguments[2:], *COARSE.get(arguments[2], []))
        assert (arguments[:2], code, err) == (["-m", "rmrc"], 0, "")
    assert [path.name for path in (tmp_path / "out").iterdir()] == [PICTURE.search(command)[1]]
