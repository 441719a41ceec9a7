"""What a process started, and how a test leaves none of it behind."""

import contextlib
import os
import signal
import subprocess
import time
from pathlib import Path

# A program that says on stdout when the first ticks are done, and is the command line otherwise.
TELLS_OF_TICKS = """
from rmrc.cli import main
from rmrc.simulation.world import World

advance = World.advance

def tell(world, ticks):
    advance(world, ticks)
    World.advance = advance
    print("moves", flush=True)

World.advance = tell
main()
"""


def descendants(pid):
    """Processes that a process started, and what those started; zombies left out."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # ended in the meantime
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
            if state != "Z":
                parents[int(stat.parent.name)] = int(parent)
    found = [pid]
    for one in found:
        found += [child for child, parent in parents.items() if parent == one]
    return found[1:]


@contextlib.contextmanager
def started(command, **options):
    """Start a process, and kill it with all that it started at the end."""
    process = subprocess.Popen(command, **options)
    try:
        yield process
    finally:
        for one in [*descendants(process.pid), process.pid]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
        process.wait()
        for pipe in (process.stdout, process.stderr):
            if pipe:
                pipe.close()


def wait_for(condition, seconds=30.0):
    """Return what a condition gives as soon as it holds."""
    until = time.monotonic() + seconds
    while True:
        found = condition()
        if found:
            return found
        if time.monotonic() > until:
            raise AssertionError(f"not within {seconds} s")
        time.sleep(0.05)
