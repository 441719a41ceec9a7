"""A loop that logs an arm for `rmrc identify`; here a stand-in of numpy, with delay, lag and noise."""

import math

import numpy as np

PERIOD, DURATION = 0.008, 10.0  # s
JOINTS = ("shoulder", "elbow")


class Arm:
    """Stands for the driver of a real arm: rates take 18 ms to arrive, and each joint lags behind them."""

    delay, lag, step = 0.018, np.array([0.010, 0.006]), 0.0005
    resolution, noise = 2.0 * math.pi / 2**17, 2e-5

    def __init__(self) -> None:
        """Start at rest."""
        self.q, self.rate = np.array([0.3, -1.2]), np.zeros(2)
        self.sent = [np.zeros(2)] * round(self.delay / self.step)
        self.chance = np.random.default_rng(0)

    def read(self) -> np.ndarray:
        """Return the encoders' readings of the joints [rad]."""
        noisy = self.q + self.noise * self.chance.standard_normal(2)
        return np.round(noisy / self.resolution) * self.resolution

    def send(self, rate: np.ndarray) -> None:
        """Send joint rates [rad/s], and wait for the next period."""
        decay = np.exp(-self.step / self.lag)
        for _ in range(round(PERIOD / self.step)):
            self.sent.append(rate)
            behind = self.rate - self.sent.pop(0)
            self.q = self.q + (self.rate - behind) * self.step + self.lag * (1.0 - decay) * behind
            self.rate = self.rate - (1.0 - decay) * behind


def wave(time: float, period: float) -> float:
    """Return a wave of sharp starts and stops: 0.1 s up, stay, down through 0, stay, and so on, within 1."""
    return min(max(period / 0.2 * math.sin(2.0 * math.pi * time / period), -1.0), 1.0)


arm = Arm()
print(",".join(["t", *(f"q_{name}" for name in JOINTS), *(f"qdot_cmd_{name}" for name in JOINTS)]))
for tick in range(round(DURATION / PERIOD)):
    t = tick * PERIOD
    q = arm.read()
    qdot_cmd = np.round([0.4 * wave(t, 1.7), 0.6 * wave(t, 1.1)], 4)
    print(",".join([f"{t:.3f}", *(f"{value:.6f}" for value in q), *(f"{value:.4f}" for value in qdot_cmd)]))
    arm.send(qdot_cmd)
