"""Watches workers: hands them inputs, and counts those that hang, take all memory or kill them."""

import contextlib
import itertools
import json
import os
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from .judge import Finding, signature

TESTS = Path(__file__).resolve().parents[1]

# After so many inputs a worker is replaced, so that what it holds on to is bounded.
RENEWED = 3000
# A worker is idle and yet so large [bytes]: it is replaced as well.
LARGE = 3 * 2**29
# How often the workers are looked at [s].
LOOK = 0.05


@dataclass(frozen=True)
class Bounds:
    """What an input may take.

    Attributes:
        seconds: Of the wall clock, if a processor was free for most of them; three times as long else.
        grace: Seconds to end after Ctrl-C, which a run that is merely long then gets.
        memory: Bytes that are resident.
        addresses: Bytes of address space beside what the imports took; 0: any number.
    """

    seconds: float = 20.0
    grace: float = 3.0
    memory: int = 4 * 2**30
    addresses: int = 4 * 2**30


@dataclass
class Failure:
    """An input and what is wrong with what came of it."""

    kind: str
    index: object
    finding: Finding


@dataclass
class Result:
    """What came of all inputs.

    Attributes:
        counts: Inputs that were run, by class.
        codes: Exit codes, by class.
        cpu: Seconds of processors, by class.
        long: How many ran on, told how far they were, and ended at Ctrl-C, by class: no failures.
        failures: In the order in which they were seen.
        seconds: Of the wall clock.
    """

    counts: Counter = field(default_factory=Counter)
    codes: dict = field(default_factory=dict)
    cpu: Counter = field(default_factory=Counter)
    long: Counter = field(default_factory=Counter)
    failures: list = field(default_factory=list)
    seconds: float = 0.0

    def kinds(self):
        """Return how many inputs have findings of each kind."""
        return Counter(
            kind for kind, _, _ in {(one.finding.kind, one.kind, one.index) for one in self.failures}
        )

    def causes(self):
        """Return failures by what seems to be one cause, the most frequent first."""
        found = {}
        for failure in self.failures:
            found.setdefault(signature(failure.finding), []).append(failure)
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))


