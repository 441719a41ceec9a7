"""Call every verb on every robot, and print a table of the results.

    .venv/bin/python tools/robots.py                        the robots in models/, and all of tests/models
    .venv/bin/python tools/robots.py FOLDER FILE...         and these: .xml and .urdf of a folder, or files
    .venv/bin/python tools/robots.py --list robots.tsv      and those of a list: name, path, options of verbs
    .venv/bin/python tools/robots.py --only inspect,run --jobs 2 --markdown table.md --json table.json

A cell is `ok`, or the one line with which the program ended: `2: ...` for refused input, `1: ...` for a
failed condition. These are faults: `TRACEBACK`, `DIED`, `SLOW` for more than --limit seconds, `SILENT`
without any output, or `WORDY` if a mistake took more than one line. Exits with 1 if there is a fault. Verbs
and kinds of plant that the program does not have are left out. Each call is a separate process, with the
sources of the repository --root, by default that of this file; its files go into a folder that is deleted.
"""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
ROBOTS = "ur5e", "fr3", "xarm7", "so101"
VERBS = "check", "new", "run", "inspect", "ik", "statics", "workspace", "tune"
FAULTS = "TRACEBACK", "DIED", "SLOW", "SILENT", "WORDY"
# If `new` is missing, or refuses: 2 cm to each side and back, with defaults only.
PLAIN = """
name: mine
arm: {{model: {model}, site: {site}}}
target:
  path:
    - line: {{by: [0.02, 0, 0]}}
    - line: {{by: [-0.02, 0, 0]}}
    - line: {{by: [0, 0.02, 0]}}
    - line: {{by: [0, -0.02, 0]}}
""".lstrip()


@dataclass(frozen=True)
class Robot:
    """A model, by the name of its row, and options that all verbs get which take a model."""

    name: str
    path: Path
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Ended:
    """How a call ended: its cell, and what it printed."""

    cell: str
    printed: str


def listed(path: Path) -> Iterator[Robot]:
    """Yield the robots of a table: name, path from its folder, options, with tabs between; # is a comment."""
    for line in path.read_text("utf-8").splitlines():
        if line.strip() and not line.startswith("#"):
            name, file, *options = line.split("\t")
            yield Robot(
                name, (path.parent / file).resolve(), tuple(shlex.split(options[0] if options else ""))
            )


def given(path: Path) -> Iterator[Robot]:
    """Yield the models of a folder, or the one of a file."""
    files = (
        sorted(one for one in path.rglob("*") if one.suffix in (".xml", ".urdf")) if path.is_dir() else [path]
    )
    for file in files:
        yield Robot(str(file.relative_to(path) if path.is_dir() else file.name), file.resolve())


def rmrc(*words: str, limit: float, folder: Path) -> Ended:
    """Call the program; nothing that it prints or does stops the table."""
    command = [sys.executable, "-m", "rmrc", *words]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=limit, cwd=folder, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Ended(f"SLOW: more than {limit:g} s", "")
    text = cell(done.returncode, done.stdout, done.stderr).replace(f"{folder}/", "")
    return Ended(text, done.stdout)


def cell(code: int, out: str, err: str) -> str:
    """Return the cell for the end of a call."""
    said = [line for line in err.splitlines() if line.strip()]
    errors = [
        line for line in said if not re.match(r"rmrc: (.* \.\.\.$|note: )", line)
    ]  # notices end in dots
    if code == 70 or "Traceback" in err:
        raised = [line for line in said if re.match(r"[\w.]+(Error|Exception|Interrupt)\b", line)]
        return "TRACEBACK: " + (raised or said or ["nothing"])[-1].strip()
    if code == 0:
        return "ok"
    if code not in (1, 2, 3):
        return f"DIED: exit code {code}"
    if code != 2:
        told = errors or [line for line in out.splitlines() if line.strip()]
        # the failure of a check or of statics, which continues in further lines; otherwise the last line
        wrong = re.search(
            r"^(?:error |MISSED).*?(?=^(?:warning|note|error) |\Z)", "\n".join(told), re.M | re.S
        )
        first = [wrong[0]] if wrong else told[-1:]
        return f"{code}: {' '.join(first[0].split())}" if first else f"SILENT: exit code {code}"
    if not errors:
        return "SILENT: exit code 2"
    # One line for each mistake, and nothing else.
    wordy = (
        "" if all(line.startswith("rmrc: error: ") for line in errors) else f"WORDY: {len(errors)} lines: "
    )
    return f"{wordy}2: {errors[0].removeprefix('rmrc: error: ').strip()}"


def row(robot: Robot, columns: list[str], limit: float) -> dict[str, str]:
    """Return the cells of a robot by column."""
    with tempfile.TemporaryDirectory() as place:
        folder, model = Path(place), str(robot.path)

        def call(*words: str) -> Ended:
            return rmrc(*words, limit=limit, folder=folder)

        cells = {}
        scenario = folder / "mine.yaml"
        seen = call("inspect", model, *robot.options, "--json")
        facts = json.loads(seen.printed) if seen.cell == "ok" else {}
        cells["frame"] = f"{facts['site']}, {len(facts['joints'])}" if facts else "-"
        if {"new", "tune"} & {*columns} or any(one.startswith("run") for one in columns):
            made = call("new", model, *robot.options, "-o", str(scenario)) if "new" in columns else None
            if made:
                cells["new"] = made.cell
            if facts and made is None:
                start = dict(zip(robot.options[::2], robot.options[1::2], strict=False)).get("--keyframe")
                text = PLAIN.format(model=json.dumps(model), site=json.dumps(facts["site"]))
                scenario.write_text(
                    text.replace("}\ntarget", f", start: {start}}}\ntarget") if start else text
                )
        for column in columns:
            verb, _, kind = column.partition(":")
            if verb in ("run", "tune") and not scenario.exists():
                cells[column] = "as new" if "new" in columns else "as inspect"
            elif verb == "run":
                chosen = ["--set", f"plant.kind={kind}"] if kind else []
                cells[column] = call("run", str(scenario), *chosen, "--out", "out", "-q", "--no-record").cell
            elif verb == "tune":
                few = ["--runs", "24", "--perturbed", "1", "--threads", "1"]
                cells[column] = call("tune", str(scenario), *few, "--out", "out", "-q").cell
            elif column not in cells:
                cells[column] = asked(verb, model, robot, facts, seen, call)
        return {column: text.replace(model, robot.path.name) for column, text in cells.items()}


