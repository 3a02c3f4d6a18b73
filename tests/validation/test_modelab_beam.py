"""A free-free beam measured by others: github.com/alxhslm/ModeLAB, Example/SignalCalc, GPL-3.0.

Roving-hammer accelerances at nine points, DataPhysics SignalCalc ASCII, 0 to 1000 Hz in steps of 1/51.2 Hz. Length
1.3 m is inferred from the symmetry of the points, and E / (kappa G) = 3.06 assumed; section and material are not
documented. The files are read where they lie and are not part of the project.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from receptance import FRF, Assembly, Material, Observation, Part, ReceptanceWarning, Segment, Unknown, identify
from receptance.io import read_frf
from receptance.modal import circle_fit, find_peaks, fit_modes

BEAM = Path(__file__).resolve().parents[3] / "shared" / "measured" / "modelab_freefree_beam"
PUBLISHED_HZ = np.array([111.992, 306.855, 596.367, 974.141])
"""Found by others in these files."""
BANDS_HZ = [(108.0, 116.0), (300.0, 312.0), (590.0, 600.0), (970.0, 980.0)]
"""One mode each, from the files' own setup.csv."""
LENGTH = 1.3
SHEAR = 3.06
"""E / (kappa G)."""


@pytest.fixture(scope="module")
def beam() -> FRF:
    """All nine points as responses to one excitation; by reciprocity it does not matter which side roved."""
    if not BEAM.is_dir():
        pytest.skip(f"the measured beam is not in {BEAM}")
    points = [read_frf(BEAM / f"Hxysv0000{number}.txt.gz") for number in range(1, 10)]
    values = np.concatenate([point.values for point in points], axis=1)
    return FRF(frequency_hz=points[0].frequency_hz, values=values, form=points[0].form, label="ModeLAB")


@pytest.fixture(scope="module")
def measured(beam: FRF) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Natural frequencies, their standard errors and damping ratios from all points together."""
    fits = [fit_modes(beam, 1, low_hz=low, high_hz=high) for low, high in BANDS_HZ]
    return (
        np.array([fit.frequency_hz[0] for fit in fits]),
        np.array([fit.frequency_standard_error_hz[0] for fit in fits]),
        np.array([fit.damping_ratio[0] for fit in fits]),
    )


def timoshenko() -> Assembly:
    """A solid round bar with that shear: Cowper's coefficient makes E / (kappa G) = (7 + 6 nu) / 3.

    Any section with this number has the same natural frequencies; only E / rho and the radius of gyration are left to
    find, and a diameter represents the latter.
    """
    material = Material(youngs_modulus=200e9, density=7850.0, poisson_ratio=(3.0 * SHEAR - 7.0) / 6.0)
    return Assembly([Part([Segment(length=LENGTH, outer_diameter=0.03, material=material)], name="beam")])


UNKNOWNS = [
    Unknown(address="beam.segment[0].youngs_modulus", lower=20e9, upper=800e9),
    Unknown(address="beam.segment[0].outer_diameter", lower=0.005, upper=0.1),
]


def test_natural_frequencies_are_those_of_a_timoshenko_beam(measured):
    """One test, because all of it needs the fit of all points, which takes seconds."""
    frequency, error, damping = measured
    print("Hz", frequency, "+-", error, "against published in %", 100.0 * (frequency / PUBLISHED_HZ - 1.0))
    np.testing.assert_allclose(frequency, PUBLISHED_HZ, rtol=1e-4)
    # The lines are 0.0195 Hz apart; the points drift by a few mHz in the course of the test, which the errors contain.
    assert np.all((error > 1e-4) & (error < 0.01))
    # "Damping 1e-4 or lower", with under two lines in the half-power band of the first mode.
    assert np.all((damping > 0.8e-4) & (damping < 1.6e-4))

    # Timoshenko is within 0.03 % where Euler and Bernoulli, scaled to the first, miss the fourth by 2.7 %.
    beam = timoshenko()
    found = identify(Observation.from_modes(assembly=beam, frequency_hz=frequency), UNKNOWNS, starts=4)
    assert found.converged
    left = 100.0 * (found.at(beam).assembly.natural_frequencies(1100.0) / frequency - 1.0)
    beta = np.array([4.730041, 7.853205, 10.995608, 14.137165])
    euler = 100.0 * ((beta / beta[0]) ** 2 * frequency[0] / frequency - 1.0)
    print("left in %: Timoshenko", left.round(4), "Euler-Bernoulli", euler.round(3))
    assert np.all(np.abs(left) <= 0.03)
    assert euler[3] == pytest.approx(2.7, abs=0.05)

    # With a beam six times as stiff in shear the same two parameters leave more than twice as much.
    stiff = beam.replace({"beam.segment[0].poisson_ratio": -0.9})
    other = identify(Observation.from_modes(assembly=stiff, frequency_hz=frequency), UNKNOWNS, starts=4)
    print("rms in % with E/(kappa G) of 3.06 and 0.53:", found.rms, other.rms)
    assert other.rms > 2.0 * found.rms


def test_points_one_by_one(beam):
    """The drift that the global fit reports is there: circles and peaks of single points agree on it."""
    circles, peaks = [], []
    for number in range(9):
        point = beam.select(responses=number, low_hz=108.0, high_hz=116.0)
        circles.append(circle_fit(point).frequency_hz)
        peaks.append(max(find_peaks(point), key=lambda mode: abs(mode.modal_constant)).frequency_hz)
    np.testing.assert_allclose(peaks, circles, atol=2e-3)
    assert 0.004 < np.ptp(circles) < 0.012
    fit = fit_modes(beam, 1, low_hz=108.0, high_hz=116.0)
    assert any("poles of the entries differ" in note for note in fit.notes)
    spread = np.std(circles, ddof=1) / 3.0
    assert spread / 4.0 < fit.frequency_standard_error_hz[0] < 4.0 * spread


@pytest.mark.slow
def test_whole_band_at_once(beam):
    """Four narrow modes among 48 000 lines; the lowest is found although its peak is one line wide."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        fit = fit_modes(beam.select(responses=[0, 3, 7]), 4, low_hz=60.0, high_hz=1000.0)
    np.testing.assert_allclose(fit.frequency_hz, PUBLISHED_HZ, rtol=1e-4)
