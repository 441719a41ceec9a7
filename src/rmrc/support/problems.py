"""The problem of a value: its key, text, origin and owner."""

from typing import NamedTuple

from rmrc.support.text import shortened, visible

Key = tuple[str | int, ...]  # the steps from the root of a scenario to a value


class Origin(NamedTuple):
    """The place where a value was given; all empty for a value given in Python.

    Attributes:
        source: A file, or an option such as `--set control.feedback`.
        line: Line of the file, from 1; 0 for none.
        column: Column of the line, from 1.
        key: The key that the source stands for, which messages do not repeat.
    """

    source: str = ""
    line: int = 0
    column: int = 0
    key: str = ""

    def of(self, name: str) -> str:
        """Return the beginning of messages about a key: source, line, column, and the key unless it is there.

        Args:
            name: The key, by `join`.

        >>> Origin("x.yaml", 7, 13).of("control.feedback")
        'x.yaml:7:13: control.feedback'
        >>> Origin("--set control", key="control").of("control.feedback")
        '--set control: control.feedback'
        >>> Origin("--vary arm.start", key="sweep.vary.arm.start").of("sweep.vary.arm.start[1]")
        '--vary arm.start[1]'
        """
        place = [self.line, self.column] if self.line else []
        where = ":".join([visible(self.source), *map(str, place)])
        rest = name.removeprefix(self.key)
        has_other_name = not self.source.endswith(self.key)
        is_below = name != rest and rest[:1] in ("[", ".") and has_other_name
        if self.key and (name == self.key or is_below):
            return f"{where}{rest}"
        return ": ".join(part for part in (where, name) if part)


class Problem(NamedTuple):
    """One problem; `str()` is the line that reports it.

    Attributes:
        key: Key of the value; () for a problem of the whole.
        text: The requirement, the value and the remedy.
        origin: Place where the value was given, if known.
        who: Name of its scenario among several; "" for the only one, or all.
    """

    key: Key
    text: str
    origin: Origin | None = None
    who: str = ""

    def __str__(self) -> str:
        """Return `WHO: ORIGIN: KEY: TEXT`, without empty parts."""
        place = (self.origin or Origin()).of(join(self.key))
        return visible(": ".join(part for part in (self.who, place, self.text) if part))


def join(key: Key) -> str:
    """Return a key as it is written: `arm.start[1]`."""
    parts = (f"[{step}]" if isinstance(step, int) else f".{shortened(visible(step))}" for step in key)
    return "".join(parts).removeprefix(".")
