"""The classes of inputs, and how many of each are run."""

import hashlib

from . import models, numbers, options, scenarios
from .chance import Chance

GENERATORS = {
    "models": models.generate,
    "scenarios": scenarios.generate,
    "options": options.generate,
    "numbers": numbers.generate,
}

# Which class comes when; over and over. Of 20 inputs, seven are models.
ORDER = ("models", "scenarios", "options") * 5 + ("models", "numbers") * 2 + ("numbers",)


def case(kind, index):
    """Return the input of a class and an index: always the same one."""
    return GENERATORS[kind](Chance(kind, index))


def digest(count):
    """Return a digest of the first inputs of each class."""
    texts = (case(kind, index).text() for kind in GENERATORS for index in range(count))
    return hashlib.sha256("".join(texts).encode()).hexdigest()


def mixed(count):
    """Yield (class, index) of a mix of all classes."""
    counts = dict.fromkeys(ORDER, 0)
    for position in range(count):
        kind = ORDER[position % len(ORDER)]
        yield kind, counts[kind]
        counts[kind] += 1
