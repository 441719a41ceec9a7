import pytest
from scenario_texts import MINIMAL

from rmrc.scenario import draft_of, grid, variants
from rmrc.support.errors import ScenarioError
from wording import says

METHOD, MAXIMUM = "control.inverse.method", "control.inverse.damping.maximum"


def labels(*texts):
    return [variant.label for variant in variants(texts)]


def test_several_keys_give_every_combination_and_the_last_changes_fastest():
    texts = f"{METHOD}=inverse,damped", f"{MAXIMUM}=0.1,0.2"
    assert labels(*texts) == ["inverse, 0.1", "inverse, 0.2", "damped, 0.1", "damped, 0.2"]
    assert tuple(map(str, variants(texts)[2].changes)) == (f"{METHOD}=damped", f"{MAXIMUM}=0.1")
    same = grid({METHOD: ["inverse", "damped"], MAXIMUM: [0.1, 0.2]})
    assert [one.label for one in same] == labels(*texts)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{MAXIMUM}=0.05,1.0e-1", ["maximum=0.05", "maximum=0.1"]),
        ("control.nullspace.posture=[1,2], [3 ,4]", ["posture=[1, 2]", "posture=[3, 4]"]),
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


def test_a_variant_is_the_scenario_with_its_changes_on_top(folder):
    (folder / "x.yaml").write_text(MINIMAL)
    draft = draft_of("x.yaml", [f"{METHOD}=pseudoinverse", "control.feedback=3"])
    damped, _ = variants([f"{METHOD}=damped,inverse"])
    top = draft.changed(*damped.changes).scenario()
    assert (top.control.inverse.method, top.control.feedback) == ("damped", 3.0)
    assert top.locate(METHOD) == f"--vary {METHOD}"
    assert top.locate("control.feedback") == "--set control.feedback"
    wrong, _ = variants([f"{MAXIMUM}=-2,-3"])
    with pytest.raises(ScenarioError) as caught:
        draft.overridden(["plant.kv=-1"]).changed(*wrong.changes).scenario()
    wanted = f"--vary {MAXIMUM}: … 0 … -2", "--set plant.kv: … 0 … -1"
    assert list(map(str, caught.value.problems)) == list(map(says, wanted))


EXAMPLE = "control.inverse.method=inverse,damped"


@pytest.mark.parametrize(
    ("texts", "lines"),
    [
        ([], [f"--vary: … 2 variants to 50, got 0; … --vary {EXAMPLE}"]),
        (["a=1"], [f"--vary: … 2 variants to 50, got 1; … --vary {EXAMPLE}"]),
        (["a="], [f"--vary: … 2 variants to 50, got 0; … --vary {EXAMPLE}"]),
        (["a=0,1,2,3,4,5,6", "b=0,1,2,3,4,5,6,7"], [f"--vary: … 2 variants to 50, got 56; … --vary {EXAMPLE}"]),
        (["a=1,2", "a=3,4"], ["--vary a: … twice"]),
        (["a=1,2,1"], ["--vary: … a=1"]),
        (["foo"], [f"--vary foo: … KEY=V1,V2,... … {EXAMPLE}"]),
        (["a=[1,2"], ["--vary a: … YAML: … bracket …"]),
        (["a=1,,2"], ["--vary a: … YAML: … comma …"]),
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
