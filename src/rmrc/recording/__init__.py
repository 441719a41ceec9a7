"""Recordings for rerun, written during a run, and their viewer."""

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def unlogged() -> Iterator[None]:
    """Have rerun, which is imported within, keep its log from stderr: what fails is a line of ours.

    It reads RUST_LOG when it is imported, and never again; who sets that wants the log.
    """
    if "RUST_LOG" in os.environ:
        yield
        return
    os.environ["RUST_LOG"] = "off"
    try:
        yield
    finally:
        del os.environ["RUST_LOG"]
