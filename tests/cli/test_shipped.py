"""What comes with the program: listed, found by its bare name, and copied out."""

import json
import subprocess
import sys

import pytest

from project import ROOT
from rmrc.support import shipped
from wording import says

SCENARIOS = sorted(path.stem for path in (ROOT / "scenarios").glob("*.yaml"))
MODELS = sorted(path.stem for path in (ROOT / "models").glob("*.xml"))


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_examples_lists_all_that_is_shipped(rmrc):
    code, out, err = rmrc("examples")
    assert (code, err) == (0, "")
    assert [
        line.split()[0] for line in out.splitlines() if line and line.split()[0] in SCENARIOS + MODELS
    ] == [
        *SCENARIOS,
        *MODELS,
    ]
    assert "run one: rmrc run approach_singularity" in out
    _, out, _ = rmrc("examples", "--json")
    found = json.loads(out)
    assert {folder: [one["name"] for one in some] for folder, some in found.items()} == {
        "scenarios": SCENARIOS,
        "models": MODELS,
    }
    abouts = [one["about"] for some in found.values() for one in some]
    assert all(20 < len(about) < 200 and "\n" not in about for about in abouts)
    assert len(set(abouts)) == len(abouts)


@pytest.mark.parametrize(
    ("text", "about"),
    [
        ("# The arm of V. Scheinman.\nname: x\n", "The arm of V. Scheinman"),
        ("# The arm of V. Scheinman has six joints, one of them a boom. More.\nname: x\n", "The arm of V. Scheinman has six joints, one of them a boom"),
        ("# Two things\n# are short: they go on; this does not.\nname: x\n", "Two things are short: they go on; this does not"),
        ("# A first clause that is long enough to say it: the rest.\nname: x\n", "A first clause that is long enough to say it"),
        ("# A first clause that is long enough to say (our choice: the rest).\nname: x\n", "A first clause that is long enough to say"),
    ],
)  # fmt: skip
def test_about_is_how_the_first_comment_begins(tmp_path, text, about):
    (tmp_path / "x.yaml").write_text(text)
    assert shipped.about(tmp_path / "x.yaml") == about


def test_a_bare_name_is_that_of_a_shipped_scenario(rmrc, tmp_path):
    code, _, err = rmrc("run", "line_tracking", "--no-record", "-q")
    assert (code, err) == (0, "")
    assert {path.name for path in (tmp_path / "recordings").iterdir()} == {
        "line_tracking.json",
        "line_tracking.npz",
    }


@pytest.mark.parametrize("words", [["sweep"], ["tune", "--only", "control.feedbck=1"]])
def test_the_other_verbs_about_scenarios_take_it_too(rmrc, words):
    code, _, err = rmrc(words[0], "line_tracking", *words[1:])
    assert code == 2 and "no such file" not in err


def test_the_verbs_about_models_take_one_by_its_bare_name(rmrc):
    code, out, _ = rmrc("inspect", "puma560", "--json")
    assert code == 0 and json.loads(out)["model"] == str(ROOT / "models/puma560.xml")


def test_what_is_here_comes_before_what_is_shipped(rmrc, tmp_path):
    text = (ROOT / "scenarios/line_tracking.yaml").read_text("utf-8").replace("..", str(ROOT))
    (tmp_path / "joint_limit").write_text(text)
    assert rmrc("run", "joint_limit", "--no-record", "-q")[0] == 0
    assert (tmp_path / "recordings/line_tracking.json").is_file()
    (tmp_path / "blow_up").mkdir()
    _, _, err = rmrc("run", "blow_up")
    assert err == says("rmrc: error: blow_up: … folder … scenario\n")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "aproach_singularity"], 'aproach_singularity: … file … "approach_singularity"…'),
        (["run", "blow_up.yaml"], 'blow_up.yaml: … file … "blow_up"…'),
        (["run", "scenarios/blow_up.yaml"], 'scenarios/blow_up.yaml: … file … "blow_up"…'),
        (["run", "zzz"], "zzz: … file"),
        (["inspect", "pumma560"], 'pumma560: … file … "puma560"…'),
        (["inspect", "models/puma560.xml"], 'models/puma560.xml: … file … "puma560"…'),
        (["inspect", "blow_up"], "blow_up: … file"),
    ],
)  # fmt: skip
def test_a_name_of_nothing_is_told_with_the_shipped_one_that_is_near(rmrc, words, said):
    assert rmrc(*words) == (2, "", says(f"rmrc: error: {said}\n"))


def test_a_file_beside_it_is_nearer_than_a_shipped_one(rmrc, tmp_path):
    (tmp_path / "blow_upp.yaml").touch()
    _, _, err = rmrc("run", "blow_up.yaml")
    assert err == says('rmrc: error: blow_up.yaml: … file … "blow_upp.yaml"…\n')


@pytest.mark.parametrize("folder", ["new/deep", "there"])
def test_examples_are_copied_out(rmrc, tmp_path, folder):
    (tmp_path / "there").mkdir()
    (tmp_path / "there/mine.txt").touch()
    code, out, err = rmrc("examples", "--copy", folder)
    assert (code, err) == (0, "")
    assert [line for line in out.splitlines() if line] == [
        f"wrote {folder}/scenarios",
        f"wrote {folder}/models",
        f"run one: rmrc run {folder}/scenarios/approach_singularity.yaml",
    ]
    copied = files(tmp_path / folder)
    assert folder != "there" or copied.pop(shipped.Path("mine.txt")) == b""
    ours = {**files(ROOT / "scenarios"), **files(ROOT / "models")}
    assert {path.name for path in copied} == {
        path.name for path in ours if path.suffix in (".yaml", ".xml", ".csv")
    }
    assert all(content == (ROOT / path).read_bytes() for path, content in copied.items())
    assert rmrc("run", f"{folder}/scenarios/line_tracking.yaml", "--no-record", "-q")[0] == 0


def test_a_copy_overwrites_nothing(rmrc, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "scenarios").touch()
    for folder, told in ((".", "scenarios"), ("scenarios", "scenarios")):
        line = says(f"rmrc: error: {told}: … already … folder\n")
        assert rmrc("examples", "--copy", folder) == (2, "", line)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["models", "scenarios"]


def test_a_package_without_them_says_so(rmrc, monkeypatch):
    monkeypatch.setattr(shipped, "root", lambda: None)
    for words in (["examples"], ["examples", "--copy", "x"]):
        code, out, err = rmrc(*words)
        assert (code, out) == (2, "")
        assert err == says("rmrc: error: … installation … scenarios and models; …\n")
    assert rmrc("run", "blow_up") == (2, "", says("rmrc: error: blow_up: … file\n"))


def test_a_copy_of_the_package_alone_has_none(tmp_path):
    site = tmp_path / "lib/site-packages/rmrc"
    (site / "support").mkdir(parents=True)
    (tmp_path / "scenarios").mkdir()
    code = f"from rmrc.support import shipped; shipped.__file__ = {str(site / 'support/shipped.py')!r}; print(shipped.root())"
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "None\n"
