"""The way of commands to the plant, written by its definition: all that was sent, sorted by time, and expm.

Nothing here shares code with the compiled stages: random numbers are numpy's own, filters are matrix exponentials.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.linalg import expm


def response(A, b, T):
    """Return what takes (x, u) over a tick of dx/dt = A x + b u: the state at its end, and the mean of x[0]."""
    n = len(b)
    # beside x: u, which stays, and the integral of x[0]
    M = np.zeros((n + 2, n + 2))
    M[:n, :n], M[:n, n], M[n + 1, 0] = A, b, 1.0
    E = expm(M * T)
    return E[:n, : n + 1], E[n + 1, : n + 1] / T


class Way:
    """What a plant is told: commands late and lost, then what filters make of them."""

    def __init__(self, plant, period, n):
        self.plant, self.period, self.n = plant, period, n
        self.tick, self.sent, self.filters = 0, [], []
        self.chance = np.random.default_rng([plant.seed, 1])  # of jitter and loss, as theory.md says
        self.play, self.drive, self.joint = np.broadcast_to(plant.backlash, n), np.zeros(n), np.zeros(n)
        lags = np.broadcast_to(plant.lag, n)
        if lags.any():
            steps = [response(np.array([[-1 / L]]), np.array([1 / L]), period) if L else None for L in lags]
            self.filters.append((steps, np.zeros((n, 1))))
        if plant.resonance.frequency is not None:
            w, z = 2 * math.pi * plant.resonance.frequency, plant.resonance.damping
            step = response(np.array([[0, 1], [-w * w, -2 * z * w]]), np.array([0, w * w]), period)
            self.filters.append(([step] * n, np.zeros((n, 2))))

    def tell(self, cmd):
        """Send a command; return what the plant is told in its tick."""
        t, plant = self.tick, self.plant
        self.tick += 1
        later, chance = self.chance.random(2)
        arrival = t * self.period + plant.delay + plant.jitter * later
        self.sent.append((math.inf if chance < plant.loss else arrival, cmd.copy()))
        told = self.mean_between(t * self.period, (t + 1) * self.period)
        for steps, x in self.filters:
            for j, step in enumerate(steps):
                if step is not None:
                    end, mean = step
                    known = np.append(x[j], told[j])
                    x[j], told[j] = end @ known, mean @ known
        if self.play.any():
            before, self.drive = self.joint, self.drive + self.period * told
            self.joint = np.clip(before, self.drive - self.play / 2, self.drive + self.play / 2)
            told = (self.joint - before) / self.period
        return told

    def mean_between(self, first, last):
        """Return the mean of what is in effect: of all that has arrived by then, what was sent last."""
        slack = 1e-9 * self.period  # decimal fractions are none of the binary system
        times = sorted({first, last, *(a for a, _ in self.sent if first + slack < a < last - slack)})
        total = np.zeros(self.n)
        for a, b in pairwise(times):
            there = [cmd for arrival, cmd in self.sent if arrival <= a + slack]
            if there:
                total += (b - a) / (last - first) * there[-1]
        arrived = [i for i, (arrival, _) in enumerate(self.sent) if arrival <= last - slack]
        self.sent = self.sent[max(arrived, default=0) :]  # what was sent before it is never in effect again
        return total


def formula(d):
    """Return the gain times the period at which an integrator with so many ticks of delay is at its edge."""
    return 2 * math.sin(math.pi / (2 * (2 * d + 1)))
