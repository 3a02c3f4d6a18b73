"""The floor under standard deviations: errors outside the noise model."""

import numpy as np
import pytest

from receptance import FRF, STEEL, Assembly, Observation, Part, Segment
from receptance.fit import Floor

LINES = np.arange(900.0, 1100.0, 0.5)


def resonance(f, f0=1000.0, zeta=0.005):
    return 1.0 / (f0**2 - f**2 + 2j * zeta * f0 * f)


def slope(f, f0=1000.0, zeta=0.005):
    return (2 * f**2 - 2j * zeta * f0 * f) * resonance(f, f0, zeta)


def test_the_floor_follows_the_slope():
    floor = Floor(relative=0.003, frequency=1e-4)
    variance = floor.variance(LINES, resonance(LINES))
    expected = 0.003**2 + 1e-8 * np.abs(slope(LINES)) ** 2
    assert variance[1:-1] == pytest.approx(expected[1:-1], rel=0.01)
    assert variance.max() > 0.01**2  # the peak, where a jitter of 0.01 % makes 2 % of 1 / zeta


def test_noise_is_not_taken_for_slope():
    rng = np.random.default_rng(5)
    lines = np.arange(4000.0, 4400.0, 0.5)
    noise = 0.02
    clean = resonance(lines, 4200.0, 0.01)
    noisy = clean * np.exp(noise * (rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)))
    added = Floor().variance(lines, noisy, np.full(lines.size, noise**2))
    exact = 0.003**2 + 1e-8 * np.abs(slope(lines, 4200.0, 0.01)) ** 2
    # Excess of the floor, relative to the noise.
    assert np.mean(np.abs(added - exact)) < 0.1 * noise**2
    assert np.abs(np.mean(added - exact)) < 0.03 * noise**2


def test_observation_has_and_reports_the_floor():
    bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    lines = np.linspace(100.0, 4000.0, 400)
    frf = FRF(frequency_hz=lines, values=bar.receptance(lines), log_variance=1e-4, correlated_lines=2.0)
    data = Observation.from_frf(bar, frf, floor=Floor(), configuration="blank")
    plain = Observation.from_frf(bar, frf, floor=0.003)
    assert plain.standard_deviation == pytest.approx(np.sqrt(2e-4 + 9e-6))
    assert np.all(data.standard_deviation >= plain.standard_deviation)
    assert data.independent_values == pytest.approx(400.0)
    assert data.configuration == "blank"
    assert any("0.3 % of the receptance and 0.01 % of frequency" in note for note in data.notes)


def test_mistakes():
    with pytest.raises(ValueError, match="frequency is -1"):
        Floor(frequency=-1.0)
    assert not Floor(relative=0.0, frequency=0.0)
