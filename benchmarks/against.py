"""How long a tick takes here, over how long it takes in another checkout of the program.

    python benchmarks/against.py CHECKOUT [--rounds 40] [--json] [--set KEY=VALUE ...]

Each checkout has a process of its own, which compiles its own law and steps when it is told to. Both take
turns on the same motion, and a second process of the other checkout shows how far equal ones differ. Time is
that of the thread. Each ratio has min, median and max over the rounds, and that of the least times.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
# Arm, site, axes, way there, way back, and how many worlds.
ROWS = [
    (*arm, worlds)
    for arm in (
        ("planar_2link", "tip", "x, y", "0.05, 0.05, 0", "-0.05, -0.05, 0"),
        ("stanford", "wrist", "x, y, z, rx, ry, rz", "0.03, 0.03, 0.03", "-0.03, -0.03, -0.03"),
    )
    for worlds in (1, 16)
]
# What a process does: a line names row and overrides, its answer is a time of the tick of a world [ns].
PROCESS = """
import gc, json, sys, time
from pathlib import Path
import rmrc
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

root, known = Path(rmrc.__file__).parents[2], {}
if root != Path(sys.argv[1]):
    sys.exit(f"{root} is imported in place of {sys.argv[1]}")
gc.disable()
for line in sys.stdin:
    (arm, site, axes, there, back, worlds), overrides = json.loads(line)
    if line not in known:
        text = f'''
name: benchmark
arm: {{model: {root}/models/{arm}.xml, site: {site}}}
task: {{axes: [{axes}]}}
control:
  feedback: 5
  inverse: {{method: damped, damping: {{schedule: smallest_singular_value, maximum: 0.1, below: 0.6}}}}
  nullspace: {{objective: posture}}
target: {{path: [{{line: {{by: [{there}]}}}}, {{line: {{by: [{back}]}}}}]}}
'''
        known[line] = prepare(loads(text, overrides=overrides))
    simulation = Simulation([known[line]] * worlds)
    started = time.thread_time_ns()
    simulation.step()
    print((time.thread_time_ns() - started) / worlds / known[line].reference.ticks, flush=True)
    del simulation
    gc.collect()
"""


class Process:
    """A checkout that steps when it is asked to."""

    def __init__(self, root: Path) -> None:
        """Start it."""
        environment = os.environ | {"PYTHONPATH": str(root / "src")}
        command = [sys.executable, "-c", PROCESS, str(root)]
        pipe = subprocess.PIPE
        self._it = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment)

    def ask(self, row: tuple, overrides: list[str]) -> float:
        """Return the time of a tick of a world [ns]."""
        print(json.dumps([row, overrides]), file=self._it.stdin, flush=True)
        if not (answer := self._it.stdout.readline()):
            sys.exit("a checkout cannot be stepped; see above")
        return float(answer)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of both")
    arguments = parser.parse_args()
    here, other, same = (Process(root.resolve()) for root in (ROOT, *[arguments.checkout] * 2))
    table = {}
    for row in ROWS:
        processes = here, other, same
        for process in processes * 2:  # compiled and warm
            process.ask(row, arguments.set)
        times = [[process.ask(row, arguments.set) for process in processes] for _ in range(arguments.rounds)]
        name = f"{row[0]}, {row[-1]} world{'s' * (row[-1] > 1)}"
        for column, what in ((0, "here"), (2, "the other")):
            ratios = [one[column] / one[1] for one in times]
            least = [min(one[i] for one in times) for i in (column, 1)]
            table[f"{what} / the other, {name}"] = {
                "min": min(ratios), "median": statistics.median(ratios), "max": max(ratios),
                "minima": least[0] / least[1], "ns": least[0],
            }  # fmt: skip
    if arguments.json:
        print(json.dumps(table, indent=2))
        return
    print(f"{'ratio':<44}{'min':>8}{'median':>8}{'max':>8}{'minima':>8}   least, ns a tick")
    for name, row in table.items():
        spread = "".join(f"{row[key]:>8.3f}" for key in ("min", "median", "max", "minima"))
        print(f"{name:<44}{spread}{row['ns']:>19.0f}")


if __name__ == "__main__":
    main()
