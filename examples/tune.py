"""Find the inverse, its damping and the feedback for a scenario."""

import rmrc

# To 5 mm from full reach: beyond reach, every setting has an error.
scenario = rmrc.load("approach_singularity").set({"target.path[0].line.to": [1.995, 0]})
# A short search over the damped inverses alone; without these options it takes all of them and 560 runs.
tuned = rmrc.tune(
    scenario,
    only={"control.inverse.method": ["damped", "filtered"], "control.at_singularity": ["damp"]},
    perturbed=1,
    runs=60,
)
best = tuned.verdict.recommended
assert best is not None  # some setting keeps the limits
print(f"{tuned.runs} runs")
for name, one in {"recommended": best, "as written": tuned.own}.items():
    print(f"{name}: {one.worst.error:.2g} m off at most, at up to {one.worst.peak_rate:.3g} rad/s")
print(tuned.block)  # the control section, ready to be pasted into a scenario
