"""Runs inputs in processes of their own as the command line would, and judges what came of them."""

import contextlib
import io
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import threading
import traceback
import warnings
from pathlib import Path
from typing import NamedTuple

from project import ROOT

from . import inputs

# Of docs/commands.md, and 128 + the number of a signal that stops a run.
DOCUMENTED = {0, 1, 2, 3, 129, 130, 141, 143}
# Seconds that an input may take, the compiling of its first one included; then Ctrl-C, and seconds to end.
SECONDS, GRACE = 120.0, 10.0
# After so many inputs a process is replaced, so that what it holds on to is bounded.
RENEWED = 2000
# What tells a program that it may draw, or use colors.
SCREEN = ("DISPLAY", "WAYLAND_DISPLAY", "FORCE_COLOR", "TTY_COMPATIBLE")
# Bytes of address space beside what a worker begins with.
MEMORY = 8 * 2**30

CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
NAN = re.compile(r"(?<![\w.-])[-+]?nan(?![\w.-])", re.IGNORECASE)
TRACE = re.compile(r"^Traceback \(most|^Exception (ignored|in thread)|Fatal Python error", re.MULTILINE)
NUMPY = re.compile(r"^.*encountered in .*$", re.MULTILINE)
UNFINISHED = re.compile(r"/\.[^/]*-[0-9a-f]{16}[^/]*$|\.part$|\.tmp$|^tmp/.")


class Answer(NamedTuple):
    """An input's class and index, its exit code, its faults as (in a word, what exactly), and its output."""

    name: str
    index: object
    code: str
    faults: list
    out: str = ""
    err: str = ""


class Outcome(NamedTuple):
    """What came of an input: exit code, traceback of an exception that came out, output, warnings, new files."""

    code: object
    error: str
    out: str
    err: str
    warned: list
    files: set


def around(match):
    """Return a match with what stands beside it."""
    return match.string[max(0, match.start() - 60) : match.end() + 60]


def judge(case, outcome):
    """Yield (what is wrong in a word, what exactly)."""
    text = outcome.err + outcome.out
    if outcome.error or outcome.code == 70 or TRACE.search(text):
        yield "traceback", (outcome.error or text).strip()[-400:]
    elif "not enough memory" in outcome.err:
        yield "memory", outcome.err[-300:]
    elif outcome.code not in DOCUMENTED:
        yield "exit code", repr(outcome.code)
    elif outcome.code and not text.strip():
        yield "silence", f"exit code {outcome.code}"
    for match in filter(None, (CONTROL.search(outcome.out), CONTROL.search(outcome.err))):
        yield "control", f"U+{ord(match[0]):04X}: {around(match)!r}"
    for line in [*outcome.warned, *(match[0] for match in NUMPY.finditer(outcome.err))][:1]:
        yield "warning", line
    yield from _stray(case, outcome)
    if outcome.code == 0 and not {"--help", "--version"} & {*case.argv}:
        yield from _undefined(case, outcome)


def _stray(case, outcome):
    """Yield the first file that is left over, or where none may be."""
    allowed = {"here/recordings", *(os.path.normpath(f"here/{word}") for word in case.argv)}
    allowed |= {f"here/{word.partition('=')[2]}" for word in case.argv}
    allowed |= {f"here/{Path(word).stem}.yaml" for word in case.argv[:2] if case.argv[0] == "new"}
    for path in sorted(outcome.files):
        parents = {path, *map(str, Path(path).parents)}
        if UNFINISHED.search(path) or not (
            parents & allowed or any(place.startswith(f"{path}/") for place in allowed)
        ):
            yield "file", path
            return


def _undefined(case, outcome):
    """Yield numbers that are none, of a command that says that all went well."""
    if "--json" in case.argv:
        try:
            json.loads(outcome.out, parse_constant=lambda name: name + 0)
        except (ValueError, TypeError) as error:
            yield "nan", f"no strict JSON: {error}"
    elif not any(b"nan" in data.lower() for data in case.files.values()):
        for match in NAN.finditer(outcome.out):
            yield "nan", around(match)


