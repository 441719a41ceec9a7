"""What a sweep costs: worlds whose columns are not kept, over those whose are, and over the physics alone.

    python benchmarks/sweep.py [--rounds 7] [--json]

The floor is that of `loop.py`. Compiling and wiring are left out of all.
"""

import argparse
import time

import numpy as np
from loop import closed_loop, floor, ratios, show, world

from rmrc.preparation import Prepared
from rmrc.scorecard import scorecard
from rmrc.simulation import Simulation


def kept(prepared: list[Prepared]) -> float:
    """Return seconds of stepping with all columns, and of the scorecards made of them."""
    simulation = Simulation(prepared)
    started = time.perf_counter()
    for run in simulation.run():
        scorecard(run)
    return time.perf_counter() - started


def streamed(prepared: list[Prepared]) -> float:
    """Return seconds of stepping without columns, scorecards included."""
    simulation = Simulation(prepared, keep_columns=False)
    started = time.perf_counter()
    simulation.step()
    simulation.scorecards()
    return time.perf_counter() - started


def scorecard_rows(rounds: int, worlds: int = 64) -> dict[str, dict[str, float]]:
    """Streamed scorecards over those of kept columns, over no scorecards at all, and over the floor."""
    prepared = [world("stanford")] * worlds
    controls = np.array([run["qdot_cmd"] for run in closed_loop(prepared)[1].runs()])
    below = {
        "stepping with kept columns + scorecard(run)": lambda: kept(prepared),
        "stepping with kept columns, no scorecards": lambda: closed_loop(prepared)[0],
        "C floor": lambda: floor(prepared[0], controls),
    }
    return {
        f"streamed / {name}": ratios(rounds, lambda: streamed(prepared), of) for name, of in below.items()
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    show(scorecard_rows(arguments.rounds), {}, arguments.json)


if __name__ == "__main__":
    main()
