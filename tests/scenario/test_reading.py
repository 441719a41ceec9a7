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


def test_an_alias_is_a_copy():
    text = MINIMAL + "control: {joint_weights: &w [1.0, 2.0], nullspace: {posture: *w}}\n"
    scenario = loads(text, overrides=["control.joint_weights[0]=9"])
    assert scenario.control.joint_weights == (9.0, 2.0)
    assert scenario.control.nullspace.posture == (1.0, 2.0)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", ": … empty"),
        (b"\xff\xfe\x00\x01", ": … UTF-8 … 0xff"),
        (b"name: a\n\x00\x01", ":2:1: … U+0000"),
        (b"- a\n- b\n", ":1:1: … mapping … [\"a\", \"b\"]"),
        (b"a: *b", ":1:4: … YAML: … alias 'b'"),
        (b"a: 1\n---\nb: 1\n", ":2:1: … second scenario …"),
        (b"[" * 100_000, ": … 50 …"),
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
        ("name: x", "x.yaml:6:1: name: … twice … line 1"),
        ("plant: {<<: {kv: 1}}", "x.yaml:6:9: plant: … key … text … <<"),
        ("plant: {kv: 0x_}", "x.yaml:6:13: plant.kv: … !!int … 0x_"),
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
