"""The references of overlaps against each other and against limits that need no layer."""

from __future__ import annotations

import numpy as np
import pytest

from . import exact, overlaps, side_by_side
from .tables import joint, make, segment

pytestmark = pytest.mark.slow

CARBIDE, STEEL = (580e9, 14500.0, 0.24), (205e9, 7850.0, 0.29)
SHANK = (0.012, 0.0, *CARBIDE, 0.0)
BORE = (0.040, 0.012, *STEEL, 0.0)
TIP_AND_FAR = [(0, 0), (0, 1), (3, 0), (3, 1)]
TOOL = [(0.05, 0.012, 0.0, *CARBIDE)]
HOLDER = [(0.03, 0.04, 0.012, *STEEL), (0.05, 0.06, 0.02, *STEEL)]


def model(row_length: float, layer: tuple[float, ...], points: int = 0, slope: float = 0.0):
    """Return the tables of a tool and a holder whose nodes are 0, 1 and 2, 4, 3, and the overlap between 1 and 2."""
    tables = make([
        segment(0, 1, 0.05, 0.012, CARBIDE),
        segment(2, 4, 0.03, 0.04, STEEL, inner_diameter=0.012),
        segment(4, 3, 0.05, 0.06, STEEL, inner_diameter=0.02),
    ])  # fmt: skip
    return tables, [overlaps.overlap(1, 2, row_length, SHANK, BORE, layer, points, slope)]


@pytest.mark.parametrize(("points", "slope"), [(0, 0.0), (1, 0.0), (3, 0.0), (3, -0.8), (4, 0.5)])
@pytest.mark.parametrize("k_y", [1e6, 1e9, 1e12])
def test_exponential_and_finite_elements_agree(points: int, slope: float, k_y: float) -> None:
    tables, rows = model(0.04, (k_y, 1e-4 * k_y, 0.0, 0.0, 0.0), points, slope)
    strain, inertia = side_by_side.chain(TOOL, rows[0], HOLDER, cells=8)
    for hz in (200.0, 1700.0, 9000.0):
        w = 2 * np.pi * hz
        expected = overlaps.receptance_complex128(tables, rows, [w], TIP_AND_FAR, TIP_AND_FAR)[0]
        found = side_by_side.receptance(strain, inertia, w)
        assert np.abs(found - expected).max() <= 1e-5 * np.abs(expected).max()
        np.testing.assert_allclose(found[0, 0], expected[0, 0], rtol=1e-5)


def test_short_overlap_is_a_point_joint() -> None:
    """With a length of a picometre and the same totals the overlap is a point joint."""
    tables, rows = model(1e-12, (3e8, 4e4, 10.0, 0.01, 0.02))
    pair = make(tables.segments, [joint(1, 2, 3e8, 4e4, 0.0, (10.0, 0.01, 0.0), 0.02)])
    for w in (1e2, 1e4, 1e5 - 30j):
        found = overlaps.receptance_complex128(tables, rows, [w], TIP_AND_FAR, TIP_AND_FAR)[0]
        np.testing.assert_allclose(found, exact.receptance_complex128(pair, w, TIP_AND_FAR, TIP_AND_FAR), rtol=1e-7)


def test_derivatives_agree_with_those_of_the_short_limit() -> None:
    tables, rows = model(1e-12, (3e8, 4e4, 10.0, 0.01, 0.02))
    pair = make(tables.segments, [joint(1, 2, 3e8, 4e4, 0.0, (10.0, 0.01, 0.0), 0.02)])
    found = overlaps.derivative_complex128(
        tables, rows, [1e4], [(0, 0)], [(0, 0)], [(0, 25), (0, 26), (0, 27), (0, 28), (0, 29)]
    )
    expected = exact.derivative_complex128(
        pair, 1e4, [(0, 0)], [(0, 0)], [(1, 0, 2), (1, 0, 3), (1, 0, 5), (1, 0, 6), (1, 0, 8)]
    )
    np.testing.assert_allclose(found[0], expected, rtol=1e-7)
