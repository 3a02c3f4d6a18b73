"""Joints from FRFs under an exponential window: exact on complex lines, biased where the window is ignored."""

import numpy as np
import pytest

from receptance import FRF, STEEL, Assembly, Coordinate, GroundSpring, Observation, Part, Segment, Unknown, identify
from scipy_fits import task_of
from tool_in_holder import DASHPOTS, LINES, STIFFNESSES, TRUE, assert_found, make_assembly

SIGMA = 40.0


def complex_lines(sigma=SIGMA, lines=LINES):
    return lines - 1j * sigma / (2.0 * np.pi)


def windowed(assembly=None, sigma=SIGMA, **options):
    """Return an FRF of a windowed force and a windowed response."""
    assembly = assembly or make_assembly()
    return FRF(
        frequency_hz=LINES,
        values=assembly.receptance(complex_lines(sigma)),
        responses=Coordinate("tool"),
        excitations=Coordinate("tool"),
        decay_rate=sigma,
        **options,
    )


def test_complex_lines_equal_a_window_in_time():
    """The impulse response of a clamped bar, windowed in time and transformed, against the model on complex lines."""
    bar = Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")
    ground = GroundSpring(k_y=2e7, k_theta=2e4, c_y=1000.0, c_theta=1.0, part="bar", position="end", name="clamp")
    assembly = Assembly([bar], [ground])
    rate, n = 2.0**18, 2**16
    spectrum = np.r_[0.0, assembly.receptance(np.fft.rfftfreq(n, 1.0 / rate)[1:])]
    spectrum[0] = spectrum[1].real
    response = np.fft.irfft(spectrum, n)
    assert np.abs(response[n // 2 : n - n // 8]).max() < 1e-6 * np.abs(response).max()
    lines = np.fft.rfftfreq(n, 1.0 / rate)[50:1500]
    window = np.exp(-200.0 * np.arange(n) / rate)
    found = np.fft.rfft(response * window)[50:1500]
    size = np.abs(found).max()
    # Cut off at half the sampling rate, the impulse response rings before its beginning: 1e-4 of the peak.
    np.testing.assert_allclose(found, assembly.receptance(complex_lines(200.0, lines)), atol=3e-4 * size)
    assert np.abs(found - assembly.receptance(lines)).max() > 0.1 * size
    assert np.abs(found - assembly.receptance(complex_lines(-200.0, lines))).max() > 0.1 * size


@pytest.mark.parametrize("form", ["receptance", "mobility", "accelerance"])
def test_the_joint_is_found_exactly_on_complex_lines(form):
    observed = Observation.from_frf(make_assembly(), windowed().to(form))
    np.testing.assert_allclose(observed.frequency_hz, complex_lines(), rtol=1e-15)
    assert_found(identify(observed, STIFFNESSES + DASHPOTS), TRUE)


def test_ignoring_the_window_puts_its_damping_into_the_joint():
    ignored = windowed().with_(decay_rate=0.0)
    result = identify(Observation.from_frf(make_assembly(), ignored), STIFFNESSES + DASHPOTS)
    error = {address: result.values[address] / TRUE[address] - 1.0 for address in TRUE}
    # The decay of the window is more than a quarter of the damping by the rotation of the joint in this band.
    assert error["joint.c_theta"] > 0.25
    right = identify(Observation.from_frf(make_assembly(), windowed()), STIFFNESSES + DASHPOTS)
    assert np.abs(result.residuals[0]).max() > 0.05
    assert np.abs(right.residuals[0]).max() < 1e-6


@pytest.mark.parametrize("objective", ["log", "percentage"])
def test_any_parameter_and_objective_on_complex_lines(objective):
    # The modulus is no joint parameter: the fit then takes the whole model, not the reduced one.
    unknowns = [*STIFFNESSES, Unknown(address="tool.segment[*].youngs_modulus", lower=5e11, upper=7e11, start=6.4e11)]
    observed = Observation.from_frf(make_assembly(), windowed())
    result = identify(observed, unknowns, objective=objective, starts=4)
    modulus = make_assembly().get("tool.segment[0].youngs_modulus")
    assert_found(result, {a: TRUE[a] for a in list(TRUE)[:2]} | {"tool.segment[*].youngs_modulus": modulus}, 1e-5)


@pytest.mark.parametrize("unit", ["logarithm", "standard deviations", "percent"])
def test_derivatives_on_complex_lines_against_differences(unit):
    observed = Observation.from_frf(make_assembly(), windowed(log_variance=1e-4), high_hz=9e3)
    unknowns = (*STIFFNESSES, *DASHPOTS, Unknown(address="tool.segment[0].length", lower=0.06, upper=0.065))
    problem = task_of(observed, unknowns, unit, bands=[(0.0, 1e9)]).problem()
    x = np.array([8.3, 5.4, 2.2, -1.4, np.log10(0.0611)])
    jacobian = problem.jacobian(x)
    for column in range(x.size):
        step = np.zeros(x.size)
        step[column] = 2e-5 * max(1.0, abs(x[column]))
        wide, half = (
            (problem.residual(x + h * step) - problem.residual(x - h * step)) / (2.0 * h * step[column])
            for h in (1.0, 0.5)
        )
        slope = (4.0 * half - wide) / 3.0
        np.testing.assert_allclose(jacobian[:, column], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max())


def test_windowed_and_plain_measurements_share_a_joint():
    observed = [
        Observation.from_frf(make_assembly(0.0623), windowed(log_variance=1e-4), label="windowed"),
        Observation.from_frf(
            make_assembly(0.114), windowed(make_assembly(0.114), 0.0, log_variance=1e-4), label="plain"
        ),
    ]
    assert_found(identify(observed, STIFFNESSES + DASHPOTS), TRUE)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (LINES + 1j, r"frequency_hz\[0\] is 100[+]1j Hz, expected an imaginary part of zero or less"),
        (np.where(LINES[3] == LINES, np.nan, complex_lines()), r"frequency_hz\[3\] is .*nan"),
        (complex_lines()[::-1], "not ascending"),
    ],
)
def test_invalid_complex_lines(lines, words):
    with pytest.raises(ValueError, match=words):
        Observation(assembly=make_assembly(), frequency_hz=lines, receptance=np.ones(LINES.size))
