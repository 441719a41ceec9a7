"""What comes with the program: listed, found by its bare name, and copied out."""

import json

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


def test_a_bare_name_is_that_of_a_shipped_scenario(rmrc, tmp_path):
    code, _, err = rmrc("run", "line_tracking", "--no-record", "-q")
    assert (code, err) == (0, "")
    assert {path.name for path in (tmp_path / "recordings").iterdir()} == {
        "line_tracking.json",
        "line_tracking.npz",
    }


def test_the_verbs_about_models_take_one_by_its_bare_name(rmrc):
    code, out, _ = rmrc("inspect", "puma560", "--json")
    assert code == 0 and json.loads(out)["model"] == str(ROOT / "models/puma560.xml")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "aproach_singularity"], 'aproach_singularity: … file … "approach_singularity"…'),
        (["run", "scenarios/blow_up.yaml"], 'scenarios/blow_up.yaml: … file … "blow_up"…'),
        (["inspect", "pumma560"], 'pumma560: … file … "puma560"…'),
    ],
)  # fmt: skip
def test_a_name_of_nothing_is_told_with_the_shipped_one_that_is_near(rmrc, words, said):
    assert rmrc(*words) == (2, "", says(f"rmrc: error: {said}\n"))


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
