"""What a limit policy costs where limits act, as ratios of whole runs to those with `scale`.

    python benchmarks/limits.py [--rounds 7]

The scenarios pass a singularity with little damping, so that a rate limit acts at many ticks. The whole tick
counts, physics included. Policies take turns; of each ratio min, median and max over the rounds.
"""

import argparse
import statistics
import time
from pathlib import Path

from rmrc.scenario import load
from rmrc.scenario.choices import LIMITS
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

SCENARIOS = Path(__file__).parent.parent / "scenarios"
HURRIED = ("control.inverse.damping={schedule: constant, maximum: 0.005}", "control.limits.rate=0.5")
CASES = {
    "2 joints": ("approach_singularity", HURRIED),
    "3 joints for 2 rows": ("joint_limit", ("control.limits.rate=0.2",)),
    "6 joints": ("stanford_wrist", HURRIED),
    "7 joints": ("xarm7_wrist", HURRIED),
}
KEPT = "optimal, direction kept"
POLICIES = (*LIMITS.names, KEPT)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    print("whole run over that with scale: min, median, max; ticks at which a limit acts")
    for name, (scenario, overrides) in CASES.items():
        times: dict[str, list[float]] = {policy: [] for policy in POLICIES}
        shares: dict[str, float] = {}
        for _ in range(rounds + 1):  # the first loads the machine code
            for policy in POLICIES:
                keep = f"control.limits.keep_direction={str(policy == KEPT).lower()}"
                chosen = f"control.limits.on_excess={policy.partition(',')[0]}"
                world = prepare(load(SCENARIOS / f"{scenario}.yaml", [*overrides, chosen, keep]))
                simulation = Simulation([world])
                begin = time.thread_time()
                (run,) = simulation.run()
                times[policy].append(time.thread_time() - begin)
                shares[policy] = float(((run["status"] & 28) > 0).mean())  # rate, acceleration, position
        for policy in POLICIES:
            ratios = [a / b for a, b in zip(times[policy][1:], times["scale"][1:], strict=True)]
            print(
                f"{name:20s} {policy:24s} {min(ratios):5.2f} {statistics.median(ratios):5.2f} "
                f"{max(ratios):5.2f}   {shares[policy]:4.0%}"
            )


if __name__ == "__main__":
    main()
