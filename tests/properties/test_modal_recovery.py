"""Poles and residues of random systems are recovered from their FRFs without noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from known_modes import FORMS, frf_of
from receptance.modal import fit_modes

ACCURACY_FREQUENCY, ACCURACY_DAMPING, ACCURACY_CONSTANT = 1e-12, 1e-10, 1e-9
"""Relative, of natural frequencies, of dampings as the lines show them, and of modal constants."""


@st.composite
def systems(draw, closest=0.2):
    """Lines, modes at least `closest` half-power bands apart, complex modal constants, a window and a form.

    Half-power bands hold from one and a half lines to a fifteenth of all.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count, lines = draw(st.integers(1, 5)), draw(st.integers(150, 500))
    low = 10.0 ** rng.uniform(1.5, 3.5)
    step = low * 10.0 ** rng.uniform(-4.0, -3.0)
    f = low + step * np.arange(lines)
    width = step * 10.0 ** rng.uniform(np.log10(1.5), np.log10(lines / 15.0), count)
    places = np.sort(rng.uniform(f[0] + 0.1 * (f[-1] - f[0]), f[0] + 0.8 * (f[-1] - f[0]), count))
    for mode in range(1, count):
        places[mode] = max(places[mode], places[mode - 1] + closest * min(width[mode - 1], width[mode]))
    entries = draw(st.integers(1, 4))
    size = rng.uniform(0.3, 3.0, (count, entries)) * rng.choice([-1.0, 1.0], (count, entries))
    constants = size * np.exp(1j * rng.uniform(-0.3, 0.3, (count, entries)))
    decay_rate = float(draw(st.sampled_from([0.0, 1.0])) * rng.uniform(0.0, 3.0) * np.pi * step)
    return f, places, 0.5 * width / places, constants, decay_rate, draw(st.sampled_from(FORMS))


def check(fit, system):
    _, places, damping, constants, decay_rate, _ = system
    assert fit.frequency_hz.size == places.size, fit.summary()
    # A window adds to the damping that the lines show, and to its rounding.
    apparent = damping + decay_rate / (2.0 * np.pi * places)
    np.testing.assert_array_less(np.abs(fit.frequency_hz / places - 1.0), ACCURACY_FREQUENCY)
    np.testing.assert_array_less(np.abs(fit.damping_ratio - damping) / apparent, ACCURACY_DAMPING)
    largest = np.abs(constants).max(axis=1, keepdims=True)
    np.testing.assert_array_less(np.abs(fit.modal_constant[:, :, 0] - constants) / largest, ACCURACY_CONSTANT)


@settings(max_examples=12)
@given(systems())
@pytest.mark.parametrize("given", ["count", "frequencies"])
def test_poles_are_recovered(given, system):
    f, places, damping, constants, decay_rate, form = system
    frf = frf_of(f, places, damping, constants, decay_rate=decay_rate, form=form)
    check(fit_modes(frf, places.size if given == "count" else list(places)), system)


@settings(max_examples=10)
@given(systems(closest=1.0))
def test_number_of_modes_is_recovered(system):
    f, places, damping, constants, decay_rate, form = system
    check(fit_modes(frf_of(f, places, damping, constants, decay_rate=decay_rate, form=form)), system)


@settings(max_examples=10)
@given(systems(), st.floats(0.5, 3.0))
def test_window_leaves_poles_unchanged(system, windows):
    """The FRF of the same structure under a stronger window: another set of numbers, the same poles."""
    f, places, damping, constants, _, form = system
    decay_rate = windows * np.pi * (f[1] - f[0])
    plain = fit_modes(frf_of(f, places, damping, constants, form=form), places.size)
    windowed = fit_modes(frf_of(f, places, damping, constants, form=form, decay_rate=decay_rate), places.size)
    np.testing.assert_allclose(windowed.poles.imag, plain.poles.imag, rtol=ACCURACY_FREQUENCY)
    scale = np.abs(plain.poles.real) + decay_rate
    np.testing.assert_array_less(np.abs(windowed.poles.real - plain.poles.real) / scale, ACCURACY_DAMPING)
