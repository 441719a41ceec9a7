import os
import time
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scenario_texts import MINIMAL, problems

from rmrc.scenario import inline, load, loads, reading
from rmrc.scenario.reading import parse
from rmrc.support.errors import ScenarioError
from wording import says

# All of UTF-8, the default, which hypothesis takes seconds to find out in a new clone.
ANY = st.characters(exclude_categories=["Cs"])


def test_a_merge_key_takes_what_is_not_said():
    text = MINIMAL.replace("by: [0.1, 0.0]", "by: [0.1, 0.0], turn: &t {axis: z, angle: 1}")
    text += "    - turn: {<<: *t, angle: 2}\n"
    scenario = loads(text, "x.yaml")
    turn = scenario.target.path[1].turn
    assert (turn.axis, turn.angle) == ("z", 2.0)
    assert scenario.locate("target.path[1].turn.angle") == "x.yaml:6:29: target.path[1].turn.angle"
    assert scenario.locate("target.path[1].turn.axis") == "x.yaml:5:46: target.path[1].turn.axis"


def test_an_alias_is_a_copy():
    text = MINIMAL + "control: {joint_weights: &w [1.0, 2.0], nullspace: {posture: *w}}\n"
    scenario = loads(text, overrides=["control.joint_weights[0]=9"])
    assert scenario.control.joint_weights == (9.0, 2.0)
    assert scenario.control.nullspace.posture == (1.0, 2.0)


def file_problem(path):
    start = time.thread_time()  # which other programs do not lengthen
    with pytest.raises(ScenarioError) as caught:
        load(path)
    assert time.thread_time() - start < 5  # a bound on hangs; the slowest takes 0.6 s
    return str(caught.value)


BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join(['*' + old] * 10)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", ": … empty"),
        (b"# only a comment\n", ": … empty"),
        (b"\xff\xfe\x00\x01", ": … 0xff … 0"),
        (b"name: a\n\x00\x01", ":2:1: … U+0000"),
        (b"name: \x1b[31m", ":1:7: … U+001B"),
        (b"- a\n- b\n", ":1:1: … mapping … [\"a\", \"b\"]"),
        (b"---\n...\n", ":2:1: … mapping … nothing"),
        (b"a: [1, 2\nb: 3", ":2:2: … YAML: … ',' … ':'"),
        (b"a: b: c", ":1:5: … YAML: mapping values are not allowed here"),
        (b"a:\n\tb: 1", ":2:1: … YAML: … tab … spaces"),
        (b"!mine {a: 1}", ":1:1: … !mine …"),
        (b"a: *b", ":1:4: … YAML: … alias 'b'"),
        (b"a: 1\n---\nb: 1\n", ":2:1: … one YAML document"),
        (b"[" * 100_000, ":1:51: … 50 …"),
        (b"- " * 100_000, ":1:101: … 50 …"),
        (b"a: &a [*a]", ":1:4: … 50 …"),
        (b"a: &a {<<: *a}", ":1:4: … 50 …"),
        (b"[" + b"1," * 40_000 + b"]", ":1:20000: … 10000 values … aliases …"),
        (BOMB.encode(), ":1:35: … 10000 values … aliases …"),
    ],
)  # fmt: skip
def test_a_broken_or_hostile_file_gets_one_line(content, problem):
    Path("x.yaml").write_bytes(content)
    assert file_problem("x.yaml") == says(f"x.yaml{problem}")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("1: a", "x.yaml:6:1: … key … text … 1"),
        ("no: a", "x.yaml:6:1: … key … text … no"),
        ("? [a]\n: b", "x.yaml:6:3: … key … text … list"),
        ("? {a: b}\n: c", "x.yaml:6:3: … key … text … mapping"),
        ('"\\ud800": 1', r"x.yaml:6:1: … key … text … \ud800"),
        ("name: x", "x.yaml:6:1: name: … twice … line 1"),
        ("plant: {<<: 3}", "x.yaml:6:13: plant: << … mapping … 3"),
        ("plant: !!set {a}", "x.yaml:6:8: plant: … !!set …"),
        ("plant: !mine {kv: 1}", "x.yaml:6:8: plant: … !mine …"),
        ("plant: {kv: !!int abc}", "x.yaml:6:13: plant.kv: … !!int … abc"),
        ("plant: {kv: 0x_}", "x.yaml:6:13: plant.kv: … !!int … 0x_"),
        ("plant: {kv: !!python/object/apply:os.system [ls]}", "x.yaml:6:13: plant.kv: … !!python/object/apply:os.system …"),
        ("<line>: 1", "x.yaml:6:1: <line>: … key … name, arm, task, control, target, plant, expect, look, baseline, sweep, tune"),
        ('"a\\nb": 1', r"x.yaml:6:1: a\nb: … key … name, arm, task, control, target, plant, expect, look, baseline, sweep, tune"),
    ],
)  # fmt: skip
def test_yaml_that_is_no_plain_value_gets_one_line(text, line):
    assert problems(MINIMAL + text) == [says(line)]


