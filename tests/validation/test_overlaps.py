"""Joints spread along the insertion against fifty digits, finite elements and their own limits."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from oracle import overlaps, side_by_side
from oracle.tables import Tables, joint, make, segment
from receptance import _core
from validation.overlap_cases import ENDS, SEED, Case, case

DRIVE_BOUND = 1e-9
TRANSFER_BOUND = 1e-6
"""Between tip and far end a soft layer passes on a small share of the load, whose digits the large one takes."""
NONE = np.zeros((0, 3))
CARBIDE, STEEL = (580e9, 14500.0, 0.24), (205e9, 7850.0, 0.29)
SHANK, BORE = (0.012, 0.0, *CARBIDE, 0.0), (0.040, 0.012, *STEEL, 0.0)
TOOL = [(0.05, 0.012, 0.0, *CARBIDE)]
HOLDER = [(0.05, 0.04, 0.012, *STEEL), (0.05, 0.06, 0.02, *STEEL)]
LAYER = (6e8, 5e4, 0.0, 0.0, 0.0)
LINES = 2.0 * np.pi * np.array([50.0, 700.0, 2100.0, 5300.0, 9700.0]) + 0j
PHYSICAL = [column for column in range(2, overlaps.POINTS) if column not in overlaps.FIXED]
CORE = [*range(9, 13), *range(20, 24)]
"""Columns of cores, which no beam here has."""
Summarise = Callable[[str, str, object], None]


def chain(
    length: float, layer: tuple[float, ...] = LAYER, points: int = 0, slope: float = 0.0
) -> tuple[Tables, np.ndarray]:
    """Return the model whose finite elements are TOOL, the overlap and HOLDER."""
    tables = make([
        segment(0, 1, 0.05, 0.012, CARBIDE),
        segment(2, 4, 0.05, 0.04, STEEL, inner_diameter=0.012),
        segment(4, 3, 0.05, 0.06, STEEL, inner_diameter=0.02),
    ])  # fmt: skip
    return tables, np.array([overlaps.overlap(1, 2, length, SHANK, BORE, layer, points, slope)])


def receptance(tables: Tables, rows: np.ndarray, w: np.ndarray = LINES, threads: int = 1) -> np.ndarray:
    return _core.Model(0, *tables, rows).receptance(_core.Lines(w), ENDS, ENDS, NONE, threads)[0]


def derivative(tables: Tables, rows: np.ndarray, w: np.ndarray, columns: list[int]) -> np.ndarray:
    parameters = np.array([[4, 0, column] for column in columns], dtype=float)
    return _core.Model(0, *tables, rows).receptance(_core.Lines(w), ENDS, ENDS, parameters, 1)[1]


def cases(offset: int, count: int) -> list[Case]:
    rng = np.random.default_rng([SEED, offset])
    return [case(rng) for _ in range(count)]


def worst(found: np.ndarray, expected: np.ndarray) -> tuple[float, float]:
    """Return the largest relative errors of drive points and of all entries, over (lines, 4, 4, ...)."""
    error = np.abs(found - expected) / np.abs(expected)
    drive = np.array([error[:, k, k] for k in range(4)])
    return float(drive.max()), float(error.max())


@pytest.mark.parametrize("count", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_random_overlaps_against_fifty_digits(count: int, summarise: Summarise) -> None:
    drive = all_ = 0.0
    for drawn in cases(0, count):
        expected = overlaps.receptance_complex128(drawn.tables, drawn.overlaps, drawn.w, ENDS, ENDS)
        one, other = worst(receptance(drawn.tables, drawn.overlaps, drawn.w), expected)
        assert one <= DRIVE_BOUND, f"seed {SEED}: {one:.2g}, {drawn.label}"
        assert other <= TRANSFER_BOUND, f"seed {SEED}: {other:.2g}, {drawn.label}"
        drive, all_ = max(drive, one), max(all_, other)
    text = f"seed {SEED}, {count} models: drive points at both ends {drive:.1e}, all entries {all_:.1e}"
    summarise("overlaps against fifty digits", text, {"seed": SEED, "drive": drive, "all": all_})


@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_derivatives_against_fifty_digits(count: int, summarise: Summarise) -> None:
    """By central differences of the reference; the tip's drive point, which everything else is fitted to."""
    columns = [column for column in PHYSICAL if column not in CORE]
    most = 0.0
    for drawn in cases(1, count):
        w = drawn.w[:1]
        own = [c for c in columns if drawn.overlaps[0, c] != 0.0]
        expected = overlaps.derivative_complex128(
            drawn.tables, drawn.overlaps, w, [(0, 0)], [(0, 0)], [(0, c) for c in own]
        )
        found = derivative(drawn.tables, drawn.overlaps, w, own)[:, :1, :1]
        error = float(np.max(np.abs(found - expected) / np.abs(expected)))
        assert error <= 1e-6, f"seed {SEED}: {error:.2g}, {drawn.label}"
        most = max(most, error)
    summarise("derivatives of overlaps", f"seed {SEED}, {count} models: {most:.1e}", {"seed": SEED, "tip": most})


