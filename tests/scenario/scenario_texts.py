"""Scenarios that the tests share, and what is wrong with others."""

from pathlib import Path

import pytest

from rmrc.scenario import loads
from rmrc.support.errors import ScenarioError

MINIMAL = """\
name: x
arm: {model: arm.xml, site: tip}
target:
  path:
    - line: {by: [0.1, 0.0]}
"""

# Section 5 of the design.
EXAMPLE = """\
# The 2-link arm is driven straight through full reach and back; watch sigma and qdot.
name: approach_singularity
arm: {model: arm.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
control:
  period: 0.001
  inverse: {method: damped, damping: {schedule: smallest_singular_value, maximum: 0.1, below: 0.3}}
  feedback: 20
  nullspace: {objective: none}
  limits: {rate: 3.0, on_excess: scale}        # scale | clamp | none
  at_singularity: damp                         # damp | slow | stop
target:
  path: [{line: {to: [1.99, 0.0]}}, {line: {to: [1.0, 0.0]}}]
  limits: {velocity: 0.5, acceleration: 2.0, jerk: 20.0}
plant: {kind: servo, kv: 1000, timestep: 0.001}
expect:
  joint_rate.peak: {below: 3.0}
  position_error.end: {below: 0.001}
"""

# Every key of a scenario has a value here, but for those that exclude others, which OTHER_FRAMES have; the schema
# test holds both against the schema.
FULL = """\
name: full
arm: {model: arm.xml, site: tip, start: [60 deg, 0.5], joints: [a, b],
      pose: {position: [0.5, 0.1], orientation: [0.0, 10 deg, 0.0], frame: base},
      encoder: {offset: [-0.1 deg, 0.2], deviation: 0.1 deg, seed: 7, noise: 1.0e-5,
                resolution: [0.001 deg, 0.0], delay: 0.002}, stretch: {link_1: 1.1},
      packages: {arm_description: ..}}
task: {axes: [x, y], frame: site, length: 0.5, weights: [1.0, 2.0]}
control:
  period: 0.002
  state: integrated
  rate_filter: 0.01
  inverse: {method: pseudoinverse, tolerance: 0.001, cutoff: 0.02, gamma: 0.2, rate_bound: 1.5,
            damping: {schedule: constant, maximum: 0.2, below: 0.4, manipulability_below: 0.6, error_gain: 0.7}}
  feedback: 3.0
  feedforward: false
  joint_weights: [1.0, 4.0]
  nullspace: {objective: posture, gain: 2.0, posture: [0.1, 10 deg], rates: [0.5, -0.5],
              secondary: {site: elbow, axes: [y], frame: base, to: [0.3], feedback: 4.0, priority: classical, damping: 0.01}}
  limits: {rate: [1.0, 2.0], acceleration: [3.0, 4.0], jerk: [50.0, 60.0], profile: franka_fr3, position: false, braking: 5.0, on_excess: clamp}
  at_singularity: damp
  slow: {change: 3.0, patience: 0.5, longest: 2.0}
  stop: {sigma: 0.1, condition: 50.0, change: 4.0}
target:
  path:
    - line: {to: [1.0, 0.0], turn: {axis: [0, 0, 2], angle: 30 deg}}
    - line: {by: [0.0, 0.1, 0.2], turn: {to: [1, 0, 0, 0]}}
    - arc: {center: [0.5, 0.0], axis: [0, 0, 1], angle: -360 deg, turn: {axis: z, angle: 0.1}}
    - arc: {center: [0.5, 0.0], angle: 1.0, turn: {axis: [1, 0, 0], angle: 0.1}}
    - arc: {center: [0.5, 0.0], angle: 1.0, turn: {to: [0, 1, 0, 0]}}
    - turn: {axis: [0, 1, 0], angle: 1.0}
    - turn: {to: [0.5, 0.5, 0.5, 0.5]}
    - line: {by: [0.0, 0.1], tilt: {axis: [0, 0, 1], to: [1, 0, 0], frame: base}, frame: start}
    - line: {by: [0.0, 0.1], turn: {axis: z, angle: 0.1, frame: base}}
    - arc: {center: [0.5, 0.0], angle: 1.0, tilt: {axis: [0, 0, 1], to: [1, 0, 0], frame: site}, frame: site}
    - arc: {center: [0.5, 0.0], angle: 1.0, turn: {to: [0, 1, 0, 0], frame: site}}
    - turn: {axis: z, angle: 1.0, frame: site}
    - tilt: {axis: [0, 1, 0], to: [0, 0, -1], frame: world}
    - set: {to: [0.5, 0.1], turn: {axis: [0, 0, 1], angle: 0.1, frame: site}, frame: base, for: 0.5}
    - set: {by: [0.5, 0.1], tilt: {axis: [1, 0, 0], to: [0, 1, 0], frame: site}, for: 0.5}
    - set: {turn: {to: [0, 1, 0, 0]}, for: 0.5}
    - configurations: [home, [0.1, 10 deg]]
    - file: {path: motion.csv, columns: pose, from: start, speed: 0.5, frame: base}
    - hold: {for: 0.5}
  frame: base
  offset: [0.1, 0.0, 0.0]
  limits: {velocity: 1.0, acceleration: 2.0, jerk: 3.0,
           angular_velocity: 4.0, angular_acceleration: 5.0, angular_jerk: 6.0}
plant: {kind: torque, kv: 10.0, bandwidth: 20.0, timestep: 0.001, gravity_compensation: false,
        payload: 1.5, gravity: [0.0, 0.5, -9.0], wrench: [1, 2, 3, 4, 5, 6],
        delay: 0.01, jitter: 0.002, loss: 0.1, lag: [0.01, 0.02], resonance: {frequency: 12.0, damping: 0.2}, seed: 7,
        backlash: [0.1 deg, 0.002],
        friction: {coulomb: [1.0, 2.0], viscous: 0.5}, stretch: {link_1: 1.005}, joint_offset: [0.1 deg, 0.001]}
expect:
  joint_rate.peak: {below: 3.0, above: 1.0}
  position_error.end: {equals: 0.0, within: 0.001}
  profile: franka_fr3
baseline: {control.inverse.method: pseudoinverse}
sweep:
  vary: {control.inverse.method: [damped, pseudoinverse]}
  draw: {control.feedback: [1.0, 20.0]}
  sampler: sobol
  samples: 3
  repeat: 2
  seed: 5
tune: {delay: [0.006, 0.012], lag: 0.01, noise: 0.001 deg, calibration: 0.002}
look: {quantity: rates, at: 0.5}
"""


OTHER_FRAMES = (
    ("arm.site=null", "arm.body=link_2"),
    (
        "arm.site=null",
        "arm.tool={body: link_2, position: [0.1, 0, 0], orientation: [1, 0, 0, 0], mass: 0.5, center: [0, 0, 0.1], "
        "inertia: [0.1, 0.1, 0.1]}",
    ),
    ("arm.site=null", "arm.tool={orientation: [90 deg, 0, 0], model: arm.xml, site: tip}"),
)


def full_scenarios():
    """Return scenarios that use every key together."""
    return [loads(FULL), *(loads(FULL, overrides=frame) for frame in OTHER_FRAMES)]


def problems(text, *overrides):
    with pytest.raises(ScenarioError) as caught:
        loads(text, "x.yaml", overrides)
    return str(caught.value).splitlines()


def number_keys(value, key=""):
    """Walk plain data to the key of every number in it."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from number_keys(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from number_keys(inner, f"{key}[{i}]")
    elif isinstance(value, float):
        yield key


def full_number_keys():
    Path("arm.xml").write_text("<mujoco/>")
    Path("motion.csv").touch()
    return sorted(number_keys(loads(FULL).model_dump(mode="json")))
