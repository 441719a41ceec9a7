"""What comes from files, options and models is printed as it is: no markup, no control characters, not too long."""

import itertools
import json
import re
import subprocess
import sys

import pytest

from project import ROOT, mostly_long
from rmrc.support.legible import LONGEST

NAMES = [
    "[red]w[/red]",
    "[/]",
    ":smile:",
    "[link=http://a.b]c",
    "a\x1b[31mb",
    "a\x9b2Jb",
    "a\u202eb",
    "a\nb",
    "a b",
]
PRINTABLE = [name for name in NAMES if name.isprintable()]
MODEL = (ROOT / "models/planar_2link.xml").read_text("utf-8").replace(
    "common/", f"{ROOT}/models/common/"
)  # fmt: skip


def named(name):
    """Return a model whose site and joints are called so."""
    text = MODEL.replace('name="tip"', f'name="{name}"').replace('"shoulder"', f'"{name}s"')
    assert text.count(name) > 2
    return text


@pytest.mark.parametrize(
    ("verb", "name"),
    [
        *mostly_long(itertools.product(["inspect", "statics --wrench 0,-1,0", "ik --to 1,1"], PRINTABLE), 4),
        *mostly_long(itertools.product(["workspace --cells 20"], PRINTABLE), len(PRINTABLE)),
    ],
)
@pytest.mark.usefixtures("undrawn")
def test_names_of_a_model_are_no_markup(rmrc, tmp_path, name, verb):
    verb = verb.split()
    (tmp_path / "model.xml").write_text(named(name))
    code, out, err = rmrc(verb[0], "model.xml", *verb[1:])
    assert (code, err) == (0, "")
    assert name in out


@pytest.mark.parametrize("name", mostly_long(NAMES, 1, set(NAMES) - {"[/]", "a\x1b[31mb", "a\nb"}))
def test_the_name_of_a_file_is_printed_with_its_control_characters_made_visible(rmrc, tmp_path, name):
    name = name.replace("/", "|")  # which no file can have
    (tmp_path / f"{name}.xml").write_text(MODEL)
    (tmp_path / f"{name}.yaml").write_text("name: [")
    for arguments in (
        ["inspect", f"{name}.xml"],
        ["ik", f"{name}.xml", "--to", "1,1"],
        ["statics", f"{name}.xml", "--wrench", "1,2,3"],
        ["run", f"{name}.yaml"],
        ["run", f"{name}.xml"],
        ["replay", f"{name}.rrd"],
        ["run", "x.yaml", f"--{name.replace('=', ':')}"],
        [name],
    ):
        _, out, err = rmrc(*arguments)
        assert (out + err).replace("\n", "").isprintable()
        assert name.encode("unicode_escape").decode() in (out + err).replace(
            "link:http", "link=http"
        ).replace("\\x0a", "\\n")
        assert err.count("\n") <= 1


LONG = "a" * 10_000
TOO_LONG = {
    "a choice": (["--set", f"control.inverse.method={LONG}"], 'characters)'),
    "a number": (["--set", f"control.feedback={LONG}"], 'characters)'),
    "an angle": (["--set", f"arm.start=[{'1' * 10_000} degrees]"], 'characters)'),
    "a key": (["--set", f"control.{LONG}=1"], "keep_out"),
    "a model": (["--set", f"arm.model={LONG}"], ""),
    "a site": (["--set", f"arm.site={LONG}"], "its sites: tip"),
    "an option": ([f"--{LONG}"], "rmrc run --help"),
    "no key": (["--set", LONG], "control.feedback=10"),
    "a folder": (["--out", LONG], "file name too long"),
}  # fmt: skip


@pytest.mark.parametrize("case", TOO_LONG)
def test_of_a_long_value_the_middle_is_cut_and_the_cure_stays(rmrc, tmp_path, case):
    options, end = TOO_LONG[case]
    (tmp_path / "quick.yaml").write_text(
        f"name: x\narm: {{model: {ROOT}/models/planar_2link.xml, site: tip}}\ntask: {{axes: [x, y]}}\n"
        "target: {path: [{hold: {for: 0.01}}]}\n"
    )
    code, _, err = rmrc("run", "quick.yaml", *options)
    assert code == 2 and err.count("\n") == 1
    # Six such values, and a sentence around them.
    assert len(err) < 6 * LONGEST + 250
    assert err.rstrip().endswith(end)
    assert re.search(r"(a+…a+(/x.rrd)?|1+….*1*)\"? \([0-9,]+ characters\)", err)


CALLS = [
    (["{python}", "-m", "rmrc"], "{python} -m rmrc", "model.xml"),
    (["{python}", "-X", "dev", "-m", "rmrc"], "{python} -X dev -m rmrc", "my model's.xml"),
    (["{folder}/rmrc"], "{folder}/rmrc", "it's\na model.xml"),
    (["rmrc"], "rmrc", "$HOME.xml"),
]


# In the place of rmrc: tells what it was called with.
ECHO = """
import json, sys
def main():
    print(json.dumps(sys.argv[1:]))
if __name__ == "__main__":
    main()
"""


@pytest.mark.parametrize(
    ("call", "told", "name"), [CALLS[2], *mostly_long([one for one in CALLS if one != CALLS[2]], 1, CALLS)]
)
def test_a_command_to_copy_is_written_as_this_one_was_called(tmp_path, call, told, name):
    # The console script as pip writes it, for this environment.
    script = tmp_path / "rmrc"
    script.write_text(f"#!{sys.executable}\nimport sys\nfrom rmrc.__main__ import main\nsys.exit(main())\n")
    script.chmod(0o755)
    places = {"python": sys.executable, "folder": str(tmp_path)}
    path = f"{tmp_path}:/usr/bin:/bin" if call == ["rmrc"] else "/usr/bin:/bin"
    (tmp_path / name).write_text(MODEL)
    done = subprocess.run(
        [*(word.format(**places) for word in call), "run", name],
        cwd=tmp_path, capture_output=True, text=True, check=False, env={"PATH": path},
    )  # fmt: skip
    assert done.returncode == 2
    (command,) = re.findall("`([^`]* inspect [^`]*)`", done.stderr)
    assert command.startswith(f"{told.format(**places)} inspect ")
    # Copied to a shell, it calls what this one called, and names the same file.
    (tmp_path / "called/rmrc").mkdir(parents=True)
    (tmp_path / "called/rmrc/__init__.py").touch()
    (tmp_path / "called/rmrc/__main__.py").write_text(ECHO)
    again = subprocess.run(
        ["bash", "-c", command],
        cwd=tmp_path, capture_output=True, check=True, env={"PATH": path, "PYTHONPATH": "called"},
    )  # fmt: skip
    assert json.loads(again.stdout) == ["inspect", name]
