"""Derivatives by address are the derivatives of what `replace` does, and shared addresses are sums."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from properties.strategies import assemblies, both_ends, frequencies
from properties.test_invariance import rich
from receptance import STEEL, Assembly, Coordinate, Part, PointMass, Segment, _core

F = np.array([120.0, 700.0, 1900.0, 4100.0, 8800.0])
STEP = 1e-5


def difference(assembly: Assembly, address: str, f: np.ndarray, **points: object) -> np.ndarray:
    """Return the derivative times the value, by central differences with Richardson's extrapolation."""
    value = assembly.get(address)

    def slope(step: float) -> np.ndarray:
        up, down = (assembly.replace({address: value * (1 + s)}).receptance(f, **points) for s in (step, -step))
        return (up - down) / (2 * step)

    return (4 * slope(STEP) - slope(2 * STEP)) / 3


@pytest.mark.parametrize("address", rich().parameters)
def test_every_address_against_differences(address: str) -> None:
    assembly = rich()
    value = assembly.get(address)
    points = both_ends(assembly)
    h, slope = assembly.derivatives(F, [address], response=points, excitation=points)
    assert slope.shape == (len(F), 4, 4, 1)
    if value == 0.0:
        assert np.all(np.isfinite(slope))
        if address.endswith("inner_diameter"):
            np.testing.assert_array_equal(slope, 0.0)
        elif not address.endswith("ytheta"):
            # A coupling needs both its neighbours; the oracle checks it. No value here may be negative: one side only.
            step = 1e-6 if address.endswith("loss_factor") else 1e-4
            up = assembly.replace({address: step}).receptance(F, response=points, excitation=points)
            size = np.abs(slope[..., 0]).max(axis=(1, 2), keepdims=True)
            assert np.all(np.abs((up - h) / step - slope[..., 0]) <= 2e-2 * size)
        return
    found = slope[..., 0] * value
    expected = difference(assembly, address, F, response=points, excitation=points)
    scale = np.sqrt(np.abs(np.einsum("nii,njj->nij", h, h)))
    assert np.all(np.abs(found - expected) <= 1e-6 * np.abs(expected) + 1e-8 * scale), address


@given(assembly=assemblies(lossy=True), f=frequencies(), which=st.integers(0, 10**6))
@settings(max_examples=30)
def test_random_addresses_against_differences(assembly: Assembly, f: np.ndarray, which: int) -> None:
    address = assembly.parameters[which % len(assembly.parameters)]
    value = assembly.get(address)
    if value == 0.0:
        return
    h, slope = assembly.derivatives(f, [address])
    expected = difference(assembly, address, f)
    # Error of the differences: third order in the step near sharp resonances.
    other = difference(assembly, address, f * (1 + 1e-6))
    doubt = np.abs(other - expected) * 1e-2
    assert np.all(np.abs(slope[:, 0] * value - expected) <= 1e-5 * np.abs(expected) + 1e-7 * np.abs(h) + doubt), address


FIELDS = ("length", "outer_diameter", "youngs_modulus", "density", "poisson_ratio", "loss_factor")


@pytest.mark.parametrize("part", ["tool", "holder"])
@pytest.mark.parametrize("field", FIELDS)
def test_shared_segments_are_the_sum_of_the_segments(part: str, field: str) -> None:
    assembly = rich()
    points = both_ends(assembly)
    names = [f"{part}.segment[*].{field}", f"{part}.segment[0].{field}", f"{part}.segment[1].{field}"]
    _, slope = assembly.derivatives(F, names, response=points, excitation=points)
    np.testing.assert_allclose(slope[..., 0], slope[..., 1] + slope[..., 2], rtol=1e-12)
    modes, by_modes = assembly.natural_frequency_derivatives(10e3, names)
    assert len(modes) > 2
    np.testing.assert_allclose(by_modes[:, 0], by_modes[:, 1] + by_modes[:, 2], rtol=1e-12)


@pytest.mark.parametrize(
    ("part", "position"),
    [("tool", 0.011), ("tool", 0.05), ("holder", 0.02), ("holder", 0.1), ("tool", 0.0), ("holder", "end")],
)
@pytest.mark.parametrize(
    "address",
    ["tool.segment[0].length", "tool.segment[1].length", "holder.segment[0].length", "holder.segment[1].length"],
)
def test_lengths_with_places_inside_segments(part: str, position: float | str, address: str) -> None:
    """A place inside stays where it is, from the part's start, while a length changes: as `replace` has it."""
    assembly = rich()
    coordinate = Coordinate(part, position)
    _, slope = assembly.derivatives(F, [address], response=coordinate)
    expected = difference(assembly, address, F, response=coordinate)
    found = slope[:, 0] * assembly.get(address)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


def bar_with_a_place(x: float) -> list[np.ndarray]:
    """Return the tables of a bar with a node at x that carries a mass."""
    pieces = [Segment(length=length, outer_diameter=0.012, material=STEEL) for length in (x, 0.1 - x)]
    mass = PointMass(mass=5e-3, inertia=1e-7)
    return [
        Assembly([Part(pieces)]).flat().tables.segments,
        np.zeros((0, 9)),
        np.array([[1.0, *mass.columns]]),
        np.zeros((0, 8)),
    ]


def test_derivative_by_position_is_that_of_adjacent_segments() -> None:
    """One piece grows as the other shrinks: for the mass on the node and for what is seen and hit there."""
    x, step, w = 0.0371, 1e-6, 2 * np.pi * F + 0j
    lengths = np.array([[0.0, 0.0, 2.0], [0.0, 1.0, 2.0]])
    none = np.zeros((0, 3))
    for node in (0.0, 1.0):
        points = np.array([[node, 0.0], [node, 1.0]])
        up, down = (
            _core.Model(0, *bar_with_a_place(x + s)).receptance(_core.Lines(w), points, points, none, 1)[0]
            for s in (step, -step)
        )
        _, slope = _core.Model(0, *bar_with_a_place(x)).receptance(_core.Lines(w), points, points, lengths, 1)
        expected = (up - down) / (2 * step)
        scale = np.abs(expected).max(axis=0)
        assert np.all(np.abs(slope[..., 0] - slope[..., 1] - expected) <= 1e-6 * np.abs(expected) + 1e-9 * scale)
