"""What comes from files, options and models is printed as it is: no markup, no control characters, not too long."""

import re

import pytest

from project import ROOT
from rmrc.support.legible import LONGEST

MODEL = (ROOT / "models/planar_2link.xml").read_text("utf-8").replace(
    "common/", f"{ROOT}/models/common/"
)  # fmt: skip


@pytest.mark.parametrize(
    ("verb", "name"), [("inspect", "[red]w[/red]"), ("statics --wrench 0,-1,0", "[/]"), ("ik --to 1,1", ":smile:")]
)  # fmt: skip
def test_names_of_a_model_are_no_markup(rmrc, tmp_path, name, verb):
    verb = verb.split()
    (tmp_path / "model.xml").write_text(
        MODEL.replace('name="tip"', f'name="{name}"').replace('"shoulder"', f'"{name}s"')
    )
    code, out, err = rmrc(verb[0], "model.xml", *verb[1:])
    assert (code, err) == (0, "") and name in out


@pytest.mark.parametrize("name", ["[red]", "a\x1b[31mb", "a\x9b2Jb", "a\u202eb", "a\nb"])
def test_the_name_of_a_file_is_printed_with_its_control_characters_made_visible(rmrc, tmp_path, name):
    (tmp_path / f"{name}.xml").write_text(MODEL)
    (tmp_path / f"{name}.yaml").write_text("name: [")
    for arguments in (
        ["inspect", f"{name}.xml"],
        ["run", f"{name}.yaml"],
        ["run", f"{name}.xml"],
        ["replay", f"{name}.rrd"],
        ["run", "x.yaml", f"--{name}"],
        [name],
    ):
        _, out, err = rmrc(*arguments)
        assert (out + err).replace("\n", "").isprintable()
        assert name.encode("unicode_escape").decode() in (out + err).replace("\\x0a", "\\n")
        assert err.count("\n") <= 1


LONG = "a" * 10_000
TOO_LONG = {
    "a choice": (["--set", f"control.inverse.method={LONG}"], 'characters)'),
    "an angle": (["--set", f"arm.start=[{'1' * 10_000} degrees]"], "in rad or m"),
    "a key": (["--set", f"control.{LONG}=1"], "keep_out"),
    "a model": (["--set", f"arm.model={LONG}"], ""),
    "a site": (["--set", f"arm.site={LONG}"], "its sites: tip"),
    "an option": ([f"--{LONG}"], "rmrc run --help"),
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
    assert re.search(r"….*\([0-9,]+ characters\)", err)
