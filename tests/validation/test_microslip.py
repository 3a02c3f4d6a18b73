"""The law of micro-slip against its derivation from sliders in cyclic motion."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import MicroslipJoint
from receptance.model.joints import largest_share, loss_ratio

SLIDERS = 3000
STEPS = 1500


def first_harmonic(exponent: float, share: float) -> complex:
    """Return the complex stiffness, of 1 at first, of many sliders in parallel under a motion cos(phi).

    A slider of stiffness kappa that yields at the displacement phi adds kappa min(u, phi) to the backbone
    u (1 - c u^p), so kappa(phi) = c p (1+p) phi^(p-1) up to the amplitude, and a spring replaces those beyond.
    """
    p = exponent
    c = share / (largest_share(p) * (1.0 + p))
    # Places at quantiles of the distribution phi^(p-1), each in the middle of its share.
    phi = ((np.arange(SLIDERS) + 0.5) / SLIDERS) ** (1.0 / p)
    kappa = c * (1.0 + p) / SLIDERS
    spring = 1.0 - c * (1.0 + p)
    angles = np.linspace(0.0, 2.0 * np.pi, STEPS + 1)
    held = np.zeros(SLIDERS)
    before = 0.0
    for round_ in range(2):
        force = []
        for u in np.cos(angles):
            held = np.clip(held + u - before, -phi, phi)
            before = u
            force.append(kappa * held.sum() + spring * u)
        if round_ == 0:
            continue  # the first time round begins at rest
    values = np.array(force[:-1])
    return complex(2.0 * np.mean(values * np.exp(-1j * angles[:-1])))


@pytest.mark.parametrize("exponent", [0.4, 1.0, 2.0])
def test_the_first_harmonic_is_that_of_masing_loops(exponent: float) -> None:
    share = 0.6 * largest_share(exponent)
    found = first_harmonic(exponent, share)
    joint = MicroslipJoint(k_y=1.0, k_theta=1.0, slip_y=share, exponent=exponent, level=1.0)
    expected = joint.stiffness([1.0])[0, 0, 0]
    assert found.real == pytest.approx(expected.real, rel=1e-3)
    assert found.imag == pytest.approx(expected.imag, rel=2e-3)


def test_closed_forms() -> None:
    assert loss_ratio(1.0) == pytest.approx(4.0 / (3.0 * np.pi), rel=1e-14)
    assert largest_share(1.0) == pytest.approx(0.5, rel=1e-14)
    for p in (0.1, 0.5, 1.0, 3.0):
        # Energy lost a cycle: 8 times the backbone's work less 4 a f(a), pi a^2 times the loss stiffness.
        c = 1.0 / (1.0 + p)
        lost = 8.0 * (0.5 - c / (p + 2.0)) - 4.0 * (1.0 - c)
        assert np.pi * loss_ratio(p) * largest_share(p) == pytest.approx(lost, rel=1e-13)


def test_force_has_one_level_near_one_resonance() -> None:
    """l / |d(l)| only grows: 2 beta sqrt(1 + p) > p for any other damping; so no response jumps."""
    for p in np.linspace(0.01, 4.0, 200):
        assert 2.0 * loss_ratio(p) * np.sqrt(1.0 + p) > p
