"""Run a scenario and look at its columns and metrics."""

import numpy as np

import rmrc

# A file, the name of a shipped scenario (`rmrc examples` lists them), or a Scenario that was made in Python.
scenario = rmrc.load("approach_singularity")
run = rmrc.run(scenario)

# Every tick is a row of every column; docs/theory.md lists them all.
fastest = np.abs(run["qdot_cmd"]).max(axis=0)
for joint, rate in zip(run.joints, fastest, strict=True):
    print(f"{joint}: at most {rate:.2f} rad/s commanded")
print(f"least singular value: {run['sigma'][:, -1].min():.4f}")

# The scorecard has the metrics that `rmrc run` prints, by name, with unit and meaning.
error = run.scorecard["position_error.max"]
print(f"{error.meaning}: {error.value:.3g} {error.unit}")

# The same with four times the feedback. It writes no file: `rmrc.run(..., out="folder")` would.
eager = rmrc.run(scenario.set({"control.feedback": 80}))
print(f"with more feedback: {eager.scorecard['position_error.max'].value:.3g} {error.unit}")
