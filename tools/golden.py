"""Print hashes of all results that a rebuild of the internals must not change, on one machine.

    .venv/bin/python tools/golden.py > before.txt
    ...rebuild...
    .venv/bin/python tools/golden.py > after.txt; diff before.txt after.txt

Each line is a name and 16 hex digits of SHA-256: columns and scorecards of runs, rows of sweeps, settings
of `tune`, answers about arms, tables, help, and refusals. `--keep DIR` writes the hashed texts, one file
per line, so that `diff -r` of two such folders shows a difference. The program is called as
`python -m rmrc` only, with the sources of the given repository (default: the one of this file), so that
modules may be moved at will.

Hashes differ between machines and between versions of the libraries. Pictures and recordings are not hashed.
"""

import argparse
import hashlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import yaml

# Facts that differ from one execution to the next (the first two), or with the installed versions.
UNSTABLE = {"wall_time", "speed", "versions"}
# Settings with which a scenario runs on the plants that refuse it as it is.
NEEDED = {"example_5_5": "plant.timestep=1.0e-4"}
EVERY = 9  # --quick does one task in this many
LONGEST = 600.0  # s, longest duration of one execution

APPROACH = "scenarios/approach_singularity.yaml"
SHORT = "--set", "target.path=[{line: {by: [0.05, 0]}}]"
DRAWN = "--vary control.inverse.method=damped,jparse --random control.feedback=5..40 --samples 24"
EVEN = (
    "--vary control.inverse.method=damped,jparse --sobol control.feedback=5..40 --samples 8 --repeat 2 "
    "--seed 3 --set 'arm.encoder.deviation=0.1 deg'"
)

# For each model: joint positions, which are a goal as well, and a wrench.
MODELS = {
    "planar_2link": ("60 deg,-100 deg", "1,2,0"),
    "planar_3link": ("1,-1.2,0.3", "1,2,0"),
    "stanford": ("0.1,1.2,0.7,0.2,1,0.3", "1,2,3,0.1,0.2,0.3"),
    "puma560": ("0.1,-0.9,3.4,0.2,0.6,0.3", "1,2,3,0.1,0.2,0.3"),
}
# Questions about each model, `{q}` and `{w}` being the two.
QUESTIONS = (
    "inspect {m} --json",
    "inspect {m} '--q={q}' '--wrench={w}' '--joint-error={e}'",
    "ik {m} '--to-q={q}' --json",
    "ik {m} '--to-q={q}' --all --json",
    "ik {m} '--to-q={q}' --method newton --iterates",
    "statics {m} '--wrench={w}' '--q={q}' --json",
    "statics {m} '--wrench={w}' --frame site --gravity",
    "statics {m} '--wrench={w}' --hold 2 --json",
)
OVER = {"planar_2link": "shoulder,elbow", "planar_3link": "elbow,wrist"}

