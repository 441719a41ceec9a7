"""Plants small faults in the law, plants, results and analysis, and counts those that the tests notice.

    python tools/mutations.py [--count 60] [--seed 1] [--jobs 2] [--out recordings/mutations.csv]

A fault changes one operator, comparison, index or constant in a copy of this checkout. The tests of its room
and those of whole runs then have a minute. A fault survives if they pass, or find nothing in that time. Rows
that the file already holds are not run again. The exit code is 1 if more than a tenth survive.
"""

import argparse
import ast
import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
ROOMS = ("law", "plants", "results", "analysis")
RUNS = (
    "tests/test_simulation.py",
    "tests/law/test_law.py",
    "tests/test_scenarios.py",
    "tests/test_tracking.py",
)
SECONDS = 60
SWAPS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Lt: ("<", ">="), ast.LtE: ("<=", ">"), ast.Gt: (">", "<="), ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip


class Fault(NamedTuple):
    """A fault: `old` at a byte of a file becomes `new`."""

    file: str
    line: int
    start: int
    old: str
    new: str


def faults(path: Path) -> Iterator[Fault]:
    """Yield all faults that a file can have."""
    data, name = path.read_bytes(), path.relative_to(ROOT).as_posix()
    lines = [0]
    for line in data.splitlines(keepends=True):
        lines.append(lines[-1] + len(line))
    for node in ast.walk(ast.parse(data)):
        match node:
            case ast.BinOp(left, operator, right) | ast.Compare(left, [operator], [right]):
                pass
            case ast.BoolOp(operator, [left, right, *_]):
                pass
            case ast.UnaryOp(ast.USub()):
                yield Fault(name, node.lineno, lines[node.lineno - 1] + node.col_offset, "-", "")
                continue
            case ast.Constant(value) if type(value) in (int, float):
                start = lines[node.lineno - 1] + node.col_offset
                old = data[start : lines[node.lineno - 1] + node.end_col_offset].decode()
                yield Fault(
                    name,
                    node.lineno,
                    start,
                    old,
                    repr(value + 1 if type(value) is int else 1.01 * value + 0.01),
                )
                continue
            case _:
                continue
        old, new = SWAPS.get(type(operator), ("none", ""))
        end = lines[left.end_lineno - 1] + left.end_col_offset
        start = data.find(old.encode(), end, lines[right.lineno - 1] + right.col_offset)
        if start >= 0:
            yield Fault(name, left.lineno, start, old, new)


def nearest(file: str) -> list[str]:
    """Return tests in their order: for the law, whole runs come first, as they see most of it."""
    _, _, room, *folders, module = Path(file).with_suffix("").parts
    names = f"rmrc.{'.'.join([room, *folders, module])}", f"rmrc.{'.'.join([room, *folders])} import"
    edits_copies = ROOT / "tests/law/test_compiling.py"
    tests = sorted({*(ROOT / "tests").rglob("test_*.py")} - {edits_copies})
    importing = [test for test in tests if any(name in test.read_text("utf-8") for name in names)]
    beside = [test for test in tests if test.parent.name == room]
    files = [test.relative_to(ROOT).as_posix() for test in (*importing, *beside)]
    ordered = [*RUNS, *files] if room in ("law", "plants") else [*files, *RUNS]
    return list(dict.fromkeys(ordered))


def outcome(fault: Fault) -> str:
    """Return the first test that fails for a fault in a copy of the checkout, or "survives"."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "rmrc"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".git", ".venv", "build", "_site", "*.rrd"))
        data = (copy / fault.file).read_bytes()
        after = data[fault.start + len(fault.old.encode()) :]
        (copy / fault.file).write_bytes(data[: fault.start] + fault.new.encode() + after)
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider"]
        environment = os.environ | {"PYTHONPATH": str(copy / "src"), "NUMBA_CACHE_DIR": f"{folder}/cache"}
        run = subprocess.Popen(
            [*command, *nearest(fault.file)], cwd=copy, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        try:
            output, _ = run.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)  # with the processes that tests have started
            return "survives a minute"
        failed = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
        return (failed or ["crashes"])[0] if run.returncode else "survives"


def read(file: Path) -> dict[Fault, str]:
    """Return the known outcomes."""
    rows = list(csv.reader(file.read_text("utf-8").splitlines())) if file.exists() else []
    return {Fault(row[0], int(row[1]), int(row[2]), row[3], row[4]): row[5] for row in rows}


def main() -> int:
    """Run the faults that are not known yet, and print the survivors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "recordings/mutations.csv")
    options = parser.parse_args()
    files = [path for room in ROOMS for path in sorted((ROOT / "src/rmrc" / room).rglob("*.py"))]
    possible = [fault for path in files for fault in faults(path)]
    drawn = random.Random(options.seed).sample(possible, options.count)
    missing = [fault for fault in drawn if fault not in read(options.out)]
    with (
        ThreadPoolExecutor(options.jobs) as pool,
        options.out.open("a", newline="", encoding="utf-8") as file,
    ):
        for fault, result in zip(missing, pool.map(outcome, missing), strict=True):
            csv.writer(file).writerow([*fault, result])
            file.flush()
            print(f"{fault.file}:{fault.line}: {fault.old} -> {fault.new}: {result}", flush=True)
    results = read(options.out)
    survivors = [fault for fault in drawn if results[fault].startswith("survives")]
    print(f"{len(drawn) - len(survivors)} of {len(drawn)} faults are noticed; these are not:")
    for fault in survivors:
        print(f"  {fault.file}:{fault.line}: {fault.old} -> {fault.new or 'nothing'}")
    return int(10 * len(survivors) > len(drawn))


if __name__ == "__main__":
    sys.exit(main())
