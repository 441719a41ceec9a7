"""Recordings for rerun and their viewer; pictures and films of runs."""

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def unlogged() -> Iterator[None]:
    """Keep the log of rerun, imported within, from stderr: this package reports failures in one line.

    Rerun reads RUST_LOG only when it is imported; a user who sets that variable gets the log.
    """
    if "RUST_LOG" in os.environ:
        yield
        return
    os.environ["RUST_LOG"] = "off"
    try:
        yield
    finally:
        del os.environ["RUST_LOG"]
