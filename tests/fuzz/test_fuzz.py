"""Hostile inputs end as documented; and the harness that says so sees every kind of fault that is planted."""

import json
import os
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from . import case as cases
from . import classes, planted
from .__main__ import main
from .chance import Chance
from .judge import Finding, signature
from .supervisor import TESTS, Bounds, supervise

FROZEN = sorted((Path(__file__).parent / "regressions").glob("*.json"))

# So many inputs of each class: few of them take two seconds of a core in all, and more where most are refused.
FEW = {"models": 12, "scenarios": 8, "options": 16, "numbers": 6}
MANY = dict.fromkeys(classes.GENERATORS, 50)


def told(result):
    return [f"{one.kind} {one.index}: {one.finding.kind}: {one.finding.text}" for one in result.failures]


# Few inputs import and compile what they need as they go, which may take long for one of them.
SLOW = Bounds(seconds=120.0)


@pytest.mark.parametrize(
    ("counts", "bounds"),
    [(FEW, SLOW), pytest.param(MANY, Bounds(), marks=pytest.mark.long)],
    ids=["few", "many"],
)
def test_inputs_end_as_documented(counts, bounds):
    frozen = [("file", str(path)) for path in FROZEN]
    assert frozen  # every input that ever failed
    result = supervise(
        [*frozen, *((kind, index) for kind in classes.GENERATORS for index in range(counts[kind]))],
        bounds=bounds,
        prepares=counts is MANY,
    )
    assert told(result) == []
    assert result.counts == {"file": len(frozen)} | counts
    # Some go well and some are refused: what is refused at its first line, always, tries nothing else.
    assert all({"0", "2"} <= set(result.codes[kind]) for kind in classes.GENERATORS)


# What a planted fault may take: 400 MB, where a worker that has begun takes 50, and as long as the slowest machine needs.
PLANTED = Bounds(seconds=60.0, grace=3.0, memory=3 * 2**27, addresses=2**32)
# Those that run on for as long as they may, all at once, get a third of a second, and one of them the time to end.
RUNNING_ON = {"hang", "sleep", "deaf", "long"}


def supervise_planted(names, bounds, jobs):
    indices = [index for index, name in enumerate(planted.FAULTS) if name in names]
    return supervise([("planted", index) for index in indices], jobs, bounds, planted.__name__)


def test_every_planted_fault_is_counted_and_nothing_else():
    with ThreadPoolExecutor() as pool:  # both wait for most of their time
        asked = [
            pool.submit(supervise_planted, planted.FAULTS.keys() - RUNNING_ON, PLANTED, 1),
            pool.submit(
                supervise_planted, RUNNING_ON, replace(PLANTED, seconds=0.3, grace=1.0), len(RUNNING_ON)
            ),
        ]
        results = [one.result() for one in asked]
    found = {name: [] for name in planted.FAULTS}
    for kind, index in sorted(
        {(one.finding.kind, one.index) for result in results for one in result.failures}
    ):
        found[list(planted.FAULTS)[index]].append(kind)
    assert found == {name: [kind] if kind else [] for name, kind in planted.FAULTS.items()}
    assert sum((result.counts for result in results), Counter()) == {"planted": len(planted.FAULTS)}
    assert [result.long for result in results] == [{}, {"planted": 1}]
    assert sum((result.kinds() for result in results), Counter()) == Counter(
        filter(None, planted.FAULTS.values())
    )


def test_a_worker_that_cannot_start_is_an_error():
    with pytest.raises(RuntimeError, match="before its first input"):
        supervise([("planted", 0)], 1, Bounds(), "fuzz.none")


def test_class_and_index_alone_decide_an_input():
    code = (
        f"import sys; sys.path.insert(0, {str(TESTS)!r}); from fuzz.classes import digest; print(digest(10))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "17"}  # no order of a set may decide
    other = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert other.stdout.strip() == classes.digest(10)


def test_choices_are_the_same_in_every_version_of_python():
    # Written down under Python 3.11; whoever changes them changes all inputs.
    chance = Chance("models", 7)
    first = [
        chance.under(100),
        chance.between(5, 9),
        chance.pick("abcdefgh"),
        chance.decimal(),
        chance.weighted({"a": 1, "b": 9}),
    ]
    assert first == [30, 7, "f", "5.511e-178", "a"]


def test_classes_are_mixed_as_promised():
    counts = Counter(kind for kind, _ in classes.mixed(100_000))
    assert counts.total() == 100_000
    assert counts["models"] >= 20_000
    assert set(counts) == set(classes.GENERATORS)
    assert len(set(classes.mixed(1000))) == 1000  # none of them twice


@pytest.mark.parametrize("kind", classes.GENERATORS)
def test_an_input_is_read_back_as_it_was(kind):
    for index in range(100):
        case = classes.case(kind, index)
        assert cases.read(case.text(origin="x")) == case
        # What the kernel hands over has no NUL, and is bytes.
        assert all(
            "\0" not in one and len(one.encode("utf-8", "surrogateescape")) < 2**17 for one in case.argv
        )


def test_inputs_differ():
    texts = [classes.case(kind, index).text() for kind in classes.GENERATORS for index in range(100)]
    assert len(set(texts)) > 0.9 * len(texts)


def test_no_viewer_and_no_cluster_is_started():
    for index in range(500):
        argv = classes.case("options", index).argv
        assert not any(one.startswith(("local:1", "local:2", "tcp://1")) for one in argv)


def test_a_frozen_text_may_be_repeated():
    case = cases.read(json.dumps({"argv": ["run", "x"], "files": {"a": [["[", 3], ["]", 2]]}}))
    assert case.files == {"a": b"[[[]]"}


def test_findings_of_one_cause_are_told_as_one():
    one, other = (Finding("traceback", f"KeyError: 'name {i}', arm.py:{i}0 in load") for i in (3, 45))
    assert (
        signature(one)
        == signature(other)
        != signature(Finding("traceback", "KeyError: 'x', arm.py:1 in save"))
    )


def test_show_prints_what_replay_reads(capsys, tmp_path):
    assert main(["show", "models", "3", "--into", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert cases.read(text) == classes.case("models", 3)
    assert (tmp_path / "models/fuzz.xml").read_bytes() == classes.case("models", 3).files["models/fuzz.xml"]
