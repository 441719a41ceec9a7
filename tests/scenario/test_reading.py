"""Texts, files and values: what is wrong is one printable line, which names the place and the way out."""

import math
import os
import time
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scenario_texts import FULL, MINIMAL, full_number_keys, problems

from rmrc.scenario import Scenario, inline, load, loads, reading
from rmrc.scenario.reading import parse
from rmrc.support.errors import ScenarioError
from wording import says

# All of UTF-8, the default, which hypothesis takes seconds to find out in a new clone.
ANY = st.characters(exclude_categories=["Cs"])
BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join(['*' + old] * 10)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


def file_problem(path):
    start = time.thread_time()  # which other programs do not lengthen
    with pytest.raises(ScenarioError) as caught:
        load(path)
    assert time.thread_time() - start < 10  # a bound on hangs; the slowest takes 2 s
    return str(caught.value)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", ": … empty"),
        (b"\xff\xfe\x00\x01", ": … UTF-8 … 0xff"),
        (b"name: a\n\x00\x01", ":2:1: … U+0000"),
        (b"a: *b", ":1:4: … YAML: … alias 'b'"),
        (b"a: 1\n---\nb: 1\n", ":2:1: … second scenario …"),
        (b"a: &a [*a]", ":1:4: … 50 …"),
        (b"#" * (2**18 + 1), ": … 256 KiB …"),
        (b"[" + b"1," * 130_000 + b"]", ": … 10000 values …"),
        (BOMB.encode(), ": … 10000 values, aliases …"),
    ],
)  # fmt: skip
def test_a_broken_or_hostile_file_gets_one_line(content, problem):
    Path("x.yaml").write_bytes(content)
    assert file_problem("x.yaml") == says(f"x.yaml{problem}")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("? {a: b}\n: c", "x.yaml:6:3: … key … text … mapping"),
        ("plant: {<<: {kv: 1}}", "x.yaml:6:9: plant: … key … text … <<"),
        ("plant: {kv: !!python/object/apply:os.system [ls]}", "x.yaml:6:13: plant.kv: … !!python/object/apply:os.system …"),
    ],
)  # fmt: skip
def test_yaml_that_is_no_plain_value_gets_one_line(text, line):
    assert problems(MINIMAL + text) == [says(line)]


def test_what_is_no_file_is_not_read(monkeypatch):
    Path("approach.yaml").write_text(MINIMAL)
    assert file_problem("aproach.yaml") == says('aproach.yaml: … file … "approach.yaml"…')
    assert file_problem("approach.yaml/x") == says("approach.yaml/x: … not a directory")
    assert file_problem("a\nb\0") == says(r"a\nb\x00: … null byte")
    assert file_problem(".") == says(".: … file")
    os.mkfifo("pipe.yaml")  # reading it would wait for ever
    assert file_problem("pipe.yaml") == says("pipe.yaml: … file")

    def refuse(*_args):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(reading, "open", refuse, raising=False)  # root may read any file
    assert file_problem("approach.yaml") == says("approach.yaml: … permission denied")


@pytest.mark.parametrize("text", ["1e-5", "1E+7", "-2.5e3", "+.5e2"])
def test_an_exponent_needs_no_point(text):
    """As in YAML 1.2, and as this program writes numbers; in quotes it is a text."""
    assert parse(f"[{text}, '{text}']", "x")[0] == [float(text), text]


def test_numbers_are_decimal():
    """To YAML 1.1, 010 is 8 and 1:20 is 80; a script that pads numbers would run with others than it wrote."""
    assert parse("[0, -3, 10, +7, 010.5, .inf]", "x")[0] == [0, -3, 10, 7, 10.5, math.inf]
    texts = ["010", "1:20", "1_000", "0x1f", "1:20.5"]
    assert parse(f"[{', '.join(texts)}]", "x")[0] == texts
    with pytest.raises(ScenarioError, match=r"control.feedback: must be a number.*write 10"):
        loads(MINIMAL, overrides=["control.feedback=010"])


def test_a_byte_order_mark_and_windows_line_ends_are_accepted():
    Path("x.yaml").write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert load("x.yaml") == loads(MINIMAL)


@given(st.text(ANY, max_size=60) | st.lists(st.sampled_from("ab:-[]{},&*!|>'\"\n #?1.<=%"), max_size=30))
def test_any_text_gives_a_scenario_error_of_whole_lines(text):
    with pytest.raises(ScenarioError) as caught:
        loads("".join(text), "x.yaml")
    for line in map(str, caught.value.problems):
        assert line.startswith("x.yaml:") and line.isprintable()


@given(st.floats(allow_nan=False) | st.integers() | st.text(ANY, max_size=8) | st.lists(st.booleans()))
@example("010")
@example("1e5")
@example(1e-5)
def test_a_value_on_one_line_is_read_back(value):
    line = inline(value)
    assert "\n" not in line
    try:
        back = parse(line)[0]
    except ScenarioError:
        assert isinstance(value, str)  # a text may hold what no file may
    else:
        assert (type(back), repr(back)) == (type(value), repr(value))


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ("arm.start=[-1.5e1 deg]", "arm.start", (-math.pi / 12,)),
        ("arm.start=[' 180  deg ', 1e-3 rad, -0.5]", "arm.start", (math.pi, 0.001, -0.5)),
        ("control.limits.rate=180 deg/s", "control.limits.rate", math.pi),
        ("control.limits.acceleration=[90 deg/s², 1]", "control.limits.acceleration", (math.pi / 2, 1)),
        ("control.period=30 Hz", "control.period", 1 / 30),
    ],
)
def test_a_number_may_have_a_unit(override, key, value):
    found = loads(MINIMAL, overrides=[override])
    for name in key.split("."):
        found = getattr(found, name)
    assert found == pytest.approx(value, rel=1e-15)  # one rounding in the product with pi/180


