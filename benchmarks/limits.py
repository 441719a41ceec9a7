"""What a limit policy costs where limits act, as ratios of whole runs to those with `scale`.

    python benchmarks/limits.py [--rounds 7] [--json]

The scenarios pass a singularity with little damping, so that a rate limit acts at many ticks. The whole tick
counts, physics included. Policies take turns; of each ratio min, median and max over the rounds.
"""

import time

from measure import ROOT, Rows, options, show, spread

from rmrc.scenario import load
from rmrc.scenario.choices import LIMITS
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

HURRIED = ("control.inverse.damping={schedule: constant, maximum: 0.005}", "control.limits.rate=0.5")
CASES = {
    "2 joints": ("approach_singularity", HURRIED),
    "3 joints for 2 rows": ("joint_limit", ("control.limits.rate=0.2",)),
    "6 joints": ("stanford_wrist", HURRIED),
    "7 joints": ("xarm7_wrist", HURRIED),
}
DIRECTED = "optimal, direction kept"
POLICIES = (*LIMITS.names, DIRECTED)


def main() -> None:
    """Measure and print."""
    arguments = options(__doc__, 7).parse_args()
    table: Rows = {}
    for name, (scenario, overrides) in CASES.items():
        times: dict[str, list[float]] = {policy: [] for policy in POLICIES}
        shares: dict[str, float] = {}
        for _ in range(arguments.rounds + 1):  # the first loads the machine code
            for policy in POLICIES:
                keep = f"control.limits.keep_direction={str(policy == DIRECTED).lower()}"
                chosen = f"control.limits.on_excess={policy.partition(',')[0]}"
                world = prepare(load(ROOT / f"scenarios/{scenario}.yaml", [*overrides, chosen, keep]))
                simulation = Simulation([world])
                begin = time.thread_time()
                (run,) = simulation.run()
                times[policy].append(time.thread_time() - begin)
                shares[policy] = float(((run["status"] & 28) > 0).mean())  # rate, acceleration, position
        for policy in POLICIES:
            found = spread([*zip(times[policy][1:], times["scale"][1:], strict=True)])
            table[f"{name}, {policy} / scale"] = found | {"acts": shares[policy]}
    show(table, arguments.json, "whole run over that with scale; share of ticks at which a limit acts")


if __name__ == "__main__":
    main()
