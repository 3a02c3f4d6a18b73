"""FRFs of modes that are known, for tests of modal estimates; written with another formula than the estimates use."""

from __future__ import annotations

from typing import Any

import numpy as np

from receptance import FRF

FORMS = ("receptance", "mobility", "accelerance")


def values_of(lines, frequency_hz, damping, constants, *, decay_rate=0.0, form="receptance"):
    """`(n, m)` values on complex lines; `constants` is `(M, m)`, complex where modes are.

    With C = 2 i w_d A, A / (s - p) + A* / (s - p*) = (2 Re A s - 2 Re(A p*)) / (s^2 + 2 zeta w s + w^2).
    """
    s = (2j * np.pi * np.asarray(lines) + decay_rate)[:, None]
    total = np.zeros((s.size, np.shape(constants)[1]), dtype=complex)
    for f, zeta, constant in zip(frequency_hz, damping, np.asarray(constants, dtype=complex), strict=True):
        w = 2.0 * np.pi * f
        damped = w * np.sqrt(1.0 - zeta**2)
        residue = constant / (2j * damped)
        top = 2.0 * residue.real * s - 2.0 * (residue * complex(-zeta * w, -damped)).real
        total += top / (s**2 + 2.0 * zeta * w * s + w**2)
    return total * s ** FORMS.index(form)


def frf_of(lines, frequency_hz, damping, constants, *, noise=0.0, seed=0, stated=False, **options: Any):
    """An FRF of known modes; `noise` is its standard deviation over each entry's largest magnitude, `stated` or not."""
    form, decay_rate = options.get("form", "receptance"), options.get("decay_rate", 0.0)
    exact = values_of(lines, frequency_hz, damping, constants, decay_rate=decay_rate, form=form)
    rng = np.random.default_rng(seed)
    deviation = noise * np.abs(exact).max(axis=0) * np.ones(exact.shape)
    values = exact + deviation * (rng.normal(size=exact.shape) + 1j * rng.normal(size=exact.shape))
    variance = ((deviation / np.abs(exact)) ** 2)[:, :, None] if stated else None
    return FRF(frequency_hz=lines, values=values[:, :, None], log_variance=variance, **options)