@pytest.mark.parametrize("override", ["control.limits.rate=180 deg", "control.period=30 ms", "control.period=1/0",
                                      f"arm.start=[{'1' * 100_000} degrees]"])  # fmt: skip
def test_another_unit_is_refused_at_once(override):
    """Digits that could stand on both sides of a dot that is not there took the square of their number: minutes."""
    with pytest.raises(ScenarioError, match="number"):
        loads(MINIMAL, overrides=[override])


def test_a_model_that_is_not_there_is_told_with_its_neighbor(folder):
    (line,) = problems(MINIMAL.replace("arm.xml", "amr.xml"))
    assert line == says(f'x.yaml:2:14: arm.model: … "{folder}/amr.xml"; … "arm.xml"…')
    (folder / "loop").symlink_to("loop")
    for name in (".", '"a\\0b"', "loop"):
        (line,) = problems(MINIMAL.replace("arm.xml", name))
        assert line == says(f'x.yaml:2:14: arm.model: … file "{folder}…')


@pytest.mark.parametrize(("text", "shown"), [(".nan", "nan"), ("-.inf", "-inf")])
def test_no_number_of_a_scenario_may_be_nan_or_infinite(text, shown):
    # those of a sweep aside, whose own keys have dots and brackets
    keys = [key for key in full_number_keys() if not key.startswith("sweep.")]
    assert len(keys) > 50
    lines = problems(FULL, *(f"{key}={text}" for key in keys))
    assert [key for key in keys if says(f"--set {key}: … finite … {shown}") not in lines] == []


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("target.path[0].line.by[1]", "x.yaml:5:24: target.path[0].line.by[1]"),
        ("arm.start[1]", "x.yaml:2:6: arm.start[1]"),  # the nearest parent
        ("plant", "--set plant.kv: plant"),
        ("arm.joints[1]", "--set arm.joints: arm.joints[1]"),
    ],
)
def test_locate_says_where_a_value_is(key, place):
    text = f'{MINIMAL}expect:\n  "a[0]..b = c": {{below: 3}}\n'
    assert loads(text, "x.yaml", ["plant.kv=1", "arm.joints=[a, b]"]).locate(key) == place
    made = Scenario.model_validate(loads(MINIMAL).model_dump())
    assert made.locate(key) == key  # made in Python


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("control.feedbak=1", '… key; … "feedback"?'),
        ("arm={site: tip}", "--set arm: arm.model: … required: MJCF or URDF file…"),
        ("control.inverse.method=dampd", '… one of "inverse", … "damped"?'),
        ("control.inverse.method=dls", "… write damped"),
        ("arm.site=2024", "… text, … quotes … got 2024"),
        ("target.path=[{go: {to: [1, 0]}}]", "… key; the keys are line, arc, …"),
        ("target.path=[{}]", "… target.path[0]: must have exactly one of line, arc, … got none"),
        ("target.limits.velocity=250 mm/s", '… number, got "250 mm/s"; write … in m/s'),
        ("control.inverse={feedback: 20}", "… key; … key of control: indent it less"),
        ("target.path={line: {by: [1, 0]}}", "… begin each item with a dash"),
        ("target.limits.velocity=0,25", '… got "0,25"; write 0.25, in m/s'),
        ("expect.joint_rate.peak={equals: 1}", "… equals needs within"),
        ("expect.joint_rate.peak={above: 3, below: 3}", "… must have above < below, got 3 and 3"),
        ("sweep.draw.plant.seed=[0, 9]", "… cannot be changed here… sweep.repeat and sweep.seed…"),
        ("control.nullspace.objective=rates", "… control.nullspace.rates: must be given …"),
        ("task={axes: [x], weights: [1, 2]}", "--set task: task.weights: … one value for each of axes, got 2 … x"),
        ("arm.body=b", "… must have at most one of site, body, tool, got site and body"),
        ("\x1b[0m=1", r"--set \x1b[0m=1: … KEY=VALUE … control.feedback=10"),
        ("arm.site[0]=1", '--set arm.site[0]: arm.site … "tip" … list'),
        ("arm.start=[1", "--set arm.start: … YAML: … bracket … not closed …"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_with_the_way_out(override, line):
    (problem,) = problems(MINIMAL, override)
    assert problem == says(line), problem


@pytest.mark.parametrize(
    ("lines", "where", "why"),
    [
        ("control:\n  period: 0.01\n    feedback: 20\n", "3:13", "indented too far"),
        ("control:\n  period: 0.01\n feedback: 20\n", "3:2", "not indented as the lines beside it"),
        ("plant:\n  seed: 1\n  kind ideal\n  loss: 0\n", "3:3", "without a colon"),
        ("plant:\n\tkind: ideal\n", "2:1", "a tab; indent with spaces"),
        ("task: {axes: [x, y}\n", "1:14", "bracket that is not closed"),
        ('plant: {kind: "ideal}\n', "1:15", "quote that is not closed"),
    ],
)
def test_a_mistake_in_the_layout_is_told_where_it_is_and_not_where_yaml_notices_it(lines, where, why):
    (problem,) = problems(lines)
    assert problem.startswith(f"x.yaml:{where}: is not valid YAML: ") and why in problem
