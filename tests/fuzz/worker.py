"""Runs inputs one after the other in this process, and says what it found; started by the supervisor."""

import contextlib
import faulthandler
import functools
import importlib
import json
import os
import resource
import signal
import sys
from pathlib import Path

from . import case as cases
from .judge import judge, was_stopped
from .sandbox import Sandbox

# A file that grows beyond this is an error of its writer.
LARGEST_FILE = 2**30

# What needs all that is ever compiled; other verbs need no more.
SHORT = ("--set", "target.path=[{hold: {for: 0.01}}]")
WARMING = tuple(
    (*line.split(), *(SHORT if "scenarios" in line else ()))
    for line in (
        "run ../scenarios/null_space.yaml",
        "compare ../scenarios/null_space.yaml --no-record --vary control.feedback=1,2",
        "ik ../models/planar_2link.xml --to 1,1",
        "ik ../models/torus_3r.xml --to-q 0.1,0.2,0.3 --all",
        "workspace ../models/planar_2link.xml --cells 10",
    )
)


def main(folder, plant, memory, ready):
    """Read names of inputs on stdin, a JSON list each; write what came of each on stdout.

    Args:
        folder: Where to work; its name with `.trace` takes the Python stacks on SIGUSR1.
        plant: Module of a command line to run instead of rmrc's, and of its class `planted`; "" for none.
        memory: Bytes of address space that inputs may take beside what the imports took; "0" for any number.
        ready: What to do before the first input: "imported" to import all that any may need, "warm" to compile it as well; "" for nothing.
    """
    tell = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    hear = os.fdopen(os.dup(0), encoding="utf-8")
    with open(os.devnull, "r+b") as nothing:
        for number in (0, 1):
            os.dup2(nothing.fileno(), number)
    trace = Path(f"{folder}.trace").open("w", encoding="utf-8")  # noqa: SIM115, as it stays open
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # but while an input runs
    faulthandler.enable(trace)
    faulthandler.register(signal.SIGUSR1, trace, all_threads=True)
    generate, command_line = _planted(plant) if plant else _ours(ready)
    sandbox = Sandbox(folder, command_line)
    if ready == "warm" and not plant:
        _warm_up(sandbox)
    _bound(int(memory))
    print("ready", file=tell)
    for line in hear:
        kind, index = json.loads(line)
        # Frozen inputs come as their path.
        case = cases.read(Path(index).read_text("utf-8")) if kind == "file" else generate(kind, index)
        outcome = sandbox.run(case)
        found = judge(case, outcome, sandbox.root)
        sandbox.clean()
        code = outcome.code if isinstance(outcome.code, int) else str(outcome.code)
        said = {"code": code, "cpu": outcome.cpu, "findings": found, "stopped": was_stopped(outcome)}
        print(json.dumps(said), file=tell)


def _ours(ready):
    """Return the generators and the command line; import before all that a verb may import, if asked to."""
    from rmrc import cli

    for name in _modules() if ready else ():
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    _remember_what_never_changes()
    from .classes import case

    return case, cli.main


def _warm_up(sandbox):
    for argv in WARMING:
        outcome = sandbox.run(cases.Case(argv))
        sandbox.clean()
        if outcome.code not in (0, 1):
            raise RuntimeError(f"{argv}: {outcome.code} {outcome.error} {outcome.err.decode()}")


def _modules():
    """Return the modules of rmrc, so that no input waits for an import or has its memory counted."""
    import rmrc

    package = Path(rmrc.__file__).parent
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        if parts[-1] not in ("__init__", "__main__"):
            yield ".".join(("rmrc", *parts))


def _remember_what_never_changes():
    """Keep what libraries find out anew at each call of the command line: its own parser.

    Nothing of rmrc is remembered, so that what an input leaves behind shows in the next.
    """
    import typer.main

    typer.main.get_command = functools.cache(typer.main.get_command)


def _planted(name):
    module = importlib.import_module(name)
    return module.case, module.main


def _bound(memory):
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    if memory:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


if __name__ == "__main__":
    main(*sys.argv[1:])
