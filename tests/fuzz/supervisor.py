"""Hands inputs to worker processes, and sees those that hang or die."""

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import NamedTuple

TESTS = Path(__file__).resolve().parents[1]
# Seconds that an input may take, the compiling of its first one included; then Ctrl-C, and seconds to end.
SECONDS, GRACE = 120.0, 10.0
# What tells a program that it may draw, or use colors.
SCREEN = ("DISPLAY", "WAYLAND_DISPLAY", "FORCE_COLOR", "TTY_COMPATIBLE")
# After so many inputs a worker is replaced, so that what it holds on to is bounded.
RENEWED = 2000


class Answer(NamedTuple):
    """An input's class and index, its exit code, its faults as (in a word, what exactly), and its output."""

    name: str
    index: object
    code: str
    faults: list
    out: str = ""
    err: str = ""


class Worker:
    """A process that runs inputs."""

    def __init__(self, folder, module):
        path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {name: value for name, value in os.environ.items() if name not in SCREEN}
        self.folder, self.count = Path(tempfile.mkdtemp(dir=folder)), 0
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fuzz.worker", self.folder, module], env={**environment, "PYTHONPATH": path},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0,
        )  # fmt: skip

    def ask(self, name, index, seconds):
        """Return what came of an input; a worker without `process.returncode` can run more."""
        self.count += 1
        with contextlib.suppress(BrokenPipeError):  # a worker that is dead is seen below
            self.process.stdin.write(json.dumps([name, index]).encode() + b"\n")
        if not self._answers(seconds):
            self.process.send_signal(signal.SIGINT)
            if not self._answers(GRACE):
                self.close()
                return Answer(name, index, "", [("hang", f"{seconds:g} s, and not ended by Ctrl-C")])
        line = self.process.stdout.readline()
        while line and not line.endswith(b"\n"):
            line += self.process.stdout.readline()
        if line:
            return Answer(name, index, *json.loads(line))
        self.process.wait()
        said = Path(f"{self.folder}.stderr").read_text("utf-8", "replace")
        return Answer(name, index, "", [("death", f"{self.process.returncode}: {said[-300:]}")])

    def _answers(self, seconds):
        return bool(select.select([self.process.stdout], [], [], seconds)[0])

    def close(self):
        """End the process."""
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


def answers(names, jobs=1, seconds=SECONDS, module="rmrc.cli"):
    """Return what came of inputs.

    Args:
        names: Class and index of each.
        jobs: Number of worker processes.
        seconds: That an input may take before Ctrl-C.
        module: The module whose `main` is the command line.
    """
    collected, names, lock = [], iter(names), threading.Lock()

    def work(folder):
        worker = None
        while True:
            with lock:
                name = next(names, None)
            if worker and (name is None or worker.process.returncode is not None or worker.count >= RENEWED):
                worker.close()
                worker = None
            if name is None:
                return
            worker = worker or Worker(folder, module)
            collected.append(worker.ask(*name, seconds))

    with tempfile.TemporaryDirectory(prefix="rmrc-fuzz-") as folder:
        threads = [threading.Thread(target=work, args=(folder,)) for _ in range(jobs)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return collected
