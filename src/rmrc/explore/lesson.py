"""Lessons: a prepared scene with questions, what to try, and the number to find."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Lesson:
    """What the reader of the page is asked.

    Attributes:
        markdown: As the page shows it.
    """

    markdown: str
