"""identify(simulate(p)) = p for joints over three decades, tools and materials drawn at random."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment
from receptance.fit import Observation, Unknown, identify

overhangs = st.floats(0.03, 0.14)
diameters = st.floats(0.006, 0.02)
exponents = st.tuples(st.floats(7.0, 9.5), st.floats(3.5, 6.0), st.floats(-7.5, -6.0), st.floats(-7.5, -6.0))
losses = st.sampled_from([0.0, 0.001, 0.01])


def make_assembly(overhang, diameter, exponent, loss):
    tool = Segment(length=overhang, outer_diameter=diameter, material=replace(CARBIDE, loss_factor=loss))
    steel = replace(STEEL, loss_factor=loss)
    holder = [Segment(length=0.03, outer_diameter=d, material=steel) for d in (0.035, 0.047, 0.05, 0.042)]
    k_y, k_theta = 10.0 ** exponent[0], 10.0 ** exponent[1]
    joint = PointJoint(
        k_y=k_y, k_theta=k_theta, c_y=k_y * 10.0 ** exponent[2], c_theta=k_theta * 10.0 ** exponent[3], name="joint"
    )
    return Assembly([Part([tool], name="tool"), joint, Part(holder, name="holder")])


def unknowns(*fields):
    limits = {"k_y": (1e6, 1e11), "k_theta": (1e2, 1e8), "c_y": (1e-2, 1e6), "c_theta": (1e-6, 1e3)}
    return [Unknown(address=f"joint.{f}", lower=limits[f][0], upper=limits[f][1]) for f in fields]


def assert_found(result, assembly, tolerance):
    assert result.converged, result.summary()
    for address, value in result.values.items():
        true = assembly.get(address)
        # A line within rounding of an undamped antiresonance has an error of 1e-5, which the standard error includes.
        error = result.standard_errors[address]
        allowed = max(tolerance * true, 5.0 * error if np.isfinite(error) else 0.0)
        assert error <= 1e-4 * true or not np.isfinite(error)
        np.testing.assert_allclose(value, true, rtol=0, atol=allowed, err_msg=result.summary())


@settings(max_examples=15, deadline=None)
@given(overhangs, diameters, exponents, losses)
def test_receptance(overhang, diameter, exponent, loss):
    assembly = make_assembly(overhang, diameter, exponent, loss)
    lines = np.linspace(50.0, 15e3, 800)
    frf = Observation(assembly=assembly, frequency_hz=lines, receptance=assembly.receptance(lines))
    assert_found(identify(frf, unknowns("k_y", "k_theta", "c_y", "c_theta"), starts=4), assembly, 1e-6)


@settings(max_examples=15, deadline=None)
@given(overhangs, diameters, exponents)
def test_natural_frequencies(overhang, diameter, exponent):
    assembly = make_assembly(overhang, diameter, exponent, 0.0)
    observed = Observation.from_modes(assembly=assembly, frequency_hz=assembly.natural_frequencies(30e3))
    assert_found(identify(observed, unknowns("k_y", "k_theta")), assembly, 1e-5)
