"""Ctrl-C as an event, so that nothing is torn out of a block or of a file that is being written."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interruptible() -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C sets."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():  # Ctrl-C is not ours to handle
        yield stop
        return
    previous = signal.signal(signal.SIGINT, lambda *_: stop.set())
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, previous)