REFUSED = (
    f"run {APPROACH} --set control.feedbak=3 --set control.inverse.damping.maximum=-1",
    f"run {APPROACH} --set 'arm.start=[1]' --set 'control.nullspace.rates=[1]'",
    f"run {APPROACH} --set arm.site=hand",
    f"run {APPROACH} --set 'task.axes=[x, w]'",
    f"run {APPROACH} --set control.period=0.0015",
    f"run {APPROACH} --set 'target.path=[]'",
    f"run {APPROACH} --set 'target.path=[{{line: {{to: [1, 0], by: [1, 0]}}}}]'",
    f"run {APPROACH} --set plant.kv=stiff --set plant.kind=rubber",
    f"run {APPROACH} --set 'expect={{joint_rate.peek: {{below: 3}}}}'",
    f"run {APPROACH} --set 'arm.joints=[shoulder, knee]'",
    f"run {APPROACH} --set arm.model=models/nothing.xml",
    f"run {APPROACH} --nothing",
    "run scenarios/nothing.yaml",
    "run models/planar_2link.xml",
    "run scenarios/null_space.yaml --set 'control.nullspace.posture=[1, 2]'",
    f"compare {APPROACH} --vary control.feedback=-1,2",
    f"compare {APPROACH} --vary plant.kind=ideal,foo",
    f"compare {APPROACH} --vary control.feedback=1,1",
    f"sweep {APPROACH} --vary control.feedback=-1,2",
    f"sweep {APPROACH} --random plant.payload=-1..1",
    f"sweep {APPROACH} --random control.feedback=2..1 --samples 0",
    f"sweep {APPROACH} --vary control.inverse.method=damped,x --sobol control.feedback=1..2",
    f"sweep {APPROACH} --vary control.feedback=1,2 --record worst:1:nothing",
    f"sweep {APPROACH} --vary control.feedback=1,2 --cluster nowhere",
    f"tune {APPROACH} --only control.inverse.method=dampd",
    f"tune {APPROACH} --only control.period=0.001",
    f"tune {APPROACH} --perturbed=-1",
    "statics models/planar_2link.xml --wrench 1 --q 9,9",
    "statics models/planar_2link.xml --wrench 1,2,0 --at nowhere",
    "ik models/planar_2link.xml --to 3,3",
    "ik models/planar_2link.xml --to 1,2,3",
    "ik models/stanford.xml --to 0.5,0.2,0.5 --quat 0,0,0,0",
    "inspect models/planar_2link.xml --site hand",
    "inspect models/nothing.xml",
    "inspect models/common/world.xml",
    f"inspect {APPROACH}",
    "workspace models/planar_2link.xml --over shoulder,knee",
    "workspace models/planar_2link.xml --plane zz --cells 5",
)


@dataclass(frozen=True)
class Said:
    """The output of an execution.

    Attributes:
        code: Its exit code.
        out: Its standard output.
        err: Its standard error.
    """

    code: int
    out: str
    err: str

    def text(self) -> str:
        """Return all of it as one text."""
        return f"exit {self.code}\n--- stdout\n{self.out}--- stderr\n{self.err}"


