"""Plants small faults in the law, plants, results and analysis, and counts those that the tests notice.

    python tools/mutations.py [--count 60] [--seed 1] [--out recordings/mutations.csv]

A fault changes one operator, comparison, index or constant in a copy of this checkout. The tests then have a
minute: those of its module first, then those of its room and of whole runs. A fault survives if they pass, or
find nothing in that time. All tests run once before, without a fault, which takes six minutes, so that only
what a fault changes is compiled in its minute. Rows that the file already holds are not run again. The exit
code is 1 if more than a tenth survive.
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
                yield Fault(name, node.lineno, start, old, repr(value + 1))
                continue
            case _:
                continue
        old, new = SWAPS.get(type(operator), ("none", ""))
        end = lines[left.end_lineno - 1] + left.end_col_offset
        start = data.find(old.encode(), end, lines[right.lineno - 1] + right.col_offset)
        if start >= 0:
            yield Fault(name, left.lineno, start, old, new)


def nearest(file: str) -> list[str]:
    """Return tests in their order: those that import the module, of its room, of whole runs."""
    _, _, room, module = Path(file).with_suffix("").parts
    paths = sorted((ROOT / "tests").rglob("*.py"), key=lambda path: (path.parent.name != room, path))
    texts = {path: path.read_text("utf-8") for path in paths}
    importing = [
        path for path, text in texts.items()
        if f"rmrc.{room}.{module}" in text or (f"rmrc.{room} import" in text and module in text)
    ]  # fmt: skip
    helped = tuple(f"from {path.stem} import" for path in importing if not path.stem.startswith("test_"))
    importing += [path for path, text in texts.items() if any(line in text for line in helped)]
    named = [path for path in texts if path.stem == f"test_{module}"]
    beside = [path for path, text in texts.items() if path.parent.name == room or f"rmrc.{room}." in text]
    apart = [path for path in texts if path.parent.name == "tests" and not (ROOT / "tests" / room).exists()]
    ordered = dict.fromkeys([*named, *importing, *beside, *(ROOT / test for test in RUNS), *apart])
    apart_from = ROOT / "tests/law/test_compiling.py", ROOT / "tests/test_commands.py"  # which take long
    tests = [path for path in ordered if path.stem.startswith("test_") and path not in apart_from]
    return [path.relative_to(ROOT).as_posix() for path in tests]


def dependents(copy: Path, file: str) -> set[str]:
    """Return the names of a module and of all that import it, directly or through others."""
    imports = dict[str, set[str]]()
    for path in (copy / "src").rglob("*.py"):
        nodes = [node for node in ast.walk(ast.parse(path.read_bytes())) if isinstance(node, ast.ImportFrom)]
        names = {f"{node.module}.{alias.name}" for node in nodes for alias in node.names}
        imports[module_name(path.relative_to(copy))] = names | {str(node.module) for node in nodes}
    reached, new = set[str](), {module_name(Path(file))}
    while new:
        reached |= new
        new = {name for name, imported in imports.items() if imported & new} - reached
    return reached


def module_name(path: Path) -> str:
    """Return the dotted name of a module under `src`."""
    return ".".join(path.with_suffix("").parts[1:]).removesuffix(".__init__")


def check(copy: Path, tests: list[str], seconds: float | None = None) -> str:
    """Run tests in a copy of the checkout; return the first that fails, "" if none, or that time is over."""
    environment = os.environ | {
        "PYTHONPATH": str(copy / "src"),
        "NUMBA_CACHE_DIR": str(copy.parent / "cache"),
        "PYTEST_ADDOPTS": "-rfE",  # which the caller may have set otherwise
    }
    run = subprocess.Popen(
        [sys.executable, "-m", "pytest", "-q", "-x", "--maxschedchunk=1", *tests],
        cwd=copy, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    try:
        output, _ = run.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        os.killpg(run.pid, signal.SIGKILL)  # with the processes that tests have started
        run.communicate()
        return "survives a minute"
    failed = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return (failed or ["crashes"])[0] if run.returncode else ""


def outcome(copy: Path, fault: Fault) -> str:
    """Return the first test that fails for a fault in a copy of the checkout, or "survives"."""
    path, before = copy / fault.file, copy / fault.file.replace(".py", ".before")
    path.rename(before)
    data = before.read_bytes()
    path.write_bytes(data[: fault.start] + fault.new.encode() + data[fault.start + len(fault.old.encode()) :])
    cache = copy.parent / "cache"
    try:
        name = subprocess.run(
            [sys.executable, "-c", "from rmrc.law.compiling import cache_folder; print(cache_folder())"],
            env=os.environ | {"PYTHONPATH": str(copy / "src"), "NUMBA_CACHE_DIR": str(cache)},
            text=True, stdout=subprocess.PIPE, check=False,
        ).stdout.strip()  # fmt: skip
        if not name:
            return "crashes"
        stems = {dependent.rpartition(".")[2] for dependent in dependents(copy, fault.file)}
        shutil.copytree(
            copy.parent / "warm", name, dirs_exist_ok=True,
            ignore=lambda _, names: [name for name in names if name.partition(".")[0] in stems],
        )  # fmt: skip
        return check(copy, nearest(fault.file), SECONDS) or "survives"
    finally:
        before.replace(path)
        shutil.rmtree(cache)


def read(file: Path) -> dict[Fault, str]:
    """Return the known outcomes."""
    rows = list(csv.reader(file.read_text("utf-8").splitlines())) if file.exists() else []
    return {Fault(row[0], int(row[1]), int(row[2]), row[3], row[4]): row[5] for row in rows}


def main() -> int:
    """Run the faults that are not known yet, and print the survivors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=ROOT / "recordings/mutations.csv")
    options = parser.parse_args()
    files = [path for room in ROOMS for path in sorted((ROOT / "src/rmrc" / room).rglob("*.py"))]
    possible = [fault for path in files for fault in faults(path)]
    drawn = random.Random(options.seed).sample(possible, options.count)
    missing = [fault for fault in drawn if fault not in read(options.out)]
    with (
        tempfile.TemporaryDirectory() as folder,
        options.out.open("a", newline="", encoding="utf-8") as file,
    ):
        copy, cache = Path(folder) / "rmrc", Path(folder) / "cache"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".git", ".venv", "build", "_site", "*.rrd"))
        if missing and (failed := check(copy, ["tests"])):
            sys.exit(f"without a fault, this fails: {failed}")
        for warm in cache.glob("*") if missing else ():
            warm.rename(Path(folder) / "warm")
        for fault in missing:
            result = outcome(copy, fault)
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