class Worker:
    """A process that runs inputs."""

    def __init__(self, folder, bounds, plant, prepares, warms_up):
        self._folder, self._bounds = folder, bounds
        code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from fuzz.worker import main; main(*sys.argv[1:])"
        readies = ("warm" if warms_up else "imported") if prepares else ""
        arguments = [str(TESTS), str(folder), plant, str(bounds.addresses), readies]
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "ARROW")}
        with open(f"{folder}.words", "wb") as words:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code, *arguments],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words, start_new_session=True,
                env={**os.environ, **threads, "PYTHONHASHSEED": "0"},
            )  # fmt: skip
        self.input, self.done, self.is_ready = None, 0, False
        self._since, self._cpu, self.asked, self.stack = time.monotonic(), 0.0, None, ""

    def take(self, kind, index):
        """Hand over an input."""
        self.input, self.asked = (kind, index), None
        self._since, self._cpu = time.monotonic(), self._used()
        with contextlib.suppress(BrokenPipeError):  # it is dead, as the next look tells
            self.process.stdin.write(json.dumps([kind, index]).encode() + b"\n")
            self.process.stdin.flush()

    def trouble(self):
        """Return what is wrong with it right now, or None."""
        if not self.is_ready:
            return None  # it imports, and perhaps compiles
        if self.input is None:
            return None
        resident = self._resident()
        if resident > self._bounds.memory:
            return Finding("memory", f"{resident / 2**30:.2f} GiB are resident; {self._stack()}")
        if self.asked is not None:
            return self.hang() if time.monotonic() - self.asked > self._bounds.grace else None
        seconds, most = time.monotonic() - self._since, self._bounds.seconds
        if seconds > most and (self._used() - self._cpu > 0.7 * most or seconds > 3 * most or self._sleeps()):
            self.stack, self.asked = self._stack(), time.monotonic()
            os.kill(self.process.pid, signal.SIGINT)
        return None

    def hang(self):
        """Return the finding of an input that took too long."""
        return Finding("hang", f"over {self._bounds.seconds:g} s; {self.stack}")

    def is_worn(self):
        return self.done >= RENEWED or self._resident() > LARGE

    def end(self, patience=0.0):
        """End it, and whatever it started; return its exit status, or the signal that it died of, negative."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(patience)  # of one that is about to be dead
        dead = self.process.poll()
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
        self.process.stdout.close()
        status = self.process.wait()
        return status if dead is None else dead

    def last_words(self):
        """Return what it left when it died: the innermost of its lines, or what it said on stderr."""
        for suffix, part in ((".trace", slice(6)), (".words", slice(-3, None))):
            path = Path(f"{self._folder}{suffix}")
            lines = path.read_text("utf-8", "replace").strip().splitlines() if path.exists() else []
            if lines:
                return " > ".join(line.strip() for line in lines[part])[:1000]
        return "without a word"

    def _sleeps(self):
        """Return whether it waits for something and has done nothing so far: no other process is to blame."""
        try:
            return self._proc("stat").rpartition(")")[2].split()[0] in "SD" and self._used() - self._cpu < 1.0
        except OSError:
            return False

    def _resident(self):
        try:
            return int(self._proc("statm").split()[1]) * os.sysconf("SC_PAGE_SIZE")
        except (OSError, IndexError):
            return 0

    def _used(self):
        """Return the seconds of processors that it used so far."""
        try:
            fields = self._proc("stat").rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK") if len(fields) > 12 else 0.0

    def _proc(self, name):
        return Path(f"/proc/{self.process.pid}/{name}").read_text("utf-8", "replace")

    def _stack(self):
        """Return where it is, from our outermost line inwards."""
        trace = Path(f"{self._folder}.trace")
        before = trace.stat().st_size
        os.kill(self.process.pid, signal.SIGUSR1)
        sizes = [before]
        for _ in range(15):  # until it has begun to write, and has written no more for a while
            time.sleep(0.02)
            sizes.append(trace.stat().st_size)
            if before < sizes[-1] == sizes[-2]:
                break
        lines = trace.read_text("utf-8", "replace")[before:].splitlines()
        own = [line.strip() for line in lines if "/rmrc/" in line or "/planted.py" in line]
        names = [line.split("/")[-1].replace('"', "") for line in reversed(own)]
        return " > ".join(names[-4:]) or "nowhere of ours"


def supervise(inputs, jobs=1, bounds=None, plant="", until=None, on_input=None, *, prepares=True):
    """Run inputs in worker processes and return what came of them.

    Args:
        inputs: (class, index) of each.
        jobs: How many workers there are.
        bounds: What an input may take.
        plant: A module with another command line, see `fuzz.planted`.
        until: `time.monotonic()` after which no input is begun; None: any time.
        on_input: Called after each input with the result so far.
        prepares: Whether workers import and compile before their first input what any input may need; each input
            imports and compiles what it needs else, which is cheaper for few, but counts as its own.
    """
    waiting, result, started = iter(inputs), Result(), time.monotonic()
    folder = Path(tempfile.mkdtemp(prefix="rmrc-fuzz-"))
    names = (folder / f"worker-{number}" for number in itertools.count())
    bounds = bounds or Bounds()
    crew = _Crew(lambda warms_up: Worker(next(names), bounds, plant, prepares, warms_up), result)
    try:
        crew.run(waiting, jobs, until, on_input or (lambda _: None))
    finally:
        crew.end()
        shutil.rmtree(folder, ignore_errors=True)
    result.seconds = time.monotonic() - started
    return result


class _Crew:
    """Workers, and the inputs that they are at."""

    def __init__(self, start, result):
        self._start, self._result = start, result
        self._workers, self._selector = [], selectors.DefaultSelector()
        self._is_warm = False

    def run(self, waiting, jobs, until, on_input):
        """Hand out inputs until there are no more, and wait for those that are under way."""
        following = next(waiting, None)
        while following is not None or self._workers:
            while following is not None and len(self._workers) < (jobs if self._is_warm else 1):
                self._add()
            for key, _ in self._selector.select(LOOK):
                if self._hear(key.data):
                    on_input(self._result)
            for worker in list(self._workers):
                trouble = worker.trouble()
                if trouble is not None:
                    self._note(worker, "killed", 0.0, [trouble])
                    self._remove(worker)
                    on_input(self._result)
                elif worker.is_ready and worker.input is None:
                    if until is not None and time.monotonic() > until:
                        following = None
                    if following is None or worker.is_worn():
                        self._remove(worker)
                    else:
                        worker.take(*following)
                        following = next(waiting, None)

    def end(self):
        """End all workers."""
        for worker in list(self._workers):
            self._remove(worker)
        self._selector.close()

    def _hear(self, worker):
        """Take what a worker says; return whether it was about an input."""
        line = worker.process.stdout.readline()
        if not line:
            status = self._remove(worker, patience=5.0)
            if worker.input is None:
                raise RuntimeError(
                    f"a worker ended with {status} before its first input: {worker.last_words()}"
                )
            name = signal.Signals(-status).name if status < 0 else f"exit status {status}"
            self._note(worker, "died", 0.0, [Finding("death", f"{name}; {worker.last_words()}")])
            return True
        if not worker.is_ready:
            worker.is_ready = self._is_warm = True
            return False
        answer = json.loads(line)
        findings = [Finding(*one) for one in answer["findings"]]
        if worker.asked is not None and answer["stopped"]:
            self._result.long[worker.input[0]] += 1
        elif worker.asked is not None:
            findings = [worker.hang()]
        self._note(worker, answer["code"], answer["cpu"], findings)
        # A library that ran out of memory, or was left in the middle, may not be itself any more.
        shaken = any(kind in ("memory", "traceback") for kind, _ in answer["findings"])
        worker.input, worker.done = None, RENEWED if shaken else worker.done + 1
        return True

    def _note(self, worker, code, cpu, findings):
        kind, index = worker.input
        self._result.counts[kind] += 1
        self._result.cpu[kind] += cpu
        self._result.codes.setdefault(kind, Counter())[str(code)] += 1
        self._result.failures += [Failure(kind, index, finding) for finding in findings]

    def _add(self):
        worker = self._start(not self._is_warm)  # what one compiles, the others find
        self._workers.append(worker)
        self._selector.register(worker.process.stdout, selectors.EVENT_READ, worker)

    def _remove(self, worker, patience=0.0):
        self._workers.remove(worker)
        self._selector.unregister(worker.process.stdout)
        return worker.end(patience)
