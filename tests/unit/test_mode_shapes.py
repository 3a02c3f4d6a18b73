"""Mode shapes against receptances, a slender beam, and rigid bodies on springs; drawings in notebooks."""

from __future__ import annotations

import base64
import re
import warnings

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    Material,
    Part,
    PointJoint,
    PointMass,
    Segment,
    mode_shapes,
)

JOINT = PointJoint(k_y=3e8, k_theta=5e4, c_y=300.0, c_theta=0.05, name="joint")
TOOL = Part([Segment(length=0.08, outer_diameter=0.012, material=CARBIDE)], name="tool")
NOSE = Segment(length=0.04, outer_diameter=0.05, material=STEEL)
HOLDER = Part([NOSE, Segment(length=0.06, outer_diameter=0.04, material=STEEL)], name="holder")
CLAMP = GroundSpring(part="holder", position="end", k_y=2e8, k_theta=1e6, c_y=2e3, name="clamp")
CLAMPED = Assembly([TOOL, JOINT, HOLDER], [CLAMP])


@pytest.mark.parametrize("way", ["y", "theta"])
def test_the_receptance_is_the_sum_of_the_modes(way: str) -> None:
    """At lines inside the band, with the modes above it as a remainder that hardly changes."""
    shapes = mode_shapes(CLAMPED, 120e3)
    assert len(shapes) > 8
    f = np.array([400.0, 900.0, 1700.0, 3100.0])
    w, wr = 2.0 * np.pi * f[:, None], 2.0 * np.pi * shapes.frequency_hz
    i, j = 0, shapes.part.index("holder") + 20
    at = [Coordinate(shapes.part[k], float(shapes.position[k]), way if k == i else "y") for k in (i, j)]  # type: ignore[arg-type]
    values = (shapes.y if way == "y" else shapes.theta)[:, i] * shapes.y[:, j]
    summed = np.sum(values / (wr**2 - w**2 + 2j * shapes.damping_ratio * wr * w), axis=1)
    exact = CLAMPED.receptance(f, response=at[0], excitation=at[1])
    np.testing.assert_allclose(summed, exact, rtol=0.02, atol=0.01 * np.abs(exact).max())


def test_a_slender_clamped_beam() -> None:
    """First shape of a cantilever (Euler and Bernoulli) at unit modal mass: 2 / sqrt(m) at the tip; slope by length."""
    length = 1.0
    bar = Part([Segment(length=length, outer_diameter=0.004, material=STEEL)], name="bar")
    beam = Assembly([bar], [GroundSpring(part="bar", position="end", k_y=1e12, k_theta=1e9, name="clamp")])
    shapes = mode_shapes(beam, 20.0)
    mass = STEEL.density * np.pi * 0.002**2 * length
    assert abs(shapes.y[0, 0]) * np.sqrt(mass) == pytest.approx(2.0, rel=1e-3)
    x = 1.0 - shapes.distance / length
    k = 1.8751040687
    sigma = (np.cosh(k) + np.cos(k)) / (np.sinh(k) + np.sin(k))
    exact = np.cosh(k * x) - np.cos(k * x) - sigma * (np.sinh(k * x) - np.sin(k * x))
    np.testing.assert_allclose(shapes.y[0].real * np.sqrt(mass), exact, atol=3e-3)
    slope = np.gradient(shapes.y[0].real, shapes.distance)
    np.testing.assert_allclose(shapes.theta[0].real[1:-1], slope[1:-1], atol=5e-3 * np.abs(slope).max())


def test_shapes_are_orthogonal_with_the_mass() -> None:
    """Without damping, with a point mass: the sum of m y_r y_s is the unit matrix (slender: without rotation)."""
    light = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, loss_factor=0.0)
    bar = Part([Segment(length=1.0, outer_diameter=0.01, material=light)], name="bar")
    springs = [GroundSpring(part="bar", position=at, k_y=1e4, name=f"s{n}") for n, at in enumerate((0.0, 1.0))]
    loaded = Assembly([bar], [*springs, PointMass(part="bar", position=0.3, mass=0.2, name="block")])
    shapes = mode_shapes(loaded, 300.0, points=801)
    y = shapes.y.real
    step = np.gradient(shapes.distance)
    step[[0, -1]] *= 0.5
    weight = 7850.0 * np.pi * 0.005**2 * step
    weight[np.abs(shapes.distance - 0.3).argmin()] += 0.2
    np.testing.assert_allclose((y * weight) @ y.T, np.eye(len(shapes)), atol=0.02)
    assert np.abs(shapes.y.imag).max() < 1e-6 * np.abs(y).max()


def test_limits_and_errors() -> None:
    none = mode_shapes(CLAMPED, 10.0)
    assert len(none) == 0
    assert none.y.shape == (0, len(none.part))
    assert none.plot().axes
    with pytest.raises(ValueError, match="points is 1, expected a whole number of at least 2"):
        mode_shapes(CLAMPED, 1e4, points=1)
    with pytest.raises(ValueError, match="upper_hz"):
        mode_shapes(CLAMPED, -1.0)


def test_shapes_are_a_result() -> None:
    shapes = mode_shapes(CLAMPED, 10e3)
    assert "Mode shapes" in shapes.summary()
    assert len(shapes.to_dict()["y"]) == len(shapes)
    figure = shapes.plot()
    assert len(figure.axes) == 1 + len(shapes)
    assert figure.axes[1].get_ylabel() == "y (1/√kg)"


def _image(html: str) -> bytes:
    source = re.search(r'src="data:image/png;base64,([^"]+)"', html)
    assert source
    return base64.b64decode(source[1])


def test_an_assembly_in_a_notebook_is_drawn_to_scale() -> None:
    odd = Material(name='<b>&"x', youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3)
    bar = Part([Segment(length=0.1, outer_diameter=0.02, material=odd)], name="bar")
    named = Assembly([bar, JOINT, TOOL])
    html = named._repr_html_()
    assert _image(html).startswith(b"\x89PNG")
    assert "<b>&" not in html.replace("<p><b>", "")
    assert "&lt;b&gt;&amp;&quot;x" in html
    assert "k_y 3e+08" in html
    text = CLAMPED.summary()
    assert "holder" in text
    assert "GroundSpring" in text
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert CLAMPED.drawing().axes