def test_a_layer_and_points_against_finite_elements() -> None:
    for length in (0.01, 0.04):
        for points in (0, 1, 5):
            for k_y in (1e7, 1e9, 1e11):
                tables, rows = chain(length, (k_y, 1e-4 * k_y, 0.0, 0.0, 0.0), points)
                factors = side_by_side.chain(TOOL, rows[0], HOLDER, cells=4)
                expected = np.array([side_by_side.receptance(*factors, w) for w in LINES.real])
                found = receptance(tables, rows)
                size = np.abs(np.diagonal(expected, axis1=1, axis2=2))
                scale = np.sqrt(size[:, :, None] * size[:, None, :])
                assert np.max(np.abs(found - expected) / scale) <= 1e-4


@pytest.mark.parametrize(("points", "slope"), [(0, 0.0), (1, 0.0), (2, 1.0), (7, 0.0), (7, -0.9)])
@pytest.mark.parametrize("k_y", [1e4, *(pytest.param(k, marks=pytest.mark.slow) for k in (1e7, 1e9)), 1e11])
def test_all_natural_frequencies_are_found(points: int, slope: float, k_y: float) -> None:
    tables, rows = chain(0.04, (k_y, 1e-4 * k_y, 5.0, 0.0, 0.1), points, slope)
    factors = side_by_side.chain(TOOL, rows[0], HOLDER, cells=5)
    expected = side_by_side.natural_frequencies(*factors, 40e3)
    found, _ = _core.Model(0, *tables, rows).natural_frequencies(2 * np.pi * 40e3, 1000, NONE)
    np.testing.assert_allclose(found / (2 * np.pi), expected, rtol=1e-6)