@dataclass(frozen=True)
class Place:
    """The place where the program is called and where it writes.

    Attributes:
        root: The repository from which it is called.
        out: A folder for one task's files, new and empty.
    """

    root: Path
    out: Path

    def command(self, words: list[str]) -> list[str]:
        """Return the command that calls the program."""
        return [sys.executable, "-m", "rmrc", *words]

    def environment(self) -> dict[str, str]:
        """Return the environment of the calls: sources of this repository, a plain terminal."""
        without = "FORCE_COLOR", "PYTHONDONTWRITEBYTECODE"  # keeping bytecode saves time
        own = {name: value for name, value in os.environ.items() if name not in without}
        plain = {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb", "PYTHONUTF8": "1"}
        return own | plain | {"PYTHONPATH": str(self.root / "src")}

    def call(self, *words: str, writes: bool = True) -> Said:
        """Call the program.

        Args:
            *words: The words after `rmrc`.
            writes: Whether it takes `--out`.
        """
        command = self.command([*words, "--out", str(self.out)] if writes else list(words))
        done = subprocess.run(
            command,
            cwd=self.root,
            env=self.environment(),
            capture_output=True,
            encoding="utf-8",
            timeout=LONGEST,
            check=False,
            stdin=subprocess.DEVNULL,
        )
        # Notices about slow steps: the first compilation, or a model on a busy machine.
        heard = re.sub(r"^rmrc: .* \.\.\.\n", "", done.stderr, flags=re.MULTILINE)
        return Said(done.returncode, done.stdout, heard)

    def plain(self, text: str) -> str:
        """Return a text with words instead of this place's folders."""
        text = re.sub(r"[\w./~+-]*/bin/python[\d.]*", "PYTHON", text)
        text = text.replace(str(self.out), "OUT").replace(str(self.root), "ROOT")
        return text.replace(os.path.relpath(self.root, self.out) + "/", "ROOT/")


@dataclass(frozen=True)
class Task:
    """A task, which gives some lines.

    Attributes:
        name: The first words of its lines.
        lines: The last words of its lines; "" for none.
        do: Does it, and returns the text of each line.
    """

    name: str
    lines: tuple[str, ...]
    do: Callable[[Place], Mapping[str, str]]

    def names(self) -> list[str]:
        """Return the names of its lines."""
        return [f"{self.name} {line}".strip() for line in self.lines]


# Files as texts ----------------------------------------------------------------------------------


def stable(value: object) -> object:
    """Return a value of a JSON file without entries that differ from one execution to the next."""
    if isinstance(value, dict):
        return {key: stable(one) for key, one in value.items() if key not in UNSTABLE}
    return [stable(one) for one in value] if isinstance(value, list) else value


def json_text(text: str) -> str:
    """Return a JSON text without its unstable entries; any other text as it is."""
    try:
        value = json.loads(text)
    except json.JSONDecodeError:
        return text
    return json.dumps(stable(value), indent=1, ensure_ascii=False)


def text_of(path: Path) -> str:
    """Return the text of a file, or a note that there is none."""
    return path.read_text(encoding="utf-8") if path.exists() else "no file\n"


def columns_text(path: Path) -> str:
    """Return the arrays of an .npz: type, shape and hash of each, and some rows to look at."""
    if not path.exists():
        return "no file\n"
    parts: list[str] = []
    with np.load(path, allow_pickle=False) as file:
        for name in file.files:
            if name == "facts":  # has the wall time, and otherwise the same as the JSON
                continue
            array = np.ascontiguousarray(file[name])
            parts.append(f"{name} {array.dtype} {array.shape} {digest(array.tobytes())}")
            rows = array[:: max(1, len(array) // 50)] if array.ndim else [array]
            parts += [f"  {np.asarray(row).tolist()}" for row in rows]
    return "\n".join(parts)


def rows_text(path: Path) -> str:
    """Return the rows of a Parquet file, its schema and its metadata, without versions."""
    if not path.exists():
        return "no file\n"
    table = pq.read_table(path)
    parts = [f"{field.name} {field.type} {field.nullable} {field.metadata}" for field in table.schema]
    for key, value in (table.schema.metadata or {}).items():
        parts.append(f"{key.decode()} {json_text(value.decode())}")
    for name in table.column_names:
        if name not in UNSTABLE:
            parts += [f"{name}[{i}] {value!r}" for i, value in enumerate(table[name].to_pylist())]
    return "\n".join(parts)


def digest(data: bytes) -> str:
    """Return 16 hex digits of SHA-256."""
    return hashlib.sha256(data).hexdigest()[:16]


# Tasks -------------------------------------------------------------------------------------------


def asked(words: str, name: str = "", writes: bool = False) -> Task:
    """Return the task that calls a verb and takes its output, JSON or not.

    Args:
        words: The words after `rmrc`.
        name: The task's name; default: the words.
        writes: Whether the verb takes `--out`.
    """

    def do(place: Place) -> Mapping[str, str]:
        said = place.call(*shlex.split(words), writes=writes)
        return {"": Said(said.code, json_text(said.out) + "\n", said.err).text()}

    return Task(name or words, ("",), do)


def kinds_of(place: Place) -> list[str]:
    """Return the kinds of plant that the program knows."""
    schema = json.loads(place.call("schema", "--json", writes=False).out)
    return list(schema["$defs"]["PlantSection"]["properties"]["kind"]["enum"])


def verbs_of(place: Place) -> dict[str, bool]:
    """Return the verbs of the program, and whether each takes `--out`."""
    _, _, listed = place.call("--help", writes=False).out.partition("Commands:")
    names = re.findall(r"^  (\w+)\b", listed.partition("Exit codes:")[0], re.MULTILINE)
    return {name: "--out" in place.call(name, "--help", writes=False).out for name in names}


def run(scenario: str, *settings: str) -> Task:
    """Return the task that runs a scenario.

    Args:
        scenario: Its name.
        *settings: Its changes, as KEY=VALUE.
    """

    def do(place: Place) -> Mapping[str, str]:
        changes = [word for one in settings for word in ("--set", one)]
        said = place.call("run", f"scenarios/{scenario}.yaml", "--no-record", *changes)
        # Two rows of the table show the wall time, whose length decides the width of their column.
        table = re.sub(r"^(wall_time|speed) .*\n", "", said.out, flags=re.MULTILINE)
        table = re.sub(r" *\n", "\n", re.sub(r"─+", "─", re.sub(r" +", " ", table)))
        return {
            "columns": columns_text(place.out / f"{scenario}.npz"),
            "json": json_text(text_of(place.out / f"{scenario}.json")),
            "said": Said(said.code, table, said.err).text(),
        }

    return Task(" ".join(["run", scenario, *settings]), ("columns", "json", "said"), do)


def runs(root: Path, kinds: list[str]) -> list[Task]:
    """Return the runs: every scenario as it is, and on each other plant.

    Args:
        root: The repository.
        kinds: Kinds of plant.
    """
    tasks: list[Task] = []
    for path in sorted((root / "scenarios").glob("*.yaml")):
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        written = content.get("plant", {}).get("kind", "servo")
        tasks.append(run(path.stem))
        for kind in kinds:
            if kind != written:
                tasks.append(run(path.stem, f"plant.kind={kind}"))
                if path.stem in NEEDED:
                    tasks.append(run(path.stem, f"plant.kind={kind}", NEEDED[path.stem]))
    return tasks


def compare(name: str, words: str) -> Task:
    """Return the task that compares.

    Args:
        name: The task's name.
        words: The scenario and the options.
    """

    def do(place: Place) -> Mapping[str, str]:
        scenario, *options = shlex.split(words)
        said = place.call("compare", scenario, "--no-record", *options)
        path = place.out / f"{Path(scenario).stem}.compare.json"
        return {"json": json_text(text_of(path)), "said": said.text()}

    return Task(f"compare {name}", ("json", "said"), do)


def sweep(name: str, words: str, interrupted: bool = False) -> Task:
    """Return the task that sweeps.

    Args:
        name: The task's name.
        words: The options.
        interrupted: Whether it is interrupted first, and then resumed.
    """

    def do(place: Place) -> Mapping[str, str]:
        options = ["sweep", APPROACH, *shlex.split(words)]
        if interrupted:
            interrupt(place, options)
        said = place.call(*options)
        rows = rows_text(place.out / "approach_singularity.sweep.parquet")
        # After an interruption it prints the number of earlier runs, which is a matter of luck.
        return {"rows": rows, "said": (Said(said.code, said.out, "") if interrupted else said).text()}

    return Task(f"sweep {name}", ("rows", "said"), do)


def interrupt(place: Place, options: list[str]) -> None:
    """Start a sweep and interrupt it as soon as it has finished some batches, so that some are missing.

    If the sweep ended before the interruption, its file is removed and another is tried.

    Args:
        place: The place.
        options: The verb and its options.

    Raises:
        RuntimeError: It could not be interrupted in time.
    """
    for _ in range(3):
        process = subprocess.Popen(
            place.command([*options, "--threads", "1", "--out", str(place.out)]),
            cwd=place.root,
            env=place.environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            until = time.monotonic() + LONGEST
            while len(list(place.out.glob("*.sweep/part-*.parquet"))) < 2 and process.poll() is None:
                if time.monotonic() > until:
                    break
                time.sleep(0.002)
            process.send_signal(signal.SIGINT)
            if process.wait(LONGEST) == 130:
                return
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        for path in place.out.glob("*.sweep.parquet"):
            path.unlink()
    raise RuntimeError("the sweep could not be interrupted")


def tune(name: str, words: str) -> Task:
    """Return the task that tunes.

    Args:
        name: The task's name.
        words: The options.
    """

    def do(place: Place) -> Mapping[str, str]:
        said = place.call("tune", APPROACH, *SHORT, *shlex.split(words))
        stem = place.out / "approach_singularity.tune"
        return {
            "rows": rows_text(stem.with_suffix(".tune.parquet")),
            "yaml": text_of(stem.with_suffix(".tune.yaml")),
            "said": said.text(),
        }

    return Task(f"tune {name}", ("rows", "yaml", "said"), do)


def workspace(model: str, words: str) -> Task:
    """Return the task that maps a workspace.

    Args:
        model: The model's name.
        words: The options.
    """

    def do(place: Place) -> Mapping[str, str]:
        said = place.call("workspace", f"models/{model}.xml", *shlex.split(words))
        answer = Said(said.code, json_text(said.out) + "\n", said.err)
        return {"columns": columns_text(place.out / f"{model}.workspace.npz"), "said": answer.text()}

    return Task(f"workspace {model} {words}", ("columns", "said"), do)


def questions() -> list[Task]:
    """Return the questions about arms."""
    tasks: list[Task] = []
    for model, (q, wrench) in MODELS.items():
        path = f"models/{model}.xml"
        tasks += [
            asked(
                words.format(m=path, q=q, w=wrench, e=",".join(["0.002"] * len(q.split(",")))),
                words.format(m=model, q="Q", w="W", e="E").replace("'", ""),
            )
            for words in QUESTIONS
        ]
        tasks.append(workspace(model, "--cells 60 --samples 50000 --json"))
        if model in OVER:
            tasks.append(workspace(model, f"--over {OVER[model]} --cells 60"))
    return tasks


def everything(place: Place) -> list[Task]:
    """Return all tasks, in the order in which their lines are printed.

    Args:
        place: Place of the program, for its verbs and its plants.
    """
    verbs = verbs_of(place)
    joined = " ".join(map(shlex.quote, SHORT))
    return [
        # The two that take longest come first, so that nothing waits for them at the end.
        sweep("cluster", f"{DRAWN} --cluster local:2"),
        sweep("resumed", DRAWN, interrupted=True),
        sweep("drawn", DRAWN),
        sweep("one thread", f"{DRAWN} --threads 1"),
        sweep("two threads", f"{DRAWN} --threads 2"),
        sweep("even, repeated", f"{EVEN} {joined}"),
        tune("all", "--runs 120"),
        tune(
            "some",
            "--runs 60 --only control.inverse.method=damped,truncated --only control.feedback=20 --seed 2",
        ),
        compare("methods", f"{APPROACH} --vary control.inverse.method=damped,inverse,jparse,filtered"),
        compare(
            "grid",
            "scenarios/joint_limit.yaml --vary control.limits.on_excess=scale,clamp --vary plant.payload=0,1",
        ),
        asked("schema"),
        asked("schema --json"),
        asked("--help"),
        *[asked(f"{verb} --help") for verb in verbs],
        *runs(place.root, kinds_of(place)),
        *questions(),
        *[asked(words, f"refused: {words}", verbs[words.split()[0]]) for words in REFUSED],
    ]


# Doing them --------------------------------------------------------------------------------------


def kept_name(name: str) -> str:
    """Return the name of the file that keeps what a line's hash is of."""
    return re.sub(r"[^\w.=,-]+", "_", name)[:120] + f"-{digest(name.encode())[:4]}.txt"


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "root", nargs="?", type=Path, default=Path(__file__).parents[1], help="the repository"
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="how many at a time (default: 2)")
    parser.add_argument("--quick", action="store_true", help=f"one in {EVERY} only")
    parser.add_argument("--only", default="", metavar="TEXT", help="lines whose name contains it")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write the hashed results")
    options = parser.parse_args()
    root = options.root.resolve()
    # A script in the background may ignore it, and then so would the processes started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if options.keep:
        options.keep.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        place = Path(folder).resolve()
        (place / "first").mkdir()
        first = Place(root, place / "first")
        tasks = [one for one in everything(first) if any(options.only in name for name in one.names())]
        tasks = tasks[::EVERY] if options.quick else tasks

        def texts(index: int) -> dict[str, str]:
            """Do a task; return the text of each of its lines."""
            task, where = tasks[index], Place(root, place / f"{index:04d}")
            where.out.mkdir()
            found = task.do(where)
            return {
                name: where.plain(found[line]) for name, line in zip(task.names(), task.lines, strict=True)
            }

        first.call("run", APPROACH, "--no-record", *SHORT)  # compiles, if it has to
        with ThreadPoolExecutor(options.jobs) as pool:
            for lines in pool.map(texts, range(len(tasks))):
                for name, text in lines.items():
                    if options.only not in name:
                        continue
                    print(f"{name:80s} {digest(text.encode())}", flush=True)
                    if options.keep:
                        (options.keep / kept_name(name)).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
