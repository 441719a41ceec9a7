import pytest
from scenario_texts import MINIMAL

from rmrc.scenario import draft_of, load, variants
from rmrc.support.errors import ScenarioError
from wording import says

METHOD, MAXIMUM = "control.inverse.method", "control.inverse.damping.maximum"


def labels(*texts):
    return [variant.label for variant in variants(texts)]


def overrides(*texts):
    return [tuple(map(str, variant.changes)) for variant in variants(texts)]


def test_the_values_of_one_key_in_order():
    assert overrides(f"{METHOD}=inverse, damped") == [(f"{METHOD}=inverse",), (f"{METHOD}=damped",)]
    assert labels(f"{METHOD}=inverse, damped") == ["inverse", "damped"]


def test_several_keys_give_every_combination_and_the_last_changes_fastest():
    texts = f"{METHOD}=inverse,damped", f"{MAXIMUM}=0.1,0.2"
    assert labels(*texts) == ["inverse, 0.1", "inverse, 0.2", "damped, 0.1", "damped, 0.2"]
    assert overrides(*texts)[2] == (f"{METHOD}=damped", f"{MAXIMUM}=0.1")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{MAXIMUM}=0.05,1.0e-1", ["maximum=0.05", "maximum=1.0e-1"]),  # as they are written
        ("control.nullspace.posture=[1,2], [3 ,4]", ["posture=[1,2]", "posture=[3 ,4]"]),
        ("control.limits={rate: 1, on_excess: clamp},{rate: 2}",
         ["limits={rate: 1, on_excess: clamp}", "limits={rate: 2}"]),
        ("arm.start[1]=60 deg,-0.5", ["start[1]=60 deg", "start[1]=-0.5"]),
        ("control.feedforward=true,false", ["feedforward=true", "feedforward=false"]),
        ("arm.start=home,[0, 1]", ["home", "start=[0, 1]"]),
        ("""arm.site="a, b",'c'""", ["a, b", "c"]),
        ("arm.site=tip,tip 2,", ["tip", "tip 2"]),
    ],
)  # fmt: skip
def test_only_commas_outside_of_brackets_and_quotes_part_values(text, expected):
    assert labels(text) == expected


def test_a_variant_is_the_scenario_with_its_overrides_on_top(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    (tmp_path / "x.yaml").write_text(MINIMAL)
    given = [f"{METHOD}=pseudoinverse", "control.feedback=3"]
    for variant, posture in zip(
        variants(["control.nullspace.posture=[1, 2],[3, 4]"]), ((1, 2), (3, 4)), strict=True
    ):
        got = draft_of("x.yaml", given).changed(*variant.changes).scenario()
        assert got == load("x.yaml", [*given, f"control.nullspace.posture={list(posture)}"])
        assert got.control.nullspace.posture == posture
    damped, _ = variants([f"{METHOD}=damped,inverse"])
    top = load("x.yaml", given).changed(*damped.changes)
    assert (top.control.inverse.method, top.control.feedback) == ("damped", 3.0)
    assert top.locate(METHOD) == f"--vary {METHOD}"
    assert top.locate("control.feedback") == "--set control.feedback"


def test_a_wrong_value_is_told_by_its_option(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    (tmp_path / "x.yaml").write_text(MINIMAL)
    with pytest.raises(ScenarioError) as caught:
        draft_of("x.yaml", ["plant.kv=-1"]).changed(*variants([f"{MAXIMUM}=-2,-3"])[0].changes).scenario()
    wanted = f"--vary {MAXIMUM}: … 0 … -2", "--set plant.kv: … 0 … -1"
    assert list(map(str, caught.value.problems)) == list(map(says, wanted))
    with pytest.raises(ScenarioError) as caught:
        load("x.yaml").changed(*variants(["control={invers: 1},{}"])[0].changes)
    assert str(caught.value) == says('--vary control: control.invers: … "inverse"…')


EXAMPLE = "control.inverse.method=inverse,damped"


@pytest.mark.parametrize(
    ("texts", "lines"),
    [
        ([], [f"--vary: … 2 variants … 0; … --vary {EXAMPLE}"]),
        (["a=1"], [f"--vary: … 2 variants … 1; … --vary {EXAMPLE}"]),
        (["a="], [f"--vary: … 2 variants … 0; … --vary {EXAMPLE}"]),
        (["a=0,1,2,3,4,5,6", "b=0,1,2,3,4,5,6,7"], ["--vary: … 50 variants … 56"]),
        (["a=1,2", "a=3,4"], ["--vary a: … twice"]),
        (["a=1,2,1,'2'"], ["--vary: … a=1", "--vary: … a=2"]),
        (["foo", "=1,2"], [f"--vary {text}: … KEY=V1,V2,... … {EXAMPLE}" for text in ("foo", "=1,2")]),
        (["a=[1,2"], ["--vary a: … YAML: … ']' … '<stream end>'"]),
        (["a=1,,2"], ["--vary a: … YAML: … ','"]),
        (["a=1],[2"], ["--vary a: … YAML: … ','"]),
        (["a=1,2 # x", "b=\x00"], ["--vary b: … U+0000"]),
    ],
)  # fmt: skip
def test_what_cannot_be_varied_is_said_at_once(texts, lines):
    with pytest.raises(ScenarioError) as caught:
        variants(texts)
    assert str(caught.value).splitlines() == list(map(says, lines))


def test_fifty_variants_are_not_too_many():
    assert len(variants(["a=0,1,2,3,4", "b=0,1,2,3,4,5,6,7,8,9"])) == 50