class Sandbox:
    """A folder with copies of the models and scenarios, and an empty one in which commands are called."""

    def __init__(self, folder):
        from rmrc import cli  # once the environment is as it shall be

        self.folder, self.main = Path(folder), cli.main
        self._make()

    def _make(self):
        for name in ("models", "scenarios"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
            shutil.copytree(ROOT / name, self.folder / name)
        for name in ("here", "tmp"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
            (self.folder / name).mkdir()

    def _state(self):
        """Return the time of change of each file, and 0 for a folder."""
        return {
            str(path.relative_to(self.folder)): 0 if path.is_dir() else path.lstat().st_mtime_ns
            for path in self.folder.rglob("*")
        }

    def run(self, case):
        """Return what came of an input; fds 1 and 2 of this process are files."""
        for path, data in case.files.items():
            place = self.folder / path
            (place if path.endswith("/") else place.parent).mkdir(parents=True, exist_ok=True)
            if not path.endswith("/"):
                place.write_bytes(data)
        before = self._state()
        os.chdir(self.folder / "here")
        os.environ |= {"COLUMNS": case.columns, "LINES": "24", "TMPDIR": str(self.folder / "tmp")}
        tempfile.tempdir = None
        for number in (1, 2):
            os.ftruncate(number, 0)
        sys.argv, sys.stdin = ["rmrc", *case.argv], io.StringIO()
        sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False), case.encoding)
        sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", closefd=False), case.encoding, "backslashreplace")
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            for category in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
                warnings.simplefilter("ignore", category)
            code, error = self._call()
        texts = (
            Path(f"/proc/self/fd/{number}").read_bytes()[: 2**22].decode(case.encoding, "replace")
            for number in (1, 2)
        )
        after = self._state()
        changed = {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)}
        outcome = Outcome(
            code, error, *texts, [f"{each.category.__name__}: {each.message}" for each in seen], changed
        )
        os.chdir(self.folder)
        self._make()
        return outcome

    def _call(self):
        """Return the exit code, and the traceback of what is none."""
        code, error = None, ""
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            self.main()
        except SystemExit as end:
            code = end.code or 0
        except BaseException:  # whatever it is, a user would see it
            error = traceback.format_exc()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except Exception:
                error = error or traceback.format_exc()
            with contextlib.suppress(Exception):
                stream.detach()
        return code, error


def serve(pipe, folder):
    """Answer a class and an index of an input with its exit code, faults and output, until the pipe is closed."""
    for name in SCREEN:
        os.environ.pop(name, None)
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(f"{folder}.{name}", os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND), number)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # but while an input runs
    sandbox = Sandbox(folder)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY,) * 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**30, 2**30))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(EOFError):
        while True:
            case = inputs.case(*pipe.recv())
            outcome = sandbox.run(case)
            pipe.send((str(outcome.code), list(judge(case, outcome)), outcome.out, outcome.err))


def started(folder):
    """Return a process that serves, and our end of its pipe."""
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs, tempfile.mkdtemp(dir=folder)), daemon=True)
    process.start()
    theirs.close()
    return process, pipe


def ask(process, pipe, name, index):
    """Return what came of an input; a process that hangs is ended by Ctrl-C, or killed."""
    fault = "death"
    with contextlib.suppress(EOFError, OSError):
        pipe.send((name, index))
        if not pipe.poll(SECONDS):
            os.kill(process.pid, signal.SIGINT)
            fault = "death" if pipe.poll(GRACE) else "hang"
        if fault == "death":
            return Answer(name, index, *pipe.recv())
    process.kill()
    process.join()
    return Answer(name, index, "", [(fault, f"within {SECONDS:g} s; exit code {process.exitcode}")])


def answers(names, jobs=1):
    """Return what came of inputs, each a class and an index, by so many processes at a time."""
    collected, names, lock = [], iter(names), threading.Lock()

    def work(folder):
        process, count = None, 0
        while True:
            with lock:
                name = next(names, None)
            if process and (name is None or count % RENEWED == 0 or not process.is_alive()):
                process.kill()
                process = None
            if name is None:
                return
            if process is None:
                process, pipe = started(folder)
            collected.append(ask(process, pipe, *name))
            count += 1

    with tempfile.TemporaryDirectory(prefix="rmrc-fuzz-") as folder:
        threads = [threading.Thread(target=work, args=(folder,)) for _ in range(jobs)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return collected