@pytest.mark.parametrize("count", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_natural_frequencies_of_random_overlaps(count: int) -> None:
    """Without supports, which the finite elements of side-by-side beams do not have."""
    for drawn in cases(2, count):
        row = drawn.overlaps[0]
        tool, holder = drawn.tables.segments
        parts = [[(r[2], r[3], r[4], *r[5:8])] for r in (tool, holder)]
        factors = side_by_side.chain(parts[0], row, parts[1], layer_cells=16)
        first = side_by_side.natural_frequencies(*factors, np.inf)
        limit = 1.0001 * first[5]
        tables = make(drawn.tables.segments)
        found, _ = _core.Model(0, *tables, drawn.overlaps).natural_frequencies(2 * np.pi * limit, 1000, NONE)
        np.testing.assert_allclose(
            found / (2 * np.pi), first[first < limit], rtol=1e-4, err_msg=f"seed {SEED}: {drawn.label}"
        )


def test_slopes_of_natural_frequencies() -> None:
    tables, rows = chain(0.04)
    columns = [2, 3, 5, 6, 14, 16, 25, 26]
    upper = 2 * np.pi * 15e3
    parameters = np.array([[4, 0, column] for column in columns], dtype=float)
    found, slope = _core.Model(0, *tables, rows).natural_frequencies(upper, 5, parameters)
    for number, column in enumerate(columns):
        sides = []
        for sign in (1, -1):
            moved = rows.copy()
            moved[0, column] *= 1 + sign * 1e-5
            sides.append(_core.Model(0, *tables, moved).natural_frequencies(1.01 * upper, len(found), NONE)[0])
        expected = (sides[0] - sides[1]) / (2e-5 * rows[0, column])
        np.testing.assert_allclose(slope[:, number], expected, atol=1e-6 * np.abs(expected).max(), rtol=1e-6)


def test_points_converge_to_the_layer_with_the_second_order(summarise: Summarise) -> None:
    tables, layer = chain(0.04)
    expected = receptance(tables, layer)[:, 0, 0]
    errors = []
    for points in (4, 8, 16, 32):
        found = receptance(tables, chain(0.04, points=points)[1])[:, 0, 0]
        errors.append(float(np.max(np.abs(found - expected) / np.abs(expected))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() >= 1.9
    text = ", ".join(f"{error:.1e}" for error in errors)
    summarise("points to layer", f"4, 8, 16, 32 points: {text}; orders {orders.round(2)}", errors)


def test_a_short_overlap_is_the_point_joint() -> None:
    point = make(chain(0.04)[0].segments, [joint(1, 2, 6e8, 5e4, 0.0, (30.0, 0.02, 0.0), 0.03)])
    expected = _core.Model(0, *point).receptance(_core.Lines(LINES), ENDS, ENDS, NONE, 1)[0]
    errors = []
    for length in (1e-3, 1e-5, 1e-7, 1e-9):
        found = receptance(point._replace(joints=np.zeros((0, 9))), chain(length, (6e8, 5e4, 30.0, 0.02, 0.03))[1])
        errors.append(np.max(np.abs(found - expected) / np.abs(expected)))
    assert errors[-1] <= 1e-6
    for before, after in pairwise(errors):
        assert after <= before / 30


def test_a_stiff_layer_is_the_bonded_section() -> None:
    """Bonded, shank and bore are one section of their summed stiffness; the ends come closer as the layer stiffens."""
    bonded = make([
        segment(0, 1, 0.05, 0.012, CARBIDE),
        segment(1, 2, 0.04, 0.04, STEEL, inner_diameter=0.012, core=CARBIDE),
        segment(2, 4, 0.05, 0.04, STEEL, inner_diameter=0.012),
        segment(4, 3, 0.05, 0.06, STEEL, inner_diameter=0.02),
    ])  # fmt: skip
    expected, _ = _core.Model(0, *bonded).natural_frequencies(2 * np.pi * 40e3, 5, NONE)
    errors = []
    for k_y in (1e10, 1e11, 1e12, 1e13):
        tables, rows = chain(0.04, (k_y, 1e-4 * k_y, 0.0, 0.0, 0.0))
        found, _ = _core.Model(0, *tables, rows).natural_frequencies(2 * np.pi * 40e3, 5, NONE)
        errors.append(np.max(np.abs(found - expected) / expected))
    assert errors[-1] <= 5e-3
    assert np.all(np.diff(errors) < 0.0)


def test_reciprocity_and_passivity() -> None:
    lever = np.array([1.0, 0.05, 1.0, 0.05])
    for drawn in cases(3, 40):
        h = receptance(drawn.tables, drawn.overlaps, drawn.w)
        h = h * lever[:, None] * lever
        size = np.sqrt(np.abs(np.diagonal(h, axis1=1, axis2=2)))
        size = size[:, :, None] * size[:, None, :]
        assert np.max(np.abs(h - np.swapaxes(h, 1, 2)) / size) <= 1e-9, f"seed {SEED}: {drawn.label}"
        # i w H has a real part that is positive semidefinite, for complex w of a decaying window too
        power = 1j * drawn.w[:, None, None] * h
        power = power + np.conj(np.swapaxes(power, 1, 2))
        for values, one in zip(np.linalg.eigvalsh(power), np.abs(drawn.w), strict=True):
            assert values[0] >= -1e-9 * one * np.abs(h).max(), f"seed {SEED}: {drawn.label}"


def test_results_are_bitwise_independent_of_threads() -> None:
    tables, rows = chain(0.04, (6e8, 5e4, 30.0, 0.02, 0.03))
    w = 2 * np.pi * np.linspace(10.0, 2e4, 1500) + 0j
    parameters = np.array([[4, 0, 2], [4, 0, 25], [0, 0, 2]], dtype=float)
    expected = _core.Model(0, *tables, rows).receptance(_core.Lines(w), ENDS[:1], ENDS[:1], parameters, 1)
    for threads in (2, 3):
        found = _core.Model(0, *tables, rows).receptance(_core.Lines(w), ENDS[:1], ENDS[:1], parameters, threads)
        assert all(np.array_equal(x, y) for x, y in zip(found, expected, strict=True))
