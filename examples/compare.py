"""Run variants of a scenario side by side: the plain inverse against damping, beyond full reach."""

import rmrc

scenario = rmrc.load("blow_up")
runs = rmrc.compare(
    scenario,
    {"control.inverse.method": ["inverse", "damped"], "control.feedback": [5, 20]},
)

# No run depends on those beside it.
print(f"{'variant':<16}{'peak command':>16}{'largest error':>16}")
for label, run in runs.items():
    peak = run.scorecard["joint_rate_cmd.peak"].value
    error = run.scorecard["position_error.max"].value
    print(f"{label:<16}{peak:>10.5g} rad/s{error:>14.2g} m")