def test_a_file_that_is_not_there_is_told_with_its_neighbor():
    Path("approach.yaml").write_text(MINIMAL)
    assert file_problem("aproach.yaml") == says('aproach.yaml: … file … "approach.yaml"…')
    assert file_problem("nowhere/zzz.yaml") == says("nowhere/zzz.yaml: … file")
    assert file_problem("approach.yaml/x") == says("approach.yaml/x: … not a directory")
    assert file_problem("a\nb\0") == says(r"a\nb\x00: … NUL")


def test_what_is_no_file_is_not_read():
    assert file_problem(".") == says(".: … directory … YAML …")
    os.mkfifo("pipe.yaml")  # reading it would wait for ever
    assert file_problem("pipe.yaml") == says("pipe.yaml: … file")


def test_a_file_that_may_not_be_read_gets_one_line(monkeypatch):
    def refuse(*_args):
        raise PermissionError(13, "Permission denied")

    Path("x.yaml").write_text(MINIMAL)
    monkeypatch.setattr(reading, "open", refuse, raising=False)  # root may read any file
    assert file_problem("x.yaml") == says("x.yaml: … permission denied")


def test_a_huge_file_is_refused_by_its_size_without_reading(monkeypatch):
    with open("big.yaml", "wb") as file:
        file.truncate(100_000_000)
    monkeypatch.setattr(reading, "open", None, raising=False)  # opening it would be a TypeError
    assert file_problem("big.yaml") == says("big.yaml: … 100.0 MB … 1 MiB …")
    assert problems("#" * (2**20 + 1)) == [says("x.yaml: … 1.0 MB … 1 MiB …")]


def test_a_byte_order_mark_and_windows_line_ends_are_accepted():
    Path("x.yaml").write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert load("x.yaml") == loads(MINIMAL)


@given(st.text(ANY, max_size=60) | st.lists(st.sampled_from("ab:-[]{},&*!|>'\"\n #?1.<=%"), max_size=30))
def test_any_text_gives_a_scenario_error_of_whole_lines(text):
    with pytest.raises(ScenarioError) as caught:
        loads("".join(text), "x.yaml")
    for line in map(str, caught.value.problems):
        assert line.startswith("x.yaml:")
        assert line.isprintable()


@given(
    st.floats(allow_nan=False)
    | st.integers()
    | st.text(ANY, max_size=8)
    | st.lists(st.booleans() | st.none())
)
@example("010")
@example("1e5")
@example(1e-5)
@example(-0.0)
def test_a_value_on_one_line_is_read_back(value):
    line = inline(value)
    assert "\n" not in line
    try:
        back = parse(line).value
    except reading.TextError:
        assert isinstance(value, str)  # a text may hold what no file may
    else:
        assert (type(back), repr(back)) == (type(value), repr(value))
