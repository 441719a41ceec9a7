"""How much faster many configurations are surveyed than one by one through MuJoCo: ratios of one run.

    python benchmarks/workspace.py [--rounds 7] [--json]

1. Position and singular values at a million random configurations of the six-joint arm, all cores, over a
   Python loop of mj_fwdKinematics, mj_jacSite and numpy's svd over fewer of them, scaled; one core beside it.
2. Whole workspaces: seconds for an arm that is a surface, and for one that is sampled.
Machines are noisy: both take turns, and each ratio is given as min, median and max over the rounds.
"""

import time
from collections.abc import Callable

import mujoco
import numpy as np
from measure import ROOT, options, show, spread

from rmrc import arm as arms
from rmrc.analysis.survey import survey
from rmrc.analysis.workspace.workspace import workspace
from rmrc.law.task import choose

COUNT = 1_000_000
LOOPED = 10_000
# In a round all take so many turns, and the least of each counts.
TURNS = 4


def seconds(work: Callable[[], object]) -> float:
    """Return how long something takes."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def loop(arm: arms.Arm, q: np.ndarray) -> np.ndarray:
    """Return the singular values of J at configurations, one by one, as anybody would write it."""
    model, site, sigma = arm.model, arm.wiring.site, np.empty_like(q)
    data, jacobian = mujoco.MjData(model), np.empty((6, model.nv))
    for i, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_fwdKinematics(model, data)
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        sigma[i] = np.linalg.svd(jacobian, compute_uv=False)
    return sigma


def main() -> None:
    """Measure and print."""
    arguments = options(__doc__, 7).parse_args()
    arm = arms.load(ROOT / "models/stanford.xml")
    task, q = choose(arm), arm.sampled(COUNT)
    # Both give the same, and everything is compiled.
    np.testing.assert_allclose(survey(task, q[:LOOPED]).sigma, loop(arm, q[:LOOPED]), atol=1e-12)
    rows: dict[str, list[float]] = {}
    for _ in range(arguments.rounds):
        looped, every, one = (
            min(times)
            for times in zip(*(
                (
                    seconds(lambda: loop(arm, q[:LOOPED])) * COUNT / LOOPED,
                    seconds(lambda: survey(task, q)),
                    seconds(lambda: survey(task, q, threads=1)),
                )
                for _ in range(TURNS)
            ), strict=True)
        )  # fmt: skip
        rows.setdefault("Python loop / survey, all cores", []).append(looped / every)
        rows.setdefault("Python loop / survey, one core", []).append(looped / one)
        rows.setdefault("survey of 10^6 configurations, all cores, s", []).append(every)
        rows.setdefault("Python loop, us a configuration", []).append(looped / COUNT * 1e6)
    for name in ("planar_6_3", "torus_3r", "stanford"):
        other = arms.load(ROOT / f"models/{name}.xml")
        workspace(other, cells=20, samples=1000)
        times = [seconds(lambda other=other: workspace(other)) for _ in range(arguments.rounds)]
        rows[f"workspace of {name}, s"] = times
    show({name: spread(values) for name, values in rows.items()}, arguments.json)


if __name__ == "__main__":
    main()
