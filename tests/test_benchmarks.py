"""benchmarks/all.py: what it reads of the other programs, and which rows it calls worse than earlier ones."""

import subprocess
import sys
from types import ModuleType

import pytest

from project import ROOT


@pytest.fixture(scope="module")
def every() -> ModuleType:
    """Return the module, whose name is that of a built-in function."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        return __import__("all")
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))


def row(*values):
    return dict(zip(("min", "median", "max"), values, strict=True))


@pytest.mark.parametrize(
    ("now", "factor"),
    [
        ((1.1, 1.2, 1.3), 1.2),
        ((1.04, 1.2, 1.3), 1.0),  # its best round is as the median before
        ((1.06, 1.1, 1.3), 1.0),  # its median is within the rounds before
        ((0.5, 0.6, 0.7), 1.0),
    ],
)
def test_a_row_is_worse_beyond_the_noise_of_both(every, now, factor):
    before = row(0.95, 1.0, 1.1)
    assert every.worse_by("closed loop / C floor, stanford, 1 world", row(*now), before) == pytest.approx(
        factor
    )


def test_of_some_rows_less_is_worse(every):
    before, slower = row(70.0, 77.0, 80.0), row(40.0, 45.0, 50.0)
    for name in (
        "plain numpy loop / closed loop, stanford, 1 world", "1 thread / 2 threads, stanford, 1000 runs",
        "stanford, scipy least_squares / ours", "Python loop / survey, one core", "stanford, success, %",
    ):  # fmt: skip
        assert every.worse_by(name, slower, before) > 1.0
        assert every.worse_by(name, before, slower) == 1.0


@pytest.mark.parametrize("name", ["us a tick", "1 thread / 2 threads"])
def test_a_row_without_a_least_and_a_largest_value_is_compared_by_its_median(every, name):
    better, worse = sorted((1.0, 1.2), reverse=name.startswith("1 thread"))
    assert every.worse_by(name, {"median": worse}, {"median": better}) > 1.0
    assert every.worse_by(name, {"median": better}, {"median": worse}) == 1.0


def test_rows_are_found_in_what_programs_print(every):
    printed = {"a": row(1, 2, 3) | {"minima": 1, "acts": 0.5}, "b": {"c": [3, 1, 2], "d": True, "why": "no"}}
    assert dict(every.rows_of(printed)) == {
        "a": row(1, 2, 3) | {"minima": 1}, "b, c": row(1, 2, 3), "b, d": row(1, 1, 1),
    }  # fmt: skip


def test_every_part_is_a_program(every):
    for command in every.PARTS.values():
        assert (ROOT / "benchmarks" / command.split()[0]).is_file()


def test_a_part_that_is_none_is_refused():
    done = subprocess.run(
        [sys.executable, "benchmarks/all.py", "--only", "nothing"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "invalid choice: 'nothing'" in done.stderr
