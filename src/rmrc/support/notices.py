"""What a user should hear while it happens: that something takes long, and why.

Nothing is said unless somebody listens, as the command line does.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

# Said by `rmrc.law.jit` when it is so, of what is compiled.
COMPILING = "compiling {} ({}) ..."
KEPT, NOT_KEPT = "once; kept for the next time", "this time and each other time; it cannot be kept"
# Said by verbs that wait for a model, where that takes long.
READING = "reading the model ..."

_listeners: list[Callable[[str, str], None]] = []


def tell(text: str, once: str = "") -> None:
    """Say something to whoever listens now.

    Args:
        text: A line.
        once: What it is about; of that only the first is heard. Default: the line itself.
    """
    for listener in tuple(_listeners):
        listener(text, once or text)


def tell_assumed(notes: Iterable[str]) -> None:
    """Say assumptions, each once."""
    for note in notes:
        tell(f"note: {note}")


@contextmanager
def heard_by(listener: Callable[[str], None]) -> Iterator[None]:
    """Have a function called with what is said, of each matter once.

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