def asked(
    verb: str, model: str, robot: Robot, facts: dict[str, Any], seen: Ended, call: Callable[..., Ended]
) -> str:
    """Return the cell of a verb that takes a model."""
    if verb == "inspect":
        return seen.cell
    options = list(robot.options)
    if verb == "ik":
        # Each joint a little off towards the middle of its range: a reachable goal.
        places = zip(facts.get("q", ()), facts.get("limits", ()), strict=True)
        goal = [q + 0.05 * toward(q, limits) for q, limits in places]
        options += ["--to-q", ",".join(f"{q:.6f}" for q in goal) or "0"]
    elif verb == "statics":
        options += ["--wrench", "0,0,-1,0,0,0", "--hold", "10"]
    elif verb == "workspace":
        options += ["--samples", "20000", "--cells", "40", "--out", "out", "-q"]
    return call(verb, model, *options).cell


def toward(q: float, limits: list[float | None]) -> float:
    """Return 1 or -1: the direction from a joint's position to the middle of its limits."""
    low, high = (0.0 if end is None else end for end in limits)
    return 1.0 if q <= 0.5 * (low + high) else -1.0


def had(only: str) -> list[str]:
    """Return the requested columns that the program can fill."""
    wished = only.split(",") if only else [*VERBS]
    with tempfile.TemporaryDirectory() as place:
        told = rmrc("--help", limit=60.0, folder=Path(place)).printed
        kinds = rmrc("schema", "--json", limit=60.0, folder=Path(place)).printed
    verbs = [verb for verb in wished if re.search(rf"^  {verb.partition(':')[0]}\b", told, re.MULTILINE)]
    (choice,) = re.findall(r'"enum": (\[\s*"ideal".*?\])', kinds, re.DOTALL)[:1] or ["[]"]
    plants = json.loads(choice)
    return [
        column
        for verb in verbs
        for column in ([f"run:{kind}" for kind in plants] if verb == "run" else [verb])
    ]


def markdown(rows: dict[str, dict[str, str]]) -> str:
    """Return the table, with texts longer than a word below it."""
    columns = list(next(iter(rows.values()), {}))
    lines = ["| robot | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    notes: dict[str, int] = {}
    for name, cells in rows.items():
        short = []
        for column in columns:
            text = cells[column]
            plain = column == "frame" or text in ("ok", "as inspect", "as new")
            short.append(
                text if plain else f"{text.partition(':')[0]} [{notes.setdefault(text, len(notes) + 1)}]"
            )
        lines.append(f"| {name} | " + " | ".join(short) + " |")
    return "\n".join([*lines, "", *(f"{number}. `{text}`" for text, number in notes.items()), ""])


def main() -> int:
    """Print the table; return 1 if a cell is a fault."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("models", nargs="*", type=Path, help="folders and files")
    parser.add_argument("--list", type=Path, action="append", default=[], help="a table of names and paths")
    parser.add_argument("--only", default="", help="columns, such as check,new,run,inspect")
    parser.add_argument("--root", type=Path, default=ROOT, help="the repository whose program is asked")
    parser.add_argument("--bare", action="store_true", help="leave out those of models/ and tests/models")
    parser.add_argument("--jobs", type=int, default=1, help="robots at a time")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds a cell may take")
    parser.add_argument("--markdown", type=Path, help="where the table goes as well")
    parser.add_argument("--json", type=Path, help="where the cells go")
    options = parser.parse_args()
    os.environ["PYTHONPATH"] = str(options.root.resolve() / "src")
    robots = [] if options.bare else [Robot(name, ROOT / f"models/{name}.xml") for name in ROBOTS]
    if not options.bare and (ROOT / "tests/models").is_dir():
        robots += given(ROOT / "tests/models")
    robots += [one for path in options.models for one in given(path)]
    robots += [one for path in options.list for one in listed(path)]
    columns, rows = had(options.only), {}
    with ThreadPoolExecutor(options.jobs) as pool:
        for robot, cells in zip(
            robots, pool.map(lambda one: row(one, columns, options.limit), robots), strict=True
        ):
            rows[robot.name] = {"frame": cells["frame"], **{column: cells[column] for column in columns}}
            print(f"{robot.name}: " + "; ".join(f"{c} {v}" for c, v in rows[robot.name].items()), flush=True)
    table = markdown(rows)
    print("\n" + table)
    if options.markdown:
        options.markdown.write_text(table, "utf-8")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    return int(any(text.startswith(FAULTS) for cells in rows.values() for text in cells.values()))


if __name__ == "__main__":
    sys.exit(main())
