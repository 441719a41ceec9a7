"""Stdout and stderr that take everything: in any encoding, and when nobody listens any more.

A verb has work to finish and files to write, whoever reads what it prints. What could not be printed is told
at its end.
"""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO, cast

from rmrc.support.legible import IN_ASCII


class _Patient(io.RawIOBase):
    """A stream that goes on when what is behind it fails, and keeps the first reason."""

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
    """What became of what was printed."""

    def __init__(self, stdout: _Patient | None) -> None:
        """Watch a stream; None: nothing can be known of it."""
        self._stdout = stdout

    @property
    def is_closed(self) -> bool:
        """Whether a pipe was closed by its reader, who had enough."""
        return self._error is not None and self._error.errno == errno.EPIPE

    @property
    def problem(self) -> str | None:
        """Why something could not be written, but for a closed pipe."""
        error = self._error
        if error is None or self.is_closed:
            return None
        return (error.strerror or str(error)).lower()

    @property
    def _error(self) -> OSError | None:
        return None if self._stdout is None else self._stdout.error


@contextmanager
def patient() -> Iterator[Output]:
    """Let nothing that is printed raise: not an encoding, not a full disk, not a closed pipe.

    Yields:
        What became of stdout, to be looked at after it was flushed. What stderr cannot take is lost: there
        is nobody to tell.
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
        io.BufferedWriter(cast(io.RawIOBase, raw)), encoding=encoding, errors=IN_ASCII, line_buffering=by_line
    )


def _occupy() -> None:
    """Open what is closed of the first three files, or else a recording would be where others write."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
