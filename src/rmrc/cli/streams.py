"""Stdout and stderr that never raise: not on an encoding, and not after the reader has gone.

A verb finishes its work and writes its files even if its output cannot be printed. It reports the failure at
its end.
"""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO, cast


class _Patient(io.RawIOBase):
    """A stream that ignores failures of the stream behind it, and keeps the first reason."""

    def __init__(self, inner: io.RawIOBase | None) -> None:
        super().__init__()
        self._inner = inner
        self.error: OSError | None = None

    def writable(self) -> bool:
        return True

    def isatty(self) -> bool:
        return self._inner is not None and self._inner.isatty()

    def fileno(self) -> int:
        if self._inner is None:
            raise io.UnsupportedOperation("closed")
        return self._inner.fileno()

    def write(self, data: "memoryview | bytes") -> int:  # type: ignore[override]
        if self.error is None:
            try:
                if self._inner is None:
                    raise OSError(errno.EBADF, "it is closed")
                return self._inner.write(data) or 0
            except OSError as error:
                self.error = error
        return len(data)


class Output:
    """The state of stdout after printing."""

    def __init__(self, stdout: _Patient | None) -> None:
        """Watch a stream; None: its state is unknown."""
        self._stdout = stdout

    @property
    def is_closed(self) -> bool:
        """Whether the reader closed the pipe."""
        return self._error is not None and self._error.errno == errno.EPIPE

    @property
    def problem(self) -> str | None:
        """Why writing failed, apart from a closed pipe."""
        error = self._error
        if error is None or self.is_closed:
            return None
        return (error.strerror or str(error)).lower()

    @property
    def _error(self) -> OSError | None:
        return None if self._stdout is None else self._stdout.error


@contextmanager
def patient() -> Iterator[Output]:
    """Keep printing from raising, whatever the encoding, and with a full disk or a closed pipe.

    Yields:
        The state of stdout, to be read after a flush. Text that stderr cannot take is lost.
    """
    _occupy()
    before = sys.stdout, sys.stderr
    out, stdout = _wrapped(before[0])
    _, stderr = _wrapped(before[1])
    sys.stdout, sys.stderr = stdout, stderr
    try:
        yield Output(out)
    finally:
        for stream in (stdout, stderr):
            stream.flush()
        sys.stdout, sys.stderr = before


def _wrapped(stream: TextIO | None) -> tuple[_Patient | None, TextIO]:
    if stream is None:  # as it is after `>&-`
        inner, encoding, by_line = None, "utf-8", False
    elif isinstance(stream, io.TextIOWrapper):
        stream.flush()
        inner, encoding = getattr(stream.buffer, "raw", stream.buffer), stream.encoding
        by_line = stream.line_buffering or stream.write_through  # the latter as `python -u` asks for
    else:  # a notebook's
        return None, stream
    raw = _Patient(inner)
    return raw, io.TextIOWrapper(
        io.BufferedWriter(cast(io.RawIOBase, raw)),
        encoding=encoding,
        errors="backslashreplace",
        line_buffering=by_line,
    )


def _occupy() -> None:
    """Open the standard streams that are closed; otherwise a recording could take the place of stdout."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
