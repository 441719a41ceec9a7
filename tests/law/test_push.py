"""J-PARSE's gains on what linear and angular rows ask of fading directions [Guptasarma25]."""

import numpy as np
from hypothesis import given
from numpy.testing import assert_allclose, assert_array_equal
from worlds import Variant, rates_of, seeds, with_sigma

from codes import Method
from oracle_inverse import jparse_inverse

JPARSE, GAMMA = Variant(Method.JPARSE), 0.25


def published(A, t, position, rotation):
    """Return J_s⁺ J_p J_p⁺ t + J_s⁺ Φ K t, as the authors have it: what K = 1 adds is replaced by what K adds."""
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    fading = sigma < GAMMA * sigma[0]
    K = np.diag(np.where(np.arange(len(t)) < 3, position, rotation))
    push = (u[:, fading] * (sigma[fading] / (GAMMA * sigma[0]))) @ u[:, fading].T @ (K - np.eye(len(t))) @ t
    safe = (u * np.maximum(sigma, GAMMA * sigma[0])) @ vt
    return jparse_inverse(A, GAMMA) @ t + np.linalg.pinv(safe) @ push


@given(seeds)
def test_what_is_asked_of_fading_directions_is_weighed_as_published(seed):
    rng = np.random.default_rng(seed)
    m, n = 6, int(rng.integers(6, 9))
    A = with_sigma(rng, m, n, np.array([2.0, 1.3, 0.9, 0.6, 0.3, 0.02]))
    t, (position, rotation) = rng.normal(size=m), rng.uniform(0, 3, 2)
    rates = rates_of(A, t, JPARSE, gamma=GAMMA, push_position=position, push_rotation=rotation)
    # gains of up to 1/(γ σ₁) of two decompositions
    assert_allclose(rates, published(A, t, position, rotation), rtol=0, atol=1e-12)
    # negative control, and the defaults: gains of 1 are those of the method without them, to the bit
    plain = rates_of(A, t, JPARSE, gamma=GAMMA)
    assert np.abs(rates - plain).max() > 1e-6
    assert_array_equal(rates_of(A, t, JPARSE, gamma=GAMMA, push_position=1.0, push_rotation=1.0), plain)
    # and what does not fade is as it was
    vt = np.linalg.svd(A)[2]
    assert_allclose(vt[:4] @ rates, vt[:4] @ plain, rtol=0, atol=1e-12)
