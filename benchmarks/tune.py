"""What a search costs, and how good its front is.

    python benchmarks/tune.py [--scenarios NAME ...] [--set KEY=VALUE ...] [--seeds 6] [--runs 320]
        [--ideal] [--threads 1]

For each scenario and seed: seconds of CPU of this process, of the search and of the margins at its end, with
all that is compiled loaded; ticks of the runs on the scenarios, in millions, from their durations, which do
not depend on the machine; settings that were run on the scenarios, and these runs; the error of the
recommended setting; and the hypervolume of the front. In the plane of ln(peak rate) and ln(error) that is the
area which the front dominates, as far as it betters the setting as written in both: 0.7 is half the
error at 0.37 times the peak rate. In the end min, median and max of each scenario.
"""

import argparse
import json
import math
import resource
import statistics
from collections.abc import Sequence
from pathlib import Path

from rmrc.tuning.front import area
from rmrc.tuning.tune import Tuned, Tuning

SCENARIOS = Path(__file__).parent.parent / "scenarios"
CASES = ("approach_singularity", "ur5e_wrist", "stanford_wrist")
FIGURES = ("CPU, s", "Mticks", "settings", "runs", "error, mm", "hypervolume")


def measured(path: Path, overrides: Sequence[str], seed: int, **options: object) -> list[float]:
    """Return the figures of a search."""
    before = resource.getrusage(resource.RUSAGE_SELF)
    tuning = Tuning(path, overrides, seed=seed, **options)
    found: Tuned = tuning.run()
    after = resource.getrusage(resource.RUSAGE_SELF)
    front = [trial.worst.point for trial in found.verdict.front]
    best = found.verdict.recommended
    seconds = sum(outcome.time for tried in found.tried for outcome in tried.outcomes.values())
    return [
        after.ru_utime - before.ru_utime,
        seconds / tuning.scenario.control.period / 1e6,
        len(found.tried),
        found.runs,
        1e3 * best.worst.error if best else math.nan,
        area(front, found.own.worst.point.logs),
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", nargs="+", default=CASES)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of all scenarios")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--runs", type=int, default=320)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--ideal", action="store_true")
    parser.add_argument(
        "--json", action="store_true", help="print all figures as well, by scenario, each of all seeds"
    )
    arguments = parser.parse_args()
    options = {name: getattr(arguments, name) for name in ("runs", "threads", "ideal")}
    found: dict[str, list[list[float]]] = {}
    print(f"{'':28s}" + "".join(f"{name:>13s}" for name in FIGURES))
    for name in arguments.scenarios:
        path = SCENARIOS / f"{name}.yaml"
        Tuning(path, arguments.set).compile()
        rows = found[name] = []
        for seed in range(arguments.seeds):
            rows.append(measured(path, arguments.set, seed, **options))
            _show(f"{name}, {seed}", rows[-1])
        for what, of in (("min", min), ("median", statistics.median), ("max", max)):
            _show(f"{name}, {what}", [of(values) for values in zip(*rows, strict=True)])
    if arguments.json:
        print(json.dumps({
            name: dict(zip(FIGURES, zip(*rows, strict=True), strict=True)) for name, rows in found.items()
        }))  # fmt: skip


def _show(name: str, figures: Sequence[float]) -> None:
    print(f"{name:28s}" + "".join(f"{value:13.4g}" for value in figures), flush=True)


if __name__ == "__main__":
    main()
