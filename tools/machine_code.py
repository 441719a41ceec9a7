"""Compile the code of the verbs for x86-64-v3, to ship it in a wheel.

    python tools/machine_code.py FOLDER

Processors of that level load it if sources, Python and numba are the same. Others compile at their first
run. A build of a wheel calls this.
"""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WORKER = "--in-this-process"
SHORT = "target.path=[{line: {by: [0.01, 0.01, 0.01]}}]"


def settings() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield shipped scenarios, each with keys that need other compiled code."""
    from rmrc.scenario import choices

    for file in sorted((ROOT / "scenarios").glob("*.yaml")):
        yield file.stem, ()
    for one in (choices.INVERSES, choices.SCHEDULES, choices.LIMITS, choices.POLICIES):
        for name in one.names:
            yield "stanford_line", (SHORT, f"control.{one.key}={name}")
    for name in ("joint_limits", "manipulability"):  # others have scenarios of their own
        yield "null_space", ("target.path=[{hold: {for: 0.01}}]", f"control.nullspace.objective={name}")
    for plant in (
        "{kind: ideal}", "{kind: torque}", "{delay: 0.002, lag: 0.005}", "{jitter: 0.002, loss: 0.1}",
        "{resonance: {frequency: 30, damping: 0.5}}", "{backlash: 1.0e-4}", "{friction: {coulomb: 0.1}}",
    ):  # fmt: skip
        yield "stanford_line", (SHORT, f"plant={plant}")
    for key in ("control.limits.jerk=5000", "control.inverse.metric=inertia", "arm.encoder.noise=1.0e-5"):
        yield "stanford_line", (SHORT, key)


def commands(out: str) -> Iterator[list[str]]:
    """Yield command lines, each of which needs other compiled code."""
    scenario = str(ROOT / "scenarios/approach_singularity.yaml")
    yield ["run", scenario, "--out", out]
    yield ["compare", scenario, "--vary", "control.inverse.method=damped,transpose", "--out", out]
    yield ["sweep", scenario, "--vary", "control.feedback=1,2", "--out", out]
    yield ["tune", scenario, "--runs", "60", "--out", out]
    yield ["margins", scenario]
    for model, joints in (("planar_3link", 3), ("ur5e", 6)):
        path = str(ROOT / "models" / f"{model}.xml")
        yield ["inspect", path]
        yield ["workspace", path, "--out", out]
        yield ["ik", path, "--to-q", ",".join(["0.5"] * joints)]


def compile_here() -> None:
    """Run the code of the verbs, so that numba keeps the compiled code."""
    import numpy as np

    import rmrc
    from rmrc.cli import app
    from rmrc.law.jit import all_at_once
    from rmrc.scenario import load
    from rmrc.simulation.prepare import prepare
    from rmrc.simulation.simulation import Simulation

    with all_at_once():
        for name, keys in settings():
            Simulation([prepare(load(ROOT / f"scenarios/{name}.yaml", keys))])  # compiles all that it needs
    with tempfile.TemporaryDirectory() as out:
        for command in commands(out):
            with contextlib.suppress(SystemExit):
                app([*command], standalone_mode=False)
    law = rmrc.Law(7, 6)
    law.step(np.eye(6, 7), np.ones(6))
    rmrc.resolve_rates(np.eye(6, 7), np.ones(6))


def main() -> None:
    """Compile in a separate process, and put the compiled code into a folder."""
    if sys.argv[1] == WORKER:
        compile_here()
        return
    from rmrc.law import jit, kept

    folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as cache:
        about = {"NUMBA_CACHE_DIR": cache, "NUMBA_CPU_NAME": kept.LEVEL, "NUMBA_CPU_FEATURES": kept.FEATURES}
        subprocess.run([sys.executable, __file__, WORKER], env={**os.environ, **about}, check=True)
        shutil.rmtree(folder, ignore_errors=True)
        for file in Path(cache).rglob("*.nb[ci]"):
            place = folder / file.parent.name.rpartition("_")[0] / file.name
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(file, place)
    (folder / kept.STAMP).write_text(jit.SOURCES)


if __name__ == "__main__":
    main()
