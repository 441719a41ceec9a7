"""Notices to a user during the work: that something takes long, and why.

Nothing is reported without a listener, such as the command line.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

# Sent by `rmrc.law.compiling` while it compiles, with the name of the compiled part.
COMPILING = "compiling {} ({}) ..."
KEPT, NOT_KEPT = "once; kept for the next time", "this time and each other time; it cannot be kept"

_listeners: list[Callable[[str, str], None]] = []


def tell(text: str, once: str = "") -> None:
    """Send a notice to the present listener.

    Args:
        text: A line.
        once: Its subject; only the first notice about it is heard. Default: the line itself.
    """
    for listener in tuple(_listeners):
        listener(text, once or text)


def tell_assumed(notes: Iterable[str]) -> None:
    """Send assumptions, each once: `rmrc.arm.frames` has notes that are warnings."""
    for note in notes:
        tell(f"{getattr(note, 'level', 'note')}: {note}")


@contextmanager
def heard_by(listener: Callable[[str], None]) -> Iterator[None]:
    """Have a function called with the notices, once for each subject.

    Args:
        listener: Called with a line; threads may call it.
    """
    said = set[str]()

    def once(text: str, about: str) -> None:
        if about not in said:
            said.add(about)
            listener(text)

    _listeners.append(once)
    try:
        yield
    finally:
        _listeners.remove(once)
