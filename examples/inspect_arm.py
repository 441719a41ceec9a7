"""Ask about an arm: no scenario, no run."""

import numpy as np

import rmrc

# An MJCF file, or the name of a shipped model, at joint positions where its wrist is singular.
found = rmrc.inspect("puma560", [0.0, -0.8, 0.6, 0.0, 0.0, 0.0])
print(f"rank {found.rank}, sigma {found.sigma.round(3)}")
for lost in found.lost:
    print(lost.words)

# All postures that bring the tip of a planar arm to a point.
postures = rmrc.ik("planar_2link", [1.0, 1.0], every=True).postures
assert postures is not None
print(np.degrees(postures.q).round(1))

# Actuator torques and link loads while 10 N pull the tip down.
print(rmrc.statics("planar_2link", [0.0, -10.0, 0.0], [0.0, 1.0]).balance.equilibrium.round(3))

# The workspace of another arm, with and without its joint limits.
reach = rmrc.workspace("planar_6_3", cells=60)
print(f"{reach.limited.area:.0f} of {reach.free.area:.0f} m²")
