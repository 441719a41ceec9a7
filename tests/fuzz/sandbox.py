"""Runs an input in this process, as the command line would, and keeps all that came of it."""

import contextlib
import io
import os
import shutil
import signal
import sys
import time
import traceback
import warnings
from dataclasses import dataclass, field
from pathlib import Path

from .case import HERE
from .shipped import ROOT

# More of what a command prints is not kept.
MOST_OUTPUT = 2**22


@dataclass
class Outcome:
    """What came of an input.

    Attributes:
        code: Exit code; None if an exception came out instead.
        error: Traceback of that exception, or of the one that made it an exit.
        out: Bytes on stdout, those of libraries in C included.
        err: Bytes on stderr.
        warnings: Python warnings that reached the user, one line each.
        files: Paths of new files below the sandbox, with the folder that is not theirs for temporary files.
        gone: Paths of shipped files or of the input that were changed or removed.
        seconds: Of the wall clock.
        cpu: Seconds of processors.
    """

    code: object = None
    error: str = ""
    out: bytes = b""
    err: bytes = b""
    warnings: list = field(default_factory=list)
    files: list = field(default_factory=list)
    gone: list = field(default_factory=list)
    seconds: float = 0.0
    cpu: float = 0.0


class Sandbox:
    """A folder with the shipped models and scenarios, and with an empty one to call the command line in."""

    def __init__(self, folder, main):
        """Make the folder.

        Args:
            folder: A path; what is there already is removed.
            main: The command line: reads `sys.argv` and ends with SystemExit.
        """
        self.root, self._main = Path(folder), main
        shutil.rmtree(self.root, ignore_errors=True)
        for name in (HERE, "tmp"):
            (self.root / name).mkdir(parents=True)
        self._restore()
        self._out, self._err = self.root.with_suffix(".stdout"), self.root.with_suffix(".stderr")
        self._terminal = [os.dup(1), os.dup(2)]

    def run(self, case):
        """Run an input; the folder then has what it left, until `clean`."""
        for path, data in case.files.items():
            place = self.root / path
            if path.endswith("/"):
                place.mkdir(parents=True, exist_ok=True)
            else:
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(data)
        self._before = self._state()
        outcome = Outcome()
        with self._around(case, outcome):
            started, cpu = time.perf_counter(), time.process_time()
            try:
                self._main()
                outcome.code = "returned"
            except SystemExit as end:
                outcome.code = 0 if end.code is None else end.code
            except BaseException:  # whatever it is, a user would see it
                outcome.error = traceback.format_exc()
            outcome.seconds, outcome.cpu = time.perf_counter() - started, time.process_time() - cpu
        outcome.out, outcome.err = (self._read(path) for path in (self._out, self._err))
        after = self._state()
        outcome.files = sorted(set(after) - set(self._before))
        outcome.gone = sorted(path for path, state in self._before.items() if after.get(path) != state)
        return outcome

    def clean(self):
        """Remove all that an input and its run left."""
        os.chdir(self.root)
        for name in (HERE, "tmp"):
            shutil.rmtree(self.root / name, ignore_errors=True)
            (self.root / name).mkdir(exist_ok=True)
        for path in set(self._state()) - set(self._shipped):
            place = self.root / path
            shutil.rmtree(place) if place.is_dir() and not place.is_symlink() else place.unlink(
                missing_ok=True
            )
        if self._state() != self._shipped:
            self._restore()

    def _restore(self):
        """Copy what is shipped anew."""
        for name in ("models", "scenarios"):
            shutil.rmtree(self.root / name, ignore_errors=True)
            shutil.copytree(ROOT / name, self.root / name)
        self._shipped = self._state()

    def _state(self):
        """Return size and time of change of every file below, a folder's as None."""
        found = {}
        for folder, folders, files in os.walk(self.root):
            below = os.path.relpath(folder, self.root)
            for name in folders:
                found[os.path.normpath(os.path.join(below, name))] = None
            for name in files:
                status = os.lstat(os.path.join(folder, name))
                found[os.path.normpath(os.path.join(below, name))] = (status.st_size, status.st_mtime_ns)
        return found

    @contextlib.contextmanager
    def _around(self, case, outcome):
        """Set up what a process has of its own: arguments, folder, environment, streams, warnings."""
        streams, argv, environment, folder = (
            (sys.stdin, sys.stdout, sys.stderr),
            sys.argv,
            dict(os.environ),
            os.getcwd(),
        )
        os.environ |= {"COLUMNS": case.columns, "TMPDIR": str(self.root / "tmp"), "LINES": "24"}
        for name in ("DISPLAY", "WAYLAND_DISPLAY", "FORCE_COLOR", "TTY_COMPATIBLE"):
            os.environ.pop(name, None)
        sys.argv = ["rmrc", *case.argv]
        os.chdir(self.root / HERE)
        for number, path in ((1, self._out), (2, self._err)):
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
            os.dup2(file, number)
            os.close(file)
        sys.stdin = io.StringIO()
        # As Python opens them where no terminal is.
        sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False), case.encoding, "strict")
        sys.stderr = io.TextIOWrapper(
            os.fdopen(2, "wb", closefd=False), case.encoding, "backslashreplace", line_buffering=True
        )
        try:
            with warnings.catch_warnings():
                warnings.resetwarnings()  # what Python ignores by itself is of no concern to a user either
                warnings.simplefilter("always")
                for kind in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
                    warnings.simplefilter("ignore", kind)
                warnings.showwarning = _note(outcome.warnings)
                deaf = signal.signal(signal.SIGINT, signal.default_int_handler)
                try:
                    yield
                finally:
                    signal.signal(signal.SIGINT, deaf)
                for stream in (sys.stdout, sys.stderr):
                    try:
                        stream.flush()
                    except Exception:
                        outcome.error = outcome.error or traceback.format_exc()
        finally:
            sys.stdin.close()
            for stream in (sys.stdout, sys.stderr):
                with contextlib.suppress(Exception):
                    stream.detach()
            sys.stdin, sys.stdout, sys.stderr = streams
            sys.argv = argv
            os.chdir(folder)
            os.environ.clear()
            os.environ.update(environment)
            for number, terminal in zip((1, 2), self._terminal, strict=True):
                os.dup2(terminal, number)

    def _read(self, path):
        with open(path, "rb") as file:
            return file.read(MOST_OUTPUT)


def _note(kept):
    def show(message, category, filename, lineno, file=None, line=None):  # noqa: ARG001
        kept.append(f"{category.__name__}: {message} ({os.path.basename(filename)}:{lineno})")

    return show
